"""The steps of partial functional maps in the solvers: the dual bound, cells, norms and squares in convex models."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from nonrigid.formulations.functional_maps import slanted_mask
from nonrigid.formulations.model import Problem, Variable, free, minimize
from nonrigid.formulations.model.terms.area_gap import AreaGap
from nonrigid.formulations.model.terms.gram_penalty import GramPenalty
from nonrigid.formulations.model.terms.group_norm import GroupNorm21
from nonrigid.formulations.model.terms.masked_data import MaskedBasis, MaskedTarget
from nonrigid.formulations.model.terms.membership import membership
from nonrigid.formulations.model.terms.mumford_shah import MumfordShah
from nonrigid.formulations.model.terms.weighted_squares import WeightedSquares
from nonrigid.solvers.bounds.bound import BoundError, bound
from nonrigid.solvers.bridges.cells import RegionCells
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.route import route
from nonrigid.solvers.solve import solve
from nonrigid.solvers.status import Status
from nonrigid.solvers.testing import check_bridge
from nonrigid.solvers.testing.instances import functional_map, region, robust_regression

EVERY_MODEL = ("CLARABEL", "SCS", "OSQP", "PIQP", "HIGHS")


def map_step(size: int, seed: int, *, orthogonality_weight: float = 0.0, descriptors: int = 25) -> Problem:
    """A step in C on random data."""
    rng = np.random.default_rng(seed)
    A, B = rng.standard_normal((size, descriptors)), rng.standard_normal((size, descriptors))
    C = Variable("C", (size, size))
    energy = 0.7 * GroupNorm21(A, B)(C) + 0.3 * WeightedSquares(slanted_mask(size, size // 2))(C)
    if orthogonality_weight:
        energy = energy + orthogonality_weight * GramPenalty(1.0 * (np.arange(size) < size // 2))(C)
    return Problem("C", minimize(energy), C @ free())


def region_step(side: int, seed: int) -> Problem:
    """A step in v on a bumpy square of side * side vertices: half of it is described."""
    rng = np.random.default_rng(seed)
    x, y = (axis.ravel() for axis in np.meshgrid(np.linspace(0, 1, side), np.linspace(0, 1, side)))
    corner = np.arange(side * side).reshape(side, side)
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]))
    vertices = np.c_[x, y, 0.1 * np.sin(5.0 * x) * y]
    faces = np.concatenate([np.c_[a, b, c], np.c_[a, c, d]])
    n = len(vertices)
    whole = MaskedBasis(rng.standard_normal((n, 8)), np.full(n, 1.0 / n), rng.standard_normal((n, 12)))
    inside = 1.0 * (x < 0.5)
    v = Variable("v", n)
    energy = (
        MaskedTarget(whole.project(inside), whole)(v)
        + 5.0 * AreaGap(np.full(n, 1.0 / n), float(inside.mean()))(v)
        + 0.05 * MumfordShah(vertices, faces)(v)
    )
    return Problem("v", minimize(energy), v @ free(), start={"v": np.full(n, 0.6)})


@settings(max_examples=8, deadline=None)
@example(216084, 3)  # a column fitted exactly, which 200 passes leave at 1e-4 to 1e-3 of the longest residual
@example(218, 3)
@given(st.integers(0, 10**6), st.integers(3, 6))
def test_the_dual_bound_lies_below_what_is_found_and_close_to_it(seed: int, size: int) -> None:
    problem, limits = map_step(size, seed), Limits(evaluations=200)
    proved = bound(problem, "convex_dual").value
    assert proved <= solve(problem, "native:reweighted", limits=limits).objective
    assert proved >= 0.999 * solve(problem, "native:reweighted", limits=limits).objective
    whole = map_step(size, seed, orthogonality_weight=2.0)
    assert bound(whole).value <= solve(whole, limits=limits).objective


def test_a_cone_solver_and_the_dual_bound_meet() -> None:
    problem = map_step(5, 0)
    answer = solve(problem, "cvxpy:CLARABEL").with_bound(bound(problem))
    assert answer.status is Status.CERTIFIED
    assert answer.certificate == "convex_dual"


@pytest.mark.parametrize("instance", [functional_map(), robust_regression()], ids=lambda i: i.problem.name)
def test_the_dual_bound_meets_a_proved_optimum(instance) -> None:  # type: ignore[no-untyped-def]
    assert bound(instance.problem, "convex_dual").value == pytest.approx(instance.optimum, rel=1e-5)
    assert bound(instance.problem, "convex_dual").value <= instance.optimum


def test_the_dual_bound_holds_where_it_cannot_be_tight() -> None:
    few = map_step(6, 1, descriptors=3)  # some maps do nothing to the data, and the mask vanishes at one entry
    assert 0.0 <= bound(few, "convex_dual").value <= solve(few, "native", limits=Limits(evaluations=300)).objective
    early = bound(map_step(5, 2), "convex_dual", seconds=1e-9)
    assert 0.0 <= early.value <= solve(map_step(5, 2)).objective
    with pytest.raises(BoundError, match="convex_dual needs one free matrix"):
        bound(region().problem, "convex_dual")


@pytest.mark.parametrize("seed", range(2))
def test_cells_are_feasible_and_not_better_than_all_fields(seed: int) -> None:
    problem = region_step(10, seed)
    check_bridge(RegionCells(), problem)
    start = {"v": np.full(100, 0.6)}
    unrestricted = solve(problem, "native", start=start, limits=Limits(evaluations=300))
    coarse = solve(problem, "cvxpy", start=start, limits=Limits(evaluations=200))
    assert coarse.claim == "restriction"
    assert coarse.route[0] == "cells"
    assert coarse.violation == 0.0
    assert coarse.objective == pytest.approx(problem.objective.value(coarse.values), rel=1e-12)
    assert unrestricted.objective <= coarse.objective < problem.objective.value(start)
    assert len(np.unique(coarse["v"])) <= 25
    assert np.mean((membership(coarse["v"]) > 0.5) == (membership(unrestricted["v"]) > 0.5)) > 0.6


def test_cells_cover_a_mesh_of_two_pieces() -> None:
    problem = region_step(6, 0)
    edge = next(t.term for t in problem.objective.terms if isinstance(t.term, MumfordShah))
    twice = MumfordShah(np.concatenate([edge.vertices, edge.vertices + 3.0]), np.concatenate([edge.faces] * 2))
    v = Variable("v", 72)
    apart = Problem("v", minimize(MumfordShah(twice.vertices, edge.faces)(v)), v @ free())  # the second has no face
    rewritten = RegionCells(count=5).apply(apart)
    assert rewritten.problem.variables[0].shape == (5,)
    assert rewritten.inverse({"v": np.arange(5.0)})["v"].shape == (72,)
    assert "MumfordShah" in (RegionCells().obstacle(functional_map().problem) or "")


@pytest.mark.parametrize("algorithm", EVERY_MODEL)
def test_every_convex_solver_comes_down_to_the_step_in_c(algorithm: str) -> None:
    for instance in (robust_regression(), functional_map()):
        answer = solve(
            instance.problem, f"cvxpy:{algorithm}", start={"C": np.zeros((4, 4))}, limits=Limits(evaluations=150)
        )
        assert instance.optimum - 1e-9 <= answer.objective <= 1.02 * instance.optimum


def test_the_nonlinear_mode_refuses_norms_of_columns() -> None:
    rows = [row for row in route(robust_regression().problem, ["cvxpy"]) if row.algorithm == "nlp-UNO"]
    assert "norms of columns" in str(rows[0].acceptance)
