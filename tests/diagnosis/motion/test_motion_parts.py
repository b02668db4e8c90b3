"""Parts of the diagnosis of motion records, each against what is known beforehand."""

import numpy as np
import pytest

from picchio.campaign.campaign import Campaign
from picchio.campaign.record import Record
from picchio.diagnosis.motion.data.split import split
from picchio.diagnosis.motion.data.system import System
from picchio.diagnosis.motion.diagnosis import diagnose_motion
from picchio.diagnosis.motion.fit.orders import find_orders, power_at, power_spectrum
from picchio.diagnosis.motion.fit.state import State, stated_friction
from picchio.diagnosis.motion.fit.stretches import confidence
from picchio.diagnosis.result import unit_of
from picchio.model.effects.registry import effect_class
from picchio.prediction.motion.log import MotionLog
from picchio.robot.loading.load import load_robot

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
    train, held_out = split([both, one, other])
    assert (files(train), files(held_out)) == (["a.csv", "b.csv"], ["both.csv"])


def test_nothing_faster_than_what_was_fitted_is_judged():
    slow = [log(f"{i}.csv", {"a": 1.0}) for i in range(3)]
    fast = [log("fast.csv", {"a": 3.0}), log("fastest.csv", {"a": 3.1})]
    train, held_out = split([*slow, *fast])
    assert "fastest.csv" in files(train)
    assert "fast.csv" in files(held_out)


def test_one_record_alone_is_fitted_to():
    train, held_out = split([log("a.csv", {"a": 1.0})])
    assert (len(train), len(held_out)) == (1, 0)


def test_the_spectrum_over_angles_is_the_exact_sum():
    rng = np.random.default_rng(0)
    angle = np.cumsum(rng.uniform(0.0, 1e-3, 4000))
    values = np.cos(700.0 * angle) + rng.normal(size=angle.size)
    orders, power = power_spectrum((angle, values), 5.0, 2500.0, 0.5)
    exact = power_at((angle, values), orders)
    np.testing.assert_allclose(power, exact, atol=2e-3 * exact.max())


def sweeps(samples=5000, speeds=(0.10, 0.31)):
    """Two records of a slide, one slow and one fast."""
    t = np.arange(samples) / RATE
    records = []
    for number, speed in enumerate(speeds):
        x = speed * t + 0.005 * np.sin(2.0 * t)
        return_ = MotionLog(f"{number}.csv", RATE, {"slide": x}, {"slide": "motor_position"},
                            {"slide": np.zeros(samples)}, {}, {})  # fmt: skip
        records.append(return_)
    return System(load_robot("emps"), records, 20.0)


def noise(system, levels, rng, colour=0.0):
    """Residuals with a noise of its own in every record."""
    from scipy.signal import lfilter

    residual = np.zeros(system.size)
    for s in system.segments:
        white = rng.normal(size=s.samples.size)
        residual[s.rows] = levels[s.record] * lfilter([1.0], [1.0, -colour], white)
    return residual


def wave_in(system, record, order, size):
    residual = np.zeros(system.size)
    for s in system.segments:
        if s.record == record and s.group[0] == "ripple":
            angle = system.predictors[record].nominal.angle["slide"][s.samples]
            residual[s.rows] = size * np.cos(order * angle)
    return residual


@pytest.mark.slow
def test_noise_has_no_orders():
    """A false alarm in one search of ten thousand is allowed: none in 200 is what to expect."""
    system, rng = sweeps(), np.random.default_rng(8)
    for number in range(200):
        residual = noise(system, (1.0, 5.0), rng, colour=0.9 * (number % 2))
        assert find_orders(system, residual, "slide", State()) == []


def test_a_quiet_records_lines_are_found_beside_a_noisy_one():
    """Each record is held against its own noise, in its own range of orders."""
    system, rng = sweeps(), np.random.default_rng(9)
    residual = noise(system, (1.0, 30.0), rng)
    # The fast record resolves orders up to 8100 a metre, the slow one up to 22000.
    for order in (2000.0, 2600.0, 15000.0):
        residual += wave_in(system, 0, order, 0.3)
    found = [order for order, _ in find_orders(system, residual, "slide", State())]
    assert sorted(found) == pytest.approx([2000.0, 2600.0, 15000.0], rel=1e-3)


def test_side_lobes_of_a_strong_line_are_no_lines():
    system, rng = sweeps(), np.random.default_rng(10)
    residual = noise(system, (0.1, 0.1), rng) + wave_in(system, 0, 5000.0, 20.0)
    found = [order for order, _ in find_orders(system, residual, "slide", State())]
    assert found == pytest.approx([5000.0], rel=1e-4)


def test_what_is_left_of_a_known_ripple_is_no_line_of_its_own():
    system, rng = sweeps(), np.random.default_rng(11)
    residual = noise(system, (1.0, 1.0), rng) + wave_in(system, 0, 5010.0, 0.5)
    assert find_orders(system, residual, "slide", State())
    ripple = effect_class("torque_ripple")("slide", order=5000.0, cosine=1.0)
    assert find_orders(system, residual, "slide", State(effects=(ripple,))) == []


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


def test_what_a_slide_is_told_in():
    slide, arm = load_robot("emps"), load_robot("fanuc_like_3dof")
    assert unit_of(slide, "slide", "N*m/rad") == "N/m"
    assert unit_of(arm, "joint_1", "N*m/rad") == unit_of(arm, "tool", "N*m/rad") == "N*m/rad"


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
