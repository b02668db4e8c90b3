"""Robots, tasks, guns and saved results side by side: what differs, exactly that."""

from __future__ import annotations

import json
import math

import pytest

import picchio
from picchio.core.errors import InputError

TASK = """format = "picchio-task/1"
hits_per_rivet = 3
excitation = {{ kind = "pulse_train", force = {force}, period = 0.040, width = 0.004 }}
operation = [{{ name = "forward", direction = [1.0, 0.0, 0.0], poses = [[0.0, 0.5, -0.8]] }}]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("compared")
    for name, force in (("soft", 300.0), ("strong", 600.0)):
        (path / f"{name}.toml").write_text(TASK.format(force=force))
        robot = picchio.load_robot("fanuc_like_3dof")
        found = picchio.assess(robot, picchio.load_task(path / f"{name}.toml", robot))
        (path / f"{name}.json").write_text(json.dumps(found.to_dict()))
    return path


def test_tasks_and_their_saved_results_say_the_same(folder):
    tasks = picchio.compare(folder / "soft.toml", folder / "strong.toml", robot="fanuc_like_3dof")
    saved = picchio.compare(folder / "soft.json", folder / "strong.json")
    assert [row.key for row in tasks.inputs] == ["task.forward.excitation.force"]
    assert tasks.inputs[0].values == (300.0, 600.0) and tasks.inputs[0].unit == "N"
    ours, theirs = tasks.to_dict(), saved.to_dict()
    assert ours["format"] == "picchio-comparison/1"
    assert ours["inputs"] == theirs["inputs"] and ours["results"] == theirs["results"]
    peaks = {row.key: row for row in tasks.figures}["joints.joint_2.peak_deflection"]
    assert peaks.ratios[1] == pytest.approx(2.0)
    assert peaks.label == "joint_2: peak deflection, rad"
    assert [item["verdict"]["status"] for item in ours["items"]] == ["safe", "safe"]


def test_the_same_differs_in_nothing(folder):
    found = picchio.compare(folder / "soft.json", folder / "soft.json")
    assert found.inputs == found.results == ()
    assert [item.name for item in found.items] == [f"{folder / 'soft.json'} (1)",
                                                   f"{folder / 'soft.json'} (2)"]  # fmt: skip


@pytest.mark.parametrize(
    ("before", "after", "label", "shown"),
    [
        ([], [("payload", "tool", {"mass": 2.0})], "effects payload tool", ("-", "mass 2")),
        (
            [("backlash", "joint_1", {"gap": 1e-3})],
            [("backlash", "joint_1", {"gap": 2e-3})],
            "effects backlash joint_1 parameters: gap",
            ("0.001", "0.002"),
        ),
        (
            [("payload", "tool", {"mass": 2.0})],
            [("payload", "tool", {"mass": 2.0}), ("cable", "link_3", {"k": 5.0, "c": 1.0})],
            "effects cable link_3",
            ("-", "k 5, c 1"),
        ),
        (
            [("joint_stiffness", "joint_1", {"factor": 0.5})],
            [("joint_stiffness", "joint_2", {"factor": 0.5})],
            "effects joint_stiffness joint_2",
            ("-", "factor 0.5"),
        ),
    ],
)
def test_an_effect_that_differs_is_told_with_its_numbers(before, after, label, shown):
    def content(effects):
        rows = [{"effect": e, "target": t, "parameters": p} for e, t, p in effects]
        return {"format": "picchio-x/1", "inputs": {"effects": rows}}

    found = picchio.compare(content(before), content(after))
    assert (label, shown) in [(row.label, row.shown) for row in found.entered]


def test_a_list_of_lives_is_shown_as_one():
    def content(p10):
        return {"format": "picchio-x/1", "sampling": {"p10": p10}}

    for other in ([1.0, 3.0], None, [1.0, 2.0, 3.0, 4.0, 5.0]):
        found = picchio.compare(content([1.0, 2.0]), content(other))
        assert found.results[0].shown[0] == "1, 2"


def test_robots_whose_joints_have_other_names(folder):
    """What one of them lacks is a row, not twenty; no number is made up."""
    joints = {"a": {"k": 1.0, "c": 2.0}, "b": {"k": 3}}
    ours = {"format": "picchio-x/1", "inputs": {"joint": joints},
            "joints": [{"name": "a", "peak": 1.0}]}  # fmt: skip
    other = {"format": "picchio-x/1", "inputs": {"joint": {"b": {"k": 4}}},
             "joints": [{"name": "b", "peak": 0.0}]}  # fmt: skip
    found = picchio.compare(ours, other)
    assert [(row.label, row.shown) for row in found.entered] == [
        ("joint a", ("k 1, c 2", "-")), ("joint b: k", ("3", "4")),
    ]  # fmt: skip
    assert [row.values for row in found.results] == [(1.0, None), (None, 0.0)]
    assert all(math.isnan(row.ratios[1]) for row in found.results)


def test_an_estimate_is_no_lone_number():
    """In place of its life stands the interval; a stated one stays as it is."""
    life = {"p10": 2e3, "p50": 4e4, "p90": None}
    guess = {"format": "picchio-x/1", "rivets_to_failure": 4e4, "estimated": True, "life": life}
    sure = {"format": "picchio-x/1", "rivets_to_failure": 5e4}
    rows = {row.key: row.shown for row in picchio.compare(guess, sure).results}
    assert rows["rivets_to_failure"] == ("2,000 to unlimited", "50,000")


def test_a_slide_has_the_units_of_a_slide():
    sides = [{"format": "picchio-x/1", "joints": [
        {"name": "rail", "kind": "prismatic", "peak_deflection": x, "peak_torque": x},
        {"name": "hinge", "kind": "revolute", "peak_deflection": x, "peak_torque": x},
    ]} for x in (1.0, 2.0)]  # fmt: skip
    units = [row.unit for row in picchio.compare(*sides).results]
    assert units == ["m", "N", "rad", "N m"]


@pytest.mark.parametrize(
    ("items", "options", "words"),
    [
        (["soft.toml"], {}, "at least two"),
        (["soft.toml", "strong.toml"], {}, "--robot"),
        (["soft.json", "other.json"], {}, "one format"),
        (["soft.json", "new.json"], {}, "unknown version"),
        (["soft.json", "none.json"], {}, "format"),
        (["soft.json", "list.json"], {}, "object"),
        (["soft.json", "soft.json"], {"flex": "x.toml"}, "--robot"),
    ],
)
def test_what_cannot_be_compared_is_refused(folder, items, options, words):
    (folder / "other.json").write_text('{"format": "picchio-envelope/1"}')
    (folder / "new.json").write_text('{"format": "picchio-assessment/2"}')
    (folder / "none.json").write_text("{}")
    (folder / "list.json").write_text("[]")
    with pytest.raises(InputError, match=words):
        picchio.compare(*(folder / item for item in items), **options)


def test_page_and_table(folder, in_process, tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    hostile = json.loads((folder / "soft.json").read_text())
    hostile["verdict"]["reasons"] = ["<script>alert(1)</script>"]
    (tmp_path / "<b>.json").write_text(json.dumps(hostile))
    done = in_process("compare", "-v", tmp_path / "<b>.json", folder / "strong.json", "--report",
                      tmp_path / "page.html", "--json", tmp_path / "out.json")  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "task forward excitation: force, N" in done.stdout
    page = (tmp_path / "page.html").read_text()
    assert "<script>" not in page and "&lt;b&gt; side" not in page and "&lt;b&gt;" in page
    assert "task forward excitation: force, N" in page
    assert json.loads((tmp_path / "out.json").read_text())["inputs"][0]["values"] == [300.0, 600.0]
