"""Record what the numbers of a benchmark depend on besides its plan: machine, versions, state of the code."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import subprocess
from functools import cache
from importlib.metadata import PackageNotFoundError, requires, version
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
import scipy.linalg
from threadpoolctl import threadpool_info

from nonrigid import benchmark, formulations, geometry, solvers
from nonrigid.geometry.errors import NonrigidError
from nonrigid.solvers.backend import backend_class, backend_names
from nonrigid.solvers.confine import child_context

_ROOMS = (geometry, formulations, solvers, benchmark)


def environment() -> dict[str, object]:
    """Return the environment as plain data: package, native solver and BLAS versions, CPU, state of the code."""
    scipy.linalg.lu(np.ones((2, 2)) @ np.ones((2, 2)))  # BLAS libraries are listed once they are loaded
    return {
        "nonrigid": version("nonrigid"),
        "source": source_digest(),
        "git": _git(),
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        "cpu": _cpu(),
        "cores": os.cpu_count(),
        "packages": _packages(),
        "backends": {name: dict(backend_class(name).versions()) for name in backend_names()},
        "blas": [
            {key: pool.get(key) for key in ("internal_api", "version", "architecture", "num_threads")}
            for pool in threadpool_info()
            if pool.get("user_api") == "blas"
        ],
    }


@cache
def known_environment() -> tuple[str, dict[str, object]]:
    """Return a short word for this process's environment, and the environment, looked up once.

    A child looks, since all backends have to be loaded for it: a process that holds them all is slow to fork for runs.

    Raises
    ------
    NonrigidError
        If the child dies of it, as where a library crashes while it is loaded.
    """
    context = child_context()
    here, there = context.Pipe(duplex=False)
    child = context.Process(target=_tell, args=(there,), daemon=False)
    child.start()
    there.close()
    try:
        found = here.recv()
    except EOFError:
        raise NonrigidError("the libraries of the backends cannot be loaded: see what they printed") from None
    finally:
        child.join()
        here.close()
    return hashlib.sha256(json.dumps(found, sort_keys=True, default=str).encode()).hexdigest()[:12], found


def _tell(pipe: Connection) -> None:
    pipe.send(environment())
    pipe.close()


@cache
def source_digest() -> str:
    """Return a short hash of the package's code, so that results of different states can be told apart."""
    digest = hashlib.sha256()
    for room in _ROOMS:
        root = Path(room.__path__[0])
        for path in sorted(root.rglob("*.py")):
            digest.update(f"{room.__name__}/{path.relative_to(root).as_posix()}".encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


def _packages() -> dict[str, str]:
    found = {}
    for line in requires("nonrigid") or []:
        name = line.split(";")[0].split("[")[0]
        for sign in "<>=!~ ":
            name = name.split(sign)[0]
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue  # an extra that is not installed
    return dict(sorted(found.items()))


def _git() -> str | None:
    folder = Path(benchmark.__path__[0])
    if not (folder.parent / ".git").exists():
        return None
    try:
        words = ["git", "describe", "--always", "--dirty", "--abbrev=12"]
        answer = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=10, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return answer.stdout.strip()


def _cpu() -> str:
    table = Path("/proc/cpuinfo")
    if table.is_file():
        for line in table.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
