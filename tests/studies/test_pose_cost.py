"""The cost for planners: its value and gradient, and a path that it makes lighter."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import picchio
from picchio.studies.cost import PoseCost
from picchio.studies.placement.self_collision import SelfCollision

pytestmark = pytest.mark.filterwarnings("ignore::picchio.PicchioWarning")

ALONG = np.array([0.6, -0.48, 0.64])
BLOWS = picchio.HalfSineTrain(700.0, 0.033, 0.005, 40.0)


def used(robot: picchio.load_robot, pose: np.ndarray) -> np.ndarray:
    """(n,) by `assess`: the closed form, counted in Python."""
    from picchio.studies.instant import Place

    task = Place(pose, ALONG, BLOWS, 9).task
    found = picchio.assess(robot, task, uncertainty=False, steady_check=False).operations[0]
    return np.nan_to_num(np.fmax(found.utilisation[0], found.reducer_utilisation[0]))


@pytest.mark.parametrize("name", ["fanuc_like_3dof", "ur10"])
def test_value_and_gradient_are_those_of_assess(name: str) -> None:
    robot = picchio.load_robot(name)
    cost = PoseCost(robot, 3.0 * ALONG, BLOWS, hits=9)
    pose = np.clip(np.linspace(0.3, 0.7, len(robot.joint_names)), robot.lower, robot.upper)
    value, gradient = cost(pose)
    each = used(robot, pose)
    assert value == pytest.approx((each**12).sum() ** (1 / 12), rel=1e-6)
    assert each.max() <= value * (1 + 1e-9) <= 1.24 * each.max()
    np.testing.assert_allclose(cost.batch([pose, pose]), [value, value])
    # Other steps, another way to the numbers, along a direction of no joint alone.
    way = np.cos(np.arange(len(pose)) + 1.0)
    ends = [(used(robot, pose + s * 1e-3 * way) ** 12).sum() ** (1 / 12) for s in (1.0, -1.0)]
    slope = (ends[0] - ends[1]) / 2e-3
    assert gradient @ way == pytest.approx(slope, rel=0.02, abs=1e-4 * value)


def test_a_robot_without_limits_is_refused() -> None:
    robot = picchio.load_robot("ur10")
    from dataclasses import replace

    bare = replace(robot, flexible_joints=tuple(
        replace(j, shaft=None, strength=None, reducer=None) for j in robot.flexible_joints
    ))  # fmt: skip
    with pytest.raises(picchio.InputError, match="no joint has a shaft"):
        PoseCost(bare, ALONG, BLOWS)


@pytest.mark.slow
def test_the_example_lowers_a_paths_damage_at_equal_success(repository: Path) -> None:
    text = (repository / "docs" / "how_to" / "planner_cost.md").read_text()
    found: dict[str, Any] = {}
    exec(re.search(r"```python\n(.*?)```", text, re.DOTALL)[1], found)  # type: ignore[index]
    robot, points, along = found["robot"], found["points"], found["along"]
    assert 0.0 < found["after"] < 0.7 * found["before"]
    touches = SelfCollision.of(robot, found["path"][0])
    for poses in (found["path"], found["lighter"]):
        assert len(poses) == len(points) == 10
        assert np.abs(np.diff(poses, axis=0)).max() < 0.5  # one motion, no jump of a joint
        for pose, point in zip(poses, points, strict=True):
            _, turn = robot.frame_placement(pose, robot.tool_frame)
            np.testing.assert_allclose(robot.tool_position(pose), point, atol=1e-6)
            axis = turn @ np.array(robot.tool.axis)
            assert axis @ -along / np.linalg.norm(axis) > 1 - 1e-8
            assert robot.limit_violations(pose) == [] and not touches.collides(pose)
