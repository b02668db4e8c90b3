"""Motion records: filters, inverse dynamics, effects, the closed loop, against other code."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import butter, sosfiltfilt

from picchio.campaign.campaign import Campaign
from picchio.campaign.record import Record
from picchio.core.errors import InputError
from picchio.model.effects.registry import effect_class
from picchio.model.motion import TORQUE, WINDUP
from picchio.prediction.motion.closed_loop import CascadeLaw, friction_curve, simulate_closed_loop
from picchio.prediction.motion.filters import Band, choose_cutoff, shift
from picchio.prediction.motion.log import read_logs
from picchio.prediction.motion.readings import Predictor
from picchio.robot.loading.load import load_robot

RATE = 500.0
T = np.arange(4000) / RATE


def sines(robot, seed=0):
    rng = np.random.default_rng(seed)
    phase = rng.uniform(0.0, 6.0, len(robot.joint_names))
    return 0.4 * np.sin(2.0 * np.pi * 0.4 * T + phase[:, None])


def predictor(robot, q, kind="motor_position", **more):
    channels = {f"{kind}.{joint}": q[j] for j, joint in enumerate(robot.joint_names)}
    channels |= {f"torque.{joint}": 0.0 * T for joint in robot.joint_names} | more
    campaign = Campaign.from_records([Record.from_arrays("a.csv", T, channels, kind="motion")])
    return Predictor(robot, read_logs(robot, campaign)[0], Band(20.0, RATE))


def test_the_low_pass_is_scipys():
    noise = np.random.default_rng(0).normal(size=(2, 3000)).cumsum(axis=1)
    band = Band(15.0, RATE)
    sections = butter(4, 15.0, fs=RATE, output="sos")
    expected = sosfiltfilt(sections, noise, padlen=band.edge)
    np.testing.assert_allclose(band.low_pass(noise), expected, rtol=1e-9, atol=1e-9)


def test_no_phase():
    wave = np.sin(2.0 * np.pi * 3.0 * T)
    np.testing.assert_allclose(Band(30.0, RATE).low_pass(wave), wave, atol=2e-4)


@pytest.mark.parametrize("noise", [1e-6, 1e-4])
def test_the_cutoff_falls_with_the_encoders_noise(noise):
    rng = np.random.default_rng(1)
    steps = np.cumsum(np.cumsum(np.repeat(rng.normal(size=40), 100))) / RATE**2
    quiet = choose_cutoff([(steps + 1e-9 * rng.normal(size=T.size), RATE)])
    loud = choose_cutoff([(steps + noise * rng.normal(size=T.size), RATE)])
    assert loud < quiet


@pytest.mark.parametrize("name", ["fanuc_like_3dof", "ur10", "kinova"])
def test_inverse_dynamics_is_pinocchios(name):
    """kinova has continuous joints, which have two coordinates in Pinocchio."""
    robot = load_robot(name)
    q = sines(robot)
    found = predictor(robot, q).predict(())[TORQUE]
    band = Band(20.0, RATE)
    smooth = band.low_pass(q)
    v, a = (np.gradient(x, 1 / RATE, axis=1) for x in (smooth, smooth))
    a = np.gradient(v, 1 / RATE, axis=1)
    model = pin.buildModelFromUrdf(str(robot.source))
    data = model.createData()
    order = [model.getJointId(joint) for joint in robot.joint_names]
    for i in range(500, 3500, 97):
        full, vel, acc = pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
        step = np.zeros(model.nv)
        for j, joint in enumerate(order):
            at = model.joints[joint].idx_v
            step[at], vel[at], acc[at] = smooth[j, i], v[j, i], a[j, i]
        torque = pin.rnea(model, data, pin.integrate(model, full, step), vel, acc)
        for j, joint in enumerate(order):
            expected = torque[model.joints[joint].idx_v]
            got = found[robot.joint_names[j]][i]
            assert got == pytest.approx(expected, rel=1e-6, abs=1e-3 * np.abs(torque).max())


def test_payload_is_a_body_appended_in_pinocchio():
    robot = load_robot("fanuc_like_3dof")
    q = sines(robot)
    one = predictor(robot, q)
    effect = effect_class("payload")("tool", mass=7.0)
    model = robot.rigid._model.copy()
    frame = model.frames[model.getFrameId(robot.tool_frame)]
    point = pin.Inertia(7.0, np.zeros(3), np.zeros((3, 3)))
    model.appendBodyToJoint(frame.parentJoint, point, frame.placement)
    data = model.createData()
    found = one.predict((effect,))[TORQUE]
    nominal = one.nominal
    for i in range(0, 4000, 101):
        state = [np.array([x[joint][i] for joint in robot.joint_names])
                 for x in (nominal.angle, nominal.velocity, nominal.acceleration)]  # fmt: skip
        torque = pin.rnea(model, data, *state)
        got = [found[joint][i] for joint in robot.joint_names]
        np.testing.assert_allclose(got, torque, rtol=1e-9, atol=1e-9)


def test_windup_is_torque_over_stiffness_and_a_late_encoder_lags():
    robot = load_robot("fanuc_like_3dof")
    q = sines(robot)
    more = {"position.joint_2": q[1]}
    one = predictor(robot, q, **more)
    spring = effect_class("joint_stiffness")("joint_2", scale=0.5)
    found = one.predict((spring,))[WINDUP]["joint_2"]
    expected = -one.nominal.body["joint_2"] / (0.5 * robot.stiffness[1])
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    late = effect_class("encoder_delay")("position", delay=0.0031)
    found = one.predict((late,))[WINDUP]["joint_2"][100:-100]
    phase = 2.0 * np.pi * 0.4 * 0.0031
    amplitude = 2.0 * 0.4 * np.sin(0.5 * phase)
    assert np.abs(found).max() == pytest.approx(amplitude, rel=1e-3)


def test_late_angles_and_late_torques_are_opposite():
    robot = load_robot("fanuc_like_3dof")
    one = predictor(robot, sines(robot))
    delay = effect_class("encoder_delay")
    bare = one.predict(())[TORQUE]["joint_2"]
    for target, sign in (("motor_position", -1.0), ("torque", 1.0)):
        moved = one.predict((delay(target, delay=0.01),))[TORQUE]["joint_2"]
        expected = np.interp(T - sign * 0.01, T, bare)
        inner = slice(100, -100)
        np.testing.assert_allclose(moved[inner], expected[inner], atol=2e-3 * np.ptp(bare))


@pytest.mark.parametrize("late", [0.5, 2.3, -1.7])
@pytest.mark.parametrize("frequency", [0.02, 0.2, 0.35])
def test_shifting_a_wave(late, frequency):
    i = np.arange(1000.0)
    found = shift(np.sin(2.0 * np.pi * frequency * i), late)
    expected = np.sin(2.0 * np.pi * frequency * (i - late))
    np.testing.assert_allclose(found[40:-40], expected[40:-40], atol=5e-3)


def test_every_friction_opposes_the_motion():
    robot = load_robot("fanuc_like_3dof")
    one = predictor(robot, sines(robot))
    v = one.nominal.velocity["joint_1"]
    bare = one.predict(())[TORQUE]["joint_1"]
    for name, values in (
        ("viscous_friction", {"coefficient": 5.0}),
        ("coulomb_friction", {"torque": 5.0}),
        ("stribeck_friction", {"torque": 5.0, "velocity": 0.1}),
    ):
        effect = effect_class(name)("joint_1", **values)
        added = one.predict((effect,))[TORQUE]["joint_1"] - bare
        assert np.trapezoid(added * v, T) > 0.0


def test_the_closed_loop_against_scipys_integrator():
    """Viscous friction only, where an ordinary integrator is right: the law held for a sample."""
    law = CascadeLaw(kp=100.0, kv=300.0, gtau=30.0, limit=10.0)
    reference = 0.1 * np.sin(2.0 * np.pi * 0.5 * T)
    curve = friction_curve((effect_class("viscous_friction")("x", coefficient=200.0),), "x", 1.0)
    found = simulate_closed_loop(law, reference, RATE, 90.0, curve)
    x, v = 0.0, 0.0
    for i in range(400):
        assert found.position[i] == pytest.approx(x, rel=1e-3, abs=1e-6)
        volts = np.clip(law.kp * law.kv * (reference[i] - x) - law.kv * v, -10.0, 10.0)
        force = law.gtau * volts
        step = solve_ivp(lambda _, y, f=force: [y[1], (f - 200.0 * y[1]) / 90.0],
                         (0.0, 1.0 / RATE), [x, v], rtol=1e-9, atol=1e-12)  # fmt: skip
        x, v = step.y[:, -1]


def test_dry_friction_holds_a_standing_joint():
    law = CascadeLaw(kp=100.0, kv=300.0, gtau=30.0)
    curve = friction_curve((effect_class("coulomb_friction")("x", torque=20.0),), "x", 1.0)
    # 20 N hold against gtau kp kv times the reference: below 22 um nothing moves.
    held = simulate_closed_loop(law, np.full(500, 20e-6), RATE, 90.0, curve)
    assert np.all(held.position == 0.0)
    moved = simulate_closed_loop(law, np.full(500, 30e-6), RATE, 90.0, curve)
    assert moved.position[-1] > 1e-6


@pytest.mark.parametrize(("effects", "most"), [(0, 0.19), (1, 0.10), (2, 0.05)])
def test_emps_forwards(measured_data, effects, most):
    """The same ladder as in the inverse model, without a measured acceleration in it."""
    import picchio.datasets

    campaign = picchio.datasets.load("emps", measured_data)
    read = campaign.records[0].read()
    law = CascadeLaw.from_controller(campaign.controller)
    viscous = effect_class("viscous_friction")
    model = [
        (viscous("slide", coefficient=411.0),),
        (viscous("slide", coefficient=205.0),
         effect_class("coulomb_friction")("slide", torque=20.4)),
        (viscous("slide", coefficient=205.0),
         effect_class("coulomb_friction")("slide", torque=20.4),
         effect_class("asymmetric_friction")("slide", coefficient=-38.0)),
    ][effects]  # fmt: skip
    found = simulate_closed_loop(
        law, read["reference_position.slide"], 1000.0, 95.1, friction_curve(model, "slide", 0.2),
        start=(float(read["motor_position.slide"][0]), 0.0),
    )  # fmt: skip
    band = Band(100.0, 1000.0)
    measured, simulated = band.low_pass(read["torque.slide"]), band.low_pass(found.torque)
    error = np.linalg.norm(simulated - measured) / np.linalg.norm(measured)
    assert error < most
    position = np.std(found.position - read["motor_position.slide"])
    assert position < 10e-6


def test_an_unknown_law_is_told():
    with pytest.raises(InputError, match="the key is missing"):
        CascadeLaw.from_controller({"kp": 1.0})
    with pytest.raises(InputError, match="must be a number"):
        CascadeLaw.from_controller({"kp": 1.0, "kv": "x", "gtau": 1.0})


def test_a_balancer_is_part_of_the_torque():
    balancer = {"parent_point": [0, 0, 0.3], "child_point": [0.2, 0, 0], "stiffness": 9e3}
    robot = load_robot("fanuc_like_3dof", values={"joint_2": {"balancer": balancer}})
    q = np.array([[0.0], [0.3], [0.6]]) + 1e-3 * np.sin(0.2 * T)
    one = predictor(robot, q)
    pose = [one.nominal.angle[joint][2000] for joint in robot.joint_names]
    got = [one.predict(())[TORQUE][joint][2000] for joint in robot.joint_names]
    np.testing.assert_allclose(got, robot.gravity_torque(pose), atol=0.05)
    bare = load_robot("fanuc_like_3dof")
    assert abs(got[1] - bare.gravity_torque(pose)[1]) > 1.0
