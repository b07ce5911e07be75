"""The site's sources hold together without what builds it: links lead somewhere, commands exist, snippets run."""

from __future__ import annotations

import importlib.util
import os
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import click
import pytest
import typer
from typer.testing import CliRunner

from nonrigid.benchmark import methods
from nonrigid.benchmark.cli import app
from nonrigid.benchmark.plan import read_plan

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.rglob("*.md"))
RUN = [page for page in PAGES if page.parent.name == "howto" or page.name == "tutorial.md"]
MADE = ("generated/", "reference/")
"""Where the build puts what it makes."""


def name(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def load(path: Path) -> Any:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return module


read = load(DOCS / "snippets.py")


@pytest.mark.parametrize("page", [*PAGES, ROOT / "README.md", ROOT / "CONTRIBUTING.md"], ids=name)
def test_links_lead_to_files_of_the_site(page: Path) -> None:
    text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    for target in re.findall(r"\]\(([^)#\s]+)", re.sub(r"`[^`\n]*`", "", text)):
        place = (page.parent / target).resolve()
        assert place.is_relative_to(DOCS if page.is_relative_to(DOCS) else ROOT), target
        made = place.is_relative_to(DOCS) and place.relative_to(DOCS).as_posix().startswith(MADE)
        assert made or place.is_file(), target


def test_the_site_names_no_page_that_is_not_there() -> None:
    listed = re.findall(r"^ +- ([\w/]+\.md)$", (ROOT / "mkdocs.yml").read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert "tutorial.md" in listed
    assert [page for page in listed if not (DOCS / page).is_file()] == []


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_commands_name_options_that_exist(page: Path) -> None:
    lines = [line for line in page.read_text(encoding="utf-8").splitlines() if re.match(r"( {4})?nonrigid ", line)]
    for line in lines:
        words = shlex.split(line, comments=True)[1:]
        context = click.Context(typer.main.get_command(app), info_name="nonrigid")
        while isinstance(context.command, click.Group):
            _, command, words = context.command.resolve_command(context, words)
            assert command is not None
            context = click.Context(command, parent=context)
        context.command.make_parser(context).parse_args(words)


@pytest.mark.parametrize("page", [page for page in PAGES if page not in RUN], ids=name)
def test_other_pages_show_plans_that_can_be_read(page: Path, tmp_path: Path) -> None:
    for snippet in read.snippets(page):
        assert snippet.kind in ("toml", "text", "bash"), f"{name(page)} has a snippet that no test runs"
        if snippet.kind != "toml":
            continue
        given = tomllib.loads(snippet.text)
        text = snippet.text if "backends" in given else f'backends = ["native"]\n{snippet.text}'
        text += "" if "methods" in given else '\n[[methods]]\nmethod = "gt"\n'
        text += "" if "data" in given else '\n[data]\ndataset = "creatures"\n'
        (tmp_path / "plan.toml").write_text(text, encoding="utf-8")
        assert read_plan(tmp_path / "plan.toml").backends


@pytest.mark.slow
@pytest.mark.parametrize("page", RUN, ids=name)
def test_a_page_runs_from_top_to_bottom(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))  # for the children, as an editable install would do
    namespace: dict[str, object] = {}
    files = {snippet.title for snippet in read.snippets(page) if snippet.title}
    for snippet in read.snippets(page):
        if snippet.title:
            (tmp_path / snippet.title).write_text(snippet.text, encoding="utf-8")
        elif snippet.kind == "python":
            exec(compile(snippet.text, name(page), "exec"), namespace)
        else:
            assert snippet.kind == "bash"
            for command in snippet.commands:
                run_command(shlex.split(command), tmp_path)
    for module in (Path(file).stem for file in files if file.endswith(".py")):
        sys.modules.pop(module, None)
    methods.methods.cache_clear()


def run_command(words: list[str], place: Path) -> None:
    if words == ["pip", "install", "-e", "."]:
        return install(place)
    if words[0] == "python":
        environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        done = subprocess.run(
            [sys.executable, *words[1:]], env=environment, capture_output=True, text=True, timeout=120, check=False
        )
        assert done.returncode == 0, done.stderr
        return None
    assert words[0] == "nonrigid", words
    outcome = CliRunner().invoke(app, words[1:])
    assert outcome.exit_code == 0, f"{words}: {outcome.output} {outcome.exception}"
    return None


def install(place: Path) -> None:
    """Leave what an editable install of a folder on the path leaves, without asking for its build tools."""
    project = tomllib.loads((place / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    home = place / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    home.mkdir()
    (home / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n")
    groups = [
        f"[{group}]\n" + "".join(f"{word} = {target}\n" for word, target in entries.items())
        for group, entries in project["entry-points"].items()
    ]
    (home / "entry_points.txt").write_text("\n".join(groups))
    importlib.invalidate_caches()
    methods.methods.cache_clear()


def test_what_was_done_before_is_not_done_again() -> None:
    snippet = read.Snippet("bash", "", "make\n. .venv/bin/activate\nnonrigid cite  # all of it\n")
    assert snippet.commands == ["nonrigid cite"]
