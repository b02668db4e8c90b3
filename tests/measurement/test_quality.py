"""The checks against an independent simulator of the arm: what is wrong is named, the rest is not.

Causes inside the robot (friction, backlash, a payload) are no fault of the data: no check may take
one for a swapped axis, a delay or a clipped sensor.
"""

import tracemalloc

import numpy as np
import pytest

import picchio
from picchio.robot.loading.load import load_robot

SENSOR = "accelerometer.tool"


@pytest.fixture(scope="module")
def robot():
    return load_robot("fanuc_like_3dof")


def check(worlds, robot, causes, seed=0, **options):
    made, truth = worlds.make(robot=options.pop("robot_name", "fanuc_like_3dof"), seed=seed,
                              causes=causes, **{"records": 9, **options})  # fmt: skip
    report = picchio.check(made, robot)
    return report, truth, [f for f in report.findings if f.severity != "note"]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_nothing_wrong_and_the_noise_known(worlds, robot, seed):
    report, truth, wrong = check(worlds, robot, [], seed)
    assert [str(f) for f in wrong] == []
    for name, noise in report.noise.items():
        group = name.rpartition(".")[0] if name.startswith("acc") else name.partition(".")[0]
        assert noise.std == pytest.approx(np.ravel(truth["noise"][group])[0], rel=0.1)


def test_records_of_a_recorded_force_are_bursts_from_rest(worlds, robot):
    """Their quiet time tells the noise, as that of programmed blows does."""
    sensors = ("accelerometer", "deflection", "force")
    report, truth, _ = check(worlds, robot, [], records=3, sensors=sensors, programmed=False,
                             blend=1.0, sampling=2000.0)  # fmt: skip
    assert {record.blows for record in report.records} == {"the force was recorded"}
    assert not any(record.steady for record in report.campaign)
    for name, noise in report.noise.items():
        group = name.rpartition(".")[0] if name.startswith("acc") else name.partition(".")[0]
        assert noise.std == pytest.approx(np.ravel(truth["noise"][group])[0], rel=0.2)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ur10", "kinova_gen3", "kuka_iiwa14"])
def test_nothing_wrong_with_other_robots(worlds, name):
    sensor = "accelerometer.tool0" if name == "ur10" else None
    options = {"sensors": (sensor, "deflection")} if sensor else {}
    _, _, wrong = check(worlds, load_robot(name), [], 1, robot_name=name, **options)
    assert [str(f) for f in wrong] == []


AXES = {
    "yxz": "x shows y, y shows x",
    "-xyz": "x shows -x",
    "x-z-y": "y shows -z, z shows -y",
    "zxy": "x shows z, y shows x, z shows y",
    "-x-yz": "x shows -x, y shows -y",
}


@pytest.mark.slow
@pytest.mark.parametrize("axes", AXES)
def test_swapped_axes_are_named(worlds, robot, axes):
    cause = ("sensor_axes", SENSOR, {"axes": axes})
    _, _, wrong = check(worlds, robot, [cause], seed=2)
    (found,) = [f for f in wrong if f.check == "axes"]
    assert found.channel == SENSOR
    assert AXES[axes] in found.message


@pytest.mark.slow
def test_swapped_axes_of_a_robot_with_a_light_wrist(worlds):
    """Its fast modes hide the first milliseconds; the ring-down tells."""
    sensor = "accelerometer.tool0"
    _, _, wrong = check(worlds, load_robot("ur10"), [("sensor_axes", sensor, {"axes": "yxz"})], 1,
                        robot_name="ur10", sensors=(sensor, "deflection"))  # fmt: skip
    (found,) = wrong
    assert (found.check, found.channel) == ("phase", sensor)
    assert "x shows y, y shows x" in found.message


@pytest.mark.slow
@pytest.mark.parametrize("corner", [0.5, 1.0, 2.0])
def test_a_high_pass_is_measured(worlds, robot, corner):
    _, _, wrong = check(worlds, robot, [("sensor_highpass", SENSOR, {"frequency": corner})])
    (found,) = wrong
    assert found.check == "phase"
    assert found.value == pytest.approx(corner, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("delay", [1e-3, 3e-3])
def test_a_delay_is_measured(worlds, robot, delay):
    _, _, wrong = check(worlds, robot, [("sensor_delay", SENSOR, {"delay": delay})])
    (found,) = [f for f in wrong if f.check == "phase"]
    assert found.unit == "s"
    assert found.value == pytest.approx(delay, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("group", [SENSOR, "deflection"])
@pytest.mark.parametrize("name", ["sensor_clipping", "mains_hum"])
def test_clipping_and_hum(worlds, robot, name, group):
    _, truth, wrong = check(worlds, robot, [(name, group, None)], seed=3)
    told = {"sensor_clipping": "clipping", "mains_hum": "hum"}[name]
    # With its tops cut off, what is left of the ringing at the end is a larger share.
    wrong = [f for f in wrong if f.check != "length"]
    assert {f.check for f in wrong} == {told}
    assert all(f.channel.startswith(group) for f in wrong)
    parameters = truth["causes"][0]["parameters"]
    truth_value = parameters["limit"] if told == "clipping" else parameters["amplitude"]
    for found in wrong:
        assert found.value == pytest.approx(truth_value, rel=0.1)


INSIDE = (
    ("payload", "tool", {"mass": 4.0}),
    ("backlash", "joint_2", None),
    ("coulomb_friction", "joint_1", None),
    ("servo_compliance", "joint_2", None),
    ("transverse_compliance", "joint_2", None),
    ("workpiece_contact", "tool", None),
    ("rebound", "tool", None),
    ("tool_offset", "tool", None),
    ("sensor_gain", SENSOR, {"gain": 0.8}),
)


@pytest.mark.slow
@pytest.mark.parametrize("cause", INSIDE, ids=lambda cause: cause[0])
def test_what_is_inside_the_robot_is_no_fault_of_the_data(worlds, robot, cause):
    _, _, wrong = check(worlds, robot, [cause], seed=11)
    assert [str(f) for f in wrong] == []


@pytest.mark.slow
def test_measured_blows(worlds, robot):
    sensors = (SENSOR, "deflection", "force")
    for cause, words in (
        (("pulse_rate", "tool", {"scale": 1.03}), "every 41."),
        (("force_amplitude", "tool", {"scale": 1.3}), "programmed are"),
    ):
        _, _, wrong = check(worlds, robot, [cause], sensors=sensors, records=4)
        assert wrong and {f.check for f in wrong} == {"blows"}
        assert words in wrong[0].message


def test_what_is_held_does_not_grow_with_the_records(robot):
    rng = np.random.default_rng(0)
    time = np.arange(40_000) / 20_000.0 - 0.1
    wave = np.exp(-5.0 * np.maximum(time, 0.0)) * np.sin(100.0 * time) * (time > 0.0)
    records = [
        picchio.Record.from_arrays(
            f"r{k}.csv", time,
            {name: wave + 0.01 * rng.normal(size=time.size) for name in ("force", f"{SENSOR}.x")},
            kind="percussion", pose=[0.1 * k, 0.5, -0.8], direction=[1.0, 0.0, 0.0],
        )
        for k in range(6)
    ]  # fmt: skip
    excitation = {"kind": "pulse_train", "force": 300.0, "period": 0.04, "width": 0.004, "hits": 12}
    made = picchio.Campaign.from_records(records, excitation=excitation)
    held = []
    tracemalloc.start()
    try:
        picchio.check(made, robot, progress=lambda *_: held.append(tracemalloc.get_traced_memory()))
    finally:
        tracemalloc.stop()
    assert (held[-1][0] - held[-4][0]) / 3 < 0.75 * time.nbytes
