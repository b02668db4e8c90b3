"""Task files: what they mean, and how bad ones are refused."""

import numpy as np
import pytest

import picchio
from picchio.core.errors import InputError

GOOD = """
format = "picchio-task/1"
hits_per_rivet = 12
[excitation]
kind = "pulse_train"
force = 300.0
period = 0.040
width = 0.004
[[operation]]
name = "forward"
direction = [1.0, 0.0, 0.0]
poses = [[0.0, 0.5, -0.8]]
"""


@pytest.fixture(scope="module")
def robot():
    return picchio.load_robot("fanuc_like_3dof")


def load(tmp_path, robot, text):
    path = tmp_path / "task.toml"
    path.write_text(text)
    return picchio.load_task(path, robot)


def test_what_a_task_says(tmp_path, robot):
    (tmp_path / "force.csv").write_text("time [s],force [N]\n0,0\n0.002,400\n0.004,0\n")
    text = (
        GOOD
        + """
rivets = 4
[[operation]]
name = "up"
direction = [0.0, 0.0, 2.0]
hits_per_rivet = 5
force = 500.0
preload = 20.0
poses = [{ joint_2 = 0.5 }, [0.1, 0.2, 0.3]]
[[operation]]
name = "sine"
direction = [0.0, 1.0, 0.0]
excitation = { kind = "half_sine_train", width = 0.006 }
points = [[1.35, 0.25, 0.65]]
branch = "elbow-up"
[[operation]]
name = "measured"
direction = [0.0, 1.0, 0.0]
poses = [[0.0, 0.5, -0.8]]
excitation = { kind = "measured", file = "force.csv" }
"""
    )
    # A measured history has no use for force and width: they must go from the shared table.
    with pytest.raises(InputError, match="has no use"):
        load(tmp_path, robot, text)
    task = load(tmp_path, robot, text[: text.rindex("[[operation]]")])
    forward, up, sine = task.operations
    assert (forward.hits_per_rivet, forward.rivets) == (12, 4)
    assert up.hits_per_rivet == 5
    assert (up.excitation.force, up.excitation.preload) == (500.0, 20.0)
    assert up.direction.tolist() == [0.0, 0.0, 1.0]
    assert up.poses.tolist() == [[0.0, 0.5, 0.0], [0.1, 0.2, 0.3]]
    assert isinstance(sine.excitation, picchio.HalfSineTrain)
    assert sine.excitation.force == 300.0
    np.testing.assert_allclose(
        robot.state(sine.poses[0]).tool_position, [1.35, 0.25, 0.65], atol=1e-9
    )
    assert task.rivets_per_pass == 4 + 2 + 1


def test_a_measured_blow(tmp_path, robot):
    (tmp_path / "force.csv").write_text("time [s],force [N]\n0,0\n0.002,400\n0.004,0\n")
    text = GOOD.replace(
        'kind = "pulse_train"\nforce = 300.0\nperiod = 0.040\nwidth = 0.004',
        'kind = "measured"\nfile = "force.csv"\nperiod = 0.04',
    )
    task = load(tmp_path, robot, text)
    assert task.operations[0].excitation.peak_force == 400.0
    assert {path.name for path in task.files} == {"task.toml", "force.csv"}


@pytest.mark.parametrize(
    ("old", "new", "parts"),
    [
        ("picchio-task/1", "picchio-task/2", ["format", "picchio-task/1"]),
        ("hits_per_rivet = 12", "hits_per_rivet = 0", ["hits_per_rivet", "0"]),
        ("hits_per_rivet = 12", "hits_per_rivett = 1", ["'hits_per_rivett'", "hits_per_rivet"]),
        ("force = 300.0", "forse = 300.0", ["excitation", "'forse'", "did you mean 'force'"]),
        ("force = 300.0", "force = nan", ["excitation.force", "nan"]),
        ("force = 300.0\n", "", ["excitation.force"]),
        ("width = 0.004", "width = 0.04", ["excitation.width", "shorter than its period"]),
        ('"pulse_train"', '"pulses"', ["excitation.kind", "'pulse_train'", "'pulses'"]),
        ("[1.0, 0.0, 0.0]", "[0.0, 0.0, 0.0]", ["operation[0].direction", "zero length"]),
        ("[1.0, 0.0, 0.0]", "[1.0, 0.0]", ["operation[0].direction", "three"]),
        ("[1.0, 0.0, 0.0]", "[1.0, nan, 0.0]", ["operation[0].direction", "nan"]),
        ("[[0.0, 0.5, -0.8]]", "[[0.0, 0.5]]", ["operation[0].poses[0]", "3"]),
        ("[[0.0, 0.5, -0.8]]", "[]", ["operation[0].poses", "empty"]),
        ("[[0.0, 0.5, -0.8]]", "[{ joint_9 = 1 }]", ["poses[0]", "joint_9", "joint_1"]),
        ("poses = [[0.0, 0.5, -0.8]]", "points = [[9, 0, 0]]", ["points[0]", "9"]),
        ("poses = [[0.0, 0.5, -0.8]]", "points = [[1, 0]]", ["points[0]", "three coordinates"]),
        ("poses = [[0.0, 0.5, -0.8]]", "", ["operation[0]", "poses or points"]),
        (
            "poses = [[0.0, 0.5, -0.8]]",
            'points = [[1.35, 0, 0.4]]\nbranch = "elbow-left"',
            ["elbow-left", "elbow-up"],
        ),
        ("poses = [[0.0, 0.5, -0.8]]", 'poses = [["a", 0, 0]]', ["poses[0]", "'a'"]),
    ],
)
def test_bad_tasks_are_refused_in_one_line(tmp_path, robot, old, new, parts):
    assert old in GOOD
    with pytest.raises(InputError) as caught:
        load(tmp_path, robot, GOOD.replace(old, new, 1))
    message = str(caught.value)
    assert "\n" not in message
    assert "task.toml" in message
    for part in parts:
        assert part in message, message


def test_two_operations_of_one_name(tmp_path, robot):
    again = GOOD[GOOD.index("[[operation]]") :]
    with pytest.raises(InputError, match="names two operations"):
        load(tmp_path, robot, GOOD + again)
