"""Tell which works to cite for the formulations, solvers and data that were used."""

from __future__ import annotations

import re
from collections.abc import Iterable
from importlib.resources import files

from nonrigid.benchmark.choices import backend_words, parse_backend
from nonrigid.benchmark.store import Record


def citations(words: Iterable[str] | None = None) -> str:
    """Return the entries whose keywords are among the words, as BibTeX; all of them by default.

    A word is a method ("gt"), a data set ("shrec16"), a backend ("nlopt") or one of its algorithms ("nlopt:LD_CCSAQ").

    Examples
    --------
    >>> citations(["gt"]).splitlines()[0]
    '@inproceedings{rodola2012game,'
    """
    chosen = None if words is None else set(words)
    entries = re.split(r"\n(?=@)", files("nonrigid.benchmark").joinpath("citations.bib").read_text(encoding="utf-8"))
    kept = [entry for entry in entries if chosen is None or chosen & _keywords(entry)]
    return "\n".join(entry.strip() for entry in kept)


def words_used(dataset: str, records: Iterable[Record]) -> set[str]:
    """Return the words for what the runs of a benchmark used: also algorithms that a backend chose by itself."""
    words = {dataset}
    for record in records:
        if record["status"] == "refused":
            continue
        words |= {record["method"], *backend_words(parse_backend(record["backend"]))}
        words |= {stage["solver"] for stage in record["stages"]}
    return words | {word.partition(":")[0] for word in words}


def _keywords(entry: str) -> set[str]:
    found = re.search(r"keywords = \{([^}]*)\}", entry)
    return set() if found is None else {word.strip() for word in found[1].split(",")}
