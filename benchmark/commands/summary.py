"""Print solver against accuracy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from nonrigid.benchmark.report.table import BRIEF, by_method
from nonrigid.benchmark.terminal import show_table


def show_summary(title: str, rows: Sequence[Mapping[str, object]]) -> None:
    """Write one table a method to standard output."""
    for label, (members, columns) in by_method(rows, BRIEF).items():
        show_table(members, title=f"{title}: {label}", columns=columns)
