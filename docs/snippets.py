"""Read the snippets of a page, for the tests that run them and for the build that shows what they make.

A block with a title is a file; one of bash is commands, one a line; one of python without a title runs as it stands.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

BLOCK = re.compile(r"^```(\w+)(?: title=\"([^\"]+)\")?\n(.*?)^```$", flags=re.DOTALL | re.MULTILINE)
GIVEN = ("git clone", "cd ", "make", ". .venv/bin/activate", "mkdir ", "python3 -m venv")
"""Beginnings of commands that whoever runs a page has done before: there is a checkout, its .venv, and a folder."""


@dataclass(frozen=True)
class Snippet:
    """Hold a fenced block of a page."""

    kind: str
    title: str
    text: str

    @property
    def commands(self) -> list[str]:
        """Commands of a bash block, without those that are done before and without comments."""
        lines = (line.split("  #")[0].strip() for line in self.text.replace("\\\n", "").splitlines())
        return [line for line in lines if line and not line.startswith(GIVEN)]


def snippets(page: Path) -> list[Snippet]:
    """Return the fenced blocks of a page in their order."""
    return [Snippet(*found.groups(default="")) for found in BLOCK.finditer(page.read_text(encoding="utf-8"))]
