"""Joints of every kind: what moves, what is held, what follows."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import yourdfpy

from picchio.core.errors import InputError, PicchioWarning
from picchio.robot.annotations.sidecar import __doc__ as sidecar_example
from picchio.robot.annotations.sidecar import read_sidecar
from picchio.robot.loading.find import find_robot, shipped_robots
from picchio.robot.loading.load import load_robot

BODY = (
    '<inertial><origin xyz="0.1 0.2 0.3"/><mass value="2"/>'
    '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
)


@pytest.mark.parametrize("kind", ["floating", "planar"])
def test_joints_of_several_freedoms_are_held_and_told(write, kind, arm_text):
    text = arm_text.replace(
        '<link name="base"/>',
        f'<link name="world"/><joint name="free" type="{kind}"><parent link="world"/>'
        '<child link="base"/><origin xyz="0 0 1"/></joint><link name="base"/>',
    )
    with pytest.warns(PicchioWarning, match=r"held fixed: free"):
        robot = load_robot(write("free.urdf", text), values={"a": {"stiffness": 1e4}})
    assert robot.joint_names == ("a", "b", "c")
    fixed = load_robot(write("arm.urdf", arm_text), values={"a": {"stiffness": 1e4}})
    one, other = robot.state([0.1, 0.2, 0.1]), fixed.state([0.1, 0.2, 0.1])
    np.testing.assert_allclose(one.mass_matrix, other.mass_matrix)
    np.testing.assert_allclose(one.tool_position, np.add(other.tool_position, [0, 0, 1]))
    with pytest.raises(InputError, match=f"a {kind} joint cannot be flexible"):
        load_robot(robot.source, values={"free": {"stiffness": 1e4}})


def test_limits_by_kind(arm, flex):
    robot = load_robot(arm, flex=flex)
    assert [joint.kind for joint in robot.flexible_joints] == ["revolute", "revolute", "prismatic"]
    np.testing.assert_array_equal(robot.lower, [-2, -np.inf, 0])
    np.testing.assert_array_equal(robot.upper, [2, np.inf, 0.3])
    assert robot.limit_violations([2.1, 99.0, -0.1]) == ["a", "c"]
    # One number for a continuous joint; a full turn changes nothing.
    one, other = robot.state([0.3, 1.0, 0.1]), robot.state([0.3, 1.0 + 2 * np.pi, 0.1])
    np.testing.assert_allclose(one.mass_matrix, other.mass_matrix, atol=1e-12)


def test_places_against_yourdfpy(arm, flex):
    robot = load_robot(arm, flex=flex)
    oracle = yourdfpy.URDF.load(str(arm), load_meshes=False)
    for pose in ([0.0, 0.0, 0.0], [0.5, -2.0, 0.2], [-1.9, 3.0, 0.05]):
        oracle.update_cfg(pose)
        for link in ("upper", "lower", "slide", "tip"):
            position, rotation = robot.frame_placement(pose, link)
            np.testing.assert_allclose(oracle.get_transform(link)[:3, 3], position, atol=1e-12)
            np.testing.assert_allclose(oracle.get_transform(link)[:3, :3], rotation, atol=1e-12)


def test_a_flexible_joint_takes_its_mimic_along(write):
    """Two wheels of a gear on parallel axes: the follower turns with ratio -2, energy by hand."""
    text = f"""<robot name="g"><link name="w"/><link name="x">{BODY}</link>
    <link name="y">{BODY}</link>
    <joint name="one" type="continuous"><parent link="w"/><child link="x"/><axis xyz="0 0 1"/>
    </joint><joint name="two" type="continuous"><parent link="w"/><child link="y"/>
    <axis xyz="0 0 1"/><mimic joint="one" multiplier="-2" offset="0.5"/></joint></robot>"""
    urdf = write("g.urdf", text)
    robot = load_robot(urdf, values={"one": {"stiffness": 1.0}}, tool="y")
    about_axis = 1 + 2 * (0.1**2 + 0.2**2)
    assert robot.joint_names == ("one",)
    assert robot.state([0.3]).mass_matrix[0, 0] == pytest.approx(about_axis * (1 + 4))
    with pytest.raises(InputError, match="mimics 'one' and has no spring of its own"):
        load_robot(urdf, values={"two": {"stiffness": 1.0}}, tool="y")


@pytest.mark.parametrize("which", ["one joint", "arm", "mimic", "gun"])
def test_many_poses_at_once(arm, write, which, sidecar_text):
    if which == "one joint":
        text = f"""<robot name="g"><link name="w"/><link name="x">{BODY}</link>
        <joint name="j" type="continuous"><parent link="w"/><child link="x"/></joint></robot>"""
        robot = load_robot(write("o.urdf", text), values={"j": {"stiffness": 1.0}})
    elif which == "mimic":
        robot = load_robot("panda")
    else:
        gun = "[gun]\nmass = 1.0\nrecoil_stiffness = 1e4\n" if which == "gun" else ""
        robot = load_robot(arm, flex=write("f.toml", sidecar_text + gun))
    poses = np.random.default_rng(0).uniform(-1, 1, (7, len(robot.joint_names)))
    point, index = robot.rigid.frame(robot.tool_point), robot.flexible_index
    heavier = robot.rigid.with_masses([(3.0, list(robot.tree.links)[-1], (0.1, -0.4, 0.2))])
    for rigid in (robot.rigid, heavier):
        mass, jacobian = rigid.mass_and_jacobian(poses, point, index)
        for i, pose in enumerate(poses):
            pinocchio = rigid.mass_matrix(pose)[np.ix_(index, index)]
            size = np.sqrt(np.diag(pinocchio))
            error = np.abs(mass[i] - pinocchio) / size / size[:, None]
            assert error.max() < 1e-13
            expected = rigid.jacobian(pose, point)[:3, index]
            np.testing.assert_allclose(jacobian[i], expected, rtol=0, atol=1e-14)
    assert np.abs(mass - robot.mass_and_jacobian(poses)[0]).max() > 0.1


def test_a_mimic_joint_moves_with_the_one_that_it_follows(write):
    text = f"""<robot name="g"><link name="w"/><link name="x">{BODY}</link>
    <link name="y">{BODY}</link><link name="z">{BODY}</link>
    <joint name="one" type="continuous"><parent link="w"/><child link="x"/><axis xyz="0 1 0"/>
    </joint>
    <joint name="two" type="prismatic"><parent link="x"/><child link="y"/><axis xyz="1 0 1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/><mimic joint="one" multiplier="-0.5"/>
    <origin xyz="0.2 0 1"/></joint>
    <joint name="side" type="revolute"><parent link="x"/><child link="z"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/><origin xyz="0 1 0"/></joint></robot>"""
    values = {"one": {"stiffness": 1e5}, "side": {"stiffness": 1e5}}
    robot = load_robot(write("g.urdf", text), values=values, tool="y")
    # More poses than one thread takes at a time.
    poses = np.random.default_rng(0).uniform(-1, 1, (600, 2))
    point = robot.rigid.frame(robot.tool_point)
    mass, jacobian = robot.rigid.mass_and_jacobian(poses, point)
    for i in (0, 255, 256, 599):
        np.testing.assert_allclose(mass[i], robot.rigid.mass_matrix(poses[i]), rtol=1e-12)
        expected = robot.rigid.jacobian(poses[i], point)[:3]
        np.testing.assert_allclose(jacobian[i], expected, rtol=0, atol=1e-14)


def test_every_tool_frame_that_is_guessed_says_why(arm_text, write):
    values = {"a": {"stiffness": 1e4}}
    robot = load_robot(write("a.urdf", arm_text), values=values)
    assert (robot.tool_frame, robot.origins["tool.frame"]) == (
        "tip",
        "chosen: the only place at an end",
    )
    two = arm_text.replace(
        "</robot>",
        '<link name="lamp"/><joint name="l" type="fixed"><parent link="upper"/>'
        '<child link="lamp"/></joint></robot>',
    )
    robot = load_robot(write("b.urdf", two), values=values)  # the lamp is fixed to the arm's middle
    assert (robot.tool_frame, robot.origins["tool.frame"]) == (
        "tip", "chosen: the only place beyond all joints"
    )  # fmt: skip
    hands = two.replace('name="l" type="fixed"', 'name="l" type="continuous"')
    with pytest.raises(InputError, match=r"several frames could carry the tool; valid: tip, lamp"):
        load_robot(write("b.urdf", hands), values=values)
    named = two.replace('"lamp"', '"tcp"')
    assert load_robot(write("c.urdf", named), values=values).tool_frame == "tcp"


FINGER = (
    '<link name="{0}"/><joint name="to_{0}" type="prismatic"><parent link="tip"/>'
    '<child link="{0}"/><origin xyz="0 {1} 0"/><limit lower="0" upper="0.01" effort="9" '
    'velocity="1"/></joint>'
)


def test_fingers_are_carried_by_the_arms_end(arm_text, write):
    fingers = FINGER.format("left", 0.02) + FINGER.format("right", -0.02)
    robot = load_robot(write("h.urdf", arm_text.replace("</robot>", fingers + "</robot>")))
    assert robot.tool_frame == "tip"
    assert robot.origins["tool.frame"] == "chosen: where the arm ends and its fingers begin"
    assert robot.flexible_names == ("a", "b")


FIXED = '<link name="{0}"/><joint name="to_{0}" type="fixed"><parent link="slide"/>' + (
    '<child link="{0}"/><origin xyz="{1} 0 0"/></joint>'
)


@pytest.mark.parametrize(
    ("frames", "chosen"),
    [
        ([("lamp", 0.3), ("arm_tcp", 0.2)], "arm_tcp"),
        ([("lamp", 0.3), ("left_tool_link", 0.2)], "left_tool_link"),
        ([("a_ee", 0.2), ("b_ee", 0.2), ("lamp", 0.3)], "a_ee"),
        ([("weld", 0.1)], "tip"),  # where the arm's own tip is
        ([("a_ee", 0.2), ("b_ee", 0.3)], None),
        ([("lamp", 0.3)], None),
        ([("tool_camera", 0.3)], None),
    ],
)
def test_the_tools_frame_by_convention(arm_text, write, frames, chosen):
    text = arm_text.replace("</robot>", "".join(FIXED.format(*f) for f in frames) + "</robot>")
    urdf = write("f.urdf", text)
    if chosen is None:
        with pytest.raises(InputError, match="several frames could carry the tool"):
            load_robot(urdf, values={"a": {"stiffness": 1e4}})
    else:
        assert load_robot(urdf, values={"a": {"stiffness": 1e4}}).tool_frame == chosen


@pytest.mark.parametrize("name", sorted(shipped_robots()))
def test_no_warning_for_a_shipped_robot(name):
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        load_robot(name)
    # Its second joint holds 27 N m of the arm, and the URDF limits it to 22 N m.
    wrong = ["effort limits are not believed"] if name == "talos_left_arm" else []
    assert [part in str(w.message) for part, w in zip(wrong, seen, strict=True)] == [True] * len(
        wrong
    )


def test_what_is_read_twice_is_told_once():
    """example-robot-data's UR5 has wrists of 1.2 kg with the inertia of a body of 40 cm."""
    with pytest.warns(PicchioWarning) as seen:
        load_robot(find_robot("ur5").urdf)  # a second time with the estimates in it
    wrong = [f"link 'wrist_{n}_link'" for n in (1, 2, 3)]
    told = [link for w in seen for link in wrong if link in str(w.message)]
    assert told == wrong


def test_a_sidecar_of_another_robot_is_told():
    flex = shipped_robots()["ur5"].flex
    with pytest.warns(PicchioWarning, match="belongs to robot 'ur5_robot', not to .*ur10_robot"):
        load_robot("ur10", flex=flex)


def test_pinocchio_is_never_called_with_what_crashes_it(arm, flex):
    rigid = load_robot(arm, flex=flex).rigid
    pose = np.zeros(3)
    for frame in (-1, 10**6):
        for call in (rigid.jacobian, rigid.placement):
            with pytest.raises(InputError, match="no such frame"):
                call(pose, frame)
        with pytest.raises(InputError, match="no such frame"):
            rigid.mass_and_jacobian(pose[None], frame)
    for wrong in (np.zeros(2), np.zeros(4), np.zeros((1, 3)), np.zeros(0)):
        for call in (rigid.mass_matrix, rigid.gravity_torque, rigid.gravity_gradient):
            with pytest.raises(InputError, match="wrong shape"):
                call(wrong)
    with pytest.raises(InputError, match="wrong shape"):
        rigid.mass_and_jacobian(pose, 0)


def test_the_documented_sidecar_is_a_sidecar(write):
    assert sidecar_example is not None
    text = sidecar_example.split("```toml\n")[1].split("```")[0]
    sidecar = read_sidecar(write("documented.toml", text))
    assert sidecar.joint["elbow_joint"].balancer is not None
    assert sidecar.gun is not None
