"""The contract of a term, checked by sampling."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations
from typing import Any

import numpy as np

from nonrigid.formulations.model import Applied, Curvature, Set, Variable, free
from nonrigid.formulations.model.ops import NumpyOps
from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.testing.differences import along, directions
from nonrigid.solvers.testing.errors import distance, expect, largest

Shape = int | tuple[int, ...]
Point = tuple[FloatArray, ...]
_RELATIVE = 1e-6


def check_term(
    term: Any,
    shapes: Shape | Sequence[Shape],
    *,
    rng_seed: int = 0,
    domain: Set | Sequence[Set] | None = None,
    points: int = 4,
) -> None:
    """Check that a term keeps its contract, and that every optional member agrees with `value_and_gradient`.

    The gradient is held to central differences (1e-6 relative); curvature is sampled along segments; degree and
    monotonicity are sampled; `hessian`, `hessian_product` and `column` are held to differences of the gradient; `lower`
    in numpy's operations, and `fix` for every choice of arguments, to the value.

    Parameters
    ----------
    term
        The term.
    shapes
        Shape of its argument; a list of shapes where it takes several.
    rng_seed
        Seed of the sampled points.
    domain
        Set, or one an argument, from which points are drawn; all arrays by default. The term must be defined near it.
    points
        Number of points sampled.

    Raises
    ------
    ConformanceError
        At the first broken promise: what was expected, what was found, where to look.

    Examples
    --------
    >>> from nonrigid.formulations.model import QuadraticForm
    >>> check_term(QuadraticForm(np.array([[2.0, 1.0], [1.0, 0.0]])), 2)
    """
    listed = shapes if isinstance(shapes, list) else [shapes]
    full = [(shape,) if isinstance(shape, int) else tuple(shape) for shape in listed]
    domains = [free() if domain is None else domain] * len(full) if not isinstance(domain, Sequence) else list(domain)
    rng = np.random.default_rng(rng_seed)

    def draw() -> Point:
        return tuple(set_.sample(shape, rng) for set_, shape in zip(domains, full, strict=True))

    drawn = [draw() for _ in range(points)]
    for x in drawn:
        _check_gradient(term, x, rng)
        _check_lowering(term, x)
        _check_fix(term, x)
        if len(x) == 1:
            _check_hessian(term, x[0], rng)
    _check_curvature(term, draw)
    for x in drawn:
        _check_degree(term, x)
        _check_monotone(term, x, rng)
    _check_latex(term, len(full))


def parts_of(gradient: Any) -> Point:
    """Return the gradient as a tuple, one array an argument."""
    return gradient if isinstance(gradient, tuple) else (gradient,)


def _value(term: Any, x: Point) -> float:
    return float(term.value_and_gradient(*x)[0])


def _name(term: Any) -> str:
    return type(term).__name__


def _check_gradient(term: Any, x: Point, rng: np.random.Generator) -> None:
    look, before = f"{_name(term)}.value_and_gradient", [part.copy() for part in x]
    value, gradient = term.value_and_gradient(*x)
    parts = parts_of(gradient)
    expect(np.isscalar(value) and np.isfinite(value), _name(term), expected="a finite number", found=value, look=look)
    expect(len(parts) == len(x), _name(term), expected=f"{len(x)} gradients", found=len(parts), look=look)
    for argument, (part, own, kept) in enumerate(zip(parts, x, before, strict=True)):
        expect(np.array_equal(own, kept), _name(term), expected="its argument untouched", found="a change", look=look)
        expect(
            np.shape(part) == own.shape,
            _name(term),
            expected=f"a gradient of shape {own.shape}",
            found=np.shape(part),
            look=look,
        )

        def moved(new: FloatArray, argument: int = argument) -> float:
            return _value(term, (*x[:argument], new, *x[argument + 1 :]))

        scale = largest(part)
        for direction in directions(own.shape, rng):
            claimed, measured = float(np.sum(part * direction)), along(moved, own, direction)
            allowed = _RELATIVE * max(scale, abs(measured)) + 1e-11 * abs(value)
            expect(
                abs(claimed - measured) <= allowed,
                _name(term),
                expected=f"a slope of {measured:.9g} in argument {argument} (central differences)",
                found=f"{claimed:.9g}",
                look=f"the gradient of {look}",
            )
    again = _value(term, x)
    expect(again == value, _name(term), expected=f"the same value {value!r} again", found=again, look=look)


def _check_hessian(term: Any, x: FloatArray, rng: np.random.Generator) -> None:
    products: list[tuple[str, Callable[[FloatArray], FloatArray]]] = []
    if hasattr(term, "hessian"):
        matrix = np.asarray(term.hessian(x))
        expect(
            matrix.shape == (x.size, x.size),
            _name(term),
            expected=f"a Hessian of shape {(x.size, x.size)}",
            found=matrix.shape,
            look=f"{_name(term)}.hessian",
        )
        products.append(("hessian", lambda d: (matrix @ d.ravel()).reshape(x.shape)))
    if hasattr(term, "hessian_product"):
        products.append(("hessian_product", lambda d: np.asarray(term.hessian_product(x, d))))
    if hasattr(term, "column"):
        products.append(("column", lambda d: np.asarray(term.column(int(np.argmax(d.ravel())))).reshape(x.shape)))
    for direction in directions(x.shape, rng) if products else ():
        measured = along(lambda new: np.asarray(term.value_and_gradient(new)[1], dtype=float), x, direction)
        for member, product in products:
            if member == "column" and np.count_nonzero(direction) != 1:
                continue
            off = distance(product(direction), measured)
            expect(
                off <= _RELATIVE * largest(measured) + 1e-9 * max(largest(term.value_and_gradient(x)[1]), 1e-3),
                _name(term),
                expected="the differences of its gradient",
                found=f"an entry off by {off:.3g}",
                look=f"{_name(term)}.{member}",
            )


def _check_lowering(term: Any, x: Point) -> None:
    if hasattr(term, "lower"):
        lowered, value = float(term.lower(*x, NumpyOps())), _value(term, x)
        expect(
            abs(lowered - value) <= 1e-9 * max(abs(value), 1e-3),
            _name(term),
            expected=f"the value {value:.12g} from its lowering",
            found=f"{lowered:.12g}",
            look=f"{_name(term)}.lower",
        )


def _check_fix(term: Any, x: Point) -> None:
    variables = tuple(Variable(f"x{index}", part.shape) for index, part in enumerate(x))
    values = {variable.name: part for variable, part in zip(variables, x, strict=True)}
    joint, gradient = Applied(term, variables).value_and_gradient(values)
    for count in range(1, len(x)):
        for chosen in combinations(values, count):
            given = {name: values[name] for name in chosen}
            rest = {name: part for name, part in values.items() if name not in given}
            value, parts = Applied(term, variables).fix(given).value_and_gradient(rest)
            off = max(distance(parts[name], gradient[name]) / max(largest(gradient[name]), 1e-3) for name in rest)
            expect(
                abs(value - joint) <= 1e-9 * max(abs(joint), 1e-3) and off <= 1e-9,
                _name(term),
                expected=f"the joint value {joint:.12g} and gradient with {list(given)} fixed",
                found=f"{value:.12g}, gradient off by {off:.3g} relative",
                look=f"{_name(term)}.fix",
            )


def _check_curvature(term: Any, draw: Callable[[], Point]) -> None:
    declared = getattr(term, "curvature", Curvature.UNKNOWN)
    expect(
        isinstance(declared, Curvature),
        _name(term),
        expected="a member of Curvature",
        found=repr(declared),
        look=f"{_name(term)}.curvature",
    )
    if declared not in (Curvature.AFFINE, Curvature.CONVEX, Curvature.CONCAVE):
        return
    for _ in range(12):
        left, right = draw(), draw()
        ends = _value(term, left), _value(term, right)
        for t in (0.25, 0.5, 0.75):
            middle = _value(term, tuple((1 - t) * a + t * b for a, b in zip(left, right, strict=True)))
            above = middle - ((1 - t) * ends[0] + t * ends[1])
            allowed = 1e-9 * max(abs(ends[0]), abs(ends[1]), abs(middle), 1e-3)
            too_high = declared is not Curvature.CONCAVE and above > allowed
            too_low = declared is not Curvature.CONVEX and above < -allowed
            expect(
                not (too_high or too_low),
                _name(term),
                expected=f"a function that is {declared.value} along segments",
                found=f"a point {above:.3g} above the chord",
                look=f"{_name(term)}.curvature",
            )


def _check_degree(term: Any, x: Point) -> None:
    degree = getattr(term, "degree", None)
    if degree is None:
        return
    value = _value(term, x)
    for factor in (0.5, 2.0, 3.0):
        scaled, promised = _value(term, tuple(factor * part for part in x)), factor**degree * value
        expect(
            abs(scaled - promised) <= 1e-9 * max(abs(promised), 1e-3),
            _name(term),
            expected=f"{promised:.9g} at {factor:g} times a point, by degree {degree}",
            found=scaled,
            look=f"{_name(term)}.degree",
        )


def _check_monotone(term: Any, x: Point, rng: np.random.Generator) -> None:
    if not getattr(term, "monotone", False):
        return
    for sparse in (False, True):
        inside = tuple(np.abs(part) * (rng.random(part.shape) < 0.4 if sparse else 1.0) for part in x)
        parts = parts_of(term.value_and_gradient(*inside)[1])
        lowest = min(float(np.min(part, initial=0.0)) for part in parts)
        expect(
            lowest >= -1e-12 * max(largest(part) for part in parts),
            _name(term),
            expected="no negative entry of the gradient on x >= 0, as it declares to be monotone",
            found=lowest,
            look=f"{_name(term)}.monotone",
        )


def _check_latex(term: Any, count: int) -> None:
    if hasattr(term, "latex"):
        text = term.latex([f"x_{index}" for index in range(count)])
        expect(
            isinstance(text, str) and text.strip(),
            _name(term),
            expected="a formula as text",
            found=repr(text),
            look=f"{_name(term)}.latex",
        )
