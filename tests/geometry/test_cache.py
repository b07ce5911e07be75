"""What is cached equals what is fresh, and a broken disk costs time, never a result."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from nonrigid.geometry import cache as module
from nonrigid.geometry.cache import Cache, content_hash, default_cache


class Counted:
    def __init__(self) -> None:
        self.calls = 0

    def __call__(self) -> dict[str, np.ndarray]:
        self.calls += 1
        return {"a": np.random.default_rng(3).standard_normal(50), "b": np.arange(6).reshape(2, 3)}


def test_second_fetch_reads_the_same_bits(tmp_path: Path) -> None:
    cache, make = Cache(tmp_path / "new" / "folder"), Counted()
    fresh, stored = cache.fetch(("k", 1), make), cache.fetch(("k", 1), make)
    assert make.calls == 1
    for name in fresh:
        assert fresh[name].tobytes() == stored[name].tobytes()
        assert fresh[name].dtype == stored[name].dtype
    cache.fetch(("k", 2), make)
    assert cache.info().entries == 2
    assert cache.info().size > 800
    cache.clear()
    assert cache.info().entries == 0


def empty(path: Path) -> None:
    path.write_bytes(b"")


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def garble(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[200] ^= 255
    path.write_bytes(bytes(content))


@pytest.mark.parametrize("harm", [empty, cut, garble])
def test_broken_files_are_computed_again_and_mended(
    tmp_path: Path, harm: Callable[[Path], None], caplog: pytest.LogCaptureFixture
) -> None:
    cache, make = Cache(tmp_path), Counted()
    fresh = cache.fetch(("k",), make)
    harm(next(tmp_path.glob("*/*.npz")))
    with caplog.at_level(logging.WARNING):
        again = cache.fetch(("k",), make)
    assert make.calls == 2
    assert np.array_equal(fresh["a"], again["a"])
    assert "computing it again" in caplog.text
    cache.fetch(("k",), make)
    assert make.calls == 2


def test_unwritable_or_full_disk_still_gives_the_value(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    assert Cache(blocked).fetch(("k",), Counted())["b"].shape == (2, 3)

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(module.np, "savez", full)
    assert Cache(tmp_path).fetch(("k",), Counted())["b"].shape == (2, 3)
    assert "No space left" in caplog.text
    assert not list(tmp_path.glob("*/*"))


def test_no_root_keeps_nothing_and_errors_of_the_computation_pass() -> None:
    make = Counted()
    Cache(None).fetch(("k",), make)
    Cache(None).fetch(("k",), make)
    assert make.calls == 2
    assert Cache(None).info().entries == 0
    with pytest.raises(ZeroDivisionError):
        Cache(None).fetch(("k",), lambda: {"a": np.array(1 // 0)})


def test_the_key_tells_type_shape_and_version_apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    zeros = np.zeros(6)
    keys = [(1,), (1.0,), (True,), ("1",), (b"1",), (None,), (zeros,), (zeros.reshape(2, 3),), (zeros.astype("f4"),)]
    assert len({content_hash(*key) for key in keys}) == len(keys)
    with pytest.raises(TypeError, match="cannot hash a list"):
        content_hash([1])
    make = Counted()
    Cache(tmp_path).fetch(("k",), make)
    monkeypatch.setattr(module, "CACHE_VERSION", module.CACHE_VERSION + 1)
    Cache(tmp_path).fetch(("k",), make)
    assert make.calls == 2


@pytest.mark.parametrize(
    ("platform", "variable", "tail"),
    [("linux", "XDG_CACHE_HOME", "nonrigid"), ("win32", "LOCALAPPDATA", "nonrigid"), ("darwin", "HOME", "nonrigid")],
)
def test_default_root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, platform: str, variable: str, tail: str) -> None:
    monkeypatch.setenv("NONRIGID_CACHE", str(tmp_path / "mine"))
    assert default_cache().root == tmp_path / "mine"
    monkeypatch.delenv("NONRIGID_CACHE")
    monkeypatch.setattr(module.sys, "platform", platform)
    monkeypatch.setenv(variable, str(tmp_path))
    root = default_cache().root
    assert root is not None
    assert root.is_relative_to(tmp_path)
    assert root.name == tail
