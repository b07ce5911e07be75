"""Call a function in a child process: a hang, a crash, a full memory or a full disk ends the call, not the caller."""

from __future__ import annotations

import contextlib
import gc
import os
import signal
import sys
import time
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass
from itertools import islice
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

from nonrigid.benchmark.store import StorageError
from nonrigid.solvers.confine import (
    child_context,
    die_with_parent,
    flush_native_output,
    limit_memory,
    speak_into,
)

Tell = Callable[[str], None]

_GRACE = 10.0  # seconds that a child may take to end once it has closed its pipe; a crash writes its core then
_LOOK_EVERY = 0.2  # seconds between looks at whether a silent child still lives


@dataclass(frozen=True, kw_only=True)
class Ended:
    """Say how a call in a child ended.

    Parameters
    ----------
    well
        Whether it returned.
    killed
        Whether its time ran out.
    words
        What went wrong; empty if nothing did.
    told
        The last word that the child told before it ended; empty if it told none.
    """

    well: bool
    killed: bool = False
    words: str = ""
    told: str = ""


def guarded_call(
    work: Callable[[Tell], None],
    *,
    seconds: float | None = None,
    memory_gb: float | None = None,
    log: Path | None = None,
    until: str | None = None,
) -> Ended:
    """Call `work` in a child process and say how it ended; what it returns is lost, so it has to write its results.

    Parameters
    ----------
    work
        Called with a function by which it can tell where it is.
    seconds
        Wall-clock time after which the child and its children are killed, counted anew from each word that it tells;
        None for no bound.
    memory_gb
        Memory that the child may take beyond what this process holds; see `nonrigid.solvers.confine.limit_memory`.
    log
        File for everything that the child and the libraries in it print; by default they print where this process does.
    until
        Once the child tells this word, the bound on its time is lifted.

    Raises
    ------
    StorageError
        If the child raised one: there is no point in going on.

    Examples
    --------
    >>> guarded_call(lambda tell: None).well
    True
    """
    with GuardedChild(work, memory_gb=memory_gb, log=log) as child:
        child.begin()
        return child.end(seconds=seconds, until=until)


class GuardedChild:
    """A child process that stands ready to call `work`, so that it can be made while the one before it still works.

    Forking a process that holds a pair and its libraries, and taking it down, takes milliseconds, which nobody has to
    wait for. A context manager: on leaving it the child and its children are gone, whether they had begun or not.

    Parameters
    ----------
    work, memory_gb, log
        As in `guarded_call`; the child's memory is counted from when it begins.

    Examples
    --------
    >>> with GuardedChild(lambda tell: tell("here")) as child:
    ...     child.begin()
    ...     child.end().told
    'here'
    """

    def __init__(
        self, work: Callable[[Tell], None], *, memory_gb: float | None = None, log: Path | None = None
    ) -> None:
        context = child_context()
        self._pipe, there = context.Pipe()
        self._process = context.Process(target=_child, args=(there, os.getpid(), work, memory_gb, log), daemon=False)
        self._process.start()
        there.close()

    def __enter__(self) -> GuardedChild:
        """Return the child."""
        return self

    def __exit__(self, *exception: object) -> None:
        """Close the child."""
        self.close()

    def close(self) -> None:
        """Kill the child and its children if they still live."""
        _kill(self._process)
        self._process.join()
        self._pipe.close()

    def begin(self) -> None:
        """Have the child begin."""
        with contextlib.suppress(OSError):  # a child that was killed meanwhile is found dead by `end`
            self._pipe.send(None)

    def end(self, *, seconds: float | None = None, until: str | None = None) -> Ended:
        """Wait for the end of the child's work, or kill it, and say how it ended.

        Arguments, and the `StorageError` that the child may raise, are those of `guarded_call`.
        """
        deadline = None if seconds is None else time.monotonic() + seconds
        told, child = "", self._process
        while True:
            left = _LOOK_EVERY if deadline is None else min(_LOOK_EVERY, deadline - time.monotonic())
            if left <= 0:
                _kill(child)
                return Ended(well=False, killed=True, words=f"killed after {seconds:g} s of a run", told=told)
            if wait([self._pipe], left):
                try:
                    kind, text = self._pipe.recv()
                except (EOFError, OSError):
                    break
                if kind == "storage":
                    raise StorageError(text)
                if kind == "done":  # what is left is to take the process down, for which nobody has to wait
                    return Ended(well=not text, words=text, told=told)
                told = text
                deadline = None if seconds is None or told == until else time.monotonic() + seconds
            elif child.exitcode is not None:
                break  # a grandchild may hold the pipe open
        child.join(_GRACE)
        _kill(child)
        child.join()
        return Ended(well=False, words=f"the process ended with {_named(child.exitcode)}", told=told)


def one_ahead(children: Iterator[GuardedChild]) -> Generator[GuardedChild]:
    """Yield each child after it has begun and the one after it stands ready; close it when that is asked for.

    Examples
    --------
    >>> works = [lambda tell: tell("one"), lambda tell: tell("two")]
    >>> [child.end().told for child in one_ahead(GuardedChild(work) for work in works)]
    ['one', 'two']
    """
    open_ones: list[GuardedChild] = []  # that which ended, that which works, that which stands ready
    try:
        open_ones += islice(children, 1)
        while open_ones:
            child = open_ones[-1]
            child.begin()
            open_ones += islice(children, 1)
            while open_ones[0] is not child:
                open_ones.pop(0).close()
            yield child
            if open_ones[-1] is child:
                return
    finally:
        for child in open_ones:
            child.close()


def _child(
    pipe: Connection, parent: int, work: Callable[[Tell], None], memory_gb: float | None, log: Path | None
) -> None:
    die_with_parent(parent)
    gc.freeze()  # what was inherited is not collected here: to look at it would copy it, page by page
    if hasattr(os, "setpgid"):
        os.setpgid(0, 0)  # so that its own children can be killed with it
    try:
        pipe.recv()
    except (EOFError, OSError):
        return  # nobody wants this work any more
    try:
        if log is not None:
            speak_into(log)
        if memory_gb is not None:
            limit_memory(memory_gb)
        work(lambda word: pipe.send(("told", word)))
        last = ("done", "")
    except StorageError as failure:
        last = ("storage", str(failure))
    except Exception as failure:  # whatever a third party raises
        last = ("done", f"{type(failure).__name__}: {failure}")
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError):  # a full disk: what has to be told is told all the same
            stream.flush()
    flush_native_output()
    pipe.send(last)
    pipe.close()


def _kill(child: Any) -> None:
    if child.exitcode is not None:
        return
    if hasattr(os, "killpg"):
        with contextlib.suppress(ProcessLookupError, PermissionError):
            if os.getpgid(child.pid) == child.pid:
                os.killpg(child.pid, signal.SIGKILL)
    child.kill()


def _named(code: int) -> str:
    with contextlib.suppress(ValueError):
        if code < 0:
            return f"signal {signal.Signals(-code).name}"
    return f"exit code {code}"
