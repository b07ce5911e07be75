"""Call a function in a child process: a hang, a crash, a full memory or a full disk ends the call, not the caller."""

from __future__ import annotations

import contextlib
import gc
import os
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass
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
    context = child_context()
    here, there = context.Pipe(duplex=False)
    child = context.Process(target=_child, args=(there, os.getpid(), work, memory_gb, log), daemon=False)
    deadline = None if seconds is None else time.monotonic() + seconds
    child.start()
    there.close()
    told, failure, killed = "", "", False
    try:
        while True:
            left = _LOOK_EVERY if deadline is None else min(_LOOK_EVERY, deadline - time.monotonic())
            if left <= 0:
                killed = True
                break
            if wait([here], left):
                try:
                    kind, text = here.recv()
                except (EOFError, OSError):
                    break
                if kind == "storage":
                    raise StorageError(text)
                if kind == "failure":
                    failure = text
                else:
                    told = text
                    deadline = None if seconds is None or told == until else time.monotonic() + seconds
            elif child.exitcode is not None:
                break  # a grandchild may hold the pipe open
        if not killed:
            child.join(_GRACE)
    finally:
        _kill(child)
        child.join()
        here.close()
    if killed:
        return Ended(well=False, killed=True, words=f"killed after {seconds:g} s of a run", told=told)
    if failure:
        return Ended(well=False, words=failure, told=told)
    if child.exitcode:
        return Ended(well=False, words=f"the process ended with {_named(child.exitcode)}", told=told)
    return Ended(well=True, told=told)


def _child(
    pipe: Connection, parent: int, work: Callable[[Tell], None], memory_gb: float | None, log: Path | None
) -> None:
    die_with_parent(parent)
    gc.freeze()  # what was inherited is not collected here: to look at it would copy it, page by page
    if hasattr(os, "setpgid"):
        os.setpgid(0, 0)  # so that its own children can be killed with it
    try:
        if log is not None:
            speak_into(log)
        if memory_gb is not None:
            limit_memory(memory_gb)
        work(lambda word: pipe.send(("told", word)))
    except StorageError as failure:
        pipe.send(("storage", str(failure)))
    except Exception as failure:  # whatever a third party raises
        pipe.send(("failure", f"{type(failure).__name__}: {failure}"))
    flush_native_output()
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
