"""Write the reference for the site: a page a package, with all of its public modules, found in the folders.

MkDocs calls the two functions with its own names. Pages of docs/ that the navigation does not name are added to it too.
"""

from __future__ import annotations

import ast
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[2]
ROOMS = ("geometry", "formulations", "solvers", "benchmark")
OPEN_SECTION = "Explanation"


def on_config(config: Any) -> Any:
    """Complete the navigation: unlisted pages, then a section of the reference for each room."""
    listed = set(_pages_of(config.nav))
    rest = sorted(page.name for page in (ROOT / "docs").glob("*.md") if page.name not in listed)
    for section in config.nav:
        if OPEN_SECTION in section:
            section[OPEN_SECTION] = [*section[OPEN_SECTION], *rest]
    pages: list[Any] = ["reference/index.md"]
    for room in ROOMS:
        own = [{folder.removeprefix(f"{room}."): _page(folder)} for folder in _packages(room) if folder != room]
        pages.append({room: [_page(room), *own]})
    config.nav.append({"Reference": pages})
    return config


def on_files(files: Files, config: Any) -> Files:
    """Add the generated pages."""
    overview = ["# Reference\n", "Made from the docstrings; every example in them runs in the tests.\n"]
    for room in ROOMS:
        overview.append(
            f"\n## {room}\n\n{_summary(ROOT / room / '__init__.py')}\n\n| module | what it is for |\n| --- | --- |"
        )
        for package in _packages(room):
            text = [f"# nonrigid.{package}\n", _summary(ROOT / package.replace(".", "/") / "__init__.py"), ""]
            for module in _modules(package):
                name = f"nonrigid.{package}.{module.stem}"
                text.append(f"::: {name}\n")
                overview.append(f"| [{name}]({Path(_page(package)).name}#{name}) | {_summary(module)} |")
            files.append(File.generated(config, _page(package), content="\n".join(text)))
    files.append(File.generated(config, "reference/index.md", content="\n".join(overview) + "\n"))
    return files


def _packages(room: str) -> list[str]:
    """Return a room and the packages in it, as dotted names."""
    found = sorted(place.parent.relative_to(ROOT) for place in (ROOT / room).rglob("__init__.py"))
    return [".".join(folder.parts) for folder in found]


def _modules(package: str) -> list[Path]:
    folder = ROOT / package.replace(".", "/")
    return [place for place in sorted(folder.glob("*.py")) if not place.stem.startswith("_")]


def _page(package: str) -> str:
    return f"reference/{package}.md"


def _summary(module: Path) -> str:
    """Return the first line of a module's docstring."""
    text = ast.get_docstring(ast.parse(module.read_text(encoding="utf-8"))) or ""
    return text.partition("\n")[0].replace("|", r"\|")


def _pages_of(nav: Any) -> list[str]:
    if isinstance(nav, str):
        return [nav]
    members = nav.values() if isinstance(nav, dict) else nav
    return [page for member in members for page in _pages_of(member)]
