"""Data sets keep their contract; those on real meshes where the meshes are."""

from __future__ import annotations

from pathlib import Path

import pytest

from nonrigid.benchmark.conformance import check_dataset
from nonrigid.benchmark.datasets.creatures import Creatures
from nonrigid.benchmark.datasets.shrec16 import Shrec16


def test_creatures_keep_the_contract() -> None:
    assert len(check_dataset(Creatures(vertices=800), pairs=8)) == 8


@pytest.mark.realdata
def test_shrec16_keeps_the_contract(data: Path) -> None:
    assert len(check_dataset(Shrec16(root=data), pairs=3)) == 3
