"""Planned tests: what a record is worth, that the plan ends, and that an arm so tested is known."""

import csv
import json
import math
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import picchio
from picchio.campaign.loadings import read_loadings
from picchio.campaign.record import Record
from picchio.campaign.tables import Tolerance
from picchio.diagnosis.planning.choose import Space, choose
from picchio.diagnosis.planning.kind import Offered, Possible
from picchio.diagnosis.planning.outcome import Life, Outcome, outcome_of
from picchio.diagnosis.planning.plan import _poses
from picchio.diagnosis.planning.static import StaticTest
from picchio.model.effects.registry import effect_class
from picchio.robot.loading.saved_model import saved_model_text
from picchio.studies.default_task import possible_poses, task_of

ARM = "fanuc_like_3dof"


@pytest.fixture(scope="module")
def loads():
    """The independent world of loads."""
    from worlds import loads

    return loads


@pytest.fixture(scope="module")
def frfs():
    """The independent world of responses."""
    from worlds import frfs

    return frfs


@pytest.fixture(scope="module")
def planned():
    return picchio.plan(ARM)


def made_up(seed: int, readings: int) -> tuple[Outcome, list[Offered]]:
    """Numbers drawn at random: two stiffnesses, two damping ratios, three others."""
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((4, 4))
    outcome = Outcome("x", rng.standard_normal((3, 4)), rng.standard_normal((3, 2, 4)), 0.1,
                      root @ root.T)  # fmt: skip
    each = tuple(Possible("static", k, np.zeros(2), np.zeros(3), 1.0, None, (k,))
                 for k in range(6))  # fmt: skip
    slopes = rng.standard_normal((6, 3, readings, 7))
    return outcome, [Offered(StaticTest(), each, ("a", "b", "c"), slopes)]


@pytest.mark.parametrize("readings", [1, 3])
def test_a_gain_is_that_of_normal_equations(readings):
    outcome, kinds = made_up(1, readings)
    space, slopes = Space.of(outcome, kinds), kinds[0].slopes

    def variance(records):
        """By the information matrix and its inverse, robot by robot."""
        found = []
        for s in range(3):
            precise = np.zeros((7, 7))
            precise[:4, :4], precise[4:, 4:] = np.linalg.inv(outcome.covariance), np.eye(3)
            for record in records:
                precise += slopes[record, s].T @ slopes[record, s]
            spread = np.linalg.inv(precise)[:4, :4]
            found += [g @ spread @ g for g in outcome.slope[s]]
        return np.mean(found)

    space.take(4)
    assert space.variance == pytest.approx(variance([4]))
    gains = space.gains()
    for k in (0, 1, 5):
        assert gains[k] == pytest.approx(variance([4]) - variance([4, k]))


def test_what_is_set_up_already_costs_no_time():
    outcome, kinds = made_up(2, 1)
    here = tuple(replace(one, place=0, setting=("dial",)) for one in kinds[0].each)
    choice = choose(outcome, [replace(kinds[0], each=here)], 1e9, worth=0.0)
    assert [one.seconds for one in choice.records] == [120.0, *[30.0] * 5]
    short = choose(outcome, [replace(kinds[0], each=here)], 185.0, worth=0.0)
    assert len(short.records) == 3 and short.why == "the time is up"
    sizes = [short.before, *(one.deviation for one in short.records)]
    assert all(a > b for a, b in zip(sizes[:-1], sizes[1:], strict=True))


def test_the_life_is_that_of_an_assessment():
    """Its slopes, too: by an assessment at a stiffness a little higher and a little lower."""
    robot = picchio.load_robot(ARM)
    task = picchio.load_task(robot.task_path, robot)
    life = Life.of(robot, task)
    step = np.zeros((3, 6))
    step[1, 2], step[2, 2] = 0.05, -0.05
    found = life.parts(step)[1].max(axis=0)
    used = []
    for factor in np.exp([0.0, 0.05, -0.05]):
        joints = list(robot.flexible_joints)
        joints[2] = replace(joints[2], stiffness=factor * joints[2].stiffness)
        varied = replace(robot, flexible_joints=tuple(joints))
        shares = [
            joint["utilisation"] for joint in picchio.assess(varied, task).to_dict()["joints"]
        ]
        used.append(math.log(max(shares)))
    # An assessment takes a specimen that most outlive, a life as a distribution the median one.
    np.testing.assert_allclose(found - found[0], np.array(used) - used[0], atol=1e-6)
    assert abs(used[1] - used[2]) > 0.01


def test_the_plan_keeps_to_time_limits_and_what_drives_bear(planned):
    robot = planned.robot
    assert 0 < planned.seconds <= planned.budget == 1200.0
    for record in planned.records:
        pose = record.candidate.pose
        assert not robot.limit_violations(pose)
        degrees = np.rad2deg(pose)
        np.testing.assert_allclose(degrees, np.round(degrees, 1), atol=1e-9)
    assert planned.choice.after < 0.3 * planned.choice.before
    assert planned.widths[1] < planned.widths[0]
    shorter = picchio.plan(robot, budget="2.5min")
    assert shorter.seconds <= 150.0 and len(shorter.records) < len(planned.records)
    hung = picchio.plan(robot, instruments=["weight", "dial"])
    assert all(one.candidate.direction[2] == -1.0 for one in hung.records)
    # A weight turns no vertical axis: joint 1 stays as it was.
    assert hung.joints[0].after == pytest.approx(hung.joints[0].before, rel=1e-3)


def test_poses_are_possible_ones():
    for name in (ARM, "kinova_gen3"):
        robot = picchio.load_robot(name)
        poses = possible_poses(robot, 30, seed=1)
        assert len(poses) == 30 and len(np.unique(poses, axis=0)) == 30
        assert not any(robot.limit_violations(pose) for pose in poses)
        low = min(robot.tool_position(pose)[2] for pose in poses)
        assert low > robot.mounting.xyz[2]


@pytest.mark.parametrize("name", ["fanuc_like_3dof", "ur10", "abb_irb2600"])
def test_a_person_reaches_the_tool(name):
    robot = picchio.load_robot(name)
    poses, notes = _poses(robot, task_of(robot, None), seed=3)
    heights = [robot.frame_placement(pose, robot.tool_frame)[0][2] for pose in poses]
    assert len(poses) > 5
    assert min(heights) >= 0.2 and max(heights) <= 2.0
    assert not any("above" in note for note in notes)


def test_it_ends_where_nothing_is_left_to_know(tmp_path):
    robot = picchio.load_robot(ARM)
    text = 'format = "picchio-sidecar/1"\n'
    for joint in robot.flexible_joints:
        text += (f"[joint.{joint.name}]\nstiffness = {joint.stiffness}\nstiffness_spread = 1.01\n"
                 "shaft = { radius = 0.0176, length = 0.05, shear_modulus = 79.3e9, "
                 'sn_curve = "paper" }\n')  # fmt: skip
    shipped = tomllib.loads((Path(robot.source).parent / "flex.toml").read_text())
    curve = shipped["joint"]["joint_1"]["shaft"]["sn_curve"]
    (tmp_path / "known.toml").write_text(text.replace('"paper"', f'"{curve}"'))
    found = picchio.plan(ARM, flex=tmp_path / "known.toml")
    assert not found.records and "less than" in found.choice.why
    assert found.widths[0] == found.widths[1]


def test_an_arm_tested_as_planned_is_known(loads, planned):
    """By an arm whose masses, zeros, scale and gauge are a little wrong, stiffness far off."""
    robot = planned.robot
    life = Life.of(robot, picchio.load_task(robot.task_path, robot))
    asked = [
        loads.Asked(one.candidate.pose, one.candidate.direction, one.candidate.force,
                    one.candidate.reads)
        for one in planned.records
    ]  # fmt: skip
    error = {"planned": [], "as many at random": []}
    for seed in (3, 6, 9, 12):
        for name, options in (
            ("planned", {"asked": asked}), ("as many at random", {"loadings": len(asked)})
        ):  # fmt: skip
            world = loads.draw(3, seed, gauge=True, **options)
            record = Record.from_columns("loads.csv", world.columns, kind="static")
            campaign = picchio.Campaign.from_records([record], robot=world.robot)
            found = picchio.identify(world.robot, campaign)
            both = np.zeros((2, 6))
            value = [joint.stiffness.value for joint in found.joints]
            both[0, :3] = np.log(np.array(value) / world.nominal)
            both[1, :3] = np.log(world.truth / world.nominal)
            used = life.parts(both)[1].max(axis=0)
            error[name].append(abs(used[0] - used[1]))
    assert max(error["planned"]) < 0.2
    assert np.median(error["planned"]) < 0.5 * np.median(error["as many at random"])


@pytest.mark.slow
def test_the_form_comes_back_filled_in(loads, planned, tmp_path, in_process):
    """Every number of the form reaches `identify` as the plan has it."""
    folder = tmp_path / "loads"
    done = in_process("plan", ARM, "--to", "loads", "--json", "plan.json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    content = json.loads((tmp_path / "plan.json").read_text())
    assert content["format"] == "picchio-test-plan/1"
    assert len(content["records"]) == len(planned.records)
    assert (folder / "sheet.html").read_text().count("<svg") == len(
        {tuple(one["pose"].values()) for one in content["records"]}
    )
    plan = tomllib.loads((folder / "plan.toml").read_text())
    assert plan["format"] == "picchio-plan/1"
    rows = list(csv.DictReader((folder / "loads.csv").read_text().splitlines()))
    world = loads.draw(3, 3, gauge=True, asked=[
        loads.Asked(np.array(list(one["pose"].values())), np.array(one["direction"]), one["force"],
                    np.array(one["read_direction"]))
        for one in plan["test"]
    ])  # fmt: skip
    for row, reading in zip(rows, world.columns["dial"], strict=True):
        assert row["dial [mm]"] == ""
        row["dial [mm]"] = 1e3 * reading
    with (folder / "loads.csv").open("w", newline="") as stream:
        writer = csv.DictWriter(stream, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    (record,) = picchio.load_campaign(folder).records
    table = read_loadings(record)
    for axis, name in enumerate("xyz"):
        np.testing.assert_allclose(table.force[:, axis], world.columns[f"force.{name}"], atol=1e-4)
    for joint, angle in table.pose.items():
        np.testing.assert_allclose(angle, world.columns[f"pose.{joint}"], atol=1e-9)
    done = in_process("identify", ARM, "--data", "loads", "--out", "flex.toml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    again = in_process("plan", ARM, "--to", "loads", cwd=tmp_path)
    assert again.returncode == 2 and "loads.csv: is there already" in again.stderr
    assert "--overwrite" in again.stderr
    # The plan goes on from what is known: there is little left to do.
    after = picchio.plan(ARM, flex=tmp_path / "flex.toml")
    assert after.widths[0] < 1.2 * planned.widths[1] < 0.3 * planned.widths[0]
    refused = in_process("simulate", ARM, "--plan", "loads/plan.toml", "--to", "x", cwd=tmp_path)
    assert refused.returncode == 2 and "done by hand" in refused.stderr


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"instruments": ["scale", "ruler"]}, "unknown instrument.*'ruler'.*accelerometer"),
        ({"instruments": ["scale"]}, "make no test.*scale or weight with dial or tracker"),
        ({"budget": "a while"}, "must be a time such as 20min"),
        ({"budget": "0min"}, "must be positive"),
        ({"force": -5.0}, "force.*must be positive"),
    ],
)
def test_what_cannot_be_planned(options, words):
    with pytest.raises(picchio.InputError, match=words):
        picchio.plan(ARM, **options)


def test_a_model_with_effects_is_refused(tmp_path, loads):
    """What yields beside the joints is for the tests to tell."""
    saved = tmp_path / "model.toml"
    slack = effect_class("backlash")("joint_2", gap=2e-4)
    saved.write_text(saved_model_text(ARM, [slack.to_dict()]))
    with pytest.raises(picchio.InputError, match=r"not a model with effects.*backlash:joint_2"):
        picchio.plan(saved)
    record = Record.from_columns("a.csv", loads.draw(3, 1).columns, kind="static")
    campaign = picchio.Campaign.from_records([record])
    with pytest.raises(picchio.InputError, match=r"not a model with effects.*backlash:joint_2"):
        picchio.identify(saved, campaign)


def test_a_load_that_no_drive_bears_is_refused():
    with pytest.raises(picchio.InputError, match="loaded so hard"):
        picchio.plan("kuka_iiwa14", force=1e7)


def test_a_pull_is_a_force_along_its_cord():
    columns = {"pose.joint_1": np.zeros(2), "pull": np.array([10.0, 20.0]),
               "pull_direction.x": np.array([0.0, 3.0]), "pull_direction.z": np.array([-2.0, 4.0]),
               "dial": np.zeros(2), "dial_direction.z": np.ones(2)}  # fmt: skip
    table = read_loadings(Record.from_columns("a.csv", columns, kind="static"))
    np.testing.assert_allclose(table.force, [[0.0, 0.0, -10.0], [12.0, 0.0, 16.0]])
    twice = {**columns, "weight": np.ones(2)}
    with pytest.raises(picchio.InputError, match="stated twice"):
        read_loadings(Record.from_columns("a.csv", twice, kind="static"))
    columns["pull_direction.z"] = np.zeros(2)
    with pytest.raises(picchio.InputError, match="which way does it pull"):
        read_loadings(Record.from_columns("a.csv", columns, kind="static"))


def test_candidates_know_their_instruments():
    robot = picchio.load_robot(ARM)
    task = picchio.load_task(robot.task_path, robot)
    outcome = outcome_of(robot, task, draws=4, seed=0)
    poses = possible_poses(robot, 3, seed=0)
    made = {
        hands: StaticTest().candidates(robot, poses, outcome, 300.0, hands, Tolerance())
        for hands in (("scale", "dial"), ("scale", "tracker"))
    }
    gauge, tracker = made.values()
    assert gauge.slopes.shape[2] == 1 and tracker.slopes.shape[2] == 3
    assert all(one.reads is None for one in tracker.each)
    # A finer gauge tells more.
    finer = StaticTest().candidates(robot, poses, outcome, 300.0, ("scale", "dial"),
                                    Tolerance(dial=1e-6))  # fmt: skip
    assert (np.abs(finer.slopes[..., :3]) >= np.abs(gauge.slopes[..., :3]) - 1e-12).all()


@pytest.mark.slow
def test_an_arm_hit_as_planned_is_known(frfs):
    """By functions of an arm whose masses, places and gains are a little wrong."""
    planned = picchio.plan(ARM, instruments=["hammer", "accelerometer"])
    assert len(planned.records) >= 4 and planned.choice.after < 0.2 * planned.choice.before
    asked = [(one.candidate.pose, one.candidate.direction, one.candidate.reads, one.candidate.frame)
             for one in planned.records]  # fmt: skip
    world = frfs.draw(3, 3, asked=asked)
    campaign = picchio.Campaign.from_records([
        Record.from_columns(f"f{k}.csv", columns, kind="frf", **table)
        for k, (columns, table) in enumerate(world.records)
    ])  # fmt: skip
    found = picchio.identify(world.robot, campaign)
    robot = planned.robot
    life = Life.of(robot, picchio.load_task(robot.task_path, robot))
    both = np.zeros((2, 6))
    value = [joint.stiffness.value for joint in found.joints]
    ratio = [joint.damping_ratio.value for joint in found.joints]
    stated = [joint.damping_ratio for joint in robot.flexible_joints]
    both[0] = np.log([*np.array(value) / world.nominal, *np.array(ratio) / stated])
    both[1] = np.log([*world.truth / world.nominal, *world.damping / np.array(stated)])
    used = life.parts(both)[1].max(axis=0)
    assert abs(used[0] - used[1]) < 0.2
    texts = tomllib.loads(planned._campaign())
    assert [one["file"] for one in texts["record"]] == list(planned.files)
    assert not planned._forms()
