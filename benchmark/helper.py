"""Do tasks in a plain process beside a cluster's worker, which is full of threads and may not fork.

`python -m nonrigid.benchmark.helper` reads tasks from standard input and answers each on standard output, both pickled.
"""

from __future__ import annotations

import atexit
import os
import pickle
import subprocess
import sys
import threading
from typing import Any

from nonrigid.benchmark.task import Task, WorkerLostError, do_task
from nonrigid.solvers.confine import follow_parent

_here = threading.local()


def in_helper(task: Task) -> None:
    """Do a task in this thread's helper process, started at the first task.

    Raises whatever the task raises, and `WorkerLostError` if the helper died.
    """
    helper = getattr(_here, "process", None)
    if helper is None or helper.poll() is not None:
        helper = _here.process = _started()
    assert helper.stdin is not None
    assert helper.stdout is not None
    try:
        pickle.dump(task, helper.stdin)
        helper.stdin.flush()
        failure = pickle.load(helper.stdout)
    except (OSError, EOFError, pickle.UnpicklingError):
        helper.kill()
        raise WorkerLostError(f"the process beside a worker ended with exit code {helper.wait()}") from None
    if failure is not None:
        raise failure


def _started() -> subprocess.Popen[bytes]:
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    words = [sys.executable, "-m", "nonrigid.benchmark.helper"]
    helper = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env={**os.environ, **threads})
    atexit.register(helper.kill)
    return helper


def _serve() -> None:
    follow_parent(os.getppid())
    # What a library prints must not get between the answers.
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    while True:
        try:
            task = pickle.load(sys.stdin.buffer)
        except (EOFError, KeyboardInterrupt):
            return
        failure: Any = None
        try:
            do_task(task)
        except Exception as error:
            failure = error
        try:
            answer = pickle.dumps(failure)
        except Exception:  # an error that cannot travel
            answer = pickle.dumps(RuntimeError(f"{type(failure).__name__}: {failure}"))
        answers.write(answer)
        answers.flush()


if __name__ == "__main__":
    _serve()
