"""`picchio place` end to end: what it prints and writes, and what it refuses."""

import json

import pytest

import picchio
from picchio.cli.main import run

TASK = """format = "picchio-task/1"   # a comment that stays
[excitation]
force = 300.0
period = 0.04
width = 0.004
[[operation]]
name = "forward"
direction = [1.0, 0.0, 0.0]
branch = "elbow-down"
points = [[1.35, -0.3, 0.5], [1.35, 0.3, 0.5]]
[[operation]]
name = "slow"
direction = [0.0, 0.0, 1.0]
period = 0.05
poses = [[0.0, 0.5, -1.0]]
"""
QUICK = ("--placements", "5", "--move", "0.1,0.1,0.1,10")


@pytest.fixture
def task(tmp_path):
    file = tmp_path / "task.toml"
    file.write_text(TASK)
    return file


def test_json_and_the_moved_task(tmp_path, task, capsys):
    moved, told = tmp_path / "moved.toml", tmp_path / "life.json"
    code = run(
        [
            "place",
            "fanuc_like_3dof",
            "--task",
            str(task),
            "--json",
            "-",
            "--out",
            str(moved),
            *QUICK,
        ]
    )
    assert code == 0
    found = json.loads(capsys.readouterr().out)
    assert found["format"] == "picchio-placement/1"
    assert found["provenance"]["inputs"] and found["provenance"]["seed"] == 0
    assert found["start"]["rivets_to_failure"] is None and found["gain"]["life"] is None
    assert found["gain"]["utilisation"] >= 1.0
    assert len(found["off"]) == 6 and len(found["best"]["poses"]) == 3
    assert max(map(abs, found["best"]["work"]["shift"])) <= 0.1
    assert abs(found["best"]["work"]["heading"]) <= 0.1746  # 10 deg
    assert "a comment that stays" in moved.read_text()
    arguments = ["assess", "fanuc_like_3dof", "--task", str(moved), "--json", str(told)]
    assert run(arguments) == 0
    assessed = json.loads(told.read_text())
    for joint, use in zip(assessed["joints"], found["best"]["joints"], strict=True):
        assert joint["utilisation"] == pytest.approx(use["utilisation"], rel=1e-6)
    again = picchio.load_task(moved, picchio.load_robot("fanuc_like_3dof"))
    assert [op.excitation.period for op in again.operations] == [0.04, 0.05]


def test_what_people_read(task, capsys):
    arguments = ["place", "fanuc_like_3dof", "--task", str(task), *QUICK]
    assert run([*arguments, "--period-range", "0.03,0.05", "--sn-curve", "nie-2016"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    for part in ("shift by", "or base", "a blow every", "Gain: the weakest joint lives",
                 "other poses (another branch, say) at the old place",
                 "5 cm beside the best place", "no collision meshes"):  # fmt: skip
        assert part in shown


@pytest.mark.parametrize(
    ("options", "part"),
    [
        (["--move", "1,2"], "--move: must be 4 numbers"),
        (["--move", "a,b,c,d"], "numbers separated by commas"),
        (["--move=-1,0,0,0"], "--move"),
        (["--period-range", "0.05,0.04"], "--period-range"),
        (["--off", "0"], "--off"),
        (["--margin", "nan"], "--margin"),
        (["--placements", "0"], "--placements"),
        (["--seed", "-1"], "--seed"),
        (["--out", "TASK"], "overwrite an input"),
    ],
)
def test_bad_options(task, capsys, options, part):
    given = [str(task) if option == "TASK" else option for option in options]
    assert run(["place", "fanuc_like_3dof", "--task", str(task), *given]) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert part in said[-1] and said[-1].startswith("picchio: error: ")
