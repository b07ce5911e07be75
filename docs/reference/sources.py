"""Prepare docstrings for the site: sources where sections do not swallow them, formulas as they are written.

A reader of numpy-style sections takes a paragraph "Source: ..." below the parameters for one of them. Formulas are
shown as text: whatever sets them would have to come from the network.
"""

from __future__ import annotations

import re
from typing import Any

import griffe

SOURCE = re.compile(r"(?:^|\n\n)(Source: .*?)(?=\n\n|\Z)", flags=re.DOTALL)
FORMULA = re.compile(r":math:`([^`]+)`|^\.\. math:: (.+(?:\n[ \t]+\S.*)*)$", flags=re.MULTILINE)
SECTION = re.compile(r"\n\n[A-Z]\w+\n-{3,}\n")


class Sources(griffe.Extension):  # type: ignore[misc]
    """Treat every docstring before it is parsed."""

    def on_instance(self, *, obj: Any, **_: Any) -> None:
        """Set formulas as code; move the source, if there is one below a section."""
        if obj.docstring is None:
            return
        text = FORMULA.sub(lambda found: f"`{' '.join((found[1] or found[2]).split())}`", obj.docstring.value)
        obj.docstring.value = text
        source, section = SOURCE.search(text), SECTION.search(text)
        if source and section and source.start() > section.start():
            rest = text[: source.start()] + text[source.end() :]
            obj.docstring.value = f"{rest[: section.start()]}\n\n{source[1]}{rest[section.start() :]}"
