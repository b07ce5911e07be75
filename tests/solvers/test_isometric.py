"""The triple assignment in the solvers: searches, lifts, bounds, and bounds that a backend claims."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations
from typing import ClassVar

import numpy as np
import pytest

from nonrigid.formulations.isometric import distance_ratios
from nonrigid.formulations.model import Problem, Variable, minimize
from nonrigid.formulations.model.assignment_sets import Assignment, PartialPermutation
from nonrigid.formulations.model.terms.linear import Linear
from nonrigid.formulations.model.terms.triple_distortion import TripleDistortion
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.acceptance import Acceptance, Native, Refused
from nonrigid.solvers.backend import Raw, make_backend
from nonrigid.solvers.bounds.bound import BoundError, bound
from nonrigid.solvers.bridges.pair_lift import PairLift
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.oracle import Oracle
from nonrigid.solvers.route import route
from nonrigid.solvers.solution import Bound
from nonrigid.solvers.solve import solve
from nonrigid.solvers.status import Status


def triple_problem(k: int, n: int, seed: int, weight: float = 1.0) -> Problem:
    rng = np.random.default_rng(seed)
    target = rng.random((n, 3))
    source = 1.3 * target[rng.permutation(n)[:k]] + 0.05 * rng.standard_normal((k, 3))
    part, full = (np.linalg.norm(x[:, None] - x[None], axis=2) for x in (source, target))
    P = Variable("P", (k, n))
    term = TripleDistortion(distance_ratios(part, full, "logarithmic" if seed % 2 else "folded"))
    start = {"P": np.full((k, n), 1.0 / n)}
    return Problem("sparse", minimize(weight * term(P)), P @ PartialPermutation(), start=start)


@pytest.mark.parametrize("seed", range(6))
def test_searches_agree_with_plain_enumeration_and_with_the_lift_of_triples(seed: int) -> None:
    problem = triple_problem(4, 6, seed, weight=3.0)
    term = problem.objective.terms[0].term
    least = min(3.0 * term.value_and_gradient(np.eye(6)[list(c)])[0] for c in permutations(range(6), 4))
    for algorithm in ("exhaustive", "branch_and_bound"):
        answer = solve(problem, f"native:{algorithm}")
        assert answer.status is Status.CERTIFIED
        assert answer.certificate == algorithm
        assert answer.objective == pytest.approx(least, rel=1e-12)
    proved = bound(problem, "triple_lift").value
    assert proved <= least + 1e-12
    assert proved >= 0.9 * least


def test_a_search_cut_short_claims_no_bound() -> None:
    answer = solve(triple_problem(5, 10, 0), "native:exhaustive", limits=Limits(evaluations=5))
    assert answer.status is not Status.CERTIFIED
    assert answer.bound is None
    assert answer.values


def test_the_lift_has_the_size_of_the_formula() -> None:
    lifted = PairLift().apply(triple_problem(5, 10, 0)).problem
    assert lifted.variables[0].size == 980
    assert int(lifted.memberships[0].set.integral.sum()) == 50  # type: ignore[attr-defined]
    origin = np.zeros(980)
    assert sum(len(c.value_and_jacobian(origin)[0]) for _, c in lifted.constraints.values()) == 275


@pytest.mark.parametrize("spec", ["cvxpy:HIGHS", "scipy:milp", "casadi:bonmin"])
def test_branching_solvers_reach_the_optimum_through_the_lift(spec: str) -> None:
    problem = triple_problem(3, 4, 1)
    answer = solve(problem, spec)
    assert answer.route[0] == "pair lift"
    assert answer.objective == pytest.approx(solve(problem).objective, abs=1e-7)


@pytest.mark.parametrize("name", ["casadi", "cvxpy", "native", "nlopt", "scipy"])
def test_each_library_takes_both_problems_and_its_claim_holds(name: str) -> None:
    cost = np.random.default_rng(0).random((4, 6))
    X = Variable("X", cost.shape)
    extension = Problem("extension", minimize(Linear(cost)(X)), X @ Assignment())
    for problem in (triple_problem(3, 5, 1), extension):
        assert any(not isinstance(row.acceptance, Refused) for row in route(problem, [name]))
        best, answer = solve(problem), solve(problem, name, limits=Limits(seconds=10.0))
        assert best.status is Status.CERTIFIED
        assert answer.status.usable
        assert answer.objective >= best.objective - 1e-6
        if problem is extension:
            assert answer.objective == pytest.approx(best.objective, abs=1e-4)


def test_too_many_maps_are_refused_with_their_number() -> None:
    reason = make_backend("native:exhaustive").accepts(triple_problem(7, 13, 0))
    assert isinstance(reason, Refused)
    assert "8648640" in reason.reason


@dataclass(frozen=True)
class Boastful:
    """Return the start and claim that it is far better than it is."""

    algorithm: str = "only"
    claimed: float = 1e3
    name: ClassVar[str] = "boastful"
    algorithms: ClassVar[tuple[str, ...]] = ("only",)

    @classmethod
    def default_algorithm(cls, problem: Problem) -> str:
        return "only"

    def accepts(self, problem: Problem) -> Acceptance:
        return Native()

    def run(self, oracle: Oracle, start: FloatArray, limits: Limits) -> Raw:
        return Raw(start, "the best there is", Bound(self.claimed, "boast", 0.0))

    @classmethod
    def versions(cls) -> dict[str, str]:
        return {"boastful": "1"}


def test_a_bound_beyond_the_answer_is_dropped_and_said_to_be_refuted() -> None:
    answer = solve(triple_problem(3, 5, 1), Boastful())
    assert answer.status is not Status.CERTIFIED
    assert answer.bound is None
    assert "refuted" in answer.message


def test_trying_every_map_is_a_bound_that_meets_the_optimum() -> None:
    problem = triple_problem(5, 10, 3, weight=2.0)
    proved = bound(problem, "exhaustive")
    assert solve(problem, "native:branch_and_bound").objective == pytest.approx(proved.value, rel=1e-12)
    assert "30240 maps" in proved.detail
    assert bound(problem, "exhaustive", seconds=1e-9).value <= proved.value
    with pytest.raises(BoundError, match="at most 1000000 maps"):
        bound(triple_problem(7, 13, 0), "exhaustive")
