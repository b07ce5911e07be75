"""The errors that this package raises on purpose; each says what was wrong and what to do."""

from __future__ import annotations

from difflib import get_close_matches
from os import PathLike

_SHOWN = 40  # names that a message may list


class NonrigidError(Exception):
    """Stand at the root of every error that this package raises on purpose."""


class InputError(NonrigidError, ValueError):
    """Report bad input: the file, the place in it, what is wrong there and the remedy.

    Parameters
    ----------
    problem
        What is wrong, with the number that shows it.
    file
        The file it came from, where there is one.
    row
        The 1-based line or row in that file.
    remedy
        What the user can do about it.

    Examples
    --------
    >>> print(InputError("3 vertices are NaN", file="cat.off", row=7, remedy="remove them"))
    cat.off, row 7: 3 vertices are NaN; remove them
    """

    def __init__(
        self,
        problem: str,
        *,
        file: str | PathLike[str] | None = None,
        row: int | None = None,
        remedy: str | None = None,
    ) -> None:
        self.problem, self.file, self.row, self.remedy = problem, file, row, remedy
        place = "" if file is None else str(file)
        if row is not None:
            place += f", row {row}" if place else f"row {row}"
        super().__init__(f"{place}: " * bool(place) + problem + (f"; {remedy}" if remedy else ""))

    def at(self, file: str | PathLike[str]) -> InputError:
        """Return the same error naming `file`, for readers that learn the name later."""
        return InputError(self.problem, file=self.file or file, row=self.row, remedy=self.remedy)


class UnknownNameError(NonrigidError, KeyError):
    """Report a name (method, backend, algorithm, option) that does not exist, with the names that do.

    Of more than 40 names those that read most like it are shown, and how many there are.

    Examples
    --------
    >>> print(UnknownNameError("backend", "nlop", ["native", "nlopt"]))
    unknown backend 'nlop'; choose one of: native, nlopt
    """

    def __init__(self, kind: str, name: str, known: object) -> None:
        self.kind, self.name = kind, name
        choices = sorted(str(choice) for choice in known) if hasattr(known, "__iter__") else [str(known)]
        self.known = choices
        if len(choices) > _SHOWN:
            near = get_close_matches(name, choices, n=5, cutoff=0.0)
            self.text = f"unknown {kind} {name!r}; choose one of {len(choices)}, such as {', '.join(near)}"
        else:
            self.text = f"unknown {kind} {name!r}; choose one of: {', '.join(choices)}"
        super().__init__(self.text)

    def __reduce__(self) -> tuple[type[UnknownNameError], tuple[str, str, list[str]]]:
        return type(self), (self.kind, self.name, self.known)

    def __str__(self) -> str:
        return self.text
