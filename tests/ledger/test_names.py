"""Logs whose series are named as channels and joints are counted without a mapping."""

import numpy as np
import pandas
import pytest
import shift

import picchio
from picchio.campaign.importing.importer import read_raw
from picchio.campaign.importing.mapping import read_mapping
from picchio.campaign.importing.named import named
from picchio.campaign.importing.template import mapping_template, write_mapping
from picchio.core.errors import InputError
from picchio.ledger.count import blows_held, streams_of
from picchio.ledger.store import Ledger
from picchio.studies.tasks import load_task

NAME = "fanuc_like_3dof"
JOINTS = ("joint_1", "joint_2", "joint_3")


def log(path, made, *, rate=5000.0, axes=("x", "y", "z")):
    """A CSV with dates as text, angles in deg, forces in kN."""
    table = shift.log(made, np.random.default_rng(0), rate=rate)
    stamps = pandas.to_datetime(table["stamp"], utc=True).dt.strftime("%Y-%m-%dT%H:%M:%S.%fZ")
    columns = {"when": table["stamp"], "time": stamps}
    columns |= {f"joint_{k} [deg]": np.degrees(table[f"q{k}"]) for k in (1, 2, 3)}
    columns |= {f"force.{axis} (kN)": table[f"f{axis}"] / 1000.0 for axis in axes}
    del columns["when"]
    pandas.DataFrame(columns).to_csv(path, index=False)


@pytest.fixture
def robot():
    return picchio.load_robot(NAME)


def test_a_log_with_names_and_units_needs_no_mapping(tmp_path, robot):
    made = shift.rivets(1, np.random.default_rng(3))
    (tmp_path / "logs").mkdir()
    # The axes in any order: they are told by their names.
    log(tmp_path / "logs" / "day.csv", made, axes=("z", "x", "y"))
    (tmp_path / "curve.toml").write_text(shift.CURVE)
    (tmp_path / "task.toml").write_text(
        'format = "picchio-task/1"\nhits_per_rivet = 12\n[excitation]\nkind = "pulse_train"\n'
        'force = 750.0\nperiod = 0.04\nwidth = 0.004\n[[operation]]\nname = "up"\n'
        f"direction = [0.0, 0.0, 1.0]\nposes = [{shift.POSES[0].tolist()}]\n"
    )
    how = {"sn_curve": str(tmp_path / "curve.toml"), "task": tmp_path / "task.toml"}
    found = picchio.count(robot, tmp_path / "logs", tmp_path / "l", **how)
    assert found.blows == 12 and found.seen_share == 1.0
    assert any("joint_2 [deg] is position.joint_2" in note for note in found.notes)
    # The same by a mapping, whose axes are the tool's, too.
    mapping = tmp_path / "m.toml"
    write_mapping(tmp_path / "logs" / "day.csv", mapping, robot.joint_names, robot.tree.links)
    assert len(read_mapping(mapping).channel) == 6
    again = picchio.count(robot, tmp_path / "logs", tmp_path / "k", mapping=mapping, **how)
    assert (again.counted.totals.damage == found.counted.totals.damage).all()
    # In the tool's axes the force has turned with it, and is as large.
    with Ledger(tmp_path / "l", NAME) as book:
        task, streams = load_task(how["task"], robot), streams_of(book)[0]
        blows = blows_held(book, streams, found.model, task, shift.BEGIN)
        peak = max(blow.peak for blow in blows)
    assert peak == pytest.approx(made[0].peaks.max(), rel=0.02)


def test_what_is_asked_is_told_with_what_to_run(tmp_path, robot):
    made = shift.rivets(1, np.random.default_rng(3))
    log(tmp_path / "day.csv", made, rate=1000.0, axes=("x",))
    text = (tmp_path / "day.csv").read_text()
    (tmp_path / "day.csv").write_text(text.replace("force.x (kN)", "force [kN]"))
    with pytest.raises(InputError, match=r"valid: forward, left, upward.*picchio import.*--robot"):
        picchio.count(robot, tmp_path / "day.csv", tmp_path / "l")
    (tmp_path / "day.csv").write_text(text.replace("joint_", "axis "))
    with pytest.raises(InputError, match=r"no name says.*angles; valid: joint_1.*picchio import"):
        picchio.count(robot, tmp_path / "day.csv", tmp_path / "l")
    with pytest.raises(InputError, match=r"nothere: no such file or folder"):
        picchio.count(robot, tmp_path / "nothere", tmp_path / "l")


def test_nothing_is_guessed(tmp_path):
    table = pandas.DataFrame(np.linspace([0.0] * 9, [200.0] * 9, 50), columns=[
        "t [s]", "joint_1", "joint_2 [deg]", "joint_2 [rad]", "joint_3 [V]", "force [mm]",
        "accelerometer.gripper.x [g]", "temperature.joint_1 [degC]", "joint_3 [rad/s]",
    ])  # fmt: skip
    table["joint_2 [rad]"] /= 100.0
    table.to_csv(tmp_path / "log.csv", index=False)
    raw = read_raw(tmp_path / "log.csv")
    found = {one.series: one for one in named(raw, JOINTS, ("tool", *JOINTS))}
    assert {name: one.to for name, one in found.items() if one.to} == {
        "joint_2 [deg]": "position.joint_2", "temperature.joint_1 [degC]": "temperature.joint_1",
        "joint_3 [rad/s]": "velocity.joint_3",
    }  # fmt: skip
    assert "deg or rad" in found["joint_1"].why  # beyond a turn, and no unit
    assert "position.joint_2 already" in found["joint_2 [rad]"].why
    assert "no unit of a channel" in found["joint_3 [V]"].why
    assert "displacement" in found["force [mm]"].why  # what mm may be
    assert "robot has no gripper" in found["accelerometer.gripper.x [g]"].why
    text = mapping_template(raw)
    assert '\n[[channel]]\nfrom = "accelerometer.gripper.x [g]"\n' in text  # robot not known
    assert '\n# from = "force [mm]"\n' in text


def test_an_accelerometer_that_reads_gravity_tells_blows(tmp_path, robot):
    """A simulated accelerometer in the tool's axes, gravity included; the task is as in the log."""
    rng = np.random.default_rng(4)
    made = shift.rivets(1, rng, places=1)
    pose, length = shift.POSES[made[0].place], 2.5
    turn = robot.frame_placement(pose, "tool")[1]
    reading = shift.felt(NAME, made, length)[::5] + np.array([0.0, 0.0, 9.81])
    reading = reading @ turn + 0.05 * rng.standard_normal(reading.shape)
    stamps = shift.BEGIN + 500_000 * np.arange(len(reading))
    columns = dict(zip([f"accelerometer.tool.{axis} [m/s^2]" for axis in "xyz"], reading.T,
                       strict=True))  # fmt: skip
    table = pandas.DataFrame({"stamp": stamps, **dict(zip(JOINTS, pose, strict=True)), **columns})
    table.to_csv(tmp_path / "log.csv", index=False)
    (tmp_path / "task.toml").write_text(
        'format = "picchio-task/1"\nhits_per_rivet = 12\n[excitation]\nkind = "half_sine_train"\n'
        "force = 2000.0\nperiod = 0.04\nwidth = 0.005\n"
        + "".join(
            f'[[operation]]\nname = "{name}"\ndirection = {along}\nposes = [{pose.tolist()}]\n'
            for name, along in (("x", [1.0, 0.0, 0.0]), ("z", [0.0, 0.0, 1.0]))
        )
    )
    found = picchio.count(robot, tmp_path / "log.csv", tmp_path / "l", task=tmp_path / "task.toml")
    with Ledger(tmp_path / "l", NAME) as book:
        work = load_task(tmp_path / "task.toml", robot)
        blows = list(blows_held(book, streams_of(book)[0], found.model, work, shift.BEGIN))
    assert len(blows) == 12
    assert all((blow.direction == [0.0, 0.0, 1.0]).all() for blow in blows)
    peaks = np.array([blow.peak for blow in blows])
    np.testing.assert_allclose(peaks, made[0].peaks, rtol=0.15)


@pytest.mark.parametrize("names", ["q{}", "joint_{}", "actual_q_{}", "J{}", "q{} [deg]"])
@pytest.mark.parametrize(
    "switch", ["tool_on", "digital_out", "actual_digital_output_bits", "DO[3]"]
)
def test_joints_and_the_switch_are_guessed_without_a_robot(tmp_path, names, switch):
    series = {names.format(k): np.linspace(0.0, 0.1 * k, 40) for k in (1, 2, 3)}
    series |= {switch: np.arange(40) // 20 % 2, "tool_ready": np.ones(40)}
    pandas.DataFrame({"time": np.arange(40) / 100.0, **series}).to_csv(
        tmp_path / "a.csv", index=False
    )
    found = {one.series: one for one in named(read_raw(tmp_path / "a.csv"))}
    assert [found[n].to for n in series] == [*(f"position.joint_{k}" for k in (1, 2, 3)),
                                             "trigger", ""]  # fmt: skip
    assert all("place in an array" in found[names.format(k)].why for k in (1, 2, 3))
    assert "switch" in found[switch].why


@pytest.mark.parametrize(
    "columns",
    [
        {"tool_on": [0, 1, 0, 1], "gun_active": [0, 0, 1, 1]},  # two: which one nobody knows
        {"digital_out": [0, 0, 0, 0]},
        {"digital_out_bits": [0, 64, 0, 64]},
        {"a1": [0.1, 0.2, 0.3, 0.4], "a2": [0.1, 0.2, 0.3, 0.4]},  # analogue inputs, or joints
        {"q1": [0.1, 0.2, 0.3, 0.4]},
    ],
)
def test_what_may_be_two_things_is_not_guessed(tmp_path, columns):
    pandas.DataFrame({"time": [0.0, 0.1, 0.2, 0.3], **columns}).to_csv(
        tmp_path / "a.csv", index=False
    )
    assert not any(one.to for one in named(read_raw(tmp_path / "a.csv")))
