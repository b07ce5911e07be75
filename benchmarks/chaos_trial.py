"""What the chaos trial runs: two small pairs, and a method that ends well, crashes, hangs or fills the memory."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import trimesh

from nonrigid.benchmark.formats import write_baryc
from nonrigid.geometry.io import write_off
from nonrigid.geometry.mesh import Mesh
from nonrigid.geometry.points import SurfacePoints

METHOD = '''
"""A method that takes a moment, and then ends well, crashes, hangs or fills the memory."""

import ctypes, os, time
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from nonrigid.formulations.formulation import Correspondence
from nonrigid.formulations.model import Problem, QuadraticForm, Simplex, Variable, maximize
from nonrigid.geometry.points import SurfacePoints


@dataclass(frozen=True, kw_only=True)
class Trial:
    number: int = 0
    kind: str = "good"
    seconds: float = 0.05
    method: ClassVar[str] = "trial"

    def stages(self, pair):
        rng = np.random.default_rng(self.number)
        matrix = rng.random((6, 6))
        u = Variable("u", 6)
        solution = yield Problem("toy", maximize(QuadraticForm(matrix + matrix.T)(u)), u @ Simplex())
        rows = len(pair.part.mesh.vertices)
        self.note("begin", rows)
        time.sleep(self.seconds)
        if self.kind == "crash":
            ctypes.string_at(0)
        if self.kind == "hang":
            ctypes.PyDLL(None).sleep(3600)
        if self.kind == "memory":
            hoard = []
            while True:
                hoard.append(np.ones(1_000_000))
        count = rows if self.kind == "fat" else 3
        at = rng.integers(len(pair.full.mesh.faces), size=count)
        self.note("end", rows)
        return Correspondence(np.arange(count), SurfacePoints(at, np.full((count, 3), 1 / 3)), np.ones(count))

    def note(self, word, rows):
        line = f"{word} {self.kind} {self.number} {rows} {time.time()}\\n"
        with open(os.environ["NONRIGID_CHAOS_EVENTS"], "a") as file:
            file.write(line)
'''

PLAN = """
title = "Chaos"
backends = ["native"]
run_seconds = 8
[data]
dataset = "shrec16"
root = "data"
splits = {splits}
[limits]
memory_gb = 0.3
"""


def write_trial(folder: Path, rng: random.Random, *, small: bool) -> int:
    """Write data, method and `plan.toml` into a folder; return the number of runs."""
    write_data(folder / "data")
    site = folder / "site"
    information = site / "nonrigid_chaos-1.dist-info"
    information.mkdir(parents=True)
    (site / "nonrigid_chaos.py").write_text(METHOD)
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: nonrigid-chaos\nVersion: 1\n")
    (information / "entry_points.txt").write_text("[nonrigid.formulations]\ntrial = nonrigid_chaos:Trial\n")
    good = 6 if small else 52
    kinds = ["good"] * good + ["crash", "hang", "memory", "fat"]
    rng.shuffle(kinds)
    text = PLAN.format(splits='["cuts"]' if small else '["cuts", "holes"]')
    for number, kind in enumerate(kinds):
        settings = f'{{ number = {number}, kind = "{kind}" }}'
        text += f'[[methods]]\nmethod = "trial"\nlabel = "{kind}-{number}"\nsettings = {settings}\n'
    (folder / "plan.toml").write_text(text)
    return len(kinds) * (1 if small else 2)


def write_data(root: Path) -> None:
    """Write two pairs: a bumpy ball, and what is left of it beyond two planes, with the truth."""
    for folder in ("null", "cuts", "holes"):
        (root / folder).mkdir(parents=True)
    ball = trimesh.creation.icosphere(subdivisions=3)
    vertices = np.asarray(ball.vertices) * (
        1.0 + 0.1 * np.sin(3.0 * ball.vertices[:, :1]) + 0.1 * ball.vertices[:, 1:2]
    )
    full = Mesh(vertices, np.asarray(ball.faces))
    write_off(full, root / "null" / "cat.off")
    for split, height in (("cuts", -0.2), ("holes", 0.1)):
        faces = full.faces[(vertices[full.faces][:, :, 2] > height).all(axis=1)]
        kept, renumbered = np.unique(faces, return_inverse=True)
        name = f"{split}_cat_shape_1"
        write_off(Mesh(vertices[kept], renumbered.reshape(-1, 3)), root / split / f"{name}.off")
        write_baryc(root / split / f"{name}.baryc_gt", SurfacePoints.at_vertices(full, kept))
