"""Effects: neutral ones change nothing, real ones what a closed form or another solver says."""

from __future__ import annotations

import dataclasses
import itertools
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import picchio
from picchio.core.errors import InputError
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.search.candidates import evidence_of, measure_scales
from picchio.model.blows import Blows
from picchio.model.conditions import Conditions
from picchio.model.effects.registry import catalogue, effect_class, from_dict
from picchio.model.geometry import Geometry
from picchio.model.model import Model
from picchio.prediction.plan import Plan
from picchio.prediction.simulation import simulate
from picchio.vibration.integration.integrate import Samples, integrate

BLOWS = picchio.PulseTrain(force=300.0, period=0.040, width=0.004)
CLOCK = Samples(0.0005, 0.001, 500)
DIRECTION = np.array([0.6, 0.5, -0.6244997998])
CONTRACT = {
    "structure": "joint_stiffness modal_damping joint_damping payload link_mass joint_inertia "
    "servo_compliance base_compliance transverse_compliance tool_offset cable",
    "nonlinear": "backlash hardening hysteresis coulomb_friction workpiece_contact",
    "blows": "force_amplitude force_drift pulse_width pulse_shape pulse_rate pulse_jitter "
    "missed_hits rebound force_direction",
    "over-time": "stiffness_drift thermal_stiffness",
    "sensor": "sensor_gain sensor_axes sensor_misalignment sensor_delay clock_drift "
    "sensor_highpass sensor_lowpass sensor_clipping mount_resonance mains_hum",
}
TARGETS = {
    "joint": "joint_2",
    "joint or link": "joint_2",
    "link": "link_3",
    "tool": "tool",
    "robot": "robot",
    "axis": "ry",
    "channel group": "accelerometer.tool",
}


@pytest.fixture(scope="module")
def arm():
    return picchio.load_robot("fanuc_like_3dof")


@pytest.fixture(scope="module")
def geometry(arm):
    return Geometry.of(arm, arm.pose([0.3, 0.5, -0.8]))


def motion(arm, geometry, effects=(), clock=CLOCK):
    model = Model(arm, True).with_effects(effects)
    blows = Blows.of(BLOWS, 6, DIRECTION)
    blows = model.blows(blows.change(tool_rotation=geometry.motion("tool").rotation))
    system = model.plant(geometry).build(blows.direction)
    return system, integrate(system, blows.force(), clock)


@pytest.mark.parametrize("where", CONTRACT)
def test_the_contracts_names_are_all_there(where):
    for name in CONTRACT[where].split():
        assert effect_class(name).where == where
        assert effect_class(name).meaning


# An endless stiffness is approached, not reached: those have a test of their own.
FINITE = [
    name
    for where, names in CONTRACT.items()
    for name in names.split()
    if where != "sensor" and not any(np.isinf(p.neutral) for p in effect_class(name).parameters)
]


@pytest.mark.parametrize("name", FINITE)
def test_a_neutral_effect_changes_nothing(arm, geometry, name):
    kind = effect_class(name)
    _, plain = motion(arm, geometry)
    _, changed = motion(arm, geometry, [kind(TARGETS[kind.target_kind])])
    scale = np.abs(plain.position).max()
    assert np.abs(changed.position - plain.position).max() < 2e-4 * scale


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("base_compliance", {"stiffness": 1e12, "damping": 1e6}),
        ("transverse_compliance", {"stiffness": 1e11, "damping": 1e5}),
        ("servo_compliance", {"stiffness": 1e11, "rotor_inertia": 0.5, "damping": 1e3}),
    ],
)
def test_what_hardly_yields_hardly_matters(arm, geometry, name, values):
    kind = effect_class(name)
    _, plain = motion(arm, geometry)
    effect = kind(TARGETS[kind.target_kind], **values, modal_share=0.0)
    system, changed = motion(arm, geometry, [effect])
    there = system.deflections @ changed.position.T
    scale = np.abs(plain.position).max()
    assert np.abs(there.T - plain.position).max() < 1e-3 * scale


def test_a_payload_is_a_point_mass_in_the_mass_matrix(arm, geometry):
    system, _ = motion(arm, geometry, [effect_class("payload")("tool", mass=3.0)])
    plain, _ = motion(arm, geometry)
    jacobian = arm.state(geometry.pose).jacobian
    assert np.allclose(system.mass - plain.mass, 3.0 * jacobian.T @ jacobian, atol=1e-9)


def _reference(system, force, times, extra):
    """The same linear matrices under scipy, with an extra torque: another integrator."""
    n = len(system.coordinates)
    inverse = np.linalg.inv(system.mass)

    def rate(t, y):
        x, v = y[:n], y[n : 2 * n]
        torque, inner = extra(x, v, y[2 * n :])
        right = system.force * force(t) + torque - system.damping @ v - system.stiffness @ x
        return np.concatenate([v, inverse @ right, inner])

    out, y = [], np.zeros(2 * n + extra.states)
    edges = [*force.start, times[-1] + 1e-9]
    for a, b in zip(edges[:-1], edges[1:], strict=True):
        here = times[(times >= a) & (times < b)]
        solved = solve_ivp(
            rate, (a + 1e-12, b), y, t_eval=np.append(here, b), rtol=1e-9, atol=1e-13,
            max_step=2e-4,
        )  # fmt: skip
        out.append(solved.y[:n, :-1])
        y = solved.y[:, -1]
    return np.concatenate(out, axis=1)


def _flat(system):
    """Without geometry's second order, on both sides: the elements are what is tested."""
    return dataclasses.replace(
        system,
        mass_gradient=0.0 * system.mass_gradient,
        gravity_curvature=0.0 * system.gravity_curvature,
        force_gradient=0.0 * system.force_gradient,
    )


class _Extra:
    def __init__(self, function, states=0):
        self.function, self.states = function, states

    def __call__(self, x, v, z):
        return self.function(x, v, z)


@pytest.mark.parametrize("name", ["hardening", "backlash", "hysteresis", "workpiece_contact"])
def test_nonlinear_elements_against_scipy(arm, geometry, name):
    unit = np.array([0.0, 1.0, 0.0])
    if name == "hardening":
        effect = effect_class(name)("joint_2", cubic=8e10)
        extra = _Extra(lambda x, v, z: (-8e10 * x[1] ** 3 * unit, np.zeros(0)))
    elif name == "backlash":
        # joint_1 carries no gravity: it starts centred, and crosses the gap at once
        gap, k = 2e-4, arm.stiffness[0]
        assert abs(arm.gravity_torque(geometry.pose)[0]) < 1e-9
        effect = effect_class(name)("joint_1", gap=gap)

        def dead_zone(x, v, z):
            beyond = x[0] - np.clip(x[0], -gap / 2, gap / 2)
            return (k * x[0] - k * beyond) * np.array([1.0, 0.0, 0.0]), np.zeros(0)

        extra = _Extra(dead_zone)
    elif name == "hysteresis":
        effect = effect_class(name)("joint_2", torque=6.0, deflection=1e-4)

        def bouc_wen(x, v, z):
            rate = (v[1] - 0.5 * (abs(v[1]) * z[0] + v[1] * abs(z[0]))) / 1e-4
            return -6.0 * z[0] * unit, np.array([rate])

        extra = _Extra(bouc_wen, states=1)
    else:
        effect = effect_class(name)("tool", stiffness=1e5, damping=80.0, preload=30.0)

    system, found = motion(arm, geometry, [effect])
    if name == "workpiece_contact":
        b = system.force

        def contact(x, v, z):
            push = max(30.0 - 1e5 * (b @ x) - 80.0 * (b @ v), 0.0) - 30.0
            return push * b, np.zeros(0)

        extra = _Extra(contact)
    flat = _flat(system)
    force = Blows.of(BLOWS, 6, DIRECTION).force()
    ours = integrate(flat, force, CLOCK).position.T
    reference = _reference(flat, force, CLOCK.times, extra)
    plain = integrate(dataclasses.replace(flat, elements=(), rows=flat.rows[:0]), force, CLOCK)
    scale = np.abs(reference).max()
    assert np.abs(ours - reference).max() < 1e-4 * scale
    assert np.abs(plain.position.T - reference).max() > 0.01 * scale  # it does matter
    assert np.abs(found.position).max() > 0.0


def _with_dry_friction(system, force, times, row, limit):
    """scipy from event to event: sliding either way, or held with the torque that it takes."""
    n = system.mass.shape[0]
    inverse = np.linalg.inv(system.mass)
    compliance = row @ inverse @ row

    def pull(t, y):
        return system.force * force(t) - system.stiffness @ y[:n] - system.damping @ y[n:]

    def held(t, y):
        return row @ inverse @ pull(t, y) / compliance

    def rate(side):
        def of(t, y):
            friction = held(t, y) if side == 0 else side * limit
            return np.concatenate([y[n:], inverse @ (pull(t, y) - friction * row)])

        return of

    def comes_to_rest(t, y):
        return row @ y[n:]

    def lets_go(t, y):
        return abs(held(t, y)) - limit

    comes_to_rest.terminal = lets_go.terminal = True
    lets_go.direction = 1.0
    out, y, side = np.zeros((n, times.size)), np.zeros(2 * n), 0
    turns = 0
    edges = np.unique(np.append(force.start, times[-1] + 1e-9))
    for a, b in zip(edges[:-1], edges[1:], strict=True):
        t = a
        while t < b - 1e-9:
            if side == 0 and abs(held(t + 1e-12, y)) > limit:
                side = 1 if held(t + 1e-12, y) > 0.0 else -1
            comes_to_rest.direction = -float(side)
            event = lets_go if side == 0 else comes_to_rest
            found = solve_ivp(
                rate(side), (t, b), y, events=event, dense_output=True, rtol=1e-10, atol=1e-15,
                max_step=1e-3,
            )  # fmt: skip
            t_end = found.t[-1]
            here = (times >= t) & (times < t_end)
            if here.any():
                out[:, here] = found.sol(times[here])[:n]
            y = found.y[:, -1].copy()
            if found.status == 1:
                y[n:] -= (row @ y[n:]) * inverse @ row / compliance  # exactly at rest
                turns += side != 0
                if side == 0:
                    side = 1 if held(t_end, y) > 0.0 else -1
                elif abs(held(t_end, y)) <= limit:
                    side = 0
                else:
                    side = -side
                y = y + 1e-9 * rate(side)(t_end, y)  # past the event
                t_end += 1e-9
            t = t_end
    return out, turns


@pytest.mark.parametrize("torque", [1.0, 5.0, 15.0])
def test_dry_friction_against_scipy_from_event_to_event(arm, geometry, torque):
    effect = effect_class("coulomb_friction")("joint_3", torque=torque)
    system, _ = motion(arm, geometry, [effect])
    flat = _flat(system)
    force = Blows.of(BLOWS, 6, DIRECTION).force()
    ours = integrate(flat, force, CLOCK).position.T
    reference, turns = _with_dry_friction(
        flat, force, CLOCK.times, np.array([0.0, 0.0, 1.0]), torque
    )
    plain = integrate(dataclasses.replace(flat, elements=(), rows=flat.rows[:0]), force, CLOCK)
    scale = np.abs(reference).max()
    assert turns >= 5  # it does turn round
    assert np.abs(ours - reference).max() < 2e-4 * scale
    assert np.abs(plain.position.T - reference).max() > 0.005 * scale  # and it does matter


def test_friction_sticks(arm, geometry):
    held = effect_class("coulomb_friction")("joint_2", torque=1e4)
    system, found = motion(arm, geometry, [held])
    _, free = motion(arm, geometry)
    # Within a step the joint still moves a little; at its end it stands.
    assert np.abs(found.position[:, 1]).max() < 1e-4 * np.abs(free.position[:, 1]).max()
    assert np.abs(found.position[:, 2]).max() > 0.1 * np.abs(free.position[:, 2]).max()
    assert system.coordinates == arm.flexible_names


def test_steady_state_with_play_repeats(arm, geometry):
    model = Model(arm, True).with_effects([effect_class("backlash")("joint_1", gap=2e-5)])
    blows = Blows.of(BLOWS, None, DIRECTION)
    system = model.plant(geometry).build(blows.direction)
    two = integrate(system, blows.force(), Samples(0.0, 0.001, 81)).position
    assert np.abs(two[:40] - two[40:80]).max() < 1e-4 * np.abs(two).max()


def test_effects_go_through_files(tmp_path, arm):
    from picchio.robot.loading.saved_model import saved_model_text

    effects = [
        effect_class("joint_stiffness")("joint_2", scale=0.8),
        effect_class("backlash")("joint_1", gap=1e-4),
        effect_class("pulse_jitter")("tool", std=1e-3).with_hidden({"r01.csv": (0.0, 1e-3)}),
    ]
    file = tmp_path / "found.toml"
    file.write_text(saved_model_text("fanuc_like_3dof", [e.to_dict() for e in effects]))
    robot = picchio.load_robot(file)
    assert Model(robot).effects == tuple(effects)
    assert [from_dict(e.to_dict(), arm) for e in effects] == effects


def test_a_saved_model_is_assessed_as_any_robot(tmp_path, arm):
    from picchio.robot.loading.saved_model import saved_model_text

    softer = effect_class("joint_stiffness")("joint_3", scale=0.8).to_dict()
    file = tmp_path / "softer.toml"
    file.write_text(saved_model_text("fanuc_like_3dof", [softer]))
    robot = picchio.load_robot(file)
    by_value = picchio.load_robot(
        "fanuc_like_3dof", values={"joint_3": {"stiffness": 0.8 * arm.stiffness[2]}}
    )
    task = picchio.load_task(arm.task_path, arm)
    one, other = picchio.assess(robot, task), picchio.assess(by_value, task)
    for a, b in zip(one.joints, other.joints, strict=True):
        assert a.peak_deflection == pytest.approx(b.peak_deflection, rel=1e-6)
        assert a.utilisation == pytest.approx(b.utilisation, rel=1e-5)


def test_a_nonlinear_model_is_assessed(tmp_path, arm):
    from picchio.robot.loading.saved_model import saved_model_text

    task = picchio.load_task(arm.task_path, arm)
    peaks = []
    for gap in (1e-12, 2e-4):
        file = tmp_path / f"gap{gap}.toml"
        play = effect_class("backlash")("joint_1", gap=gap).to_dict()
        file.write_text(saved_model_text("fanuc_like_3dof", [play]))
        found = picchio.assess(picchio.load_robot(file), task)
        peaks.append(found.joints[0].peak_deflection)
    plain = picchio.assess(arm, task).joints[0].peak_deflection
    assert peaks[0] == pytest.approx(plain, rel=5e-3)
    assert abs(peaks[1] / plain - 1.0) > 0.02


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('effect = "payload"\ntarget = "tool"\nparameters = { weight = 1.0 }', "weight"),
        ('effect = "backlsh"\ntarget = "joint_1"', "backlash"),
        ('effect = "backlash"\ntarget = "joint_1"\nparameters = { gap = -1.0 }', "gap"),
        ('effect = "backlash"\ntarget = "joint_9"\nparameters = { gap = 1e-4 }', "joint_9"),
    ],
)
def test_a_wrong_model_file_is_one_clear_error(tmp_path, arm, text, said):
    file = tmp_path / "wrong.toml"
    file.write_text(f'format = "picchio-model/1"\nrobot = "fanuc_like_3dof"\n[[effect]]\n{text}\n')
    with pytest.raises(InputError) as error:
        robot = picchio.load_robot(file)
        Model(robot).linear_system(robot.pose([0.0, 0.5, -0.8]))
        Model(robot).plant(Geometry.of(robot, robot.pose([0.0, 0.5, -0.8])))
    assert said in str(error.value)
    assert "\n" not in str(error.value)


@pytest.fixture(scope="module")
def problem(arm):
    """Two records of other days and temperatures, with every kind of channel."""
    start = datetime(2026, 3, 1, 8, tzinfo=UTC)
    plan = Plan(
        poses=[[0.3, 0.5, -0.8], [-0.4, 0.2, 0.3]],
        directions=[DIRECTION.tolist()],
        sample_rate=1000.0,
        quiet=0.2,
        length=0.4,
        times=[start, start + timedelta(days=30)],
        temperatures=[18.0, 30.0],
        excitation={"force": 300.0, "period": 0.04, "width": 0.004, "hits": 6},
        sensor=[{"channels": "accelerometer", "noise": 0.01}, {"channels": "deflection",
                "noise": 1e-7}, {"channels": "force", "noise": 0.1}],
    )  # fmt: skip
    return Problem(arm, simulate(arm, plan).campaign)


@pytest.fixture(scope="module")
def scales(problem):
    return measure_scales(problem, (), problem.predictions(()))


@pytest.mark.parametrize("name", [n for n, kind in catalogue().items() if kind.shows(motion=False)])
def test_what_is_tried_of_an_effect_changes_what_is_read(problem, scales, worlds, name):
    """At one target at least, by more than noise: a cable holds no link that never moves.

    Of what is drawn anew in every record, one step of its last number.
    """
    kind = effect_class(name)
    if kind.takes == "recorded":
        read = worlds.make(records=3, programmed=False, blend=1.0, sampling=2000.0,
                           sensors=("accelerometer", "deflection", "force"))  # fmt: skip
        problem = Problem(problem.robot, read[0])
    plain = problem.residuals(())

    def change(effect):
        if kind.latent is not None:
            numbers = np.zeros(kind.latent.size(6))
            numbers[-1] = kind.latent.step
            effect = effect.with_hidden({r.name: tuple(numbers) for r in problem.records})
        moved = problem.residuals((effect,))
        return sum(float(((a - b) ** 2).sum()) for a, b in zip(moved, plain, strict=True))

    targets = kind.targets(evidence_of(problem))
    tried = {target: kind(target).trials(scales) for target in targets}
    assert all(tried.values())
    assert any(
        min(change(kind(target, **values)) for values in tried[target]) > 0.1 for target in targets
    )


HISTORY = picchio.MeasuredForce(
    np.array([0.0, 0.001, 0.003, 0.004]), np.array([0.0, 310.0, 80.0, 0.0]), 0.04
)


@pytest.mark.parametrize("hits", [3, None])
def test_a_measured_force_rebounds_and_lasts_longer(hits):
    """As interpolating its samples says, echoes over the blow itself included."""
    blows = Blows.of(HISTORY, hits, DIRECTION)
    time = np.linspace(0.0, 0.0399, 1331)

    def once(t):
        return np.interp(t, HISTORY.time, HISTORY.samples, left=0.0, right=0.0)

    bounced = effect_class("rebound")("tool", ratio=0.3, delay=0.002).blows(blows, Conditions())
    np.testing.assert_allclose(
        bounced.force()(time), once(time) + 0.3 * once(time - 0.002), atol=1e-6
    )
    longer = effect_class("pulse_width")("tool", scale=1.5).blows(blows, Conditions())
    np.testing.assert_allclose(longer.force()(time), once(time / 1.5), atol=1e-6)
    plain = effect_class("pulse_shape")("tool", blend=0.5)
    with pytest.raises(InputError, match=r"pulse_shape: .* no other shape"):
        plain.blows(blows, Conditions())


@pytest.mark.parametrize("hits", [5, None])
@pytest.mark.parametrize("order", list(itertools.permutations(range(3))))
def test_another_rate_moves_the_programme_and_nothing_else(order, hits):
    """An echo comes as long after its blow, and a blow out of step as much, in any order."""
    scale, ratio, delay = 1.05, 0.3, 0.013
    late = (0.0, 1e-3, -2e-3, 5e-4, 0.0)
    effects = [
        effect_class("pulse_rate")("tool", scale=scale),
        effect_class("rebound")("tool", ratio=ratio, delay=delay),
        effect_class("pulse_jitter")("tool", std=1e-3).with_hidden({"r": late} if hits else {}),
    ]
    blows = Blows.of(BLOWS, hits, DIRECTION)
    for k in order:
        blows = effects[k].blows(blows, Conditions(record="r"))
    due = [h * scale * BLOWS.period + (late[h] if hits else 0.0) for h in range(hits or 1)]
    expected = [(t, 1.0) for t in due] + [(t + delay, ratio) for t in due]
    found = zip(blows.start, blows.height / BLOWS.force, strict=True)
    np.testing.assert_allclose(sorted(found), sorted(expected), rtol=1e-12)
    assert blows.period == (None if hits else pytest.approx(scale * BLOWS.period))


def test_blows_longer_than_their_period_add_up():
    """Each of the last two periods' blows is still there while the next one strikes."""
    longer = effect_class("pulse_width")("tool", scale=8.0)
    blows = longer.blows(Blows.of(HISTORY, None, DIRECTION).change(period=0.012), Conditions())
    time = np.linspace(0.0, 0.0119, 331)
    parts = [
        np.interp((time + shift) / 8.0, HISTORY.time, HISTORY.samples, left=0.0, right=0.0)
        for shift in (0.0, 0.012, 0.024)
    ]
    np.testing.assert_allclose(blows.force()(time), np.sum(parts, axis=0), atol=1e-5)


def test_a_loaded_joint_rests_at_the_edge_of_its_play(arm, geometry):
    """Blows too weak to lift it off leave it as without play; gravity tells the edge."""
    carried = arm.gravity_torque(geometry.pose)[1]
    assert abs(carried) > 10.0
    _, plain = motion(arm, geometry)
    _, found = motion(arm, geometry, [effect_class("backlash")("joint_2", gap=1e-3)])
    lifted = arm.stiffness[1] * np.abs(plain.position[:, 1]).max() / abs(carried)
    assert lifted < 1.0
    scale = np.abs(plain.position).max()
    assert np.abs(found.position - plain.position).max() < 1e-5 * scale


def test_a_foundation_is_stated_per_metre_along_an_axis_and_per_radian_about_it():
    kind = effect_class("base_compliance")
    assert [kind("x").unit(n) for n in ("stiffness", "damping")] == ["N/m", "N*s/m"]
    assert [kind("rx").unit(n) for n in ("stiffness", "damping")] == ["N*m/rad", "N*m*s/rad"]


def test_a_base_that_turns_about_the_first_joint_is_a_spring_in_series(arm, geometry):
    """Between them is nothing heavy: their dynamic stiffnesses add as compliances do."""
    stiffness, damping = 9e5, 400.0
    turns = from_dict(
        {"effect": "base_compliance", "target": "rz",
         "parameters": {"stiffness": stiffness, "damping": damping, "modal_share": 0.0}}, arm
    )  # fmt: skip
    force = np.array([-np.sin(0.3), np.cos(0.3), 0.0])  # across the arm: joint 1 alone answers
    plain = Model(arm, True).plant(geometry).build(force)
    system = Model(arm, True).with_effects([turns]).plant(geometry).build(force)
    assert system.coordinates[-1] == "base.rz"
    for hertz in (0.0, 3.0, 8.0, 20.0, 60.0, 200.0):
        s = 2j * np.pi * hertz
        whole = s * s * system.mass + s * system.damping + system.stiffness
        moved = np.linalg.solve(whole, system.force)
        joint = s * plain.damping[0, 0] + plain.stiffness[0, 0]
        base = s * damping + stiffness
        expected = plain.force[0] / (s * s * plain.mass[0, 0] + 1.0 / (1.0 / joint + 1.0 / base))
        assert system.force @ moved == pytest.approx(plain.force[0] * expected, rel=2e-3)
        assert moved[0] * joint == pytest.approx(moved[-1] * base, rel=0.03)  # one torque in both


def test_an_axis_that_is_none_is_refused_by_name(arm, geometry):
    """It once came out as a mass matrix that is not positive definite."""
    values = {"stiffness": 1e6, "damping": 10.0}
    with pytest.raises(InputError, match=r"no such axis.*rw.*rz"):
        from_dict({"effect": "base_compliance", "target": "rw", "parameters": values}, arm)
    turns = effect_class("base_compliance")("rw", **values)
    with pytest.raises(InputError, match=r"no such axis.*rw.*rz"):
        Model(arm, True).with_effects([turns]).plant(geometry)


def test_a_mount_that_does_not_resonate_is_refused():
    """From 1/sqrt(2) on its answer has no peak: that is a low-pass filter."""
    mount = effect_class("mount_resonance")
    mount("accelerometer.tool", frequency=200.0, damping_ratio=0.7)
    with pytest.raises(InputError, match="damping_ratio"):
        mount("accelerometer.tool", frequency=200.0, damping_ratio=0.75)


def test_a_saved_model_with_a_value_out_of_bounds_is_named_with_its_file(tmp_path):
    saved = tmp_path / "saved.toml"
    saved.write_text(
        'format = "picchio-model/1"\nrobot = "fanuc_like_3dof"\n[[effect]]\n'
        'effect = "mount_resonance"\ntarget = "accelerometer.tool"\n'
        "[effect.parameters]\nfrequency = 200.0\ndamping_ratio = 1.5\n"
    )
    with pytest.raises(InputError) as told:
        Model(picchio.load_robot(saved))
    line = str(told.value)
    assert line.startswith(
        f"{saved}: mount_resonance.damping_ratio: must lie between 0.001 and 0.7"
    )
    assert "0.7, got 1.5" in line


def test_plants_that_begin_alike_do_not_change_each_other(arm):
    """Of models that share all but the last effect the rest is made once: each has its own last."""
    pose = arm.pose([0.3, 0.5, -0.8])
    first = effect_class("payload")("tool", mass=3.0)
    last = [
        effect_class("joint_stiffness")("joint_2", scale=0.7),
        effect_class("cable")("joint_2", stiffness=2e4, damping=10.0),
        effect_class("base_compliance")("rz", stiffness=1e6, damping=10.0),
        effect_class("backlash")("joint_1", gap=1e-3),
    ]
    shared = Geometry.of(arm, pose)
    for effects in ([first, each] for each in (*last, *last[::-1])):
        one, alone = (
            Model(arm).with_effects(effects).plant(geometry).build(np.array([0.0, 0.0, 1.0]))
            for geometry in (shared, Geometry.of(arm, pose))
        )
        assert one.coordinates == alone.coordinates
        assert one.elements == alone.elements
        for name in ("mass", "stiffness", "damping", "gravity_curvature", "force"):
            assert np.array_equal(getattr(one, name), getattr(alone, name)), name
