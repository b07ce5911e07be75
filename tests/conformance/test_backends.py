"""Every algorithm of every backend keeps its contract; none is listed by hand."""

from __future__ import annotations

import pytest

from nonrigid.solvers.acceptance import Refused
from nonrigid.solvers.backend import backend_class, backend_names
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.route import route
from nonrigid.solvers.testing import check_backend, instances

ALGORITHMS = [f"{name}:{algorithm}" for name in backend_names() for algorithm in backend_class(name).algorithms]


@pytest.mark.parametrize("spec", ALGORITHMS)
def test_an_algorithm_keeps_its_contract(spec: str) -> None:
    check_backend(spec, limits=Limits(evaluations=150, seconds=10.0, hard_seconds=60.0))


@pytest.mark.parametrize("name", backend_names())
def test_a_backend_chooses_algorithms_that_exist(name: str) -> None:
    kind = backend_class(name)
    assert kind.algorithm == "", "no algorithm named means: the backend's choice for the problem"
    for instance in instances():
        assert kind.default_algorithm(instance.problem) in kind.algorithms


@pytest.mark.parametrize("name", backend_names())
def test_a_backend_takes_some_of_the_small_problems(name: str) -> None:
    rows = [row for instance in instances() for row in route(instance.problem, [name])]
    assert not all(isinstance(row.acceptance, Refused) for row in rows)
