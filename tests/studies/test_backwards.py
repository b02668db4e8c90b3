from __future__ import annotations

import dataclasses
import math

import pytest

from picchio.core.errors import InputError
from picchio.fatigue.sn.curve import SNCurve
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.loading.load import load_robot
from picchio.studies.assessment.run import assess
from picchio.studies.backwards import allowable
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


def make_task(robot: FlexibleRobot, force: float = 300.0, hits: int = 3) -> Task:
    return task_from_dict(
        {
            "hits_per_rivet": hits,
            "excitation": {
                "kind": "pulse_train", "force": force, "period": 0.04, "width": 0.004,
            },
            "operation": [
                {"name": "up", "direction": [0.0, 0.0, 1.0], "rivets": 2,
                 "poses": [[0.0, 0.5, -0.8], [0.3, 1.1, -1.0]]},
                {"name": "side", "direction": [0.0, 1.0, 0.0], "poses": [[0.7, 0.0, 0.0]]},
            ],
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
    with pytest.raises(InputError, match="no joint has a shaft"):
        allowable(without_shafts(robot), task, 1e6)
    with pytest.raises(InputError, match="survival"):
        allowable(robot, task, 1e6, sn_curve=STRAIGHT, survival=1.5)
