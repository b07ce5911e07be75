"""Terms of an objective: what a formula must offer, and what it may."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any, Protocol, runtime_checkable

import numpy as np

from nonrigid.formulations.model.variable import Variable
from nonrigid.geometry.arrays import FloatArray
from nonrigid.geometry.errors import NonrigidError


class ModelError(NonrigidError, ValueError):
    """Report a problem that is stated wrongly."""


class Curvature(Enum):
    """Say which way a term bends; declared by the term and checked by the conformance kit."""

    AFFINE = "affine"
    CONVEX = "convex"
    CONCAVE = "concave"
    INDEFINITE = "indefinite"
    UNKNOWN = "unknown"

    def negated(self) -> Curvature:
        """Return the curvature of the negative."""
        return {Curvature.CONVEX: Curvature.CONCAVE, Curvature.CONCAVE: Curvature.CONVEX}.get(self, self)


@runtime_checkable
class Term(Protocol):
    """Evaluate one formula of an objective: the only thing required is `value_and_gradient`.

    Optional members, used where present and checked against it by `nonrigid.solvers.testing.check_term`:
    `curvature: Curvature`; `degree: int`, positively homogeneous of that degree; `monotone: bool`, no entry of the
    gradient is negative on x >= 0; `hessian(x)`; `hessian_product(x, d)`; `column(i)`, a column of a constant Hessian;
    `lower(x, ops)`, the same formula in the operations of `nonrigid.formulations.model.ops.Ops`; `fix(values)`, the
    term with some arguments constant; `latex(names)`.
    """

    def value_and_gradient(self, *x: FloatArray) -> tuple[float, Any]:
        """Return the value, and the gradient: an array for one argument, a tuple of arrays for more."""


@dataclass(frozen=True, eq=False)
class Applied:
    """Hold a weighted term and the variables it is applied to; made by calling a term."""

    term: Term
    variables: tuple[Variable, ...]
    weight: float = 1.0

    @property
    def curvature(self) -> Curvature:
        """Curvature of the weighted term."""
        declared: Curvature = getattr(self.term, "curvature", Curvature.UNKNOWN)
        return declared if self.weight >= 0 else declared.negated()

    def value_and_gradient(self, values: Mapping[str, FloatArray]) -> tuple[float, dict[str, FloatArray]]:
        """Return the weighted value and the weighted gradient by variable name."""
        value, gradient = self.term.value_and_gradient(*(values[variable.name] for variable in self.variables))
        parts = gradient if isinstance(gradient, tuple) else (gradient,)
        total: dict[str, FloatArray] = {}
        for variable, part in zip(self.variables, parts, strict=True):  # f(u, u) has two parts for u
            scaled = self.weight * np.asarray(part)
            total[variable.name] = total[variable.name] + scaled if variable.name in total else scaled
        return self.weight * value, total

    def fix(self, values: Mapping[str, FloatArray]) -> Applied:
        """Return the term with the named variables constant."""
        if not any(variable.name in values for variable in self.variables):
            return self
        given = tuple(values.get(variable.name) for variable in self.variables)
        specialised = getattr(self.term, "fix", None)
        term = specialised(given) if specialised is not None else Fixed(self.term, given)
        return Applied(term, tuple(v for v in self.variables if v.name not in values), self.weight)

    def latex(self) -> str:
        """Return the term as LaTeX, with its weight."""
        names = [variable.name for variable in self.variables]
        formula = getattr(self.term, "latex", None)
        text = formula(names) if formula is not None else rf"\mathrm{{{type(self.term).__name__}}}({', '.join(names)})"
        if self.weight == 1.0:
            return text
        bracketed = rf"\left({text}\right)" if " + " in text or " - " in text else text
        return rf"{self.weight:g}\, {bracketed}"

    def __str__(self) -> str:
        names = ", ".join(variable.name for variable in self.variables)
        return f"{'' if self.weight == 1.0 else f'{self.weight:g} * '}{type(self.term).__name__}({names})"

    def __add__(self, other: Applied | Sum) -> Sum:
        return Sum((self,)) + other

    def __mul__(self, factor: float) -> Applied:
        return replace(self, weight=self.weight * float(factor))

    __rmul__ = __mul__


@dataclass(frozen=True, eq=False)
class Sum:
    """Hold a sum of weighted terms."""

    terms: tuple[Applied, ...]

    def __add__(self, other: Applied | Sum) -> Sum:
        return Sum(self.terms + (other.terms if isinstance(other, Sum) else (other,)))

    def __mul__(self, factor: float) -> Sum:
        return Sum(tuple(term * factor for term in self.terms))

    __rmul__ = __mul__


class Applicable:
    """Let a term be written `term(variable, ...)`; terms inherit it."""

    def __call__(self, *variables: Variable) -> Applied:
        """Apply the term to variables, in the order its `value_and_gradient` takes them."""
        return Applied(self, variables)  # type: ignore[arg-type]


@dataclass(frozen=True, eq=False)
class Fixed:
    """Hold any term with some of its arguments constant; the others keep their order."""

    term: Term
    given: tuple[FloatArray | None, ...]

    @property
    def curvature(self) -> Curvature:
        """Curvature in the remaining arguments, known only if the joint one is."""
        declared: Curvature = getattr(self.term, "curvature", Curvature.UNKNOWN)
        return Curvature.UNKNOWN if declared is Curvature.INDEFINITE else declared

    def value_and_gradient(self, *x: FloatArray) -> tuple[float, Any]:
        """Return the value and the gradient in the remaining arguments."""
        rest = iter(x)
        full = tuple(next(rest) if value is None else value for value in self.given)
        value, gradient = self.term.value_and_gradient(*full)
        parts = gradient if isinstance(gradient, tuple) else (gradient,)
        kept = tuple(part for part, constant in zip(parts, self.given, strict=True) if constant is None)
        return value, kept[0] if len(kept) == 1 else kept
