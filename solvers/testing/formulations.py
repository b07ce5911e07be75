"""Check a formulation: it states problems, returns a correspondence in range, and sees neither order nor frame."""

from __future__ import annotations

import numpy as np

from nonrigid.formulations.formulation import Correspondence, Formulation, Pair
from nonrigid.formulations.model import Problem
from nonrigid.geometry.mesh import Mesh
from nonrigid.solvers.backend import Backend
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.match import Match, match
from nonrigid.solvers.testing.errors import expect


def check_formulation(
    formulation: Formulation,
    part: Mesh,
    full: Mesh,
    *,
    backend: str | Backend = "native",
    limits: Limits | None = None,
    agreement: float = 0.9,
) -> Correspondence:
    """Match a part to its full surface and check what came of it; return the correspondence.

    Checked: `stages` yields problems with a name, and generates anew at each call; the correspondence names vertices
    and faces that exist, each vertex once, with a confidence between 0 and 1; the same call gives the same answer;
    after a rigid motion, a change of unit and a renumbering of both surfaces at least the share `agreement` of the
    matched vertices still has its match within 5 % of sqrt(full area).

    Raises
    ------
    ConformanceError
        Saying what was expected and found, and where to look.
    """
    name = type(formulation).__name__
    has_stages = isinstance(formulation, Formulation)
    expect(has_stages, name, expected="a method `stages`", found=formulation, look="the class")
    pair = Pair.of(part, full, cache=None)
    first = next(formulation.stages(pair))
    expect(isinstance(first, Problem) and first.name, name, expected="a named Problem", found=first, look="stages")
    found = _matched(formulation, pair, backend, limits)
    _check_range(name, found, part, full)
    again = _matched(formulation, pair, backend, limits)
    same = np.array_equal(found.part_vertices, again.part_vertices) and np.array_equal(
        found.points.barycentric, again.points.barycentric
    )
    expect(same, name, expected="the same answer twice", found="another", look="random numbers without a seed")
    share = _share_kept(formulation, part, full, found, backend, limits)
    expect(
        share >= agreement,
        name,
        expected=f"at least {agreement:.0%} of the matches after moving, scaling and renumbering both surfaces",
        found=f"{share:.0%}",
        look="anything that reads coordinates, units or vertex numbers",
    )
    return found


def _matched(formulation: Formulation, pair: Pair, backend: str | Backend, limits: Limits | None) -> Correspondence:
    outcome: Match = match(pair, formulation, backend, limits=limits)
    found = outcome.correspondence
    name = type(formulation).__name__
    expect(found is not None, name, expected="a correspondence", found=outcome.message, look="the stage it names")
    assert found is not None
    return found


def _check_range(name: str, found: Correspondence, part: Mesh, full: Mesh) -> None:
    inside = len(found) > 0 and 0 <= found.part_vertices.min() <= found.part_vertices.max() < len(part.vertices)
    expect(inside, name, expected="some vertices of the part", found=found.part_vertices, look="the read-out")
    known = bool((found.points.faces >= 0).all() and (found.points.faces < len(full.faces)).all())
    expect(known, name, expected="faces of the full surface", found=found.points.faces, look="the read-out")
    sure = bool(((found.confidence >= 0.0) & (found.confidence <= 1.0 + 1e-12)).all())
    expect(sure, name, expected="confidences between 0 and 1", found=found.confidence, look="the read-out")


def _share_kept(
    formulation: Formulation,
    part: Mesh,
    full: Mesh,
    found: Correspondence,
    backend: str | Backend,
    limits: Limits | None,
) -> float:
    """Return the share of the matched vertices whose match stays where it was on a moved and renumbered pair."""
    rng = np.random.default_rng(0)
    moved, renumbered = [], []
    for mesh in (part, full):
        new = rng.permutation(len(mesh.vertices))
        vertices = np.empty_like(mesh.vertices)
        vertices[new] = mesh.vertices
        turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
        turn *= np.sign(np.linalg.det(turn))
        shuffled = Mesh(vertices, new[mesh.faces][rng.permutation(len(mesh.faces))], name=mesh.name)
        moved.append((shuffled, turn, rng.uniform(-1.0, 1.0, 3)))
        renumbered.append(new)
    scale = 37.0
    pair = Pair.of(
        *(mesh.transformed(rotation=turn, translation=shift, scale=scale) for mesh, turn, shift in moved), cache=None
    )
    other = _matched(formulation, pair, backend, limits)
    before = np.full((len(part.vertices), 3), np.nan)
    before[renumbered[0][found.part_vertices]] = found.points.positions(full)
    after = np.full((len(part.vertices), 3), np.nan)
    after[other.part_vertices] = other.points.positions(moved[1][0])
    near = np.linalg.norm(before - after, axis=1) <= 0.05 * np.sqrt(full.area)
    return float(near.sum() / max(len(found), len(other)))
