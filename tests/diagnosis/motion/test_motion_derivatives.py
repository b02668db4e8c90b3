"""Derivatives of a motion's readings, made term by term, against differences of the whole."""

import numpy as np
import pytest

from picchio.diagnosis.motion.data.system import System
from picchio.diagnosis.motion.fit.least_squares import clean, jacobian, stable_solve, stable_solves
from picchio.diagnosis.motion.fit.state import State
from picchio.model.effects.registry import catalogue, effect_class
from picchio.prediction.motion.log import MotionLog
from picchio.robot.loading.load import load_robot

RATE, SAMPLES = 500.0, 3000
JOINTS = ("joint_1", "joint_2", "joint_3")


@pytest.fixture(scope="module")
def system():
    t = np.arange(SAMPLES) / RATE
    logs = []
    for number in range(2):
        angle = {
            joint: (0.4 + 0.1 * i) * np.sin((1.1 + 0.3 * i + 0.2 * number) * t + i)
            for i, joint in enumerate(JOINTS)
        }
        measured = {joint: 10.0 * np.cos(3.0 * t + i) for i, joint in enumerate(JOINTS)}
        link = {joint: angle[joint] + 1e-4 * np.sin(2.0 * t) for joint in JOINTS}
        group = dict.fromkeys(JOINTS, "motor_position")
        logs.append(MotionLog(f"{number}.csv", RATE, angle, group, measured, link, {}))
    return System(load_robot("fanuc_like_3dof"), logs, 20.0)


EVERYTHING = (
    ("coulomb_friction", "joint_1", {"torque": 4.0}),
    ("viscous_friction", "joint_1", {"coefficient": 3.0}),
    ("asymmetric_friction", "joint_2", {"torque": 1.0, "coefficient": 0.5}),
    ("stribeck_friction", "joint_2", {"torque": 2.0, "velocity": 0.1}),
    ("load_friction", "joint_3", {"coefficient": 0.02}),
    ("joint_inertia", "joint_3", {"inertia": 0.7}),
    ("torque_offset", "joint_3", {"torque": -1.5}),
    ("torque_ripple", "joint_1", {"order": 40.3, "cosine": 0.8, "sine": -0.4}),
    ("torque_gain", "joint_1", {"gain": 1.1}),
    ("payload", "tool", {"mass": 5.0}),
    ("payload_body", "tool", {"mass": 3.0, "x": 0.1, "z": -0.05, "yy": 0.01}),
    ("link_inertia", "link_2", {"mass": 0.2, "x": 0.1, "yy": -0.1, "xz": 0.3}),
    ("coupled_drive", "joint_3", {"coefficient": 2.0, "torque": 1.0, "inertia": 0.3}),
    ("counterbalance", "joint_2", {"cosine": 30.0, "sine": -12.0, "spring": 5.0}),
    ("encoder_delay", "motor_position", {"delay": 0.0031}),
    ("missing_gravity", "torque", {"share": 0.9}),
    ("unknown_pose", "joint_3", {"cosine": 4.0, "sine": -7.0}),
    ("joint_stiffness", "joint_2", {"scale": 0.8}),
    ("backlash", "joint_1", {"gap": 2e-4}),
)


def test_every_motion_effect_is_in_the_list():
    from picchio.diagnosis.motion.search.candidates import motion_effects

    assert {name for name, *_ in EVERYTHING} == set(motion_effects())


@pytest.mark.parametrize("alone", [True, False], ids=["alone", "all together"])
@pytest.mark.parametrize("number", range(len(EVERYTHING)), ids=[name for name, *_ in EVERYTHING])
def test_it_is_the_difference_of_two_predictions(system, number, alone):
    effects = [effect_class(name)(target, **values) for name, target, values in EVERYTHING]
    own = effects[number]
    state = State(effects=(own,) if alone else tuple(effects), scales={"joint_2": 1.03})
    predicted = system.predict(state.every, state.scales)
    index = 0 if alone else number
    wanted = [c for c in state.coordinates(system) if c.index == index]
    kept, columns = jacobian(system, state, predicted, wanted)
    assert kept
    for c, column in zip(kept, columns.T, strict=True):
        other = state.moved(c, c.value + c.step)
        whole = system.predict(other.every, other.scales) - predicted
        expected = clean(system, whole) / c.step
        np.testing.assert_allclose(column, expected, atol=2e-6 * np.abs(expected).max())


def test_a_factor_on_the_bodies_torque_is_one_too(system):
    effects = [effect_class(name)(target, **values) for name, target, values in EVERYTHING]
    state = State(effects=tuple(effects), scales=dict.fromkeys(JOINTS, 1.02))
    predicted = system.predict(state.every, state.scales)
    wanted = [c for c in state.coordinates(system) if c.index < 0]
    kept, columns = jacobian(system, state, predicted, wanted)
    assert len(kept) == 3
    for c, column in zip(kept, columns.T, strict=True):
        other = state.moved(c, c.value + c.step)
        expected = (system.predict(other.every, other.scales) - predicted) / c.step
        np.testing.assert_allclose(column, expected, atol=1e-6 * np.abs(expected).max())


def test_linear_effects_are_linear_and_have_a_neutral_zero():
    for kind in catalogue().values():
        neutral = {p.name: p.neutral for p in kind.parameters}
        bounds = {p.name: (p.lower, p.upper) for p in kind.parameters}
        for name in kind.linear:
            assert kind.target_kind == "joint"
            assert neutral[name] == 0.0
            assert bounds[name][0] <= 0.0 < 1.0 <= bounds[name][1]


def test_many_systems_are_solved_like_each_alone():
    rng = np.random.default_rng(0)
    x = rng.normal(size=(5, 30, 6)) * 10.0 ** rng.uniform(-4, 4, (5, 1, 6))
    x[3, :, 5] = x[3, :, 4]  # one that has no single answer
    normal, right = x.transpose(0, 2, 1) @ x, rng.normal(size=(5, 6))
    alone = [stable_solve(a, b) for a, b in zip(normal, right, strict=True)]
    np.testing.assert_allclose(stable_solves(normal, right), alone, rtol=1e-9)
    np.testing.assert_allclose(stable_solves(normal[:3], right[:3]), alone[:3], rtol=1e-9)
