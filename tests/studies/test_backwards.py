from __future__ import annotations

import dataclasses
import functools
import math
from typing import Any

import pytest

from picchio.core.errors import InputError
from picchio.fatigue.sn.curve import SNCurve
from picchio.model.effects.nonlinear.hardening import Hardening
from picchio.model.model import Model
from picchio.robot.drives.reducer import all_reducers, load_reducer
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.loading.load import load_robot
from picchio.studies.assessment.backwards import allowable
from picchio.studies.assessment.run import assess
from picchio.studies.tasks import Task, task_from_dict

# A thinner shaft at the same joint stiffness is meant here, and warned of.
pytestmark = pytest.mark.filterwarnings("ignore:.*own stiffness G Jp")

STRAIGHT = SNCurve(
    name="straight", strength=60e6, cycles=1e6, slopes=(5.0,), survival=0.975, scatter=0.04,
    ultimate_shear=577e6,
)  # fmt: skip


@pytest.fixture(scope="module")
def robot() -> FlexibleRobot:
    return load_robot("fanuc_like_3dof")


def make_task(
    robot: FlexibleRobot, force: float = 300.0, hits: int = 3, *, short: bool = False
) -> Task:
    operations = [
        {"name": "up", "direction": [0.0, 0.0, 1.0], "rivets": 2,
         "poses": [[0.0, 0.5, -0.8], [0.3, 1.1, -1.0]]},
        {"name": "side", "direction": [0.0, 1.0, 0.0], "poses": [[0.7, 0.0, 0.0]]},
    ]  # fmt: skip
    return task_from_dict(
        {
            "hits_per_rivet": hits,
            "excitation": {
                "kind": "pulse_train", "force": force, "period": 0.04, "width": 0.004,
            },
            "operation": operations[-1:] if short else operations,
        },
        robot,
    )  # fmt: skip


def life_of(robot: FlexibleRobot, task: Task, curve: SNCurve, joint: str, **more: str) -> float:
    value = assess(robot, task, sn_curve=curve, **more).joint(joint).rivets_to_failure  # type: ignore[arg-type]
    assert value is not None
    return float(value)


@pytest.mark.parametrize("survival", [None, 0.999])
def test_each_answer_gives_the_wanted_life(robot: FlexibleRobot, survival: float | None) -> None:
    # The assessment, which knows nothing of this, run with the answer, gives the wanted life.
    wanted = 2e6
    task = make_task(robot)
    curve = STRAIGHT if survival is None else STRAIGHT.at_survival(survival)
    for found in allowable(robot, task, wanted, sn_curve=STRAIGHT, survival=survival):
        assert found.life == pytest.approx(life_of(robot, task, curve, found.joint), rel=1e-9)
        stronger = make_task(robot, 300.0 * found.force_factor)
        assert life_of(robot, stronger, curve, found.joint) == pytest.approx(wanted, rel=1e-6)
        other = dataclasses.replace(
            robot,
            flexible_joints=tuple(
                dataclasses.replace(j, shaft=j.shaft.model_copy(update={"radius": found.radius}))
                for j in robot.flexible_joints
                if j.shaft is not None
            ),
        )
        assert life_of(other, task, curve, found.joint) == pytest.approx(wanted, rel=1e-6)
        if found.hits:
            assert life_of(robot, make_task(robot, hits=found.hits), curve, found.joint) >= wanted
            more = make_task(robot, hits=found.hits + 1)
            assert life_of(robot, more, curve, found.joint) < wanted


def test_gravity_stays_when_the_force_grows(robot: FlexibleRobot) -> None:
    task = make_task(robot)
    for found in allowable(robot, task, 2e6, sn_curve=STRAIGHT, mean_stress="goodman"):
        stronger = make_task(robot, 300.0 * found.force_factor)
        assert life_of(
            robot, stronger, STRAIGHT, found.joint, mean_stress="goodman"
        ) == pytest.approx(2e6, rel=1e-6)


def test_a_joint_that_does_not_move_allows_anything(robot: FlexibleRobot) -> None:
    task = task_from_dict(
        {
            "hits_per_rivet": 3,
            "excitation": {"kind": "pulse_train", "force": 300.0, "period": 0.04, "width": 0.004},
            "operation": [
                {"name": "up", "direction": [0.0, 0.0, 1.0], "poses": [[0.0, 0.5, -0.8]]}
            ],
        },
        robot,
    )
    found = allowable(robot, task, 1e6, sn_curve=STRAIGHT)
    first = found[0]
    assert (first.force_factor, first.radius, first.hits) == (math.inf, 0.0, None)
    assert found.to_dict()["for_life"][0]["force_factor"] is None


def without_shafts(robot: FlexibleRobot) -> FlexibleRobot:
    joints = tuple(dataclasses.replace(j, shaft=None) for j in robot.flexible_joints)
    return dataclasses.replace(robot, flexible_joints=joints)


def test_bad_questions_are_named(robot: FlexibleRobot) -> None:
    task = make_task(robot)
    for bad in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(InputError, match="rivets"):
            allowable(robot, task, bad)
    with pytest.raises(InputError, match="survival"):
        allowable(robot, task, 1e6, sn_curve=STRAIGHT, survival=1.5)


# A steel that yields before it wears, and the part kinds whose limits are fed back.
BRITTLE = SNCurve(
    name="brittle", strength=500e6, cycles=1e6, slopes=(8.0,), knees=(1e6,), survival=0.975,
    scatter=0.04, yield_shear=400e6,
)  # fmt: skip
KINDS = {
    "shaft": (STRAIGHT, {}, "shaft"),
    "yield": (BRITTLE, {}, "yield"),
    "reducer beside shafts": (BRITTLE, {"joint_2": "RV-40E"}, "reducer"),
    "reducers alone": (
        None, {"joint_1": "RV-40E", "joint_2": "RV-80E", "joint_3": "RV-20E"}, "reducer",
    ),
    "nonlinear": (STRAIGHT, {}, "shaft"),
}  # fmt: skip


def built(robot: FlexibleRobot, kind: str, **changed: dict[str, Any]) -> FlexibleRobot | Model:
    """The arm with the parts of a kind; `changed` is by joint."""
    curve, reducers, _ = KINDS[kind]
    joints = []
    for joint in robot.flexible_joints:
        name = reducers.get(joint.name)
        reducer = load_reducer(name) if name else None
        shaft = joint.shaft if curve is not None else None
        whole = dataclasses.replace(joint, reducer=reducer, shaft=shaft)
        joints.append(dataclasses.replace(whole, **changed.get(joint.name, {})))
    made = dataclasses.replace(robot, flexible_joints=tuple(joints))
    if kind != "nonlinear":
        return made
    return Model(made).with_effects([Hardening("joint_2", cubic=1e11)])


def holds(robot: FlexibleRobot | Model, task: Task, rivets: float, curve: SNCurve | None) -> bool:
    """By the assessment, which knows nothing of this."""
    found = assess(robot, task, sn_curve=curve, steady_check=False)
    return all(
        not joint.rivets_to_failure < rivets
        and not joint.yield_utilisation > 1.0
        and not joint.reducer_utilisation > 1.0
        for joint in found.joints
    )


@pytest.mark.filterwarnings("ignore::picchio.PicchioWarning")
@pytest.mark.parametrize("kind", KINDS)
def test_what_is_allowed_holds_and_the_next_does_not(robot: FlexibleRobot, kind: str) -> None:
    curve, _, governor = KINDS[kind]
    wanted = 2e6
    work = functools.partial(make_task, robot, short=kind == "nonlinear")
    tried = built(robot, kind)
    found = allowable(tried, work(), wanted, sn_curve=curve)
    told = found.to_dict()["allowable"]
    assert told["governed_by"] == governor
    assert told["met"] == holds(tried, work(), wanted, curve)
    assert found.answer.startswith("Yes: " if told["met"] else "No: ")
    force = told["force"]
    assert holds(tried, work(force), wanted, curve)
    assert not holds(tried, work(force * (1 + 1e-9)), wanted, curve)
    again = allowable(tried, work(force), wanted, sn_curve=curve)
    assert again.met and again.answer.startswith("Yes: ")
    # Hits and rivets where both are finite: at nine tenths of that force a little more is allowed.
    near = allowable(tried, work(0.97 * force), wanted, sn_curve=curve)
    if near.hits is not None:
        assert holds(tried, work(0.97 * force, hits=near.hits), wanted, curve)
        assert not holds(tried, work(0.97 * force, hits=near.hits + 1), wanted, curve)
    if near.rivets:
        assert holds(tried, work(0.97 * force), near.rivets, curve)
        assert not holds(tried, work(0.97 * force), near.rivets + 1, curve)
    if kind == "nonlinear":
        return
    strong = make_task(robot, 0.97 * force)
    order = sorted(all_reducers().values(), key=lambda r: (r.repeated_peak_torque, r.name))
    for joint in near:
        if joint.radius > 0.0 and curve is not None:
            for factor, fine in ((1.0, True), (1.0 - 1e-9, False)):
                own = next(j for j in robot.flexible_joints if j.name == joint.joint)
                assert own.shaft is not None
                shaft = own.shaft.model_copy(update={"radius": joint.radius * factor})
                other = built(robot, kind, **{joint.joint: {"shaft": shaft}})
                assert holds(other, strong, wanted, curve) == fine, (joint, factor)
        if joint.reducer is None or not joint.peak_torque > 1.0:
            continue
        chosen = load_reducer(joint.reducer)
        smaller = [r for r in order if r.repeated_peak_torque < chosen.repeated_peak_torque]
        for reducer, fine in ((chosen, True), *((r, False) for r in smaller[-1:])):
            other = built(robot, kind, **{joint.joint: {"reducer": reducer}})
            assert holds(other, strong, wanted, curve) == fine, (joint, reducer.name)


@pytest.mark.filterwarnings("ignore::picchio.PicchioWarning")
def test_stiffness_alone_says_what_the_task_needs(robot: FlexibleRobot) -> None:
    bare = without_shafts(robot)
    task = make_task(robot)
    found = allowable(bare, task, 1e6, survival=0.99)
    assert found.met is None and not found.yes
    assert found.force_factor == math.inf
    assert found.answer.startswith("Cannot be told: no joint has a shaft or a reducer.")
    second = found[1]
    assert second.reducer is not None
    needed = (
        f"joint_2 {1e3 * second.radius:.4g} mm, {second.peak_torque:.4g} N m ({second.reducer})"
    )
    assert needed in found.answer
    # With parts as large as that the task can be done, with smaller ones not.
    from picchio.fatigue.sn.library import load_sn_curve
    from picchio.robot.joint import Shaft

    steel = load_sn_curve("42CrMo4-QT-shaft").at_survival(0.99)
    for factor, fine in ((1.0, True), (1.0 - 1e-9, False)):
        joints = tuple(
            dataclasses.replace(
                joint,
                shaft=Shaft(
                    radius=max(told.radius, 1e-3) * factor, length=0.01, shear_modulus=79e9
                ),
            )
            for joint, told in zip(bare.flexible_joints, found, strict=True)
        )
        assert holds(dataclasses.replace(bare, flexible_joints=joints), task, 1e6, steel) == fine


@pytest.mark.filterwarnings("ignore::picchio.PicchioWarning")
def test_gravity_alone_may_be_too_much(robot: FlexibleRobot) -> None:
    made = built(robot, "shaft", joint_2={"reducer": load_reducer("CSG-17-50")})
    found = allowable(made, make_task(robot), 1e6, sn_curve=STRAIGHT)
    assert (found.met, found.force_factor, found.force, found.rivets) == (False, 0.0, 0.0, 0)
    assert "No force of the blows is small enough" in found.answer


@pytest.mark.filterwarnings("ignore::picchio.PicchioWarning")
def test_a_shaft_that_cannot_be_gives_no_yes(robot: FlexibleRobot) -> None:
    (first, *rest) = robot.flexible_joints
    assert first.shaft is not None
    soft = first.shaft.model_copy(update={"length": 1.0})
    made = dataclasses.replace(
        robot, flexible_joints=(dataclasses.replace(first, shaft=soft), *rest)
    )
    found = allowable(made, make_task(robot), 1e6)
    assert found.met is None and not found.yes and all(joint.met for joint in found.joints)
    assert found.answer.startswith("Cannot be told: the shaft of joint_1")


SLOPED = SNCurve(name="sloped", strength=60e6, cycles=1e6, slopes=(5.0,), yield_shear=400e6)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::picchio.PicchioWarning")
def test_an_estimate_gives_intervals_and_no_plain_yes(robot: FlexibleRobot) -> None:
    guess = load_robot("fanuc_like_3dof", values={"joint_2": {"stiffness": 1e5, "estimated": True}})
    task = make_task(guess, hits=2)
    stated = allowable(robot, task, 1e6, sn_curve=SLOPED)
    assert stated.held is None and "force_interval" not in stated.to_dict()["allowable"]
    most = stated.rivets
    assert most is not None
    for factor, met, start in ((0.02, True, "Yes: "), (0.98, None, "Cannot be told: ")):
        found = allowable(guess, task, factor * most, sn_curve=SLOPED)
        told = found.to_dict()["allowable"]
        assert (told["met"], found.yes) == (met, met is True)
        assert found.answer.startswith(start) and " of the drawn cases" in found.answer
        assert (told["held_share"] >= 0.9) == (met is True)
        low, high = told["rivets_interval"]
        assert low < most < high and (low >= factor * most) == (met is True)
        low, high = told["force_interval"]
        assert low < found.force < high
        assert " N in 80 % of the drawn cases" in found.answer
        # The end that 90 % of the cases bear is a yes when it is fed back; a little more is not.
        if met is None:
            for force, fine in ((0.999 * low, True), (1.02 * low, False)):
                again = allowable(guess, make_task(guess, force, hits=2), factor * most,
                                  sn_curve=SLOPED)  # fmt: skip
                assert again.yes == fine
