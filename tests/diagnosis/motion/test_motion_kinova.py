"""Kinova Gen3: friction per joint, and the ripple's orders, which nobody told."""

import motion_injection as injection
import pytest

import picchio.datasets
from picchio.diagnosis.motion.diagnosis import diagnose_motion
from picchio.robot.loading.load import load_robot

pytestmark = pytest.mark.slow
JOINTS = [f"joint_{n}" for n in range(1, 8)]


@pytest.fixture(scope="module")
def kinova(measured_data):
    return picchio.datasets.load("kinova-gen3", measured_data)


@pytest.fixture(scope="module")
def robot():
    return load_robot("kinova_gen3")


@pytest.fixture(scope="module")
def diagnosis(robot, kinova):
    return diagnose_motion(robot, kinova)


def test_every_joint_has_friction(diagnosis):
    """1.6 to 5.5 N m are missing at the speeds that were driven (0.4 rad/s alone)."""
    friction = dict.fromkeys(JOINTS, 0.0)
    for c in diagnosis.causes:
        if c.effect in ("coulomb_friction", "asymmetric_friction"):
            friction[c.target] += c.parameters["torque"].value
        if c.effect in ("viscous_friction", "asymmetric_friction"):
            friction[c.target] += 0.4 * c.parameters["coefficient"].value
    for joint, torque in friction.items():
        assert 1.2 < torque < 7.5, joint


def test_the_ripples_orders(diagnosis):
    orders = {joint: set() for joint in JOINTS}
    for c in diagnosis.causes:
        if c.effect == "torque_ripple":
            order = c.parameters["order"].value
            assert abs(order - round(order)) < 0.03
            orders[c.target].add(round(order))
    for joint in ("joint_5", "joint_6", "joint_7"):
        assert {7, 12, 14} <= orders[joint], joint
    # Joint 6 has a line at 2 as well, which loses on the records held out and is not claimed.
    assert all(2 in orders[joint] for joint in ("joint_5", "joint_7"))


def test_what_joint_6_has_at_two_cycles_is_seen_and_not_claimed(diagnosis):
    dropped = [(d["target"], round(d["order"])) for d in diagnosis.extra["dropped"]
               if d["effect"] == "torque_ripple"]  # fmt: skip
    assert ("joint_6", 2) in dropped


def test_ripple_tells_that_the_current_is_late(diagnosis):
    late = [c for c in diagnosis.causes if c.effect == "encoder_delay"]
    assert [c.target for c in late] == ["torque"]
    assert late[0].parameters["delay"].value == pytest.approx(3.1e-3, abs=0.5e-3)


def test_gain_on_motions_of_all_joints(diagnosis):
    assert "recordtrajectory_quadratic.csv" in diagnosis.gain.held_out_records
    assert diagnosis.verdict == "partial"
    assert diagnosis.gain.explained > 0.85
    parts = {
        (row["record"], row["channel"]): row["extended"] / row["baseline"]
        for row in diagnosis.details["held_out"]
        if row["channel"].startswith("torque")
    }
    # Joint 2 rings at 6 Hz, inside the band, which no effect of the catalogue explains.
    assert max(parts.values()) < 1.05
    assert max(part for (_, channel), part in parts.items() if "joint_2" not in channel) < 0.75


def labels(diagnosis):
    return {(c.effect, c.target) for c in diagnosis.causes}


def value(diagnosis, effect, name):
    return next(c for c in diagnosis.causes if c.effect == effect).parameters[name].value


@pytest.mark.minutes
def test_without_payload_in_the_catalogue_no_wrong_name(robot, kinova, diagnosis):
    """What hangs at the flange and a heavier last link make the same torques: one class."""
    other = diagnose_motion(robot, kinova, without=["payload", "payload_body", "link_inertia"])
    assert other.verdict in ("partial", "unexplained")
    assert other.gain.explained < diagnosis.gain.explained - 0.05
    assert labels(other) < labels(diagnosis)


@pytest.mark.minutes
def test_the_smallest_payload_that_is_found(robot, kinova, diagnosis, repository):
    urdf = str(repository / "robots" / "kinova_gen3" / "robot.urdf")
    found = diagnose_motion(robot, injection.inject(kinova, injection.payload(urdf, "tool0", 0.25)))
    more = value(found, "payload", "mass") - value(diagnosis, "payload", "mass")
    assert more == pytest.approx(0.25, abs=0.03)


@pytest.mark.minutes
def test_the_smallest_delay_that_is_found(robot, kinova, diagnosis):
    found = diagnose_motion(robot, injection.inject(kinova, injection.delay("torque", 0.001)))
    more = value(found, "encoder_delay", "delay") - value(diagnosis, "encoder_delay", "delay")
    assert more == pytest.approx(0.001, abs=0.05e-3)


@pytest.mark.minutes
def test_the_smallest_ripple_that_is_found(robot, kinova):
    """5 cycles a motor turn, 0.05 N m of 0.4 N m that shake joint 6."""
    changed = injection.inject(kinova, injection.ripple("joint_6", 500.0, 0.05))
    orders = [c.parameters["order"].value for c in diagnose_motion(robot, changed).causes
              if (c.effect, c.target) == ("torque_ripple", "joint_6")]  # fmt: skip
    assert any(order == pytest.approx(5.0, abs=0.02) for order in orders)
