"""Inverse kinematics of 6- and 7-DoF arms, with pink as the oracle."""

from __future__ import annotations

import numpy as np
import pink
import pinocchio as pin
import pytest

from picchio.core.errors import InputError
from picchio.robot.ik.branch import branch_label, tool_joints
from picchio.robot.ik.inverse_kinematics import solve_many
from picchio.robot.ik.self_motion import move_along_self_motion, self_motion_basis
from picchio.robot.loading.find import example_robots
from picchio.robot.loading.load import load_robot

from .trees import load_tree

ARMS = {
    "ur5_robot": "tool0",
    "ur10_robot": "tool0",
    "panda": "panda_hand_tcp",
    "kinova": "j2s6s200_end_effector",
    "xarm7": "link_eef",
    "z1": "link06",
}


def arm(name: str):
    path = example_robots()[name]
    values = {joint: {"stiffness": 1e4} for joint in load_tree(path).movable()}
    return load_robot(path, tool=ARMS[name], values=values)


def targets(robot, count: int, seed: int):
    """Points and axes that some pose within the limits has."""
    rng = np.random.default_rng(seed)
    lower = np.maximum(robot.lower, -3.0)
    upper = np.minimum(robot.upper, 3.0)
    states = [robot.state(rng.uniform(lower, upper)) for _ in range(count)]
    return (np.array([s.tool_position for s in states]),
            np.array([s.tool_rotation[:, 2] for s in states]), states)  # fmt: skip


def pink_solve(robot, target, start, names):
    """One pose from pink's differential inverse kinematics, or None where it gets stuck."""
    model = pin.buildModelFromUrdf(str(robot.source))
    model = pin.buildReducedModel(
        model,
        [model.getJointId(n) for n in list(model.names)[1:] if n not in names],
        pin.neutral(model),
    )
    q = pin.neutral(model)
    for joint, name in zip(list(model.joints)[1:], list(model.names)[1:], strict=True):
        angle = start[robot.joint_names.index(name)]
        q[joint.idx_q : joint.idx_q + joint.nq] = (
            angle if joint.nq == 1 else (np.cos(angle), np.sin(angle))
        )
    configuration = pink.Configuration(model, model.createData(), q)
    # No cost on the rotation about the tool's own z axis: free roll.
    task = pink.FrameTask(robot.tool_frame, 1.0, np.array([1.0, 1.0, 0.0]), lm_damping=1e-6)
    task.set_target(pin.SE3(target.tool_rotation, target.tool_position))
    for _ in range(300):
        velocity = pink.solve_ik(configuration, [task], 1.0, solver="daqp", damping=1e-9)
        configuration.integrate_inplace(np.clip(velocity, -0.3, 0.3), 1.0)
        if np.linalg.norm(task.compute_error(configuration)[:5]) < 1e-7:
            break
    else:
        return None
    pose = {}
    for joint, name in zip(list(model.joints)[1:], list(model.names)[1:], strict=True):
        at = configuration.q[joint.idx_q : joint.idx_q + joint.nq]
        pose[name] = float(at[0]) if joint.nq == 1 else float(np.arctan2(at[1], at[0]))
    return robot.pose(pose)


@pytest.mark.parametrize("name", sorted(ARMS))
def test_solutions_reach_the_point_with_the_axis_within_limits(name):
    robot = arm(name)
    points, axes, _ = targets(robot, 20, 3)
    found = solve_many(robot, points, axes=axes)
    # The targets come from poses, so every one of them can be reached.
    assert set(found.point) == set(range(20))
    assert (found.distance == 0).all()
    for pose, index in zip(found.poses, found.point, strict=True):
        state = robot.state(pose)
        np.testing.assert_allclose(state.tool_position, points[index], atol=2e-8)
        np.testing.assert_allclose(state.tool_rotation[:, 2], axes[index], atol=2e-7)
        assert robot.limit_violations(pose) == []


@pytest.mark.parametrize("name", sorted(ARMS))
def test_what_pink_finds_is_found(name):
    robot = arm(name)
    names = tool_joints(robot)
    _, _, states = targets(robot, 5, 11)
    rng = np.random.default_rng(5)
    hits = 0
    for state in states:
        start = state.pose + rng.normal(size=len(state.pose)) * 0.3
        start = np.clip(start, robot.lower + 1e-3, robot.upper - 1e-3)
        theirs = pink_solve(robot, state, start, names)
        if theirs is None or robot.limit_violations(theirs):
            continue
        hits += 1
        axis = state.tool_rotation[:, 2]
        ours = robot.all_branches(state.tool_position, axis=axis)
        assert ours
        if name.startswith("ur"):
            # The last joint turns about the tool's axis: the other five tell the branches apart.
            gaps = [np.abs(np.angle(np.exp(1j * (theirs - q))))[:5].max() for q in ours]
            assert min(gaps) < 1e-4
    assert hits >= 2


def test_a_ur_has_eight_branches():
    robot = arm("ur10_robot")
    found = robot.all_branches([0.6, 0.3, 0.4], axis=[1, 0, 0])
    assert len(found) == 8
    labels = {branch_label(robot, pose).rsplit(" ", 1)[0] for pose in found}
    assert len(labels) >= 6
    chosen = robot.inverse_kinematics(
        [0.6, 0.3, 0.4], axis=[1, 0, 0], branch=["elbow_joint-", "wrist_2_joint+"]
    )
    assert chosen[2] < 0 < chosen[4]
    with pytest.raises(InputError, match="did you mean 'elbow_joint"):
        robot.inverse_kinematics([0.6, 0.3, 0.4], branch="elbow-joint+")


def test_the_point_can_be_reached_but_not_the_axis():
    robot = arm("ur10_robot")
    reach = max(robot.all_branches([1.1, 0.0, 0.2]), key=len)
    assert reach is not None
    with pytest.raises(InputError, match="but not with the tool pointing this way"):
        robot.inverse_kinematics([1.25, 0.0, 0.1], axis=[-1, 0, 0])
    with pytest.raises(InputError, match=r"out of reach.* m away"):
        robot.inverse_kinematics([5.0, 0.0, 0.0], axis=[1, 0, 0])


def test_batched_is_the_same_as_one_by_one():
    robot = arm("ur5_robot")
    points, axes, _ = targets(robot, 6, 1)
    together = solve_many(robot, points, axes=axes)
    for index in range(6):
        alone = robot.all_branches(points[index], axis=axes[index])
        np.testing.assert_array_equal(together.poses[together.point == index], alone)


@pytest.mark.parametrize(("name", "left"), [("ur10_robot", 1), ("panda", 2), ("xarm7", 2)])
def test_self_motion_keeps_the_tool_still(name, left):
    robot = arm(name)
    state = targets(robot, 1, 2)[2][0]
    basis = self_motion_basis(robot, state.pose)
    assert basis.shape == (robot.rigid.nv, left)
    np.testing.assert_allclose(basis.T @ basis, np.eye(left), atol=1e-12)
    jacobian = robot.frame_jacobian(state.pose, robot.tool_frame)
    index = robot.flexible_index
    np.testing.assert_allclose(jacobian[:3] @ basis[index], 0, atol=1e-9)
    spin = jacobian[3:] @ basis[index]
    np.testing.assert_allclose(np.cross(spin.T, state.tool_rotation[:, 2]), 0, atol=1e-9)

    goal = np.clip(state.pose + 0.4 * basis[:, 0], robot.lower, robot.upper)
    moved = move_along_self_motion(robot, state.pose, goal)
    after = robot.state(moved)
    np.testing.assert_allclose(after.tool_position, state.tool_position, atol=1e-7)
    np.testing.assert_allclose(after.tool_rotation[:, 2], state.tool_rotation[:, 2], atol=1e-6)
    assert np.linalg.norm(moved - state.pose) > 0.05
    assert np.linalg.norm(goal - moved) < np.linalg.norm(goal - state.pose)


def test_scattered_solutions_show_the_redundancy():
    robot = arm("panda")
    _, _, states = targets(robot, 1, 4)
    point, axis = states[0].tool_position, states[0].tool_rotation[:, 2]
    few = solve_many(robot, [point], axes=[axis]).poses
    many = solve_many(robot, [point], axes=[axis], scattered=True).poses
    assert len(many) > 4 * len(few) > 0


def test_a_mimicking_chain_and_prismatic_joints(write):
    """A telescope whose second stage follows the first, on a turning base: solved by hand."""
    text = """<robot name="t"><link name="w"/><link name="a"/><link name="b"/><link name="c"/>
    <joint name="turn" type="continuous"><parent link="w"/><child link="a"/><axis xyz="0 0 1"/>
    </joint><joint name="out" type="prismatic"><parent link="a"/><child link="b"/>
    <axis xyz="1 0 0"/><limit lower="0" upper="1" effort="1" velocity="1"/></joint>
    <joint name="more" type="prismatic"><parent link="b"/><child link="c"/><axis xyz="1 0 0"/>
    <mimic joint="out" multiplier="0.5" offset="0.1"/>
    <limit lower="0" upper="1" effort="1" velocity="1"/></joint></robot>"""
    robot = load_robot(write("t.urdf", text), allow_rigid=True, tool="c")
    assert robot.joint_names == ("turn", "out")
    pose = robot.inverse_kinematics([0.6, 0.8, 0.0])
    np.testing.assert_allclose(pose, [np.arctan2(0.8, 0.6), 0.6], atol=1e-7)


@pytest.mark.slow
def test_more_starts_find_no_more_branches():
    robot = arm("ur10_robot")
    points, axes, _ = targets(robot, 25, 9)
    few = solve_many(robot, points, axes=axes)
    many = solve_many(robot, points, axes=axes, starts=3000, seed=1)
    count = [np.bincount(found.point, minlength=25) for found in (few, many)]
    np.testing.assert_array_equal(*count)
    assert count[0].max() == 8
