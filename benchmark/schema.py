"""Which versions of the results this package reads, and what an older one lacks."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from nonrigid.geometry.errors import InputError

SCHEMA_VERSION = 2
"""Raised with every change of a run's record; 2 added accuracy, accepted, total_seconds, peak_memory, environment."""

ADDED: Mapping[int, tuple[str, ...]] = {2: ("accuracy", "accepted", "total_seconds", "peak_memory", "environment")}
"""Names that a version added to a run's record."""


def migrated(record: dict[str, Any]) -> dict[str, Any]:
    """Return a run's record as this version writes it: what an older one did not measure is None.

    Raises `InputError` for a record of a newer schema.

    Examples
    --------
    >>> migrated({"schema": 1, "id": "a"})["accepted"] is None
    True
    """
    version = check_schema(record.get("schema"))
    for step in range(version + 1, SCHEMA_VERSION + 1):
        record = {**dict.fromkeys(ADDED[step]), **record}
    return {**record, "schema": SCHEMA_VERSION}


def check_schema(found: object) -> int:
    """Return a schema's version; raise `InputError` where this version of the package cannot read it."""
    if not isinstance(found, int) or not 1 <= found <= SCHEMA_VERSION:
        raise InputError(
            f"schema {found}, but this version reads 1 to {SCHEMA_VERSION}",
            remedy="use the version of nonrigid that wrote it",
        )
    return found
