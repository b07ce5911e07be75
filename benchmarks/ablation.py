"""What one idea is worth: errors with it less errors without it, pair by pair, from the results of a plan.

Usage: python benchmarks/ablation.py RESULTS [--to anchored]

RESULTS is the folder of `nonrigid bench ablation --out RESULTS` or of another plan whose entries have labels. Each
label is compared with that given by --to, cuts and holed shapes apart, on the pairs that both matched: the mean error,
the mean of the paired differences with its 95 % bootstrap interval over pairs (2,000 resamples, seed 0), and how many
pairs are worse and better by more than 0.02. Errors are geodesic, in hundredths of sqrt(full area), per shape the
better of the direct and the mirrored truth; seconds are medians of the wall time of matching.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from statistics import mean, median

from nonrigid.benchmark.report.export import as_markdown
from nonrigid.benchmark.statistics.paired import paired_difference
from nonrigid.benchmark.store import Record, Store

SPLITS = ("cuts", "holes")
NOTICED = 0.02
"""Difference of errors, in hundredths of sqrt(full area), beyond which one counts as worse or better."""


def rows(records: Sequence[Record], to: str) -> list[Record]:
    """Return a row a label, in the order of the records."""
    found: list[Record] = []
    for label in dict.fromkeys(record["label"] for record in records):
        row: Record = {"method": label}
        for split in SPLITS:
            mine, theirs = (errors(records, one, split) for one in (label, to))
            pairs = [pair for pair in mine if pair in theirs]
            if not pairs:
                continue
            a, b = [mine[pair] for pair in pairs], [theirs[pair] for pair in pairs]
            row |= {f"{split}: n": len(pairs), f"{split}: mean": f"{mean(a):.2f}"}
            if label != to:
                less = paired_difference(a, b)
                row[f"{split}: difference"] = f"{less.mean:+.2f} ({less.low:+.2f} to {less.high:+.2f})"
                off = [x - y for x, y in zip(a, b, strict=True)]
                row[f"{split}: worse, better"] = f"{sum(x > NOTICED for x in off)}, {sum(x < -NOTICED for x in off)}"
        seconds = [r["formulation_seconds"] + r["solve_seconds"] for r in records if r["label"] == label and matched(r)]
        found.append(row | {"s": f"{median(seconds):.1f}" if seconds else "-"})
    return found


def errors(records: Sequence[Record], label: str, split: str) -> dict[str, float]:
    """Return the errors x100 of the pairs that a label matched."""
    mine = (record for record in records if (record["label"], record["split"]) == (label, split) and matched(record))
    return {record["pair"]: 100.0 * record["mean_error"] for record in mine}


def matched(record: Record) -> bool:
    """Tell whether a run ended with a match that was scored."""
    return record.get("mean_error") is not None


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", type=Path)
    parser.add_argument("--to", default="anchored")
    given = parser.parse_args()
    records = Store(given.results).records()
    if given.to not in {record["label"] for record in records}:
        parser.error(f"{given.results} has no runs labelled {given.to}: give one of its labels as --to")
    columns = ("n", "mean", "difference", "worse, better")
    heads = ["method", *(f"{split}: {column}" for split in SPLITS for column in columns), "s"]
    sys.stdout.write(as_markdown(rows(records, given.to), {head: head for head in heads}))


if __name__ == "__main__":
    main()
