"""`picchio simulate` and `picchio check --report`: what they write, and how they fail."""

import json

import pytest

from picchio.campaign.campaign import load_campaign
from picchio.cli.main import run

PLAN = """\
format = "picchio-plan/1"
poses = [[0.3, 0.5, -0.8], { joint_2 = 0.9, joint_3 = -0.4 }]
directions = [[1, 0, 0], [0.0, 1.0, 1.0]]
levels = [150.0, 300.0]
hits = 6
sample_rate = 1000.0
length = 0.6
seed = 4
[excitation]
period = 0.040
width = 0.004
[[sensor]]
channels = "deflection"
noise = 2.0
unit = "urad"
[[sensor]]
channels = "accelerometer"
noise = 0.02
[[effect]]
effect = "payload"
target = "tool"
parameters = { mass = 3.0 }
"""


@pytest.fixture
def plan(tmp_path):
    path = tmp_path / "plan.toml"
    path.write_text(PLAN)
    return path


def simulate(plan, to, *more):
    return run(["simulate", "fanuc_like_3dof", "--plan", str(plan), "--to", str(to), *more])


def test_a_campaign_is_written(plan, tmp_path, capsys):
    assert simulate(plan, tmp_path / "c", "--json", "-") == 0
    said = json.loads(capsys.readouterr().out)
    assert said["format"] == "picchio-simulation/1"
    assert said["provenance"]["seed"] == 4
    assert "plan.toml" in [entry["file"] for entry in said["provenance"]["inputs"]]
    campaign = load_campaign(tmp_path / "c")
    assert len(campaign.records) == len(said["records"]) == 8
    assert campaign.robot == "fanuc_like_3dof"
    assert campaign.table.provenance["effects"][0]["parameters"] == {"mass": 3.0}
    record = campaign["r01.csv"]
    assert record.channels == tuple(said["channels"])
    assert record.clock.samples == said["samples"] == 750
    quiet = record["deflection.joint_2"][record.time < 0]
    assert quiet.std() == pytest.approx(2e-6, rel=0.3)


def test_the_seed_can_be_given_and_parquet_asked_for(plan, tmp_path):
    assert simulate(plan, tmp_path / "a", "--seed", "9", "--parquet") == 0
    campaign = load_campaign(tmp_path / "a")
    assert campaign.records[0].file == "r01.parquet"
    assert campaign.table.provenance["seed"] == 9


def test_a_campaign_is_not_overwritten_unawares(plan, tmp_path, capsys):
    assert simulate(plan, tmp_path / "c") == 0
    before = (tmp_path / "c" / "r01.csv").read_bytes()
    assert simulate(plan, tmp_path / "c", "--seed", "1") == 2
    assert "exists here already" in capsys.readouterr().err
    assert (tmp_path / "c" / "r01.csv").read_bytes() == before
    assert simulate(plan, tmp_path / "c", "--seed", "1", "--overwrite") == 0
    assert (tmp_path / "c" / "r01.csv").read_bytes() != before


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ("hits = 6", "hitz = 6", "hitz"),
        ("1000.0", "-1.0", "sample_rate"),
        ('"deflection"', '"deflektion"', "sensor[0]"),
        ('"payload"', '"payloud"', "payload"),
        ("mass = 3.0", "mess = 3.0", "mess"),
        ("joint_3 = -0.4", "joint_9 = -0.4", "joint_9"),
        ('"urad"', '"mm"', "rad"),
        ("0.004", "0.05", "width"),
        ("[1, 0, 0]", "[0, 0, 0]", "directions"),
        ("picchio-plan/1", "picchio-plan/2", "picchio-plan/2"),
        ("levels = [150.0, 300.0]", "levels = []", "levels"),
        ("poses = [[0.3", "poses = [[nan", "finite"),
        ('[[sensor]]\nchannels = "accel', '[sensors]\nchannels = "accel', "sensors"),
    ],
)
def test_one_clear_line_and_nothing_written(plan, tmp_path, capsys, old, new, word):
    assert old in PLAN
    plan.write_text(PLAN.replace(old, new, 1))
    assert simulate(plan, tmp_path / "c") == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    (line,) = captured.err.strip().splitlines()
    assert "plan.toml" in line
    assert word in line
    assert [p.name for p in tmp_path.iterdir()] == ["plan.toml"]


def test_what_was_simulated_can_be_checked_and_reported(plan, tmp_path, capsys):
    assert simulate(plan, tmp_path / "c") == 0
    page = tmp_path / "page.html"
    assert run(["check", str(tmp_path / "c"), "--report", str(page)]) == 0
    html = page.read_text()
    assert "held against its measurements" in html
    assert "payload" not in html
    assert "campaign.toml" in html


def test_a_report_needs_a_robot(plan, tmp_path, capsys):
    assert simulate(plan, tmp_path / "c") == 0
    page = tmp_path / "page.html"
    assert run(["check", str(tmp_path / "c"), "--no-robot", "--report", str(page)]) == 2
    assert "--report" in capsys.readouterr().err
    assert not page.exists()
