"""No required cell of the matrix of problems and backends is empty; claims are those of the bridges."""

from __future__ import annotations

import pytest

from nonrigid.benchmark.matrix import GENERAL, REQUIRED, empty_cells, solver_matrix

LIGHT = {
    "gt": {"part_samples": 30, "full_samples": 100},
    "en": {"part_samples": 30, "full_samples": 100},
    "im": {},
    "pfm": {"start": "mask", "rounds": 2, "landmarks": 0, "radii": (0.1,)},
}


@pytest.mark.parametrize("method", LIGHT)
def test_every_general_backend_has_a_route_for_each_required_problem(method: str) -> None:
    rows = solver_matrix([method], LIGHT[method])
    mine = {cell for cell, place in REQUIRED.items() if place[0] == method}
    assert mine <= {row["cell"] for row in rows}
    assert not [cell for cell in empty_cells(rows) if cell[0] in mine]
    for row in rows:
        assert row["accepted"] == (row["claim"] is not None)
        assert row["accepted"] != str(row["answer"]).startswith("refused")
    if method == "pfm":
        claims = {row["backend"]: row["claim"] for row in rows if row["cell"] == "pfm-v" and row["accepted"]}
        assert claims == {"native": "exact", "nlopt": "exact", "casadi": "exact", "scipy": "exact"} | {
            "cvxpy": "restriction"
        }


def test_a_missing_route_is_told() -> None:
    assert len(empty_cells([])) == len(REQUIRED) * len(GENERAL)
