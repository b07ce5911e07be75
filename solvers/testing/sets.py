"""The contract of a set, checked by sampling."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from nonrigid.formulations.model import Applicable, Curvature, Problem, Variable, minimize
from nonrigid.formulations.model.ops import NumpyOps
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.judge import kkt_residual
from nonrigid.solvers.testing.differences import along, directions
from nonrigid.solvers.testing.errors import distance, expect, largest

_EXACT, _ON = 1e-12, 1e-9


def check_set(set: Any, shape: int | tuple[int, ...], *, rng_seed: int = 0, points: int = 8) -> None:
    """Check that a set keeps its contract for a variable of a shape, and that its optional members agree with it.

    `restore` puts points exactly on the set (1e-12), is idempotent and leaves members alone; the center and samples are
    members; bounds hold, constraints vanish and lowerings have no residual on members; Jacobians agree with
    differences; `project` is nearest, against members and by first-order conditions; `linear_max` beats members;
    the gauge is homogeneous and 1 on the set.

    A projection onto the surface of a convex `body()` is held to be nearest where the body's nearest point lies on the
    surface; elsewhere any point of the surface will do.

    Raises `ConformanceError` at the first broken promise: what was expected, what was found, where to look.

    Examples
    --------
    >>> from nonrigid.formulations.model import ElasticNet
    >>> check_set(ElasticNet(mix=0.8), 4)
    """
    full = (shape,) if isinstance(shape, int) else tuple(shape)
    rng = np.random.default_rng(rng_seed)
    members = [set.center(full)] + [set.sample(full, rng) for _ in range(points)]
    outside = [scale * rng.standard_normal(full) for scale in (0.1, 1.0, 1.0, 5.0, 5.0, 50.0) for _ in range(2)]
    _check_members(set, full, members, rng_seed)
    _check_restore(set, members, outside)
    _check_constraints(set, full, members, outside, rng)
    _check_lowering(set, members, outside)
    if hasattr(set, "project"):
        _check_project(set, full, members, outside)
    if hasattr(set, "linear_max"):
        _check_linear_max(set, members, outside)
    if hasattr(set, "slope_along"):
        _check_slope_along(set, full, outside)
    if hasattr(set, "gauge_and_gradient"):
        _check_gauge(set, members, rng)
    if hasattr(set, "body"):
        _check_body(set, members, outside)
    text = set.latex("x")
    expect(isinstance(text, str), set, expected="a membership as text", found=repr(text), look="latex")


def _check_members(set_: Any, shape: tuple[int, ...], members: list[FloatArray], seed: int) -> None:
    low, high = set_.bounds(shape)
    for place, bound in (("lower", low), ("upper", high)):
        expect(np.shape(bound) == shape, set_, expected=f"{place} bounds of shape {shape}", found=bound, look="bounds")
    for x in members:
        off = set_.violation(x)
        expect(x.shape == shape, set_, expected=f"points of shape {shape}", found=x.shape, look="center and sample")
        expect(off <= _ON, set_, expected="the center and samples on the set", found=off, look="center and sample")
        beyond = max(float(np.max(low - x)), float(np.max(x - high)))
        expect(beyond <= _ON, set_, expected="members within the bounds", found=beyond, look="bounds")
    again = [set_.sample(shape, np.random.default_rng(seed)) for _ in range(2)]
    expect(np.array_equal(*again), set_, expected="one sample a seed", found="two samples", look="sample")
    if set_.convex:
        for left, right in pairwise(members):
            off = set_.violation(0.5 * (left + right))
            expect(off <= _ON, set_, expected="midpoints of members on the convex set", found=off, look="convex")


def _check_restore(set_: Any, members: list[FloatArray], outside: list[FloatArray]) -> None:
    for x in [*members, *outside, np.zeros_like(members[0]), -np.ones_like(members[0])]:
        before = x.copy()
        point = set_.restore(x)
        off, moved = set_.violation(point), distance(set_.restore(point), point)
        expect(np.array_equal(x, before), set_, expected="its argument untouched", found="a change", look="restore")
        expect(off <= _EXACT, set_, expected="restored points exactly on the set", found=off, look="restore")
        expect(moved <= _EXACT, set_, expected="restoring twice to change nothing", found=moved, look="restore")
        if distance(point, x) > 1e-6:
            expect(
                set_.violation(x) > 0.0,
                set_,
                expected="a positive violation of a point that restore moves",
                found=set_.violation(x),
                look="violation",
            )
    for x in members:
        moved = distance(set_.restore(x), x)
        expect(moved <= _EXACT, set_, expected="members left where they are", found=moved, look="restore")


def _check_constraints(
    set_: Any, shape: tuple[int, ...], members: list[FloatArray], outside: list[FloatArray], rng: np.random.Generator
) -> None:
    low, high = set_.bounds(shape)
    conditions = set_.constraints(shape)
    for condition in conditions:
        for x in members:
            off = condition.violation(x)
            expect(off <= _ON, set_, expected="constraints that members satisfy", found=off, look="constraints")
        for x in (members[1], outside[2]):
            value, jacobian = condition.value_and_jacobian(x)
            shaped = (len(value), x.size)
            expect(
                np.shape(jacobian) == shaped,
                set_,
                expected=f"a Jacobian of shape {shaped}",
                found=np.shape(jacobian),
                look="constraints",
            )
            for direction in directions(shape, rng):
                measured = along(lambda new, c=condition: c.value_and_jacobian(new)[0], x, direction)  # type: ignore[misc]
                off = distance(np.asarray(jacobian) @ direction.ravel(), measured)
                expect(
                    off <= 1e-6 * max(largest(jacobian), 1e-3),
                    set_,
                    expected="the differences of the constraint in its Jacobian",
                    found=off,
                    look="constraints: value_and_jacobian",
                )
        if condition.linear:
            slopes = [np.asarray(condition.value_and_jacobian(x)[1]) for x in (members[0], outside[2])]
            off = distance(*slopes)
            expect(off <= _ON, set_, expected="a constant Jacobian, as it is linear", found=off, look="constraints")
    for x in outside if not hasattr(set_, "integral") else ():  # integrality is no smooth condition
        if set_.violation(x) > 1e-6:
            caught = max([float(np.max(low - x)), float(np.max(x - high))] + [c.violation(x) for c in conditions])
            expect(
                caught > 0.0,
                set_,
                expected="bounds or constraints that a point off the set breaks",
                found=f"none broken at violation {set_.violation(x):.3g}",
                look="bounds and constraints",
            )


def _check_lowering(set_: Any, members: list[FloatArray], outside: list[FloatArray]) -> None:
    if not hasattr(set_, "lower"):
        return
    for x in [*members, *outside]:
        residual = max([largest(part) for part in set_.lower(x, NumpyOps())], default=0.0)
        off = set_.violation(x)
        if off <= 1e-13:
            expect(residual <= _ON, set_, expected="no residual on a member", found=residual, look="lower")
        elif off > 1e-6:
            expect(residual > 0.0, set_, expected="a residual off the set", found=residual, look="lower")


def _check_project(set_: Any, shape: tuple[int, ...], members: list[FloatArray], outside: list[FloatArray]) -> None:
    body = set_.body() if hasattr(set_, "body") else None
    x = Variable("x", shape)
    for target in outside:
        nearest = set_.project(target)
        off = set_.violation(nearest)
        expect(off <= _ON, set_, expected="projections on the set", found=off, look="project")
        if body is not None and not set_.convex and set_.violation(body.project(target)) > _ON:
            continue
        reached = float(np.linalg.norm(target - nearest))
        for other in members:
            rival = float(np.linalg.norm(target - other))
            expect(
                reached <= rival + _ON * max(rival, 1.0),
                set_,
                expected=f"a point no farther than a member at {rival:.9g}",
                found=f"{reached:.9g}",
                look="project",
            )
        if hasattr(set_, "integral"):
            continue
        problem = Problem("projection", minimize(HalfSquaredDistance(target)(x)), x @ set_)
        residual = kkt_residual(problem, {"x": nearest})
        expect(
            residual <= 1e-7 * max(reached, 1.0),
            set_,
            expected="the first-order conditions of the nearest point, from bounds and constraints",
            found=f"a residual of {residual:.3g}",
            look="project",
        )


def _check_slope_along(set_: Any, shape: tuple[int, ...], outside: list[FloatArray]) -> None:
    """Check that a slope toward a point is none at the nearest point to it, and is some at other points."""
    for target in outside:
        nearest = set_.project(target)
        reached = max(float(np.linalg.norm(target - nearest)), 1.0)
        slope = set_.slope_along(nearest, target - nearest)
        at_end = hasattr(set_, "body") and set_.violation(set_.body().project(target)) > _ON
        expect(
            at_end or slope is None or slope <= 1e-7 * reached,
            set_,
            expected="no slope along the surface toward a point at the nearest point to it",
            found=slope,
            look="slope_along",
        )
        for other in (set_.center(shape), set_.sample(shape, np.random.default_rng(0))):
            slope = set_.slope_along(other, target - other)
            expect(
                slope is None or slope > 0.0 or other.size == 1,
                set_,
                expected="a slope along the surface toward a random point, at a point that is not the nearest",
                found=slope,
                look="slope_along",
            )


def _check_linear_max(set_: Any, members: list[FloatArray], outside: list[FloatArray]) -> None:
    for slope in outside:
        best = set_.linear_max(slope)
        off = set_.violation(best)
        reached, rival = float(np.sum(slope * best)), max(float(np.sum(slope * x)) for x in members)
        expect(off <= _ON, set_, expected="a linear maximiser on the set", found=off, look="linear_max")
        expect(
            reached >= rival - _ON * max(abs(rival), 1.0),
            set_,
            expected=f"at least the {rival:.9g} of a member",
            found=f"{reached:.9g}",
            look="linear_max",
        )


def _check_gauge(set_: Any, members: list[FloatArray], rng: np.random.Generator) -> None:
    for x in members:
        gauge, slope = set_.gauge_and_gradient(x)
        expect(abs(gauge - 1.0) <= _ON, set_, expected="gauge 1 on the set", found=gauge, look="gauge_and_gradient")
        for factor in (0.5, 3.0):
            scaled = set_.gauge_and_gradient(factor * x)[0]
            expect(
                abs(scaled - factor * gauge) <= _ON,
                set_,
                expected=f"gauge {factor:g} at {factor:g} times a member",
                found=scaled,
                look="gauge_and_gradient",
            )
        for direction in directions(x.shape, rng):
            measured = along(lambda new: float(set_.gauge_and_gradient(new)[0]), x, direction)
            claimed = float(np.sum(slope * direction))
            expect(
                abs(claimed - measured) <= 1e-6 * max(largest(slope), 1.0),
                set_,
                expected=f"a gauge slope of {measured:.9g} (central differences)",
                found=f"{claimed:.9g}",
                look="gauge_and_gradient",
            )


def _check_body(set_: Any, members: list[FloatArray], outside: list[FloatArray]) -> None:
    body = set_.body()
    expect(body.convex, set_, expected="a convex body", found=body, look="body")
    for left, right in pairwise(members):
        off = body.violation(0.5 * (left + right))
        expect(off <= _ON, set_, expected="members and their midpoints in the body", found=off, look="body")


class HalfSquaredDistance(Applicable):
    """Evaluate |x - target|^2 / 2, whose minimizer over a set is the projection."""

    curvature = Curvature.CONVEX

    def __init__(self, target: FloatArray) -> None:
        self.target = target

    def value_and_gradient(self, *x: FloatArray) -> tuple[float, FloatArray]:
        """Return the value and x - target."""
        apart = x[0] - self.target
        return 0.5 * float(np.sum(apart * apart)), apart

    def lower(self, x: Any, ops: Any) -> Any:
        """Write the distance in the operations of a symbolic backend."""
        return 0.5 * ops.sum_squares(x - self.target)
