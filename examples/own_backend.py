"""A backend of your own: plain gradient steps with projection, on a small matching game."""

from dataclasses import dataclass

from nonrigid.formulations.model import Problem, QuadraticForm, Simplex, Variable, maximize
from nonrigid.solvers.acceptance import Native, Refused
from nonrigid.solvers.backend import Raw
from nonrigid.solvers.solve import solve
from nonrigid.solvers.testing.instances import planted_payoff


@dataclass(frozen=True)
class GradientSteps:  # noqa: D101
    step: float = 0.02
    algorithm, name, algorithms = "steps", "own", ("steps",)
    versions = staticmethod(lambda: {"own": "1"})

    def accepts(self, problem):  # noqa: D102
        return Native() if isinstance(problem.memberships[0].set, Simplex) else Refused("it needs a simplex")

    def run(self, oracle, x, limits):  # noqa: D102
        for _ in range(500):
            x = Simplex().project(x - self.step * oracle.value_and_gradient(x)[1])
        return Raw(x, "500 steps done")


u = Variable("u", 40)
print(solve(Problem("game", maximize(QuadraticForm(planted_payoff(40))(u)), u @ Simplex()), GradientSteps()))
