"""KUKA KR 300: numbers of issue 7, and gravity by Pinocchio."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.signal import butter, filtfilt

import picchio.datasets

AXES = [f"joint_a{axis}" for axis in range(1, 7)]
RATIOS = [256.857, 267.429, 252.333, 221.0, 239.619, 154.323]
PAYLOAD = 151.0  # kg, SOURCE.md


@pytest.fixture(scope="module")
def kuka(measured_data):
    return picchio.datasets.load("kuka-kr300", measured_data)


def rms(x):
    return np.sqrt(np.mean(np.square(x)))


def test_what_the_campaign_holds(kuka):
    assert [record.file for record in kuka] == [f"trajectory_{x}.csv" for x in "abc"]
    for record in kuka:
        assert (record.kind, record.clock.samples) == ("motion", 2501)
        assert record.clock.rate == pytest.approx(250.0)
        with_link_side = [a for a in AXES if f"position.{a}" in record.channels]
        assert with_link_side == AXES[:3]
        assert all(f"motor_position.{a}" in record.channels for a in AXES)
        # The channels that would be zeros are not there at all.
        assert all(np.ptp(record[name]) > 0.0 for name in record.channels)


def test_link_minus_motor_angle_on_trajectory_b(kuka):
    """Issue 7: 86, 32, 141 mdeg RMS raw, about 30, 32, 34 without the record's offset."""
    read = kuka["trajectory_b.csv"].read()
    for axis, raw, without in zip(AXES[:3], (86, 32, 141), (30, 32, 34), strict=True):
        windup = np.rad2deg(read[f"position.{axis}"] - read[f"motor_position.{axis}"]) * 1e3
        assert rms(windup) == pytest.approx(raw, abs=0.5)
        assert rms(windup - windup.mean()) == pytest.approx(without, abs=0.5)


def test_the_offset_jumps_between_records(kuka):
    offsets = [
        np.rad2deg(np.mean(r["position.joint_a1"] - r["motor_position.joint_a1"])) * 1e3
        for r in kuka
    ]
    assert np.ptp(offsets) > 100.0  # mdeg


def test_torque_is_after_the_gear(kuka, measured_data):
    """The stored torque times the ratio; the ratios are those of the data sheet's gears."""
    from scipy.io import loadmat

    path = measured_data / "kuka-kr300" / "kr300_traj_A.mat"
    stored = loadmat(path, variable_names=["rec", "para"])
    motor = stored["rec"]["act_torque_abs_nm"][0, 0]
    np.testing.assert_allclose(stored["para"]["u"][0, 0].ravel(), RATIOS, rtol=1e-5)
    record = kuka["trajectory_a.csv"]
    for axis, name in enumerate(AXES):
        ratio = record[f"torque.{name}"] / motor[axis]
        np.testing.assert_allclose(ratio, RATIOS[axis], rtol=1e-5)
    assert np.abs(motor).max() < 50.0  # N m, para.torque_amp_limit


def test_friction_takes_energy_on_every_axis(kuka):
    """Torque and velocity have the same sign on the whole: no axis is flipped."""
    for record in kuka:
        read = record.read()
        for axis in AXES:
            assert np.trapezoid(read[f"torque.{axis}"], read[f"motor_position.{axis}"]) > 50.0


def test_velocity_is_the_derivative_of_position(kuka):
    for record in kuka:
        read = record.read()
        for axis in AXES[:3]:
            slope = np.gradient(read[f"position.{axis}"], 1 / record.clock.rate)
            given = read[f"velocity.{axis}"]
            assert np.dot(slope, given) / np.dot(given, given) == pytest.approx(1.0, abs=0.01)


def test_axis_3_carries_gravity_with_the_payload_and_not_without(kuka, repository):
    """Gear ratio, zero of the angles, signs and payload at once, by Pinocchio.

    torque = slope * rigid body + viscous + Coulomb + constant: with the payload the slope is 1
    and nothing constant is left over; without it the slope is far off, or a ton is missing.
    """
    model = pin.buildModelFromUrdf(str(repository / "robots/kuka_kr300_r2500/robot.urdf"))
    loaded = model.copy()
    flange = pin.SE3(np.eye(3), np.array([0.24, 0.0, 0.0]))
    loaded.appendBodyToJoint(6, pin.Inertia.FromSphere(PAYLOAD, 0.1), flange)
    for record in kuka:
        slope, constant = axis_3(record, loaded)
        assert slope == pytest.approx(1.09, abs=0.08)
        assert abs(constant) < 120.0
        bare_slope, bare_constant = axis_3(record, model)
        assert bare_slope > 1.4
        assert abs(bare_constant) > 600.0


def axis_3(record, model):
    read, rate = record.read(), record.clock.rate
    b, a = butter(4, 5.0 / (rate / 2))
    position = filtfilt(b, a, [read[f"motor_position.{name}"] for name in AXES])
    velocity = np.gradient(position, 1 / rate, axis=1)
    acceleration = np.gradient(velocity, 1 / rate, axis=1)
    data = model.createData()
    states = zip(position.T, velocity.T, acceleration.T, strict=True)
    rigid = np.array([pin.rnea(model, data, *state)[2] for state in states])
    rigid += 0.0118 * RATIOS[2] ** 2 * acceleration[2]  # para.J_mr
    torque = filtfilt(b, a, read["torque.joint_a3"])
    columns = [rigid, velocity[2], np.tanh(velocity[2] / 0.01), np.ones(rigid.size)]
    inner = slice(100, -100)
    found, *_ = np.linalg.lstsq(np.column_stack(columns)[inner], torque[inner], rcond=None)
    return found[0], found[3]
