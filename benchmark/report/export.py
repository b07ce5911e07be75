"""Write tables as CSV, Markdown and LaTeX."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from nonrigid.benchmark.formats import write_text
from nonrigid.benchmark.terminal import cell

Row = Mapping[str, object]

_LATEX = {
    "\\": r"\textbackslash{}",
    **{letter: f"\\{letter}" for letter in "&%$#_{}"},
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
}


def write_table(path: Path, rows: Sequence[Row], columns: Mapping[str, str] | None = None) -> None:
    """Write rows as `<path>.csv` with numbers in full, and as `<path>.tex` as they stand on the page."""
    shown = columns or {key: key.replace("_", " ") for key in (rows[0] if rows else {})}
    write_text(path.with_suffix(".csv"), as_csv(rows))
    write_text(path.with_suffix(".tex"), as_latex(rows, shown))


def as_csv(rows: Sequence[Row]) -> str:
    """Return rows as CSV, numbers in full."""
    stream = io.StringIO()
    writer = csv.DictWriter(stream, fieldnames=list(rows[0]) if rows else [], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return stream.getvalue()


def as_markdown(rows: Sequence[Row], columns: Mapping[str, str]) -> str:
    """Return rows as a table in Markdown.

    Examples
    --------
    >>> print(as_markdown([{"a": 1, "b": None}], {"a": "A", "b": "B"}))
    | A | B |
    | --- | --- |
    | 1 |  |
    <BLANKLINE>
    """
    lines = [list(columns.values()), ["---"] * len(columns)]
    lines += [[cell(row.get(key)).replace("|", "\\|") for key in columns] for row in rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def as_latex(rows: Sequence[Row], columns: Mapping[str, str]) -> str:
    r"""Return rows as a `longtable`, numbers to the right; a paper needs `\usepackage{longtable}`.

    Examples
    --------
    >>> print(as_latex([{"a": 1, "b": "50 %"}], {"a": "n_x", "b": "share"}))
    \begin{longtable}{rl}
    \hline
    n\_x & share \\
    \hline
    \endhead
    1 & 50 \% \\
    \hline
    \end{longtable}
    <BLANKLINE>
    """
    numeric = {key: any(isinstance(row.get(key), int | float) for row in rows) for key in columns}
    lines = [
        rf"\begin{{longtable}}{{{''.join('r' if numeric[key] else 'l' for key in columns)}}}",
        r"\hline",
        _latex_row(columns.values()),
        r"\hline",
        r"\endhead",
        *(_latex_row(cell(row.get(key)) for key in columns) for row in rows),
        r"\hline",
        r"\end{longtable}",
    ]
    return "\n".join(lines) + "\n"


def _latex_row(cells: Iterable[str]) -> str:
    return " & ".join("".join(_LATEX.get(letter, letter) for letter in text) for text in cells) + r" \\"
