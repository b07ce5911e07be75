"""Fill the templates, and write scripts and styles beside the pages."""

from __future__ import annotations

import json
from importlib.resources import files
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from nonrigid.benchmark.formats import write_text
from nonrigid.benchmark.terminal import cell

ASSETS = ("style.css", "table.js", "surface.js", "pair.js")


def fill(template: str, **values: object) -> str:
    """Return a page."""
    pages = Environment(
        loader=PackageLoader("nonrigid.benchmark.report.pages", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    pages.filters["cell"] = cell
    return pages.get_template(template).render(**values)


def asset(name: str) -> str:
    """Return a script or style that ships with the package."""
    return files("nonrigid.benchmark.report.pages").joinpath(name).read_text(encoding="utf-8")


def write_assets(folder: Path) -> None:
    """Write scripts and styles, and the plotting library's own bundle, once for all pages."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in ASSETS:
        write_text(folder / name, asset(name))
    bundle = files("plotly").joinpath("package_data", "plotly.min.js").read_text(encoding="utf-8")
    write_text(folder / "plotly.min.js", bundle)


def script(**values: Any) -> str:
    r"""Return a script that hands values to the page; pages opened from disk may load scripts, but no other files.

    Values are what JSON can say; the results hold null for numbers that are not finite.

    Examples
    --------
    >>> print(script(answer=[1, None, "</script>"]))
    (window.NONRIGID = window.NONRIGID || {}).answer = [1,null,"<\/script>"];
    <BLANKLINE>
    """
    lines = []
    for name, value in values.items():
        # Inside a page, a closing tag in a text would end the script.
        text = json.dumps(value, allow_nan=False, separators=(",", ":")).replace("</", "<\\/")
        lines.append(f"(window.NONRIGID = window.NONRIGID || {{}}).{name} = {text};\n")
    return "".join(lines)
