from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest
from typer.testing import CliRunner

from nonrigid.benchmark.cli import app
from nonrigid.benchmark.datasets.creatures import Creatures
from nonrigid.benchmark.datasets.protocols import PairData
from nonrigid.benchmark.formats import write_baryc
from nonrigid.geometry.io import write_off


@dataclass(frozen=True)
class Answer:
    code: int
    out: str
    err: str


@pytest.fixture(scope="session")
def nonrigid() -> Callable[..., Answer]:
    """Run a command as a user would."""

    def run(*words: object) -> Answer:
        result = CliRunner().invoke(app, [str(word) for word in words])
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            raise result.exception
        return Answer(result.exit_code, result.stdout, result.stderr)

    return run


@pytest.fixture(scope="session")
def person() -> PairData:
    """A part of a person, of few vertices."""
    return Creatures(vertices=600).pairs()[0].load()


@pytest.fixture(scope="session")
def files(person: PairData, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same as files, under the names that the README uses."""
    folder = tmp_path_factory.mktemp("person")
    assert person.truth is not None
    assert person.mirrored is not None
    write_off(person.part, folder / "part.off")
    write_off(person.full, folder / "full.off")
    write_baryc(folder / "part.baryc_gt", person.truth)
    write_baryc(folder / "part.baryc_gt_sym", person.mirrored)
    return folder
