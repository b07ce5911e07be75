"""Every algorithm of every backend keeps its contract; none is listed by hand."""

from __future__ import annotations

import pytest

from nonrigid.solvers.backend import backend_class, backend_names
from nonrigid.solvers.testing import check_backend

ALGORITHMS = [f"{name}:{algorithm}" for name in backend_names() for algorithm in backend_class(name).algorithms]


@pytest.mark.parametrize("spec", ALGORITHMS)
def test_an_algorithm_keeps_its_contract(spec: str) -> None:
    assert check_backend(spec), f"{spec} takes none of the small problems"


@pytest.mark.parametrize("name", backend_names())
def test_a_backend_chooses_algorithms_that_exist(name: str) -> None:
    assert check_backend(name)
