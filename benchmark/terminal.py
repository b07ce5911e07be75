"""Show tables and records: with rich for people, as JSON for programs."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence

from rich.console import Console
from rich.table import Table
from rich.text import Text

Row = Mapping[str, object]


def show_json(value: object) -> None:
    """Write a value to standard output as JSON; numbers that are not finite become null."""
    Console(highlight=False, soft_wrap=True, no_color=True).out(json_text(value), highlight=False)


def json_text(value: object) -> str:
    """Return JSON with null for what is not finite, since JSON has no word for it."""
    return json.dumps(_plain(value), indent=1, ensure_ascii=False, allow_nan=False)


def show_table(rows: Sequence[Row], *, title: str = "", columns: Mapping[str, str] | None = None) -> None:
    """Write rows to standard output as a table; `columns` maps the keys that are shown to their headings."""
    shown = columns or {key: key.replace("_", " ") for key in (rows[0] if rows else {})}
    table = Table(title=title or None, title_justify="left", header_style="bold", pad_edge=False)
    for key, heading in shown.items():
        numeric = any(isinstance(row.get(key), int | float) for row in rows)
        table.add_column(heading, justify="right" if numeric else "left", overflow="fold")
    for row in rows:
        table.add_row(*(Text(cell(row.get(key))) for key in shown))
    console = Console()
    # A pipe or file has no width of its own; eighty columns would break every table.
    Console(width=None if console.is_terminal else 200).print(table)


def say(text: str) -> None:
    """Write a line to standard output."""
    Console(soft_wrap=True).print(Text(text))


def cell(value: object) -> str:
    """Return a value as it stands in a table.

    Examples
    --------
    >>> cell(0.0123456), cell(1234.5), cell(1.2e-9), cell(None), cell(float("nan"))
    ('0.01235', '1234', '1.2e-09', '', '-')
    """
    if value is None:
        return ""
    if isinstance(value, bool) or not isinstance(value, float):
        return str(value)
    if not math.isfinite(value):
        return "-" if math.isnan(value) else str(value)
    if value and (abs(value) < 1e-3 or abs(value) >= 1e5):
        return f"{value:.1e}"
    return f"{value:.0f}" if abs(value) >= 1000 else f"{value:.4g}"


def _plain(value: object) -> object:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, str | int | bool) or value is None:
        return value
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    return str(value)
