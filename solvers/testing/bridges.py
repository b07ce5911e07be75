"""The contract of a bridge: there and back, feasible, and as good as it claims."""

from __future__ import annotations

from typing import Any

import numpy as np

from nonrigid.formulations.model import Problem, Sense
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.acceptance import Claim
from nonrigid.solvers.judge import Values, violation
from nonrigid.solvers.layout import Layout
from nonrigid.solvers.testing.differences import along, directions
from nonrigid.solvers.testing.errors import expect, largest


def check_bridge(
    bridge: Any, problem: Problem, *, optimum: Values | None = None, rng_seed: int = 0, points: int = 6
) -> None:
    """Check that a bridge keeps its contract on a problem it takes.

    Points sent forward are feasible there, and come back feasible with the objective they had; the rewritten gradient
    agrees with differences; and the claim holds on samples. "exact" and "restriction": no point of the rewritten
    problem promises more than what it is brought back to; "exact" and "local": corresponding points have equal
    objectives; "relaxation": the rewritten objective is nowhere worse. A bridge that carries only some points, such as
    the stationary ones, must carry the `optimum`, which then has to be given.

    Raises `ConformanceError` at the first broken promise: what was expected, what was found, where to look.

    Examples
    --------
    >>> from nonrigid.solvers.bridges.radial import Radial
    >>> from nonrigid.solvers.testing.instances import planted_game
    >>> check_bridge(Radial(), planted_game().problem)
    """
    name, rng = f"bridge {bridge.name!r} on {problem.name!r}", np.random.default_rng(rng_seed)
    obstacle = bridge.obstacle(problem)
    expect(obstacle is None, name, expected="a problem it takes", found=f"the obstacle: {obstacle}", look="obstacle")
    expect(isinstance(bridge.claim, Claim), name, expected="a member of Claim", found=repr(bridge.claim), look="claim")
    rewritten = bridge.apply(problem)
    sign = 1.0 if problem.objective.sense is Sense.MAXIMIZE else -1.0
    same = bridge.claim in (Claim.EXACT, Claim.LOCAL)
    expect(
        rewritten.problem.objective.sense is problem.objective.sense,
        name,
        expected=f"the sense {problem.objective.sense.value}",
        found=rewritten.problem.objective.sense.value,
        look="apply",
    )
    known = [] if optimum is None else [optimum]
    for number, values in enumerate([*known, *(_sampled(problem, rng) for _ in range(points))]):
        sent = rewritten.forward(values)
        if number >= len(known) > 0 and violation(rewritten.problem, sent) > 1e-7:
            continue
        back = rewritten.inverse(sent)
        here, there = problem.objective.value(values), rewritten.problem.objective.value(sent)
        close = 1e-9 * max(abs(here), 1e-3)
        _expect_feasible(name, rewritten.problem, sent, "forward")
        _expect_feasible(name, problem, back, "inverse")
        returned = problem.objective.value(back)
        expect(
            not same or (abs(returned - here) <= close and abs(there - here) <= close),
            name,
            expected=f"the objective {here:.12g} there and back",
            found=f"{there:.12g} there, {returned:.12g} back",
            look="forward and inverse",
        )
        expect(
            bridge.claim is not Claim.RELAXATION or sign * (there - here) >= -close,
            name,
            expected=f"no worse than {here:.12g} there, by its claim of a relaxation",
            found=f"{there:.12g}",
            look="claim",
        )
    for values in [_sampled(rewritten.problem, rng) for _ in range(points)]:
        if violation(rewritten.problem, values) > 1e-7:
            continue
        back = rewritten.inverse(values)
        _expect_feasible(name, problem, back, "inverse")
        there, here = rewritten.problem.objective.value(values), problem.objective.value(back)
        expect(
            bridge.claim not in (Claim.EXACT, Claim.RESTRICTION) or sign * (there - here) <= 1e-9 * max(abs(here), 1.0),
            name,
            expected=f"no better than {here:.12g}, the objective brought back, by its claim {bridge.claim.value!r}",
            found=f"{there:.12g}",
            look="claim",
        )
    _check_gradient(name, rewritten.problem, rng)


def _sampled(problem: Problem, rng: np.random.Generator) -> dict[str, FloatArray]:
    """Return a random point of the sets, the first of at most 200 that the named constraints allow."""
    for _ in range(200):
        values = {m.variable.name: m.set.sample(m.variable.shape, rng) for m in problem.memberships}
        if violation(problem, values) <= 1e-7:
            break
    return values


def _expect_feasible(name: str, problem: Problem, values: Values, look: str) -> None:
    off = violation(problem, values)
    expect(off <= 1e-7, name, expected=f"a feasible point of {problem.name!r}", found=f"violation {off:.3g}", look=look)


def _check_gradient(name: str, problem: Problem, rng: np.random.Generator) -> None:
    layout = Layout(problem)

    def value(flat: FloatArray) -> float:
        return problem.objective.value(layout.split(flat))

    for _ in range(2):
        flat = layout.join(_sampled(problem, rng)) + 1e-2  # off the bounds, where differences need room
        gradient = layout.join(problem.objective.value_and_gradient(layout.split(flat))[1])
        step = 1e-3 * max(largest(flat), 1e-3)
        for direction in directions(flat.shape, rng):
            claimed, measured = float(gradient @ direction), along(value, flat, direction, step)
            expect(
                abs(claimed - measured) <= 1e-6 * max(largest(gradient), abs(value(flat))),
                name,
                expected=f"a slope of {measured:.9g} of the rewritten objective (central differences)",
                found=f"{claimed:.9g}",
                look="the gradient of the rewritten terms (chain rule)",
            )
