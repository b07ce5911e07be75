from __future__ import annotations

import pytest

from nonrigid.benchmark.datasets.creatures import Creatures
from nonrigid.benchmark.datasets.protocols import PairData


@pytest.fixture(scope="session")
def creature() -> PairData:
    """A cut of a built-in creature of 1,500 vertices."""
    return next(spec for spec in Creatures(vertices=1500).pairs() if spec.split == "cuts").load()
