"""Keep derived geometry on disk, under the hash of what it was derived from."""

from __future__ import annotations

import hashlib
import logging
import os
import sys
import tempfile
import zipfile
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

CACHE_VERSION = 2
"""Part of every key: raise it whenever a cached computation changes its result."""

Arrays = dict[str, NDArray[np.generic]]

_log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class CacheInfo:
    """Say where a cache lies, how many results it holds and how many bytes they take."""

    root: Path | None
    entries: int
    size: int


@dataclass(frozen=True)
class Cache:
    """Store named arrays in a folder, by content.

    A result is written to a temporary file and moved into place, so that no reader (of any process) sees half a file. A
    file that cannot be read counts as absent. A folder that cannot be written costs a logged warning, never a result.

    Parameters
    ----------
    root
        The folder; None keeps nothing.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     cache = Cache(Path(folder))
    ...     first = cache.fetch(("squares", 4), lambda: {"values": np.arange(4) ** 2})
    ...     again = cache.fetch(("squares", 4), lambda: {"values": np.zeros(4)})
    ...     again["values"], cache.info().entries
    (array([0, 1, 4, 9]), 1)
    """

    root: Path | None

    def fetch(self, parts: tuple[object, ...], compute: Callable[[], Mapping[str, NDArray[np.generic]]]) -> Arrays:
        """Return the arrays stored under `parts`, computing and storing them where there are none.

        `parts` may hold text, bytes, numbers, None and arrays; see `content_hash`.
        """
        if self.root is None:
            return dict(compute())
        path = self._path(content_hash("nonrigid", CACHE_VERSION, *parts))
        stored = _read(path)
        if stored is not None:
            return stored
        arrays = dict(compute())
        _write(path, arrays)
        return arrays

    def info(self) -> CacheInfo:
        """Return where the cache lies and how much it holds."""
        sizes = [path.stat().st_size for path in self._files("*.npz")]
        return CacheInfo(root=self.root, entries=len(sizes), size=sum(sizes))

    def clear(self) -> None:
        """Remove every stored result, and nothing else."""
        for pattern in ("*.npz", "*.part"):
            for path in self._files(pattern):
                path.unlink(missing_ok=True)

    def _path(self, key: str) -> Path:
        assert self.root is not None
        return self.root / key[:2] / f"{key}.npz"

    def _files(self, pattern: str) -> list[Path]:
        if self.root is None or not self.root.is_dir():
            return []
        return sorted(self.root.glob(f"[0-9a-f][0-9a-f]/{pattern}"))


def default_cache() -> Cache:
    """Return the cache in `$NONRIGID_CACHE`, else in the user's cache folder of this platform."""
    chosen = os.environ.get("NONRIGID_CACHE")
    return Cache(Path(chosen) if chosen else _user_cache_folder() / "nonrigid")


def content_hash(*parts: object) -> str:
    """Return the sha256, in hexadecimal, of a sequence of texts, bytes, numbers, None and arrays.

    Arrays count with their type, shape and every byte; 1, 1.0, True and "1" all differ, and so do ("ab", "c") and
    ("a", "bc").

    Raises
    ------
    TypeError
        If a part is of another type, whose text need not tell its content.

    Examples
    --------
    >>> content_hash("ab", "c") == content_hash("a", "bc")
    False
    """
    digest = hashlib.sha256()
    for part in parts:
        if isinstance(part, np.ndarray):
            head = f"array {part.dtype.str} {part.shape}"
            body = np.ascontiguousarray(part).tobytes()
        elif part is None or isinstance(part, bool | int | float | str | bytes):
            head = type(part).__name__
            body = part if isinstance(part, bytes) else repr(part).encode()
        else:
            raise TypeError(f"cannot hash a {type(part).__name__}; give text, bytes, numbers, None or arrays")
        digest.update(f"{head} {len(body)}:".encode())
        digest.update(body)
    return digest.hexdigest()


def _user_cache_folder() -> Path:
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local"))
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    return Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))


def _read(path: Path) -> Arrays | None:
    try:
        with np.load(path, allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}
    except FileNotFoundError:
        return None
    except (OSError, ValueError, EOFError, KeyError, AttributeError, zipfile.BadZipFile, zlib.error) as error:
        _log.warning("cached file %s cannot be read (%s); computing it again", path, error)
        return None


def _write(path: Path, arrays: Arrays) -> None:
    temporary = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, suffix=".part")
        temporary = Path(name)
        with os.fdopen(handle, "wb") as file:
            np.savez(file, **arrays)  # type: ignore[arg-type]
        temporary.replace(path)
    except OSError as error:
        _log.warning("result not cached in %s: %s", path, error)
        if temporary is not None:
            temporary.unlink(missing_ok=True)
