from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ndtr

from picchio.core.errors import InputError
from picchio.fatigue.mean_stress import Rule
from picchio.fatigue.sn.curve import SNCurve
from picchio.fatigue.uncertain_lives import QUANTILES, Draws, Uncertain
from picchio.model.effects.registry import effect_class
from picchio.model.model import Model
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.loading.load import load_robot
from picchio.robot.varied import robot_with
from picchio.studies.assessment.run import assess
from picchio.studies.rivet.pose import ModelAtPose
from picchio.studies.rivet.variation import WornParts
from picchio.studies.tasks import Task, load_task, task_from_dict
from picchio.studies.uncertainty.inputs import DEFAULT_INPUTS, inputs_of
from picchio.studies.uncertainty.run import uncertain_life
from picchio.studies.uncertainty.sampler import Sampler, _Draw

STRAIGHT = SNCurve(name="straight", strength=60e6, cycles=1e6, slopes=(5.0,))
STEEL = dataclasses.replace(
    STRAIGHT, ultimate_shear=700e6, tensile_strength=1000e6, yield_shear=430e6
)
SURE = 1e-9


@pytest.fixture(scope="module")
def robot() -> FlexibleRobot:
    return load_robot("fanuc_like_3dof")


@pytest.fixture(scope="module")
def task(robot: FlexibleRobot) -> Task:
    return task_from_dict(
        {
            "hits_per_rivet": 3,
            "excitation": {
                "kind": "pulse_train", "force": 300.0, "period": 0.04, "width": 0.004,
            },
            "operation": [
                {"name": "up", "direction": [0.0, 0.0, 1.0], "rivets": 2,
                 "poses": [[0.0, 0.5, -0.8], [0.3, 1.1, -1.0]]},
                {"name": "side", "direction": [0.0, 1.0, 0.0], "poses": [[0.7, 0.0, 0.0]]},
            ],
        },
        robot,
    )  # fmt: skip


def test_without_spread_it_is_the_assessment(robot: FlexibleRobot, task: Task) -> None:
    inputs = {name: Uncertain(1.0, SURE) for name in DEFAULT_INPUTS}
    found = uncertain_life(robot, task, sn_curve=STRAIGHT, inputs=inputs, samples=256)
    nominal = assess(robot, task, sn_curve=STRAIGHT)
    assert found.robot.p50 == pytest.approx(nominal.rivets_to_failure, rel=1e-6)
    for joint in nominal.joints:
        spread = found.joints[joint.name]
        assert joint.rivets_to_failure is not None
        assert spread.p10 == pytest.approx(joint.rivets_to_failure, rel=1e-6)
        assert spread.p90 == pytest.approx(spread.p10, rel=1e-6)


def test_force_and_model_error_in_closed_form(robot: FlexibleRobot, task: Task) -> None:
    # Life goes with (force * model error)^-5: log-normal, sigma = 5 sqrt(0.1^2 + 0.1^2).
    inputs = {"force": Uncertain(1.0, 0.1), "model": Uncertain(1.0, 0.1)}
    found = uncertain_life(robot, task, sn_curve=STRAIGHT, inputs=inputs).robot
    nominal = assess(robot, task, sn_curve=STRAIGHT).rivets_to_failure
    sigma = 5.0 * math.sqrt(0.02)
    assert found.p50 == pytest.approx(nominal, rel=0.03)
    assert found.p10 == pytest.approx(nominal * math.exp(-1.2816 * sigma), rel=0.05)
    assert found.p90 == pytest.approx(nominal * math.exp(1.2816 * sigma), rel=0.05)
    assert found.shares["force"] == pytest.approx(0.5, abs=0.08)
    assert found.shares["model"] == pytest.approx(0.5, abs=0.08)


def test_specimens_scatter_as_their_curve_says(robot: FlexibleRobot, task: Task) -> None:
    curve = dataclasses.replace(STRAIGHT, survival=0.9, scatter=0.04)
    found = uncertain_life(robot, task, sn_curve=curve, inputs={"force": Uncertain(1.0, SURE)})
    # The curve that 90 % of specimens survive gives the life that 90 % of lives exceed.
    assert found.robot.p10 == pytest.approx(
        assess(robot, task, sn_curve=curve).rivets_to_failure, rel=0.03
    )
    assert found.robot.shares["strength"] == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize("effect", [None, "base_compliance", "backlash"])
def test_any_model_is_varied_whole(robot: FlexibleRobot, task: Task, effect: str | None) -> None:
    # What yields beside the joints keeps its stiffness, and a gap its size, when the joints vary;
    # damping beyond critical (without an effect) leaves the compiled path.
    given = {
        None: [],
        "base_compliance": [effect_class("base_compliance")("ry", stiffness=2e6, damping=2e3)],
        "backlash": [effect_class("backlash")("joint_2", gap=1e-4)],
    }[effect]
    key, factor = ("damping_ratio", 40.0) if effect is None else ("stiffness", 0.7)
    model = Model(robot).with_effects(given)
    stress = WornParts.of(robot, STEEL)
    inputs = inputs_of(model, task, stress, {key: Uncertain(1.0, 1.0)}, [])
    drawn = Sampler(model, task, stress, inputs).run(np.array([[math.log(factor)]]))
    joints = tuple(
        dataclasses.replace(j, **{key: factor * getattr(j, key)}) for j in robot.flexible_joints
    )
    other = Model(dataclasses.replace(robot, flexible_joints=joints)).with_effects(given)
    told = assess(other, task, sn_curve=STEEL, steady_check=False).joints
    expected = [joint.rivets_to_failure for joint in told]
    np.testing.assert_allclose(drawn.lives[:, 0], expected, rtol=1e-4)
    expected = [joint.yield_utilisation for joint in told]
    np.testing.assert_allclose(drawn.yielding[:, 0], expected, rtol=1e-5)


def test_one_seed_one_result(robot: FlexibleRobot, task: Task) -> None:
    first, again, other = (
        uncertain_life(robot, task, sn_curve=STRAIGHT, samples=256, seed=seed).to_dict()
        for seed in (1, 1, 2)
    )
    assert first == again
    assert first["robot"] != other["robot"]


def test_bad_input_is_named(robot: FlexibleRobot, task: Task) -> None:
    with pytest.raises(InputError, match="did you mean 'stiffness'"):
        uncertain_life(robot, task, sn_curve=STRAIGHT, inputs={"stifness": Uncertain(1.0, 0.1)})
    joints = tuple(dataclasses.replace(j, shaft=None) for j in robot.flexible_joints)
    bare = dataclasses.replace(robot, flexible_joints=joints)
    with pytest.raises(InputError, match="no joint has a shaft"):
        uncertain_life(bare, task)


@pytest.mark.parametrize("correlation", [-1.0, 0.0, 1.0])
def test_a_correlation_moves_the_interval_as_its_closed_form_says(
    task: Task, tmp_path: Path, correlation: float
) -> None:
    # Of a straight curve of slope 5 the life goes with radius^15: log-normal in each joint. The
    # weaker of two that are tied together: P(min < l) from the bivariate normal distribution.
    posterior = (
        '\n[posterior]\nnames = ["shaft.radius.joint_2", "shaft.radius.joint_3"]\n'
        f"correlation = [[1.0, {correlation}], [{correlation}, 1.0]]\n"
    )
    text = (Path(load_robot("fanuc_like_3dof").source).parent / "flex.toml").read_text()
    text = text.replace("radius = 0.01765", "radius = 0.5").replace(
        "radius = 0.0132", "radius = 0.0132, radius_spread = 1.02"
    )
    file = tmp_path / "flex.toml"
    file.write_text(text + posterior)
    robot = load_robot("fanuc_like_3dof", flex=file)
    nominal = assess(robot, task, sn_curve=STRAIGHT, uncertainty=False)
    lives = [j.rivets_to_failure for j in nominal.joints[1:]]
    found = uncertain_life(robot, task, sn_curve=STRAIGHT, inputs={}, samples=4096).robot
    sigma = 15.0 * math.log(1.02)
    for name, p in QUANTILES.items():

        def below(log: float, p: float = p) -> float:
            a, b = ((log - math.log(life)) / sigma for life in lives)
            if correlation == 1.0:
                return float(ndtr(max(a, b))) - p
            if correlation == 0.0:
                return float(1.0 - ndtr(-a) * ndtr(-b)) - p
            return float(min(ndtr(a) + ndtr(b), 1.0)) - p

        exact = math.exp(brentq(below, math.log(min(lives)) - 5.0, math.log(min(lives)) + 5.0))
        low, high = found.sampling[name]
        assert 0.98 * low <= exact <= 1.02 * high
        assert getattr(found, name) == pytest.approx(exact, rel=0.05)


def test_an_estimate_yields_an_interval_and_no_lone_number(
    robot: FlexibleRobot, task: Task
) -> None:
    guess = load_robot("fanuc_like_3dof", values={"joint_2": {"stiffness": 1e5, "estimated": True}})
    found = assess(guess, task, sn_curve=STRAIGHT, steady_check=False)
    told = found.to_dict()
    assert told["estimated"] is True
    assert (
        told["life"]["p10"] < told["life"]["p50"] == told["rivets_to_failure"] < told["life"]["p90"]
    )
    assert set(told["joints"][1]["life"]) == {"p10", "p50", "p90"}
    assert sum(told["spread_shares"].values()) <= 1.2
    assert told["uncertainty"]["inputs"]["stiffness.joint_2"]["spread"] == pytest.approx(
        math.log(2.0)
    )
    assert " to " in found.verdict.headline and "median" in found.verdict.headline
    assert any("joint_2: stiffness is an estimate" in line for line in found.verdict.reasons)
    # What is known for sure has a life, and no interval.
    assert "life" not in assess(robot, task, sn_curve=STRAIGHT, steady_check=False).to_dict()


def test_a_resonance_shows_in_the_scan(task: Task) -> None:
    guess = load_robot(
        "fanuc_like_3dof", values={"joint_3": {"stiffness": 1e5, "stiffness_spread": 2.0}}
    )
    found = uncertain_life(guess, task, sn_curve=STRAIGHT, inputs={}, samples=256, totals=False)
    scan = found.scans["stiffness.joint_3"]
    factor = float(scan.factor[np.argmin(scan.life)])
    stiff = load_robot("fanuc_like_3dof", values={"joint_3": {"stiffness": factor * 1e5}})
    worst = assess(stiff, task, sn_curve=STRAIGHT, steady_check=False).rivets_to_failure
    assert scan.life.min() == pytest.approx(worst, rel=1e-5)


@pytest.mark.parametrize(
    ("rule", "masses"), [("none", True), ("goodman", False), ("goodman", True)]
)
def test_a_drawn_world_is_assess_on_the_changed_robot(
    task: Task, tmp_path: Path, rule: Rule, masses: bool
) -> None:
    # Every kind of value at once, by each path of the sampler and by assess on another robot.
    file = tmp_path / "flex.toml"
    text = (Path(load_robot("fanuc_like_3dof").source).parent / "flex.toml").read_text()
    text = text.replace("radius = 0.0132", "radius = 0.0132, radius_spread = 1.02")
    text = text.replace("stiffness = 1.0e5", "stiffness = 1.0e5\nstiffness_spread = 1.5")
    text = text.replace("[joint.joint_2]", '[joint.joint_2]\nreducer = "RV-80E-121"')
    if masses:
        text += "mass = 3.0\nmass_spread = 1.2\ncom = [0.0, 0.0, 0.1]\ncom_std = 0.02\n"
    file.write_text(text)
    robot = load_robot("fanuc_like_3dof", flex=file)
    found = uncertain_life(robot, task, sn_curve=STEEL, inputs={}, samples=256, totals=False,
                           mean_stress=rule, seed=3)  # fmt: skip
    spreads = [robot.spreads[name] for name in found.inputs]
    lives, yielding, geared = [], [], []
    for row in Draws(len(spreads), 3).more().reshape(-1, len(spreads))[:3]:
        drawn = robot_with(robot, [(s, s.at(float(z))) for s, z in zip(spreads, row, strict=True)])
        told = assess(drawn, task, sn_curve=STEEL, mean_stress=rule, steady_check=False)
        lives.append(told.rivets_to_failure)
        yielding.append([joint.yield_utilisation for joint in told.joints])
        geared.append(told.joints[1].reducer_utilisation)
    np.testing.assert_allclose(found.lives[:3], lives, rtol=1e-4)
    model, stress = Model(robot), WornParts.of(robot, STEEL, mean_stress=rule)
    rows = Draws(len(spreads), 3).more().reshape(-1, len(spreads))[:3]
    drawn = Sampler(model, task, stress, inputs_of(model, task, stress, {}, [])).run(rows)
    np.testing.assert_allclose(drawn.yielding.T, yielding, rtol=1e-5)
    np.testing.assert_allclose(drawn.geared[1], geared, rtol=1e-5)


def test_a_drawn_stiffness_may_lie_far_beyond_an_effects_bounds() -> None:
    """A mode that is not underdamped is computed by a whole model, whatever its springs are."""
    robot = load_robot("fanuc_like_3dof")
    assert robot.task_path is not None
    task = load_task(robot.task_path, robot)
    model = Model.of(robot)
    given = {"stiffness": Uncertain(1.0, 1.0), "damping_ratio": Uncertain(1.0, 1.0)}
    sampler = Sampler.of(model, task, WornParts.of(robot, None), given, [])
    score = np.zeros((2, len(sampler.inputs)))
    which = {each.key: i for i, each in enumerate(sampler.inputs)}
    score[:, which["stiffness"]] = np.log([60.0, 1.0 / 3000.0])
    score[:, which["damping_ratio"]] = np.log(50.0)  # 1.5: overdamped
    assert (sampler.run(score).used > 0.0).all()
    draw = _Draw.of(sampler, score, np.ones(2))
    for d, factor in enumerate((60.0, 1.0 / 3000.0)):
        at = ModelAtPose(draw._model(d), task.operations[0].poses[0])
        np.testing.assert_allclose(at.stiffness, factor * robot.stiffness, rtol=1e-9)
