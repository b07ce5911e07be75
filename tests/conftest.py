"""Fixtures shared by all tests, and the rule for real meshes."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parent.parent


def real_data() -> Path | None:
    """Return the folder of real meshes, or None where there is none."""
    place = Path(os.environ.get("NONRIGID_DATA", REPOSITORY.parent / "shared" / "data"))
    return place if (place / "shrec16").is_dir() else None


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Skip the tests on real meshes, saying why, where the folder is absent."""
    if real_data() is None:
        reason = "no real meshes: neither $NONRIGID_DATA nor ../shared/data holds a folder shrec16"
        for item in items:
            if item.get_closest_marker("realdata"):
                item.add_marker(pytest.mark.skip(reason=reason))


@pytest.fixture(scope="session")
def data() -> Path:
    """Return the folder of real meshes."""
    place = real_data()
    assert place is not None
    return place


@pytest.fixture(autouse=True, scope="session")
def _private_cache(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Keep the tests' derived geometry out of the user's cache."""
    os.environ["NONRIGID_CACHE"] = str(tmp_path_factory.mktemp("cache"))
