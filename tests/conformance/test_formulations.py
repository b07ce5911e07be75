"""Every formulation keeps its contract on a small built-in pair; none is listed by hand."""

from __future__ import annotations

import pytest

from nonrigid.benchmark.datasets.creatures import Creatures
from nonrigid.benchmark.held_out import trained_for
from nonrigid.benchmark.methods import make_method, methods
from nonrigid.formulations.game_theoretic import GameTheoretic
from nonrigid.solvers.limits import Limits
from nonrigid.solvers.testing import ConformanceError, check_formulation


def smaller(name: str) -> dict[str, object]:
    """Return settings a third as large, counts of samples and eigenfunctions above all, and one descriptor radius.

    Budgets of evaluations stay: a descent cut short ends anywhere, and says nothing of what the answer depends on.
    """
    fields = {field: getattr(methods()[name](), field) for field in methods()[name].__dataclass_fields__}
    counts = {field: n // 3 for field, n in fields.items() if isinstance(n, int) and n >= 50}
    counts = {field: n for field, n in counts.items() if not field.endswith("evaluations")}
    return {**counts, **({"radii": (0.10,)} if "radii" in fields else {})}


@pytest.mark.parametrize("name", methods())
def test_a_formulation_keeps_its_contract(name: str) -> None:
    specs = Creatures(vertices=1200).pairs()
    data = specs[1].load()
    # Time limits would make the answer depend on the machine's load; dense descents amplify rounding most.
    limits = Limits(seconds=None, evaluations=400)
    formulation = trained_for(make_method(name, smaller(name)), specs[1], specs)
    check_formulation(formulation, data.part, data.full, limits=limits, agreement=0.8)


def test_a_formulation_that_reads_coordinates_is_caught() -> None:
    class Peeking(GameTheoretic):
        def stages(self, pair):  # type: ignore[no-untyped-def]
            found = yield from super().stages(pair)
            keep = found.points.positions(pair.full.raw)[:, 0] > 0.0
            return type(found)(found.part_vertices[keep], found.points[keep], found.confidence[keep])

    data = Creatures(vertices=1000).pairs()[1].load()
    few = Peeking(part_samples=60, full_samples=300, radii=(0.10,), local_candidates=0)
    with pytest.raises(ConformanceError, match=r"renumbering|vertices of the part"):
        check_formulation(few, data.part, data.full)
