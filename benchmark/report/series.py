"""Group runs into series: one a method and backend, with a look that any colour vision tells apart."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from nonrigid.benchmark.store import Record

# Okabe and Ito's palette; its black and yellow suit either a light or a dark page only, and are left out.
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00")
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "*")


@dataclass(frozen=True, eq=False, kw_only=True)
class Series:
    """Hold the runs of one method with one backend.

    Parameters
    ----------
    name
        What a legend calls it.
    label, backend
        The method's label in the plan, and the backend's word.
    records
        All its runs, failures included.
    colour, marker
        By method where there are several, else by backend.
    """

    name: str
    label: str
    backend: str
    records: tuple[Record, ...]
    colour: str
    marker: str

    @property
    def matched(self) -> list[Record]:
        """The runs with at least one match and a score."""
        return [record for record in self.records if record.get("match_count") and _finite(record.get("mean_error"))]

    @property
    def dense(self) -> bool:
        """Whether most vertices of the parts are matched, on the mean over shapes."""
        shares = [r["match_count"] / (r["match_count"] + r["unmatched_count"]) for r in self.matched]
        return bool(shares) and float(np.mean(shares)) > 0.5

    @property
    def mean_error(self) -> float:
        """Mean error over the shapes with a match, a fraction of sqrt(full area); inf where there is none."""
        return float(np.mean([record["mean_error"] for record in self.matched])) if self.matched else math.inf


def all_series(records: Sequence[Record]) -> list[Series]:
    """Return the series in the order of the plan."""
    groups: dict[tuple[str, str], list[Record]] = {}
    for record in records:
        groups.setdefault((record["label"], record["backend"]), []).append(record)
    labels = list(dict.fromkeys(label for label, _ in groups))
    backends = list(dict.fromkeys(backend for _, backend in groups))
    found = []
    for (label, backend), members in groups.items():
        several = len(labels) > 1
        hue = labels.index(label) if several else backends.index(backend)
        found.append(
            Series(
                name=_legible(f"{label}, {backend}" if several else backend),
                label=label,
                backend=backend,
                records=tuple(members),
                colour=PALETTE[hue % len(PALETTE)],
                marker=MARKERS[(backends.index(backend) if several else hue) % len(MARKERS)],
            )
        )
    return found


def leading(series: Sequence[Series]) -> list[Series]:
    """Return for each method the series of least mean error; all series where there is one method only."""
    labels = list(dict.fromkeys(one.label for one in series))
    if len(labels) <= 1:
        return [one for one in series if one.matched]
    best = [min((one for one in series if one.label == label), key=lambda one: one.mean_error) for label in labels]
    return [one for one in best if one.matched]


def which(series: Sequence[Series], shown: Sequence[Series]) -> str:
    """Say in a caption which series a figure shows, where these are not all."""
    if len(shown) == len(series):
        return ""
    if len({one.label for one in series}) > 1:
        return f" Each method with its backend of least mean error, {len(shown)} of {len(series)} combinations."
    return f" {len(shown)} of {len(series)} backends found a match."


def _legible(name: str) -> str:
    """Return a name that legends show: they leave out those that begin with an underscore."""
    return f" {name}" if name.startswith("_") else name


def _finite(value: object) -> bool:
    return isinstance(value, int | float) and math.isfinite(value)
