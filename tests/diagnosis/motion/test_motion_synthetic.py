"""Motion records made by Pinocchio and a few lines of physics: causes are found, noise is not."""

import numpy as np
import pytest
from motion_records import ARM, RATE, campaign, wave

from picchio.campaign.campaign import Campaign
from picchio.campaign.record import Record
from picchio.core.errors import InputError
from picchio.diagnosis.motion.diagnosis import diagnose_motion
from picchio.robot.loading.load import load_robot


def found(effect, seed, **more):
    robot = load_robot(ARM)
    return diagnose_motion(robot, campaign(robot, effect, seed), **more)


def labels(diagnosis):
    return {(c.effect, c.target) for c in diagnosis.causes}


@pytest.mark.parametrize("seed", range(6))
def test_a_perfect_model_is_told_to_be_one(seed):
    diagnosis = found({}, seed)
    assert diagnosis.verdict == "nothing-wrong"
    assert diagnosis.causes == ()
    assert diagnosis.gain.extended_nrmse == pytest.approx(diagnosis.gain.noise_floor_nrmse, rel=0.1)


@pytest.mark.parametrize("seed", [11, 12])
@pytest.mark.parametrize(
    ("effect", "label", "name", "value"),
    [
        ({("coulomb", 1): 30.0}, ("coulomb_friction", "joint_2"), "torque", 30.0),
        ({("viscous", 2): 30.0}, ("viscous_friction", "joint_3"), "coefficient", 30.0),
        ({("gain", 1): 1.3}, ("torque_gain", "joint_2"), "gain", 1.3),
        ({("offset", 2): 15.0}, ("torque_offset", "joint_3"), "torque", 15.0),
        ({"payload": 8.0}, ("payload", "tool"), "mass", 8.0),
    ],
)
def test_one_effect_is_named_with_its_size(effect, label, name, value, seed):
    diagnosis = found(effect, seed)
    assert diagnosis.verdict in ("named", "ambiguous")
    alternatives = {pair for each in diagnosis.alternatives for pair in each}
    assert label in labels(diagnosis) | alternatives
    assert len(diagnosis.causes) == 1
    cause = diagnosis.causes[0]
    if (cause.effect, cause.target) == label:
        parameter = cause.parameters[name]
        assert parameter.value == pytest.approx(value, rel=0.03)
        assert abs(parameter.value - value) < 5.0 * parameter.std + 1e-3 * value
    assert diagnosis.gain.explained > 0.98


def test_a_ripples_order_is_found_and_not_given():
    diagnosis = found({("ripple", 0): 5.0}, 3)
    assert labels(diagnosis) == {("torque_ripple", "joint_1")}
    parameters = diagnosis.causes[0].parameters
    assert parameters["order"].value == pytest.approx(60.0, rel=0.01)
    assert parameters["amplitude"].value == pytest.approx(5.0, rel=0.05)


def test_two_at_once():
    diagnosis = found({("viscous", 2): 30.0, ("coulomb", 0): 30.0}, 4)
    assert labels(diagnosis) == {("viscous_friction", "joint_3"), ("coulomb_friction", "joint_1")}
    assert diagnosis.verdict == "named"


@pytest.mark.parametrize(
    ("effect", "gone"),
    [
        ({("coulomb", 1): 30.0}, {"coulomb_friction"}),
        ({"payload": 8.0}, {"payload", "link_inertia"}),
        ({("offset", 2): 15.0}, {"torque_offset", "asymmetric_friction"}),
        ({("ripple", 0): 20.0}, {"torque_ripple"}),
    ],
)
def test_without_the_cause_in_the_catalogue_no_wrong_name(effect, gone):
    diagnosis = found(effect, 5, without=gone)
    assert diagnosis.verdict in ("partial", "unexplained")


def test_a_slide_cannot_tell_payload_inertia_and_gain_apart():
    """One level axis: mass, rotor inertia and, with free friction, the torque's gain are one."""
    robot = load_robot("emps")
    rng = np.random.default_rng(2)
    t = np.arange(5000) / RATE
    records = []
    for number in range(2):
        x = 0.1 * wave(rng, t)
        v = np.gradient(x, 1 / RATE)
        force = 140.0 * np.gradient(v, 1 / RATE) + 200.0 * v
        force += 0.02 * force.std() * rng.normal(size=t.size)
        channels = {"motor_position.slide": x, "torque.slide": force}
        units = {"motor_position.slide": "m", "torque.slide": "N"}
        records.append(Record.from_arrays(f"m{number}.csv", t, channels, units=units,
                                          kind="motion"))  # fmt: skip
    diagnosis = diagnose_motion(robot, Campaign.from_records(records))
    assert diagnosis.verdict == "ambiguous"
    every = labels(diagnosis) | {pair for each in diagnosis.alternatives for pair in each}
    assert every == {("payload", "tool"), ("joint_inertia", "slide"), ("torque_gain", "slide"),
                     ("link_inertia", "carriage")}  # fmt: skip
    assert diagnosis.next_measurement["why"]
    assert diagnosis.causes[0].parameters["mass"].value == pytest.approx(40.0, rel=0.02)


def test_what_is_wrong_with_the_input_is_told():
    robot = load_robot(ARM)
    good = campaign(robot, {}, 0)
    with pytest.raises(InputError, match="no such effect"):
        diagnose_motion(robot, good, without=["rust"])
    with pytest.raises(InputError, match="the robot has no joint of this name"):
        diagnose_motion(load_robot("ur10"), good)


def test_json_is_whole():
    import json

    said = json.loads(json.dumps(found({("coulomb", 1): 30.0}, 1).to_dict()))
    assert said["format"] == "picchio-diagnosis/1"
    assert said["gain"]["train_records"] == ["m0.csv"]
    assert said["gain"]["held_out_records"] == ["m1.csv"]
    assert set(said["causes"][0]["parameters"]["torque"]) == {"value", "std", "unit"}
