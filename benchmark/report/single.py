"""Show one match: a page that is one file, or a picture drawn without a window or graphics card."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.image import imsave
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from nonrigid.benchmark.datasets.protocols import PairData
from nonrigid.benchmark.formats import write_text
from nonrigid.benchmark.matched_points import matched_points
from nonrigid.benchmark.protocol import Score, score
from nonrigid.benchmark.render import View, render
from nonrigid.benchmark.report.pack import broadside, pack_matches, place_colours
from nonrigid.benchmark.report.pages.templates import asset, fill, script
from nonrigid.benchmark.report.pairs import full_script, surfaces_of
from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.points import SurfacePoints

UNMATCHED = (0.69, 0.706, 0.73)
"""Grey of what has no match."""


SPOT = 0.025
"""Radius of the spot that a match colours in a picture, in sqrt(full area)."""


def match_score(pair: PairData, points: SurfacePoints, *, metric: str = "dijkstra") -> Score | None:
    """Return what a match is worth; None where the pair has no ground truth."""
    return None if pair.truth is None else score(pair, points, geodesics=metric)


def write_match_page(path: Path, pair: PairData, points: SurfacePoints, found: Score | None = None) -> None:
    """Write a page that shows both surfaces and the match between them, in one file that asks nobody for anything.

    Parameters
    ----------
    path
        The page, `.html`.
    pair
        Both meshes, and the ground truth where there is some.
    points
        For each vertex of the part a point of the full shape, or -1.
    found
        Its score, for the errors.
    """
    matches = matched_points(points, found)
    run = {
        "id": "match",
        "label": path.stem,
        "backend": "",
        "status": "",
        "message": "",
        "stages": [],
        "points": "match",
    }
    run |= {"side": "direct" if found is None else found.side}
    data: dict[str, Any] = {
        "name": pair.name,
        "runs": [run],
        "points": {"match": pack_matches(matches)},
        "full": "full",
    }
    texts = [
        full_script("full", pair.full),
        script(pair={**data, **surfaces_of(pair)}),
        asset("table.js"),
        asset("surface.js"),
        asset("pair.js"),
    ]
    page = fill(
        "pair.html",
        name=f"{pair.name}: {path.stem}",
        facts=_facts(pair, len(matches.rows), found),
        problem="",
        inline={"style": asset("style.css"), "scripts": texts},
    )
    write_text(path, page)


def write_match_picture(path: Path, pair: PairData, points: SurfacePoints, *, size: int = 700) -> None:
    """Write a PNG of the part, coloured as the points it is matched to, beside the full surface in its own colours."""
    thin, up, _ = broadside(pair.full)
    axis = "xyz"[up]
    # The eye starts on the axis after `up`'s successor; see `View.rotation`.
    azimuth = 25.0 + (0.0 if (up + 1) % 3 == thin else 90.0)
    colours = place_colours(pair.full) / 255.0
    view = View(azimuth=azimuth, elevation=12.0, up=axis)  # type: ignore[arg-type]
    both = [
        render(pair.part, _carried(pair, points, colours), view=view, size=size),
        render(pair.full, colours, view=view, size=size),
    ]
    picture = np.concatenate(both, axis=1).astype(float) / 255
    opaque = picture[:, :, 3:] * picture[:, :, :3] + (1 - picture[:, :, 3:])
    imsave(path, np.asarray(255 * np.clip(opaque, 0, 1), dtype=np.uint8))


def _carried(pair: PairData, points: SurfacePoints, colours: NDArray[np.float64]) -> FloatArray:
    """Return (n, 3) colours of the part's vertices: those of their matches; a match colours what is nearest to it."""
    shown = np.tile(np.array(UNMATCHED), (len(pair.part.vertices), 1))
    rows = np.flatnonzero(points.matched)
    if not len(rows):
        return shown
    corners = colours[pair.full.faces[points.faces[rows]]]
    own = np.einsum("pk,pkc->pc", points.barycentric[rows], corners)
    # A single vertex of few would not be seen; a spot of this size is.
    far, nearest = cKDTree(pair.part.vertices[rows]).query(pair.part.vertices)
    near = far <= SPOT * np.sqrt(pair.full.area)
    shown[near] = own[np.asarray(nearest)[near]]
    return shown


def _facts(pair: PairData, match_count: int, found: Score | None) -> list[str]:
    facts = [
        f"{match_count} of {len(pair.part.vertices)} vertices matched",
        f"{100 * pair.kept_area:.0f} % of the area kept",
    ]
    if found is None:
        return [*facts, "no ground truth is given, hence no error"]
    return [
        *facts,
        f"mean geodesic error {100 * found.mean_error:.3g} x100 of sqrt(full area) to the {found.side} map",
        f"{100 * found.coverage:.0f} % of the part covered",
    ]
