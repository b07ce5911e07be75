"""Plans are read whole or refused with the file, the key and the remedy."""

from __future__ import annotations

from pathlib import Path

import pytest

from nonrigid.benchmark.plan import read_plan
from nonrigid.geometry.errors import NonrigidError

GOOD = """
backends = ["native", "nlopt:LD_CCSAQ+native"]
[data]
dataset = "creatures"
vertices = 600
names = ["cuts_cat_shape_1"]
[limits]
seconds = 5
[[methods]]
method = "gt"
settings = { part_samples = 20, radii = [0.05, 0.1] }
"""


def test_a_plan_is_read_with_its_types(tmp_path: Path) -> None:
    (tmp_path / "p.toml").write_text(GOOD)
    plan = read_plan(tmp_path / "p.toml")
    assert [spec.name for spec in plan.pairs()] == ["cuts_cat_shape_1"]
    assert plan.limits.seconds == 5
    assert plan.methods[0].formulation.radii == (0.05, 0.1)  # type: ignore[attr-defined]
    assert plan.text == GOOD


def test_shipped_plans_are_sound() -> None:
    demo = read_plan("demo")
    assert len(demo.pairs()) == 4
    assert {word.partition(":")[0] for word in demo.backends} == {"native", "nlopt", "casadi", "cvxpy", "scipy"}
    assert len(demo.backends) >= 8
    assert len(read_plan("gt16").names) == 16
    ablation, details = read_plan("ablation"), read_plan("ablation_details")
    assert (ablation.names, details.names) == ((), read_plan("gt16").names)
    formulations = [entry.formulation for entry in ablation.methods + details.methods]
    assert len(set(formulations)) == len(formulations) - 1 >= 15  # as it is stands in both
    families = {"native", "nlopt", "casadi", "cvxpy", "scipy"}
    backends = read_plan("anchored_backends").backends
    assert {word.partition(":")[0] for word in backends if "=" not in word} == families


@pytest.mark.realdata
def test_the_sixteen_pairs_are_there(data: Path) -> None:
    assert [spec.name for spec in read_plan("gt16", data=data).pairs()][::8] == [
        "cuts_cat_shape_12",
        "holes_cat_shape_4",
    ]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("[data]", "[data", "is not TOML"),
        ('dataset = "creatures"', 'dataset = "faust"', "unknown data set 'faust'; choose one of: "),
        ("vertices = 600", "vertices = 10", "too few"),
        ("vertices = 600", "vertices = 600.5", "[data] of creatures.vertices is 600.5; give a whole number"),
        ("vertices = 600", "vertices = 600\nseed = 'x'", "[data] of creatures.seed is 'x'; give a whole number"),
        ("[data]", "seed = -1\n[data]", "seed is -1"),
        ("[data]", "motion_seed = -1\n[data]", "motion_seed is -1"),
        ("vertices = 600", "vertex = 600", "unknown key of [data] of creatures 'vertex'"),
        ('"native", ', '"natve", ', "unknown backend 'natve'"),
        ('"native", ', '"nlopt:LD_CCSAQ+native", ', "twice"),
        ("backends = [", "backend = [", "unknown key of the plan 'backend'"),
        ('"native", "nlopt:LD_CCSAQ+native"', "", "backends has 0 entries"),
        ("seconds = 5", "seconds = 0", "seconds is 0"),
        ("seconds = 5", 'seconds = "5"', "give a number"),
        ("seconds = 5", "second = 5", "unknown key of [limits] 'second'"),
        ('method = "gt"', 'method = "zz"', "unknown method 'zz'"),
        ("part_samples = 20", "part_sample = 20", "unknown setting of gt 'part_sample'"),
        ("part_samples = 20", "part_samples = 2.5", "whole number"),
        ("part_samples = 20", "sides = 'left'", "two-sided"),
        ("radii = [0.05, 0.1]", "radii = 0.1", "several numbers"),
        ("[data]", "metric = 'crow'\n[data]", "crow"),
        ("[data]", "starts = 0\n[data]", "starts is 0"),
        ("[data]", "seed = 1.5\n[data]", "seed is 1.5"),
        ("[data]", "accuracy = 'best'\n[data]", "unknown accuracy 'best'; choose one of: high, low, mid"),
        ("[data]", "accuracy = ['low', 'low']\n[data]", "name each once"),
        ("[data]", "run_seconds = -1\n[data]", "run_seconds is -1"),
        ("seconds = 5", "memory_gb = 0", "memory_gb is 0"),
        ('[[methods]]\nmethod = "gt"', '[[methods]]\nmethod = "gt"\n[[methods]]\nmethod = "gt"', "own label"),
    ],
)
def test_a_wrong_plan_names_file_key_and_remedy(tmp_path: Path, old: str, new: str, words: str) -> None:
    assert old in GOOD
    (tmp_path / "p.toml").write_text(GOOD.replace(old, new))
    with pytest.raises(NonrigidError) as caught:
        read_plan(tmp_path / "p.toml")
    assert words in str(caught.value)
    assert "p.toml" in str(caught.value)


def test_an_unknown_pair_is_named(tmp_path: Path) -> None:
    (tmp_path / "p.toml").write_text(GOOD.replace("cuts_cat_shape_1", "cuts_bear_shape_1"))
    with pytest.raises(NonrigidError, match="unknown pair 'cuts_bear_shape_1'"):
        read_plan(tmp_path / "p.toml").pairs()


def test_data_can_be_elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NONRIGID_DATA", str(tmp_path / "here"))
    assert read_plan("gt16").dataset.root == tmp_path / "here"  # type: ignore[attr-defined]
    assert read_plan("gt16", data=tmp_path).dataset.root == tmp_path  # type: ignore[attr-defined]
    with pytest.raises(NonrigidError, match="folder null"):
        read_plan("gt16", data=tmp_path).pairs()
    with pytest.raises(NonrigidError, match="leave out --data"):
        read_plan("demo", data=tmp_path)


def test_each_accuracy_is_a_run_with_its_own_tolerances(tmp_path: Path) -> None:
    (tmp_path / "p.toml").write_text(GOOD.replace("[data]", 'accuracy = ["low", "high"]\nrun_seconds = 90\n[data]'))
    plan = read_plan(tmp_path / "p.toml")
    assert [(word, limits.tolerance, limits.seconds) for word, limits in plan.variants()] == [
        ("low", 1e-3, 5),
        ("high", 1e-9, 5),
    ]
    assert plan.run_seconds == 90
    (tmp_path / "p.toml").write_text(
        GOOD.replace("[data]", 'accuracy = "low"\n[data]').replace("seconds = 5", "tolerance = 1e-3")
    )
    with pytest.raises(NonrigidError, match=r"both accuracy = \['low'\] and \[limits\] tolerance"):
        read_plan(tmp_path / "p.toml")
