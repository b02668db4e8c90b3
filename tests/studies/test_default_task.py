from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import picchio
from picchio.core.errors import InputError
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.loading.find import find_robot
from picchio.robot.loading.load import load_robot
from picchio.studies.default_task import (
    default_poses,
    default_task,
    default_task_content,
    task_of,
)
from picchio.studies.placement.self_collision import SelfCollision
from picchio.studies.tasks import task_from_dict

ARMS = ("fanuc_like_3dof", "ur10", "panda", "kinova", "talos_left_arm", "tiago", "xarm7")


def arm(name: str, **given: str) -> FlexibleRobot:
    return load_robot(name, allow_rigid=True, **given)  # type: ignore[arg-type]


@pytest.mark.filterwarnings("ignore::picchio.PicchioWarning")
@pytest.mark.parametrize("name", ARMS)
def test_poses_are_where_a_robot_works(name: str) -> None:
    """Asked of Pinocchio and of the limits, not of the arithmetic that chose the poses."""
    robot = arm(name)
    task = default_task(robot)
    assert [tuple(op.direction) for op in task.operations] == [(1, 0, 0), (0, 1, 0), (0, 0, 1)]
    poses = task.operations[0].poses
    assert poses.shape == (5, len(robot.joint_names))
    assert all(np.array_equal(op.poses, poses) for op in task.operations)
    np.testing.assert_array_equal(poses, poses.round(3))
    assert not any(robot.limit_violations(pose) for pose in poses)
    assert (np.abs(poses) <= np.pi).all()
    frame = robot.rigid.frame(robot.tool_point)
    moves = np.abs([robot.rigid.jacobian(pose, frame) for pose in poses]).max(axis=(0, 1)) > 1e-9
    assert (poses[:, ~moves] == 0.0).all()
    rng = np.random.default_rng(7)
    low, high = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    anywhere = [robot.tool_position(low + (high - low) * rng.random(len(low)))
                for _ in range(500)]  # fmt: skip
    points = np.array([robot.tool_position(pose) for pose in poses])
    assert (points[:, 0] > 0.0).all()  # in front
    assert (points[:, 2] > 0.0).all()
    across = max(np.linalg.norm(a - b) for a in points for b in points)
    assert across > 0.25 * np.ptp(anywhere, axis=0).max()


def test_poses_are_farther_from_singular_than_most() -> None:
    robot = arm("kuka_iiwa14")
    frame = robot.rigid.frame(robot.tool_point)

    def least(pose: np.ndarray) -> float:
        return float(np.linalg.svd(robot.rigid.jacobian(pose, frame), compute_uv=False)[-1])

    rng = np.random.default_rng(1)
    any_pose = [
        least(robot.lower + (robot.upper - robot.lower) * rng.random(7)) for _ in range(400)
    ]
    assert min(least(pose) for pose in default_poses(robot)) > np.quantile(any_pose, 0.2)


def test_links_hardly_ever_touch() -> None:
    """Pinocchio's meshes, which the choice does not look at."""
    touching = 0
    for name in ("ur10", "kinova", "xarm7"):
        robot = arm(name)
        meshes = SelfCollision.of(robot, np.zeros(len(robot.joint_names)))
        assert isinstance(meshes, SelfCollision)
        touching += sum(meshes.collides(pose) for pose in default_poses(robot))
    assert touching <= 1


def test_the_same_seed_gives_the_same_poses() -> None:
    robot = arm("ur10")
    np.testing.assert_array_equal(default_poses(robot, seed=3), default_poses(arm("ur10"), seed=3))
    assert not np.array_equal(default_poses(robot, seed=3), default_poses(robot, seed=4))
    written = default_poses(robot)[0]  # as first released: another machine gives the same
    np.testing.assert_array_equal(written, [0.16, -1.547, 1.569, -1.866, 0.437, 0.203])


BLOWS = {
    "as documented": ("bare", {}, (300.0, 0.040, 0.004, 12)),
    "the force alone": ("bare", {"force": 500.0}, (500.0, 0.040, 0.004, 12)),
    "all of them": (
        "bare", {"force": 80.0, "period": 0.1, "width": 0.01, "hits": 3}, (80.0, 0.1, 0.01, 3),
    ),
    "the robot's example": ("fanuc_like_3dof", {}, (300.0, 0.040, 0.004, 12)),
    "of the example, the rate and the hits": (
        "fanuc_like_3dof", {"period": 0.05, "hits": 1}, (300.0, 0.05, 0.004, 1),
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BLOWS)
def test_without_a_task_the_blows_are_documented_and_can_be_set(case: str) -> None:
    name, given, (force, period, width, hits) = BLOWS[case]
    robot = arm("ur10") if name == "bare" else arm(name)
    robot = dataclasses.replace(robot, task_path=None) if name == "bare" else robot
    task = task_of(robot, **given)
    assert task.assumed
    for operation in task.operations:
        blows = operation.excitation
        assert (blows.peak_force, blows.period, operation.hits_per_rivet) == (force, period, hits)
        assert f"{1e3 * width:g} ms wide" in blows.describe()
    with pytest.raises(InputError, match="force: belongs to an answer without a task"):
        task_of(robot, task, force=1.0)


@pytest.mark.parametrize("payload", [0.5, 3.0, 10.0, 300.0])
def test_a_payload_never_sets_the_blow(payload: float, tmp_path: Path) -> None:
    assert picchio.start("ur10", payload=payload).task["excitation"]["force"] == 300.0
    urdf = find_robot("ur10").urdf
    robot = picchio.load_robot(urdf, payload=payload)
    assert {op.excitation.peak_force for op in task_of(robot).operations} == {300.0}


def test_a_leg_and_a_single_slide_have_poses_too() -> None:
    leg = arm("talos_reduced", tool="left_sole_link")
    assert np.ptp(default_poses(leg), axis=0).max() > 0.1
    slide = arm("emps")
    poses = default_poses(slide)
    assert (poses > slide.lower).all() and (poses < slide.upper).all()
    content = default_task_content(leg)
    assert set(content["operation"][0]["poses"][0]) < set(leg.joint_names)
    assert len(task_from_dict(content, leg).operations) == 3


def test_nothing_that_moves_is_refused(tmp_path: Path) -> None:
    urdf = tmp_path / "post.urdf"
    urdf.write_text('<robot name="post"><link name="post"/></robot>')
    with pytest.raises(InputError, match="no joint moves the tool"):
        default_task(arm(str(urdf)))
