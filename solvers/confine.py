"""Confine a child process: it dies with its parent, holds a limit of memory, and speaks into a file of its own."""

from __future__ import annotations

import contextlib
import ctypes
import multiprocessing
import os
import signal
import sys
from pathlib import Path
from typing import Any

from nonrigid.geometry.errors import InputError

GIGABYTE = 10**9
"""Bytes of the unit in which limits of memory are given."""

_PR_SET_PDEATHSIG = 1
_LINE_BUFFERED = 1


def child_context() -> Any:
    """Return how child processes are made here: by forking, which copies no data, or spawned where that is absent."""
    return multiprocessing.get_context("fork" if "fork" in multiprocessing.get_all_start_methods() else "spawn")


def die_with_parent(parent: int) -> None:
    """Have the kernel kill this process when its parent dies, so that a killed benchmark leaves nothing running.

    Only Linux knows this; elsewhere a child ends by itself, at its own limits.

    Parameters
    ----------
    parent
        Process id of the parent, as the parent knew it: it may be dead already.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:
            os._exit(1)


def follow_parent(parent: int) -> None:
    """End this process within a second after its parent is dead, for workers that wait for work from it.

    Unlike `die_with_parent` this looks, by the interval timer and its signal: a thread would be in the way of forking,
    and the kernel's own signal comes already when the thread that made this process ends.
    """
    if not hasattr(signal, "setitimer"):
        return

    def look(*_: object) -> None:
        if os.getppid() != parent:
            os._exit(1)

    signal.signal(signal.SIGALRM, look)
    signal.setitimer(signal.ITIMER_REAL, 1.0, 1.0)


def limit_memory(gigabytes: float) -> None:
    """Let this process, and each child it makes, have at most so much more memory than it has now.

    Counted is what the kernel calls data: private writable memory, touched or not. Code, files mapped for reading and
    what libraries merely reserve do not count, unlike in the address space. A request beyond the limit fails at once:
    `MemoryError` in Python and numpy, `std::bad_alloc` in C++ (measured with numpy, OpenBLAS and CasADi); a library
    that does not check its requests crashes.

    Raises
    ------
    InputError
        Where this system cannot limit memory (it is not Linux).
    """
    if not can_limit_memory():
        raise InputError(
            f"this system, {sys.platform}, cannot limit memory", remedy="leave memory_gb out of the limits"
        )
    import resource

    data = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmData:"))
    allowed = int(data.split()[1]) * 1024 + int(gigabytes * GIGABYTE)
    hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
    resource.setrlimit(resource.RLIMIT_DATA, (allowed if hard < 0 else min(allowed, hard), hard))


def can_limit_memory() -> bool:
    """Tell whether this system can limit memory: Linux can."""
    return sys.platform == "linux"


def is_out_of_memory(words: str) -> bool:
    """Tell whether an error's words say that memory could not be had.

    Examples
    --------
    >>> is_out_of_memory("RuntimeError: std::bad_alloc"), is_out_of_memory("ValueError: 3")
    (True, False)
    """
    return any(sign in words for sign in ("MemoryError", "bad_alloc", "Unable to allocate", "Cannot allocate memory"))


def peak_memory() -> float | None:
    """Return the largest memory, in gigabytes, that this process or one of its ended children held; None if unknown."""
    if sys.platform == "win32":
        return None
    import resource

    unit = 1 if sys.platform == "darwin" else 1024
    peaks = [resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return max(peaks) * unit / GIGABYTE


def speak_into(path: Path) -> None:
    """Send what this process and the libraries in it write to standard output and error to the end of a file.

    Lines of C libraries arrive one by one, so that those before a crash are kept.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    os.dup2(handle, 1)
    os.dup2(handle, 2)
    os.close(handle)
    with contextlib.suppress(ValueError, AttributeError, OSError):  # a C library that names its streams otherwise
        library = ctypes.CDLL(None)
        library.setvbuf(ctypes.c_void_p.in_dll(library, "stdout"), None, _LINE_BUFFERED, 0)


def flush_native_output() -> None:
    """Write out what C libraries hold back; a process that ends by `os._exit`, as children do, would lose it."""
    with contextlib.suppress(TypeError, AttributeError, OSError):
        ctypes.CDLL(None).fflush(None)
