"""Move the paragraph "Source: ..." of a docstring from below its parameters to the end of its description.

A reader of numpy-style sections takes what follows a section for a part of it.
"""

from __future__ import annotations

import re
from typing import Any

import griffe

SOURCE = re.compile(r"(?:^|\n\n)(Source: .*?)(?=\n\n|\Z)", flags=re.DOTALL)
SECTION = re.compile(r"\n\n[A-Z]\w+\n-{3,}\n")


class Sources(griffe.Extension):  # type: ignore[misc]
    """Treat every docstring before it is parsed."""

    def on_instance(self, *, obj: Any, **_: Any) -> None:
        """Move the source, if there is one below a section."""
        if obj.docstring is None:
            return
        text = obj.docstring.value
        source, section = SOURCE.search(text), SECTION.search(text)
        if source and section and source.start() > section.start():
            rest = text[: source.start()] + text[source.end() :]
            obj.docstring.value = f"{rest[: section.start()]}\n\n{source[1]}{rest[section.start() :]}"
