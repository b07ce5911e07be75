"""The report of made-up results: complete, true to its data, and asking nobody for anything."""

from __future__ import annotations

import base64
import csv
import json
import re
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread

from nonrigid.benchmark.datasets.protocols import PairData, PairSpec
from nonrigid.benchmark.formats import write_corr
from nonrigid.benchmark.matched_points import MAP_VARIABLE, matched_points, read_points, write_points
from nonrigid.benchmark.protocol import score
from nonrigid.benchmark.report import write
from nonrigid.benchmark.report.export import as_latex
from nonrigid.benchmark.report.figures.gap import gap_against_error
from nonrigid.benchmark.report.figures.profiles import solver_profiles
from nonrigid.benchmark.report.pack import first_view, pack_points, pack_surface, place_colours
from nonrigid.benchmark.report.pages.templates import script
from nonrigid.benchmark.report.pairs import PairTask, slug, write_pair
from nonrigid.benchmark.report.series import all_series, leading
from nonrigid.benchmark.report.write import write_report
from nonrigid.benchmark.store import Record, Store, with_gaps
from nonrigid.geometry.errors import InputError, UnknownNameError
from nonrigid.geometry.points import SurfacePoints

HOSTILE = "a/</script><b>&"
FORMS = ("-light.svg", "-dark.svg", ".png", ".pdf", ".csv", ".tex")


def made_up(pair: str, label: str, backend: str, objective: float, seconds: float, found: Any, **more: Any) -> Record:
    """Return the record of a run that maximised something."""
    best = 4.0
    stage = {
        "problem": "game", "problem_hash": f"{pair}{label}", "variables": 9, "sense": "maximize", "solver": backend,
        "status": "stationary", "usable": True, "message": "fine", "raw_status": "</script>", "route": ["a", "b"],
        "claim": "exact", "objective": objective, "violation": 0.0, "stationarity": 1e-8, "bound": None,
        "certificate": None, "build_seconds": 0.0, "solve_seconds": seconds, "evaluations": 10.0, "versions": {},
        "attempts": [], "trace": [[0.0, 1.0, 0.0, 0.0], [seconds / 2, 5.0, objective / best * 2, 0.0]],
    }  # fmt: skip
    record = {
        "id": f"{zlib.crc32(repr((pair, label, backend)).encode()):x}", "pair": pair, "class_name": "anton",
        "split": "holes" if pair.startswith("holes") else "cuts", "label": label,
        "method": label, "settings": "", "backend": backend, "metric": "dijkstra", "motion_seed": 0,
        "status": "stationary", "message": "fine", "solver": backend, "variables": 9, "objective": objective,
        "stationarity": 1e-8, "build_seconds": 0.0, "solve_seconds": seconds, "formulation_seconds": 0.1,
        "source": "x", "stages": [stage],
    }  # fmt: skip
    if found is not None:
        record |= {
            "mean_error": found.mean_error, "mean_error_per_point": found.mean_error_per_point, "side": found.side,
            "match_count": found.match_count, "unmatched_count": found.unmatched_count, "coverage": found.coverage,
            "kept_area": found.kept_area, "curve": found.curve.tolist(),
        }  # fmt: skip
    return {**record, **more}


@pytest.fixture(scope="module")
def spec(person: PairData) -> PairSpec:
    return PairSpec(
        name=HOSTILE, split="cuts", class_name="anton", part=lambda: person.part, full=lambda: person.full,
        truth=lambda: person.truth, mirrored=lambda: person.mirrored,
    )  # fmt: skip


@pytest.fixture(scope="module")
def answers(person: PairData) -> dict[str, SurfacePoints]:
    """The truth, and a sparse answer that mixes sides."""
    assert person.truth is not None
    assert person.mirrored is not None
    faces, weights = np.full(len(person.truth), -1), np.zeros((len(person.truth), 3))
    for source, rows in ((person.truth, np.arange(0, 60, 6)), (person.mirrored, np.arange(3, 60, 12))):
        faces[rows], weights[rows] = source.faces[rows], source.barycentric[rows]
    return {"dense": person.truth, "sparse": SurfacePoints(faces, weights)}


@pytest.fixture(scope="module")
def results(
    person: PairData, spec: PairSpec, answers: dict[str, SurfacePoints], tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """A folder of results, with the pair given instead of read by a plan."""
    folder = tmp_path_factory.mktemp("results")
    store = Store(folder)
    store.prepare()
    records = []
    for label, answer, base in (("pfm", answers["dense"], 2.0), ("gt", answers["sparse"], 1.0)):
        found = score(person, answer)
        for pair in (HOSTILE, "holes_second"):
            for backend, share, seconds in (("native", 1.0, 0.1), ("scipy", 0.995, 0.4), ("nlopt", 0.5, 0.2)):
                record = made_up(pair, label, backend, base * share, seconds, found)
                functional = type("S", (), {"values": {MAP_VARIABLE: np.eye(3)}})()
                solutions = [functional] if label == "pfm" else []
                write_points(store.points_file(record["id"]), matched_points(answer, found, solutions))
                records.append(record)
    lost = made_up(HOSTILE, "gt", "casadi", 0.0, 0.0, None, status="refused", message="too <large>", stages=[])
    records += [lost, {**lost, "pair": "holes_second", "id": "lost2"}]
    index = {"title": "<i>t</i>", "dataset": "creatures", "metric": "dijkstra", "runs": {r["id"]: "x" for r in records}}
    with pytest.MonkeyPatch.context() as patch:
        plan = type("P", (), {"pairs": lambda self: [spec]})()
        patch.setattr(write, "read_plan", lambda path, data=None, templates=None: plan)
        write_report(folder, index, with_gaps(records))
    (folder / "records.json").write_text(json.dumps(records))
    return folder


@pytest.fixture(scope="module")
def records(results: Path) -> list[Record]:
    return with_gaps(json.loads((results / "records.json").read_text()))


def values(path: Path, name: str) -> Any:
    """Return what a script hands to the page."""
    found = re.search(rf"\)\.{name} = (.*);\n", path.read_text())
    assert found
    return json.loads(found[1])


def unpacked(text: str, kind: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), kind)


def test_every_figure_and_table_has_every_form(results: Path) -> None:
    out = results / "report"
    for name in ("curves", "partiality", "time", "profile", "data-profile", "gap", "paired"):
        for form in FORMS:
            assert (out / f"{name}{form}").stat().st_size > 40, name + form
    for name in ("solvers.csv", "solvers.tex", "solvers.md", "runs.csv", "runs.tex"):
        assert (out / name).stat().st_size > 60


def test_pages_name_only_files_that_exist(results: Path) -> None:
    pages = [results / "report" / "index.html", *(results / "report" / "pairs").iterdir()]
    assert len(pages) == 3
    for page in pages:
        text = page.read_text()
        assert "http:" not in text
        assert "https:" not in text
        for link in re.findall(r'(?:src|href|srcset)="([^"]+)"', text):
            if link not in ("data:,", "../runs.parquet"):
                assert (page.parent / link).is_file(), link
    for name in ("style.css", "table.js", "surface.js", "pair.js"):
        assert "//" not in re.sub(r"\s//.*", "", (results / "report" / "assets" / name).read_text())


def test_captions_hold_numbers_and_the_command_that_remakes_them(results: Path) -> None:
    page = (results / "report" / "index.html").read_text()
    assert page.count(f"nonrigid report {results.name} --figure ") == 7
    assert "2 of 7 combinations" in page
    assert "(cuts: 1 shapes; holes: 1 shapes)" in page


def test_nothing_from_the_data_becomes_markup(results: Path) -> None:
    page = (results / "report" / "index.html").read_text()
    assert "<i>t</i>" not in page
    assert "too <large>" not in page
    for path in (results / "report" / "data").glob("*.js"):
        assert "</script" not in path.read_text()
    pair = (results / "report" / "pairs" / f"{slug(HOSTILE)}.html").read_text()
    assert "<b>&" not in pair


def test_one_figure_is_remade_alone(records: list[Record], tmp_path: Path) -> None:
    write.draw_figures(tmp_path, records, only="gap")
    assert {path.name for path in tmp_path.iterdir()} == {f"gap{form}" for form in FORMS}
    with pytest.raises(UnknownNameError, match="curves"):
        write.draw_figures(tmp_path, records, only="nothing")


def test_figures_show_what_the_runs_say(results: Path, records: list[Record]) -> None:
    with (results / "report" / "curves.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    sparse = next(record for record in records if record["label"] == "gt")
    shares = [float(row["share"]) for row in rows if row["series"].startswith("gt") and row["split"] == "holes"]
    assert shares == pytest.approx(sparse["curve"])
    assert {one.label: one.dense for one in leading(all_series(records))} == {"pfm": True, "gt": False}
    profile, budget = solver_profiles(all_series([r for r in records if r["label"] == "pfm"]))
    solved = {str(row["backend"]): row["cost"] for row in profile.rows}
    assert solved == {"native": 1.0, "scipy": 4.0}
    assert {row["backend"] for row in budget.rows} == {"native", "scipy"}
    gap = gap_against_error(all_series(records))[0]
    assert "gt: not defined (6 runs)" in gap.caption
    assert max(float(str(row["gap"])) for row in gap.rows) == 0.5


def test_results_without_matches_give_no_figures(records: list[Record]) -> None:
    lost = [{**record, "match_count": None, "stages": [], "gap": None} for record in records]
    assert [sketch for make in write.FIGURES[:3] for sketch in make(all_series(lost))] == []
    assert [sketch for make in write.FIGURES for sketch in make([])] == []


def test_a_pair_holds_its_surfaces_and_matches(
    results: Path, person: PairData, answers: dict[str, SurfacePoints]
) -> None:
    path = results / "report" / "data" / f"{slug(HOSTILE)}.js"
    pair = values(path, "pair")
    block = pair["part"]
    low, size = np.array(block["low"]), np.array(block["size"])
    vertices = low + unpacked(block["vertices"], "<u2").reshape(-1, 3) / 65535 * size
    assert np.abs(vertices - person.part.vertices).max() <= size.max() / 65535
    assert (unpacked(block["faces"], "<u2").reshape(-1, 3) == person.part.faces).all()
    # Equal answers of several solvers stand there once.
    assert len(pair["points"]) == 2
    run = next(run for run in pair["runs"] if run["label"] == "gt" and run["backend"] == "native")
    points = pair["points"][run["points"]]
    rows = np.flatnonzero(answers["sparse"].matched)
    assert (unpacked(points["rows"], "<u2") == rows).all()
    assert (unpacked(points["faces"], "<u2") == answers["sparse"].faces[rows]).all()
    assert np.abs(unpacked(points["errors"], "<u2") * 1e-4 - score(person, answers["sparse"]).errors).max() <= 6e-5
    assert run["stages"][0]["raw_status"] == "</script>"
    assert len(run["stages"][0]["trace"]) == 2
    dense = next(run for run in pair["runs"] if run["label"] == "pfm")
    assert unpacked(dense["map"]["values"], "<f4").tolist() == np.eye(3).ravel().tolist()
    other = (results / "report" / "pairs" / "holes_second.html").read_text()
    assert "The data set has no pair holds_second" not in other
    assert "The data set has no pair holes_second any more." in other


def test_the_table_of_runs_is_complete(results: Path, records: list[Record]) -> None:
    table = values(results / "report" / "data" / "runs.js", "tables")["runs"]
    assert len(table["rows"]) == len(records)
    kinds = {column["heading"]: column["kind"] for column in table["columns"]}
    assert (kinds["pair"], kinds["status"], kinds["gap"], kinds["message"]) == ("link", "choice", "number", "clip")
    for page in table["pages"].values():
        assert (results / "report" / page).is_file()


def test_older_results_are_scored_again(
    person: PairData, spec: PairSpec, answers: dict[str, SurfacePoints], tmp_path: Path
) -> None:
    store = Store(tmp_path)
    store.prepare()
    for place in ("data", "pairs"):
        (tmp_path / "report" / place).mkdir(parents=True)
    found = score(person, answers["sparse"])
    record = with_gaps([made_up("p", "gt", "native", 1.0, 0.1, found)])[0]
    write_corr(store.match_file(record["id"]), answers["sparse"])
    write_pair(PairTask(name="p", records=(record,), spec=spec, problem="", folder=tmp_path))
    (block,) = values(tmp_path / "report" / "data" / "p.js", "pair")["points"].values()
    assert unpacked(block["errors"], "<u2") * 1e-4 == pytest.approx(found.errors, abs=6e-5)


def test_stored_matches_come_back(answers: dict[str, SurfacePoints], tmp_path: Path) -> None:
    sparse = answers["sparse"]
    errors = np.linspace(0, 1, int(sparse.matched.sum()))
    write_points(tmp_path / "a.npz", replace(matched_points(sparse), errors=errors))
    back = read_points(tmp_path / "a.npz")
    assert (back.points.faces == sparse.faces[back.rows]).all()
    assert back.errors == pytest.approx(errors, abs=1e-7)
    assert back.functional_map is None
    (tmp_path / "a.npz").write_bytes(b"half")
    with pytest.raises(InputError, match=r"a\.npz"):
        read_points(tmp_path / "a.npz")


def test_names_of_pages_are_files_and_differ() -> None:
    names = ["a/b", "a_b", "a b", "../a", "ä"]
    assert len({slug(name) for name in names}) == len(names)
    assert not any(re.search(r"[^A-Za-z0-9_.-]", slug(name)) for name in names)
    assert "/" not in slug("../a")


def test_colours_follow_places_and_the_view_is_a_rotation(person: PairData) -> None:
    colours = place_colours(person.full).astype(float)
    i, j = person.full.edges.T
    near = np.linalg.norm(colours[i] - colours[j], axis=1).mean()
    shuffled = np.random.default_rng(0).permutation(len(colours))
    assert near < 0.25 * np.linalg.norm(colours - colours[shuffled], axis=1).mean()
    turn = np.array(first_view(person.full)).reshape(3, 3)
    assert turn @ turn.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1.0)


def test_large_surfaces_are_packed_wide(person: PairData) -> None:
    points = SurfacePoints([70_000, 0], [[0.2, 0.3, 0.5], [1.0, 0.0, 0.0]])
    block = pack_points(points, np.array([3, 4]), np.array([np.inf, np.nan]))
    assert block["wide"]
    assert unpacked(block["faces"], "<u4").tolist() == [70_000, 0]
    assert unpacked(block["errors"], "<u2").tolist() == [65534, 65535]
    assert not pack_surface(person.part)["wide"]


def test_latex_keeps_its_special_letters() -> None:
    text = as_latex([{"a": "50 % of x_1 & <b>\\"}], {"a": "#"})
    assert r"50 \% of x\_1 \& \textless{}b\textgreater{}\textbackslash{} \\" in text
    assert r"\# \\" in text


def test_scripts_hold_no_number_that_json_has_not() -> None:
    with pytest.raises(ValueError, match="JSON"):
        script(a=float("nan"))


@pytest.fixture(scope="module")
def match_file(files: Path, answers: dict[str, SurfacePoints]) -> Path:
    write_corr(files / "shown.corr", answers["sparse"])
    return files / "shown.corr"


def test_one_match_is_a_page_of_one_file(files: Path, match_file: Path, nonrigid: Callable[..., Any]) -> None:
    truth = ("--truth", files / "part.baryc_gt", "--mirrored", files / "part.baryc_gt_sym")
    answer = nonrigid("view", files / "part.off", files / "full.off", match_file, *truth)
    assert answer.code == 0, answer.err
    page = match_file.with_suffix(".html").read_text()
    assert not re.findall(r'(?:src|href)="(?!data:)', page)
    assert "x100 of sqrt(full area)" in page
    assert page.count("<script>") == page.count("</script>") == 5
    answer = nonrigid("view", files / "part.off", files / "full.off", match_file)
    assert "no ground truth is given" in match_file.with_suffix(".html").read_text()


def test_one_match_is_a_picture(files: Path, match_file: Path, tmp_path: Path, nonrigid: Callable[..., Any]) -> None:
    out = tmp_path / "m.png"
    assert nonrigid("view", files / "part.off", files / "full.off", match_file, "--out", out).code == 0
    picture = imread(out)
    assert picture.shape[1] == 2 * picture.shape[0]
    assert 0.02 < (picture[:, :, :3].min(axis=2) < 0.99).mean() < 0.9


def test_views_of_nothing_are_refused(files: Path, match_file: Path, nonrigid: Callable[..., Any]) -> None:
    surfaces = (files / "part.off", files / "full.off")
    for words, expected in (
        ((match_file, "--out", "m.gif"), "suffix"),
        ((match_file, "--out", "none/m.html"), "none"),
        ((match_file, "--mirrored", files / "part.baryc_gt_sym"), "--truth"),
        ((files / "lost.corr",), "lost.corr"),
    ):
        answer = nonrigid("view", *surfaces, *words)
        assert answer.code == 2
        assert expected in answer.err


def test_helpers_started_in_another_working_directory_write_to_the_right_folder(
    records: list[Record], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    index = {"title": "t", "dataset": "creatures", "metric": "dijkstra", "runs": {r["id"]: "x" for r in records}}
    for place in ("first", "second"):  # the helpers of the first report live on and write the second
        (tmp_path / place / "results").mkdir(parents=True)
        monkeypatch.chdir(tmp_path / place)
        write_report(Path("results"), index, records, jobs=2)
        assert len(list(Path("results", "report", "pairs").glob("*.html"))) == len({r["pair"] for r in records})
