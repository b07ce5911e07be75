"""Elastic-net matching: its ends are the game and the leading eigenvector, and the printed `min` is degenerate."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nonrigid.benchmark.datasets.shrec16 import Shrec16
from nonrigid.benchmark.protocol import score
from nonrigid.formulations.elastic_net import ElasticNetMatching
from nonrigid.formulations.formulation import Pair
from nonrigid.formulations.games import game
from nonrigid.formulations.model import ElasticNet, Problem, QuadraticForm, Simplex, Variable, minimize
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.match import match
from nonrigid.solvers.solve import solve
from nonrigid.solvers.testing.instances import planted_payoff

FINE = Limits(tolerance=1e-10, seconds=None, evaluations=20_000)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10_000), size=st.integers(6, 40))
def test_mix_0_is_the_game(seed: int, size: int) -> None:
    payoff = planted_payoff(size, rng_seed=seed)
    net = solve(game("elastic-net", payoff, ElasticNet(mix=0.0)), limits=FINE)
    simplex = solve(game("game", payoff, Simplex()), limits=FINE)
    assert net.objective == pytest.approx(simplex.objective, abs=1e-9)
    np.testing.assert_allclose(net["u"], simplex["u"], atol=1e-7)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10_000), size=st.integers(6, 40))
def test_mix_1_is_the_nonnegative_leading_eigenvector(seed: int, size: int) -> None:
    payoff = planted_payoff(size, rng_seed=seed) + 0.02  # positive: by Perron and Frobenius the eigenvector is unique
    values, vectors = np.linalg.eigh(payoff)
    found = solve(game("elastic-net", payoff, ElasticNet(mix=1.0)), limits=FINE)
    assert found.objective == pytest.approx(values[-1], rel=1e-9)
    np.testing.assert_allclose(found["u"], np.abs(vectors[:, -1]), atol=1e-4)


@pytest.mark.parametrize("mix", [0.0, 0.3, 0.8, 1.0])
def test_the_min_of_the_text_is_degenerate_at_every_vertex(mix: float) -> None:
    payoff = planted_payoff(12)
    u = Variable("u", 12)
    surface = ElasticNet(mix=mix)
    literal = Problem("literal", minimize(QuadraticForm(payoff)(u)), u @ surface)
    rng = np.random.default_rng(0)
    for vertex in np.eye(12):
        assert surface.violation(vertex) <= 1e-15
        assert literal.objective.value({"u": vertex}) == 0.0
    assert all(literal.objective.value({"u": surface.sample((12,), rng)}) >= 0.0 for _ in range(50))


@pytest.mark.realdata
def test_a_real_cut_is_matched(data: Path) -> None:
    loaded = next(iter(Shrec16(root=data, names=("cuts_wolf_shape_7",)).pairs())).load()
    found = match(Pair.of(loaded.part, loaded.full), ElasticNetMatching(part_samples=150, full_samples=500))
    assert found.correspondence is not None
    assert [solution.problem for solution in found.solutions] == ["elastic-net", "local"]
    assert len(found.correspondence) >= 50
    assert score(loaded, found.correspondence.dense(len(loaded.part.vertices))).mean_error <= 0.02
