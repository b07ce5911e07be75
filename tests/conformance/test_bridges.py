"""Every bridge keeps its contract on each small problem that it takes; none is listed by hand."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Iterator

import pytest

from nonrigid.solvers import bridges
from nonrigid.solvers.testing import check_bridge, instances


def bridge_classes() -> Iterator[type]:
    for found in pkgutil.walk_packages(bridges.__path__, bridges.__name__ + "."):
        for kind in vars(importlib.import_module(found.name)).values():
            if inspect.isclass(kind) and kind.__module__ == found.name and hasattr(kind, "obstacle"):
                yield kind


@pytest.mark.parametrize("kind", sorted(bridge_classes(), key=lambda kind: kind.__qualname__))
def test_a_bridge_keeps_its_contract(kind: type) -> None:
    bridge = kind()
    taken = 0
    for instance in instances():
        obstacle = bridge.obstacle(instance.problem)
        if obstacle is None:
            taken += 1
            check_bridge(bridge, instance.problem, optimum=instance.values)
        else:
            assert len(obstacle.split()) >= 3, obstacle
    assert taken, f"no instance of nonrigid.solvers.testing.instances exercises {kind.__name__}; add one that does"
