"""What a motion diagnosis is judged on: named records, channel by channel, or nothing."""

import numpy as np
import pytest
from motion_records import ARM, campaign

from picchio.campaign.campaign import Campaign
from picchio.campaign.record import Record
from picchio.core.errors import InputError
from picchio.diagnosis.motion.conclude.holdout import channel_verdict
from picchio.diagnosis.motion.diagnosis import diagnose_motion
from picchio.prediction.motion.readings import angle_noise, resolution
from picchio.robot.loading.load import load_robot


@pytest.fixture(scope="module")
def robot():
    return load_robot(ARM)


@pytest.fixture(scope="module")
def rubbing(robot):
    return campaign(robot, {("coulomb", 0): 150.0, ("coulomb", 1): 150.0}, seed=5)


def changed(source, file, channel, change):
    """The campaign with one channel of one record changed."""
    records = []
    for record in source:
        read = record.read()
        time = read.pop("time")
        if record.file == file:
            read[channel] = change(read[channel])
        records.append(Record.from_arrays(record.file, time, read, kind="motion"))
    return Campaign.from_records(records)


def test_of_one_record_nothing_is_held_out(robot, rubbing):
    found = diagnose_motion(robot, Campaign.from_records([next(iter(rubbing))]))
    assert found.gain.held_out_records == ()
    assert found.extra["channels"] == []


def test_records_are_held_out_by_name(robot, rubbing):
    found = diagnose_motion(robot, rubbing, held_out=["m0.csv"])
    assert (found.gain.train_records, found.gain.held_out_records) == (("m1.csv",), ("m0.csv",))
    rows = {row["channel"]: row for row in found.extra["channels"]}
    assert set(rows) == {f"torque.{name}" for name in robot.joint_names}
    assert rows["torque.joint_1"]["after"] < 0.5 * rows["torque.joint_1"]["before"]


@pytest.mark.parametrize(
    ("sides", "value"),
    [
        ({"train": ["m7.csv"]}, "m7.csv"),
        ({"train": ["m0.csv"], "held_out": ["m0.csv"]}, "m0.csv"),
        ({"held_out": ["m0.csv", "m1.csv"]}, "m0.csv, m1.csv"),
    ],
)
def test_records_that_cannot_be_split_so(robot, rubbing, sides, value):
    with pytest.raises(InputError) as refused:
        diagnose_motion(robot, rubbing, **sides)
    assert refused.value.value == value


def test_a_cause_that_worsens_its_own_channel_is_withdrawn(robot, rubbing):
    """Friction that the record held out has with the other sign."""
    torque = next(iter(rubbing)).read()
    twice = 2.0 * 150.0 * np.sign(np.gradient(torque["motor_position.joint_2"]))
    other = changed(rubbing, "m0.csv", "torque.joint_2", lambda x: x - twice)
    found = diagnose_motion(robot, other, train=["m1.csv"], held_out=["m0.csv"])
    every = {(c.effect, c.target) for c in found.causes} | set(found.leads)
    assert ("coulomb_friction", "joint_1") in every
    assert ("coulomb_friction", "joint_2") not in {(c.effect, c.target) for c in found.causes}
    dropped = {(d["effect"], d["target"]) for d in found.extra["dropped"]}
    assert ("coulomb_friction", "joint_2") in dropped
    row = next(r for r in found.extra["channels"] if r["channel"] == "torque.joint_2")
    assert row["after"] <= 1.01 * row["before"]


def test_one_channel_does_not_veto_the_others(robot, rubbing):
    """A joint whose torque is hardly ever reported; the friction of the others is claimed."""
    silent = rubbing
    for file in ("m0.csv", "m1.csv"):
        silent = changed(silent, file, "torque.joint_3", lambda x: 1e-3 * x)
    found = diagnose_motion(robot, silent)
    assert found.verdict == "partial"
    claimed = {(c.effect, c.target) for c in found.causes}
    assert {("coulomb_friction", "joint_1"), ("coulomb_friction", "joint_2")} <= claimed
    assert not any(target == "joint_3" for _, target in claimed)
    assert "torque.joint_3" in found.note


def test_noise_is_at_least_what_rounding_makes():
    slow = np.round(3.0 * np.sin(np.linspace(0.0, 1.0, 4000)), 2)
    assert resolution(slow) == pytest.approx(0.01)
    # A rounding error is uniform: its standard deviation is the step over the root of 12.
    assert angle_noise(slow) == pytest.approx(0.01 / np.sqrt(12.0), rel=0.01)
    assert resolution(np.full(100, 0.3)) == 0.0


@pytest.mark.parametrize(
    ("before", "after", "verdict"),
    [
        (1.1, 1.0, "nothing-wrong"),
        (9.0, 1.1, "named"),
        (9.0, 3.0, "partial"),
        (9.0, 6.0, "unexplained"),
        (9.0, 12.0, "unexplained"),
    ],
)
def test_a_channels_verdict(before, after, verdict):
    assert channel_verdict(before, after, 1.0) == verdict
