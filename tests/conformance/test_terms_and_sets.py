"""Every term and set class of the modelling language keeps its contract; none is listed by hand."""

from __future__ import annotations

import pytest

from nonrigid.solvers.testing import examples_of, model_classes


@pytest.mark.parametrize("kind", sorted(model_classes(), key=lambda kind: kind.__qualname__))
def test_a_term_or_set_class_keeps_its_contract(kind: type) -> None:
    for example in examples_of(kind):
        example.check()
