"""Do what the tutorial says, in build/tutorial, and keep its figures and its report in docs/generated for the site.

Finished runs are kept, as the benchmark keeps them; `make clean` forgets them.
"""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

from snippets import snippets

DOCS = Path(__file__).resolve().parent
FIGURES = ("match.png", "first-results/report/curves.png")


def main() -> None:
    """Run every snippet in order; stop at the first that fails."""
    place = DOCS.parent / "build" / "tutorial"
    place.mkdir(parents=True, exist_ok=True)
    programs = Path(sys.executable).parent
    environment = {**os.environ, "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}"}
    for snippet in snippets(DOCS / "tutorial.md"):
        if snippet.title:
            (place / snippet.title).write_text(snippet.text, encoding="utf-8")
            continue
        python = [[sys.executable, "-c", snippet.text]] if snippet.kind == "python" else []
        for words in python or map(shlex.split, snippet.commands):
            done = subprocess.run(words, cwd=place, env=environment, capture_output=True, text=True, check=False)
            if done.returncode:
                sys.exit(f"{shlex.join(words)}\n{done.stdout}{done.stderr}")
    made = DOCS / "generated"
    shutil.rmtree(made, ignore_errors=True)
    no_pages = shutil.ignore_patterns("*.md")  # which would become pages of the site
    shutil.copytree(place / "first-results" / "report", made / "report", ignore=no_pages)
    for figure in FIGURES:
        shutil.copy(place / figure, made)


if __name__ == "__main__":
    main()
