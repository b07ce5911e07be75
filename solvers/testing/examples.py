"""Examples by class, on which the kit tries every term and set of the package."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
from scipy import sparse

from nonrigid.formulations import model
from nonrigid.formulations.model import Body, Box, Curvature, ElasticNet, QuadraticForm, Set, Simplex, Smooth, Sphere
from nonrigid.formulations.model.binary_sets import MixedBinary
from nonrigid.formulations.model.term import Fixed
from nonrigid.formulations.model.terms.linear import Linear
from nonrigid.solvers.testing.errors import ConformanceError
from nonrigid.solvers.testing.instances import SquaredGap, planted_payoff
from nonrigid.solvers.testing.sets import check_set
from nonrigid.solvers.testing.terms import Shape, check_term


@dataclass(frozen=True, eq=False)
class TermExample:
    """Hold a term, the shape of its argument (a list for several) and the set near which it is defined."""

    term: Any
    shapes: Shape | list[Shape]
    domain: Set | list[Set] | None = None

    def check(self) -> None:
        """Run `check_term` on the example."""
        check_term(self.term, self.shapes, domain=self.domain)


@dataclass(frozen=True, eq=False)
class SetExample:
    """Hold a set and the shape of a variable in it."""

    set: Any
    shape: Shape

    def check(self) -> None:
        """Run `check_set` on the example."""
        check_set(self.set, self.shape)


Example = TermExample | SetExample


def examples_of(kind: type) -> tuple[Example, ...]:
    """Return the examples of a term or set class.

    They come from the class itself, where it has a static method `examples()` that returns tuples (term, shapes) or
    (term, shapes, domain), for a set (set, shape): so a new term or set is one file. Those below serve the built-in
    classes.

    Raises `ConformanceError` where there is none.

    Examples
    --------
    >>> [str(example.set) for example in examples_of(Simplex)]
    ['Simplex()']
    """
    if "examples" in vars(kind):
        make = TermExample if hasattr(kind, "value_and_gradient") else SetExample
        found = tuple(make(*given) for given in kind.examples())  # type: ignore[attr-defined]
    else:
        found = _BUILT_IN[kind]() if kind in _BUILT_IN else ()
    if not found:
        raise ConformanceError(
            kind.__name__,
            expected="examples on which to try the class",
            found="none",
            look=f"a static method `examples` of {kind.__module__}.{kind.__name__}: [(term, shapes)] or [(set, shape)]",
        )
    return found


def model_classes(package: ModuleType = model) -> Iterator[type]:
    """Yield every term and set class that the modules of a package define."""
    for found in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        for kind in vars(importlib.import_module(found.name)).values():
            if inspect.isclass(kind) and kind.__module__ == found.name and (_is_term(kind) or _is_set(kind)):
                yield kind


def _is_term(kind: type) -> bool:
    # Terms take arrays; `Applied` and `Objective` take a mapping of values by name.
    evaluate = getattr(kind, "value_and_gradient", None)
    concrete = not getattr(kind, "_is_protocol", False)
    return concrete and evaluate is not None and "values" not in inspect.signature(evaluate).parameters


def _is_set(kind: type) -> bool:
    return not getattr(kind, "_is_protocol", False) and all(hasattr(kind, name) for name in ("restore", "bounds"))


def _quadratic_forms() -> tuple[Example, ...]:
    payoff = planted_payoff(7)
    positive = payoff @ payoff + np.eye(7)
    return (
        TermExample(QuadraticForm(payoff), 7),
        TermExample(QuadraticForm(positive, curvature=Curvature.CONVEX), 7, Simplex()),
        TermExample(QuadraticForm(-positive, curvature=Curvature.CONCAVE), 7),
        TermExample(QuadraticForm(sparse.csr_array(payoff)), 7, ElasticNet(mix=0.8)),
        TermExample(QuadraticForm(np.zeros((3, 3)), curvature=Curvature.AFFINE), 3),
    )


def _smooth() -> tuple[Example, ...]:
    logarithms = Smooth(lambda x: float(np.log(x).sum()), lambda x: 1.0 / x, curvature=Curvature.CONCAVE)
    return (
        TermExample(Smooth(lambda x: float(np.exp(x).sum()), np.exp, curvature=Curvature.CONVEX), (2, 3)),
        TermExample(logarithms, 4, Box(0.5, 2.0)),
    )


def _fixed() -> tuple[Example, ...]:
    given = np.array([1.0, 2.0, 3.0])
    return (TermExample(Fixed(SquaredGap(), (None, given)), 3), TermExample(Fixed(SquaredGap(), (given, None)), 3))


def _boxes() -> tuple[Example, ...]:
    return (
        SetExample(Box(-1.0, 2.0), (2, 3)),
        SetExample(Box(), 3),
        SetExample(Box(lower=0.0), 4),
        SetExample(Box(upper=1.0), 2),
        SetExample(Box(0.5, 0.5), 2),
    )


def _binary() -> tuple[Example, ...]:
    mixed = MixedBinary(integral=np.array([True, False, True]), upper=np.array([1.0, 5.0, 1.0]))
    return SetExample(mixed, 3), SetExample(MixedBinary(integral=np.ones(4, bool), upper=np.ones(4)), 4)


_BUILT_IN: dict[type, Callable[[], tuple[Example, ...]]] = {
    QuadraticForm: _quadratic_forms,
    Linear: lambda: (TermExample(Linear(np.array([1.0, -2.0, 0.5])), 3), TermExample(Linear(np.array([1.0, 0.0])), 2)),
    Smooth: _smooth,
    Fixed: _fixed,
    Box: _boxes,
    MixedBinary: _binary,
    ElasticNet: lambda: tuple(SetExample(ElasticNet(mix=mix), 5) for mix in (0.8, 0.0, 0.3, 1.0, 1e-9, 1e-17)),
    Simplex: lambda: (SetExample(Simplex(), 6),),
    Sphere: lambda: (SetExample(Sphere(), 6),),
    Body: lambda: tuple(SetExample(Body(ElasticNet(mix=mix)), 5) for mix in (0.8, 0.0, 0.3, 1.0)),
}
