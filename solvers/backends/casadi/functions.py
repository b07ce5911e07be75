"""Numpy functions as CasADi callbacks: numbers cross, never dense symbolic graphs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from nonrigid.geometry.arrays import FloatArray
from nonrigid.solvers.layout import FlatConstraint
from nonrigid.solvers.oracle import LimitReached, NotFiniteError, Oracle

Shape = tuple[int, int]

# Offered once the solve is to stop: so good an objective that every line search takes the step at once, after which a
# gradient that is not finite, or the iteration callback, ends the solve.
_LOW = -1e200


class NumpyFunction(ca.Callback):
    """Evaluate a numpy function of the first of its inputs; only that input has a derivative.

    Parameters
    ----------
    evaluate
        Takes the flat first input, returns an array of the output's shape.
    derivatives
        The functions for the Jacobian of the (column-stacked) output, for the Jacobian of that, and so on.
    keep
        Holds every object made, since CasADi itself does not keep Python's alive.
    """

    def __init__(
        self,
        name: str,
        inputs: list[Shape],
        output: Shape,
        evaluate: Callable[[FloatArray], FloatArray],
        derivatives: tuple[Callable[[FloatArray], FloatArray], ...],
        keep: list[Any],
        empty: tuple[Shape, ...] = (),
        options: dict[str, Any] | None = None,
    ) -> None:
        ca.Callback.__init__(self)
        self._inputs, self._output, self._evaluate = inputs, output, evaluate
        self._derivatives, self._keep, self._empty = derivatives, keep, empty
        keep.append(self)
        self.construct(name, options or {})

    def get_n_in(self) -> int:
        """Return the number of inputs."""
        return len(self._inputs)

    def get_n_out(self) -> int:
        """Return the number of outputs: the function, then the derivatives that are zero."""
        return 1 + len(self._empty)

    def get_sparsity_in(self, index: int) -> Any:
        """Return a dense pattern."""
        return ca.Sparsity.dense(*self._inputs[index])

    def get_sparsity_out(self, index: int) -> Any:
        """Return a dense pattern for the function, an empty one for zero derivatives."""
        return ca.Sparsity.dense(*self._output) if index == 0 else ca.Sparsity(*self._empty[index - 1])

    def has_eval_buffer(self) -> bool:
        """Say that numbers pass as buffers."""
        return True

    def eval_buffer(self, arguments: Any, results: Any) -> int:
        """Evaluate; CasADi stores matrices by columns."""
        x = np.frombuffer(arguments[0], dtype=float)
        if results[0] is not None:
            np.frombuffer(results[0], dtype=float)[:] = self._evaluate(x).ravel(order="F")
        return 0

    def has_jacobian(self) -> bool:
        """Say whether a derivative is known."""
        return bool(self._derivatives)

    def get_jacobian(self, name: str, inames: Any, onames: Any, options: Any) -> Any:
        """Return the Jacobian in the first input; in the others, inputs without influence, it is empty."""
        rows = self._output[0] * self._output[1]
        empty = tuple((rows, height * width) for height, width in self._inputs[1:])
        return NumpyFunction(
            name,
            [*self._inputs, self._output],
            (rows, self._inputs[0][0]),
            self._derivatives[0],
            self._derivatives[1:],
            self._keep,
            empty,
            options,
        )


class Served:
    """Serve an oracle to CasADi: one evaluation a point, and no exception crosses the library.

    After the first exception no more work is done: values come back so that the solver stops.
    """

    def __init__(self, oracle: Oracle) -> None:
        self.oracle = oracle
        self.keep: list[Any] = []
        self.failure: Exception | None = None
        self._point: FloatArray | None = None
        self._value, self._gradient = np.nan, np.full(oracle.size, np.nan)

    def objective(self, *, second_order: bool) -> NumpyFunction:
        """Return the function to be minimized as a callback with its gradient, and its Hessian if asked."""
        n = self.oracle.size
        derivatives = (self.gradient, self.hessian) if second_order else (self.gradient,)
        return NumpyFunction("objective", [(n, 1)], (1, 1), self.value, derivatives, self.keep)

    def hessian_function(self) -> NumpyFunction:
        """Return the Hessian of the objective as a callback."""
        n = self.oracle.size
        return NumpyFunction("hessian", [(n, 1)], (n, n), self.hessian, (), self.keep)

    def constraint(self, item: FlatConstraint, name: str) -> NumpyFunction:
        """Return a nonlinear constraint as a callback with its Jacobian."""
        n, rows = self.oracle.size, len(item.value_and_jacobian(np.zeros(self.oracle.size))[0])

        def part(which: int, shape: Shape) -> Callable[[FloatArray], FloatArray]:
            return lambda x: self._guarded(lambda: self._finite(item, x)[which], np.full(shape, np.nan))

        return NumpyFunction(name, [(n, 1)], (rows, 1), part(0, (rows, 1)), (part(1, (rows, n)),), self.keep)

    def value(self, x: FloatArray) -> FloatArray:
        """Return the objective."""
        self._evaluate(x)
        return np.array([_LOW if self.stopped else self._value])

    def gradient(self, x: FloatArray) -> FloatArray:
        """Return the gradient as a row."""
        self._evaluate(x)
        return np.full((1, len(x)), np.nan) if self.stopped else self._gradient[None, :]

    def hessian(self, x: FloatArray) -> FloatArray:
        """Return the dense Hessian."""
        return self._guarded(lambda: self.oracle.hessian(x), np.full((len(x), len(x)), np.nan))

    @property
    def stopped(self) -> bool:
        """Whether an exception asks the solver to stop."""
        return self.failure is not None

    def look_at_the_clock(self) -> None:
        """Stop where a limit is spent without an evaluation that would notice."""

        def work() -> FloatArray:
            self.oracle.charge(0.0)
            return self._gradient

        self._guarded(work, self._gradient)

    def _evaluate(self, x: FloatArray) -> None:
        if self.stopped or (self._point is not None and np.array_equal(x, self._point)):
            return
        point = x.copy()

        def work() -> FloatArray:
            self._value, self._gradient = self.oracle.value_and_gradient(point)
            self._point = point
            return point

        self._guarded(work, point)

    def _finite(self, item: FlatConstraint, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        self.oracle.charge(0.0)
        value, jacobian = item.value_and_jacobian(x.copy())
        if not (np.isfinite(value).all() and np.isfinite(jacobian).all()):
            self.oracle.interrupted = NotFiniteError(f"the constraint {item.name!r} is not finite at a point tried")
            raise self.oracle.interrupted
        return value, jacobian

    def _guarded(self, work: Callable[[], FloatArray], otherwise: FloatArray) -> FloatArray:
        if self.stopped:
            return otherwise
        try:
            return work()
        except Exception as failure:  # CasADi would print it, forget it and carry on: it is kept and raised at the end
            self.failure = failure
            return otherwise

    def raise_failure(self) -> None:
        """Raise what a callback ran into, other than a limit."""
        if self.failure is not None and not isinstance(self.failure, LimitReached):
            raise self.failure


class StopAsked(ca.Callback):
    """Ask the solver to stop at its next iteration once a callback has met an exception."""

    def __init__(self, served: Served, rows: int) -> None:
        ca.Callback.__init__(self)
        self._served, self._rows = served, rows
        served.keep.append(self)
        self.construct("stop_asked", {})

    def get_n_in(self) -> int:
        """Return the number of results of a solver."""
        return int(ca.nlpsol_n_out())

    def get_n_out(self) -> int:
        """Return one flag."""
        return 1

    def get_sparsity_in(self, index: int) -> Any:
        """Return the shape of a result."""
        n = self._served.oracle.size
        rows = {"f": 1, "x": n, "lam_x": n, "g": self._rows, "lam_g": self._rows}.get(ca.nlpsol_out(index), 0)
        return ca.Sparsity.dense(rows, 1) if rows else ca.Sparsity(0, 0)

    def has_eval_buffer(self) -> bool:
        """Say that numbers pass as buffers."""
        return True

    def eval_buffer(self, arguments: Any, results: Any) -> int:
        """Write 1 to stop, 0 to go on; also look at the clock, since a solver may iterate without evaluating."""
        served = self._served
        served.look_at_the_clock()
        if results[0] is not None:
            np.frombuffer(results[0], dtype=float)[0] = float(served.stopped)
        return 0
