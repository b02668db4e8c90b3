"""Parts of the diagnosis of motion records, each against what is known beforehand."""

import numpy as np
import pytest

from picchio.campaign import Campaign, Record
from picchio.diagnosis.motion import diagnose_motion
from picchio.diagnosis.motion.baseline import stated_friction
from picchio.diagnosis.motion.orders import _power, _spectrum
from picchio.diagnosis.motion.split import split
from picchio.diagnosis.motion.stretches import confidence
from picchio.prediction.motion import MotionLog
from picchio.robot import load_robot

RATE = 1000.0


def log(file, speeds):
    t = np.arange(2000) / RATE
    angle = {joint: speed * t for joint, speed in speeds.items()}
    group = dict.fromkeys(speeds, "position")
    return MotionLog(file, RATE, angle, group, {}, {}, {})


def files(logs):
    return [each.file for each in logs]


def test_the_simplest_records_are_fitted_to_and_the_rest_is_held_out():
    both = log("both.csv", {"a": 1.0, "b": 1.0})
    one, other = log("a.csv", {"a": 1.0, "b": 0.0}), log("b.csv", {"a": 0.0, "b": 1.0})
    train, held_out = split([both, one, other], None, None)
    assert (files(train), files(held_out)) == (["a.csv", "b.csv"], ["both.csv"])


def test_nothing_faster_than_what_was_fitted_is_judged():
    slow = [log(f"{i}.csv", {"a": 1.0}) for i in range(3)]
    fast = [log("fast.csv", {"a": 3.0}), log("fastest.csv", {"a": 3.1})]
    train, held_out = split([*slow, *fast], None, None)
    assert "fastest.csv" in files(train)
    assert "fast.csv" in files(held_out)


def test_one_record_alone_is_fitted_to():
    train, held_out = split([log("a.csv", {"a": 1.0})], None, None)
    assert (len(train), len(held_out)) == (1, 0)


def test_the_spectrum_over_angles_is_the_exact_sum():
    rng = np.random.default_rng(0)
    angle = np.cumsum(rng.uniform(0.0, 1e-3, 4000))
    values = np.cos(700.0 * angle) + rng.normal(size=angle.size)
    orders, power = _spectrum([(angle, values)], 5.0, 2500.0, 0.5)
    exact = _power([(angle, values)], orders)
    np.testing.assert_allclose(power, exact, atol=2e-3 * exact.max())


def test_confidence_is_students():
    assert confidence(np.array([1.0, 1.1, 0.9, 1.0])) > 0.999
    assert confidence(np.array([-1.0, 1.0])) == pytest.approx(0.5)
    # Mean over its standard error is 1, three degrees of freedom: 80.45 %.
    x = np.array([-1.0, 0.0, 1.0, 2.0])
    x = x / (x.std(ddof=1) / 2.0)
    assert confidence(x - x.mean() + 1.0) == pytest.approx(0.8045, abs=1e-3)


def test_friction_that_the_urdf_states_is_in_the_baseline():
    found = stated_friction(load_robot("emps"), ["slide"])
    assert [(e.name, e.target) for e in found] == [("viscous_friction", "slide")]
    assert stated_friction(load_robot("fanuc_like_3dof"), ["joint_1"]) == ()


@pytest.mark.parametrize("late", [0.0, 0.003])
def test_ripple_at_several_speeds_tells_how_late_the_torque_is(late):
    """One axis, 400 cycles a metre: the phase shifts with the speed."""
    rng = np.random.default_rng(5)
    t = np.arange(8000) / RATE
    records = []
    for number in range(2):
        speed = 0.1 * np.sin(2 * np.pi * 0.3 * t + number) + 0.04 * np.sin(2 * np.pi * 0.8 * t)
        x = np.cumsum(speed) / RATE
        force = 100.0 * np.gradient(speed, 1 / RATE) + 200.0 * speed
        force = np.interp(t - late, t, force + 3.0 * np.sin(2500.0 * x))
        force = force + 0.3 * rng.normal(size=t.size)
        channels = {"motor_position.slide": x, "torque.slide": force}
        units = {"motor_position.slide": "m", "torque.slide": "N"}
        records.append(Record.from_arrays(f"{number}.csv", t, channels, units=units,
                                          kind="motion"))  # fmt: skip
    diagnosis = diagnose_motion(load_robot("emps"), Campaign.from_records(records))
    found = {(c.effect, c.target): c.parameters for c in diagnosis.causes}
    ripple = found["torque_ripple", "slide"]
    assert ripple["order"].value == pytest.approx(2500.0, rel=1e-3)
    assert ripple["amplitude"].value == pytest.approx(3.0, rel=0.1)
    delays = {target: p["delay"].value for (name, target), p in found.items()
              if name == "encoder_delay"}  # fmt: skip
    if late:
        assert delays == {"torque": pytest.approx(late, abs=2e-4)}
    else:
        assert all(value < 2e-4 for value in delays.values())
