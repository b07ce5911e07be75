"""What the README shows runs as it stands."""

from __future__ import annotations

import re
import shlex
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

TEXT = (Path(__file__).resolve().parents[2] / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(\w+)\n(.*?)```", TEXT, flags=re.DOTALL)


def test_the_quick_start_runs(capsys: pytest.CaptureFixture[str]) -> None:
    (code,) = [text for kind, text in BLOCKS if kind == "python"]
    assert len(code.splitlines()) <= 20
    exec(compile(code, "README.md", "exec"), {})
    shown = capsys.readouterr().out.splitlines()
    assert shown[0].startswith("native: stationary")
    assert shown[1].startswith("nlopt:LD_CCSAQ: ")
    assert "objective" in shown[2]


def test_the_plan_runs(tmp_path: Path, nonrigid: Callable[..., Any]) -> None:
    (text,) = [text for kind, text in BLOCKS if kind == "toml"]
    (tmp_path / "plan.toml").write_text(text)
    answer = nonrigid("bench", tmp_path / "plan.toml", "--out", tmp_path / "out", "--quiet")
    assert answer.code == 0, answer.err
    assert "casadi:ipopt" in answer.out


def test_the_shell_commands_run(
    files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, nonrigid: Callable[..., Any]
) -> None:
    for path in files.glob("*"):
        shutil.copy(path, tmp_path)
    monkeypatch.chdir(tmp_path)
    commands = [line.strip() for line in TEXT.splitlines() if line.startswith("    nonrigid ")]
    assert len(commands) == 2
    for command in commands:
        answer = nonrigid(*shlex.split(command)[1:])
        assert answer.code == 0, answer.err


def test_every_command_is_in_the_table(nonrigid: Callable[..., Any]) -> None:
    listed = re.findall(r"^  (\w+) +\S", nonrigid("--help").out.split("Commands:")[1], flags=re.MULTILINE)
    assert set(listed) == set(re.findall(r"^\| `nonrigid (\w+)", TEXT, flags=re.MULTILINE))
