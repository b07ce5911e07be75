"""Properties of the elastic-net surfaces, held to KKT conditions and to each other."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from nonrigid.formulations.model import Body, ElasticNet, Simplex, Sphere
from nonrigid.geometry.arrays import FloatArray

ENTRIES = st.floats(-20.0, 20.0, allow_nan=False, width=32)
POINTS = arrays(np.float64, st.integers(1, 9), elements=ENTRIES)
MIXES = st.one_of(st.floats(0.0, 1.0), st.sampled_from([0.0, 1e-17, 1e-12, 1e-6, 0.8, 1.0]))


def normal(mix: float, x: FloatArray) -> FloatArray:
    return (1.0 - mix) + 2.0 * mix * x


def kkt_error(mix: float, x: FloatArray, slope: FloatArray) -> float:
    """How far slope is from m * normal - z, with m >= 0, z >= 0 and z'x = 0: optimality of max slope'x at x."""
    outward, played = normal(mix, x), x > 1e-9
    m = max(float(slope[played] @ outward[played]) / float(outward[played] @ outward[played]), 0.0)
    rest = slope - m * outward
    return max(float(np.abs(rest[played]).max()), float(rest.max(initial=0.0)))


@settings(max_examples=150, deadline=None)
@given(MIXES, POINTS)
def test_restoring_is_exact_and_idempotent(mix: float, x: FloatArray) -> None:
    surface = ElasticNet(mix=mix)
    point = surface.restore(x)
    assert surface.violation(point) <= 1e-12
    np.testing.assert_allclose(surface.restore(point), point, atol=1e-14)


@settings(max_examples=200, deadline=None)
@given(MIXES, POINTS)
def test_projection_onto_the_body_meets_the_kkt_conditions(mix: float, x: FloatArray) -> None:
    body = Body(ElasticNet(mix=mix))
    nearest = body.project(x)
    assert body.violation(nearest) <= 1e-12
    if ElasticNet(mix=mix).violation(nearest) > 1e-12:
        np.testing.assert_array_equal(nearest, np.maximum(x, 0.0))
    else:
        assert kkt_error(mix, nearest, x - nearest) <= 1e-9 * (1.0 + np.abs(x).max())


@settings(max_examples=200, deadline=None)
@given(MIXES, POINTS)
def test_the_linear_maximiser_meets_the_kkt_conditions(mix: float, slope: FloatArray) -> None:
    surface = ElasticNet(mix=mix)
    best = surface.linear_max(slope)
    assert surface.violation(best) <= 1e-12
    if slope.max() > 1e-6:
        vertex = mix * slope.max() <= 1e-6  # below that the maximiser is a vertex to rounding
        assert kkt_error(mix, best, slope) <= (1e-4 if vertex else 1e-8) * (1.0 + np.abs(slope).max())
    rng = np.random.default_rng(0)
    for _ in range(5):
        assert slope @ best >= slope @ surface.sample(slope.shape, rng) - 1e-9 * (1.0 + np.abs(slope).max())


@settings(max_examples=100, deadline=None)
@given(POINTS)
def test_mix_zero_is_the_simplex_and_the_limit_of_small_mixes(x: FloatArray) -> None:
    np.testing.assert_array_equal(ElasticNet(mix=0.0).project(x), Simplex().project(x))
    near = Body(ElasticNet(mix=1e-13)).project(x)
    if np.maximum(x, 0.0).sum() > 1.0 + 1e-6:
        np.testing.assert_allclose(near, Simplex().project(x), atol=1e-9)


@settings(max_examples=100, deadline=None)
@given(POINTS)
def test_on_the_sphere_projecting_and_maximising_are_scaling_of_the_positive_part(x: FloatArray) -> None:
    kept = np.maximum(x, 0.0)
    if np.linalg.norm(kept) > 1.0 + 1e-9:
        np.testing.assert_allclose(Sphere().project(x), kept / np.linalg.norm(kept), atol=1e-12)
        np.testing.assert_allclose(Sphere().linear_max(x), kept / np.linalg.norm(kept), atol=1e-12)


@settings(max_examples=40, deadline=None)
@given(st.integers(2, 8), st.integers(0, 10_000))
def test_repeated_linear_maximisation_on_the_sphere_finds_the_perron_vector(size: int, seed: int) -> None:
    A = np.random.default_rng(seed).uniform(0.1, 1.0, (size, size))
    A = A + A.T
    x = Sphere().center((size,))
    for _ in range(200):
        x = Sphere().linear_max(A @ x)
    eigenvalues, vectors = np.linalg.eigh(A)
    np.testing.assert_allclose(x, np.abs(vectors[:, -1]), atol=1e-8)
    assert float(x @ A @ x) == np.float64(eigenvalues[-1]).round(10) or abs(x @ A @ x - eigenvalues[-1]) < 1e-10


@settings(max_examples=100, deadline=None)
@given(MIXES, POINTS, st.floats(0.1, 10.0))
def test_the_gauge_is_homogeneous_and_one_on_the_surface(mix: float, x: FloatArray, factor: float) -> None:
    surface = ElasticNet(mix=mix)
    point = surface.restore(x)
    gauge, slope = surface.gauge_and_gradient(point)
    assert abs(gauge - 1.0) <= 1e-12
    assert abs(slope @ point - 1.0) <= 1e-12  # Euler, degree 1
    assert abs(surface.gauge_and_gradient(factor * point)[0] - factor) <= 1e-11 * factor
