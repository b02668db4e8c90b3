"""Tool, gun, balancer, stiffness curve and mounting against hand-made or independent figures."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from scipy.linalg import eigh

from picchio.core.errors import InputError
from picchio.robot.joint import Balancer, StiffnessCurve
from picchio.robot.loading.load import load_robot

HEAD = 'format = "picchio-sidecar/1"\n[joint.a]\nstiffness = 2e4\n[joint.b]\nstiffness = 1e4\n'
POSE = [0.4, -0.7, 0.1]


def mass_in_mujoco(text: str, pose) -> np.ndarray:
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[:] = pose
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    return mass


def test_tool_is_counted_once(arm, arm_text, write):
    flex = write(
        "f.toml",
        HEAD + '[tool]\nframe = "tip"\nxyz = [0.02, 0.03, 0.04]\nmass = 2.5\n'
        "com = [0.05, 0.01, 0.0]\ninertia = [0.01, 0.001, 0, 0.02, 0, 0.015]\n",
    )
    with_tool = arm_text.replace(
        '<link name="tip"/>',
        '<link name="tip"><inertial><origin xyz="0.05 0.01 0"/><mass value="2.5"/>'
        '<inertia ixx="0.01" ixy="0.001" ixz="0" iyy="0.02" iyz="0" izz="0.015"/></inertial>'
        "</link>",
    )
    robot = load_robot(arm, flex=flex)
    expected = mass_in_mujoco(with_tool, POSE)[:2, :2]
    np.testing.assert_allclose(robot.state(POSE).mass_matrix, expected, rtol=1e-9)
    # The force's point is offset, the frame that carries the sensors is not.
    position, rotation = robot.frame_placement(POSE, "tip")
    offset = robot.state(POSE).tool_position - position
    np.testing.assert_allclose(offset, rotation @ [0.02, 0.03, 0.04], atol=1e-12)
    # And the Jacobian is the point's: by differences of its position.
    step = 1e-6
    for column in range(2):
        ends = []
        for sign in (1, -1):
            pose = np.array(POSE)
            pose[column] += sign * step
            ends.append(robot.state(pose).tool_position)
        slope = (ends[0] - ends[1]) / (2 * step)
        np.testing.assert_allclose(robot.state(POSE).jacobian[:, column], slope, atol=1e-8)


def test_rigid_gun_is_a_mass_at_the_tool_point(arm, write):
    gun = load_robot(arm, flex=write("g.toml", HEAD + "[gun]\nmass = 3.0\nfeed_force = 80.0\n"))
    tool = load_robot(arm, flex=write("t.toml", HEAD + "[tool]\nmass = 3.0\n"))
    np.testing.assert_allclose(gun.state(POSE).mass_matrix, tool.state(POSE).mass_matrix)
    assert gun.gun is not None
    assert gun.gun.feed_force == 80.0


def test_recoiling_gun_is_a_joint_of_its_own(arm, arm_text, write):
    flex = write(
        "g.toml", HEAD + "[tool]\naxis = [0.0, 0.6, 0.8]\n[gun]\nmass = 3.0\n"
        "recoil_stiffness = 3e4\ndamping_ratio = 0.1\n",
    )  # fmt: skip
    robot = load_robot(arm, flex=flex)
    assert robot.joint_names == ("a", "b", "c", "gun_recoil")
    assert robot.flexible_names == ("a", "b", "gun_recoil")
    assert robot.stiffness.tolist() == [2e4, 1e4, 3e4]
    slide = arm_text.replace(
        "</robot>",
        '<joint name="g" type="prismatic"><parent link="tip"/><child link="gun"/>'
        '<axis xyz="0 0.6 0.8"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
        '<link name="gun"><inertial><mass value="3"/><inertia ixx="1e-9" ixy="0" ixz="0" '
        'iyy="1e-9" iyz="0" izz="1e-9"/></inertial></link></robot>',
    )
    expected = mass_in_mujoco(slide, [*POSE, 0.0])[np.ix_([0, 1, 3], [0, 1, 3])]
    state = robot.state(POSE)  # the recoil is at rest and need not be given
    np.testing.assert_allclose(state.mass_matrix, expected, rtol=1e-6, atol=1e-9)
    np.testing.assert_array_equal(robot.state([*POSE, 0.0]).mass_matrix, state.mass_matrix)
    # A very stiff recoil spring gives back the rigid gun.
    stiff = np.sort(eigh(np.diag([2e4, 1e4, 3e12]), state.mass_matrix, eigvals_only=True))[:2]
    rigid = load_robot(arm, flex=write("r.toml", HEAD + "[gun]\nmass = 3.0\n")).state(POSE)
    np.testing.assert_allclose(
        stiff, eigh(np.diag([2e4, 1e4]), rigid.mass_matrix, eigvals_only=True), rtol=1e-6
    )


def test_a_zero_length_spring_balances_a_pendulum(arm_text, write):
    """A spring of free length zero, k p c = m g l, carries a pendulum in every pose."""
    urdf = """<robot name="p"><link name="w"/><joint name="j" type="revolute"><parent link="w"/>
    <child link="l"/><axis xyz="0 -1 0"/><limit lower="-2" upper="2" effort="1" velocity="1"/>
    </joint><link name="l"><inertial><origin xyz="0.5 0 0"/><mass value="10"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link></robot>"""
    k = 10 * 9.81 * 0.5 / (0.3 * 0.2)
    flex = write(
        "f.toml",
        f'format = "picchio-sidecar/1"\n[joint.j]\nstiffness = 1e4\n'
        f"balancer = {{ parent_point = [0, 0, 0.3], child_point = [0.2, 0, 0], "
        f"stiffness = {k!r} }}",
    )
    robot = load_robot(write("p.urdf", urdf), flex=flex)
    free = load_robot(write("p.urdf", urdf), values={"j": {"stiffness": 1e4}})
    for angle in (-1.2, 0.0, 0.3, 1.5):
        assert abs(free.state([angle]).gravity_torque[0] - 49.05 * np.cos(angle)) < 1e-9
        assert abs(robot.state([angle]).gravity_torque[0]) < 1e-9
        assert abs(robot.gravity_stiffness([angle])[0, 0]) < 1e-9


def test_balancer_torque_is_the_slope_of_its_energy():
    points = {"parent_point": (-0.3, 0.1, 0.2), "child_point": (0.25, 0.05, 0.1)}
    balancer = Balancer(**points, stiffness=4000.0, free_length=0.2, force=700.0)
    axis = np.array([0.2, -1.0, 0.1])
    unit = axis / np.linalg.norm(axis)

    def energy(angle: float) -> float:
        turned = np.zeros(4)
        mujoco.mju_axisAngle2Quat(turned, unit, angle)
        child = np.zeros(3)
        mujoco.mju_rotVecQuat(child, np.array(balancer.child_point), turned)
        d = np.linalg.norm(child - balancer.parent_point)
        return 0.5 * 4000.0 * (d - 0.2) ** 2 + 700.0 * d

    for angle in (-2.0, -0.4, 0.0, 0.9, 2.5):
        torque, stiffness = balancer.torque_and_stiffness(tuple(axis), angle)
        h = 1e-5
        assert torque == pytest.approx((energy(angle + h) - energy(angle - h)) / (2 * h), rel=1e-6)
        curve = (energy(angle + h) - 2 * energy(angle) + energy(angle - h)) / h**2
        assert stiffness == pytest.approx(curve, rel=1e-3, abs=1e-2)


def test_stiffness_follows_gravity(arm, write):
    text = HEAD.replace(
        "[joint.a]\nstiffness = 2e4",
        "[joint.a]\nstiffness_curve = { k1 = 1e4, k2 = 2e4, k3 = 3e4, t1 = 20.0, t2 = 60.0 }",
    )
    robot = load_robot(arm, flex=write("f.toml", text))
    assert robot.stiffness[0] == 1e4
    seen = set()
    for angle in np.linspace(-2, 2, 41):
        state = robot.state([angle, 0.0, 0.0])
        torque = abs(state.gravity_torque[0])
        expected = 1e4 if torque <= 20 else 2e4 if torque <= 60 else 3e4
        assert state.stiffness[0] == expected
        seen.add(expected)
    assert seen == {1e4, 2e4, 3e4}


def test_stiffness_curve():
    curve = StiffnessCurve(k1=1e4, k2=2e4, k3=4e4, t1=10.0, t2=50.0)
    torque = [0.0, -10.0, 10.1, -50.0, 50.1, -90.0]
    assert curve.tangent(torque).tolist() == [1e4, 1e4, 2e4, 2e4, 4e4, 4e4]


def test_mounting(arm, sidecar_text, write):
    ceiling = write("c.toml", sidecar_text + "[base]\nxyz = [1.0, 2.0, 3.0]\n"
                    "rpy = [3.141592653589793, 0, 0]\n")  # fmt: skip
    upside_down = write("g.toml", sidecar_text + "[base]\ngravity = [0, 0, 9.81]\n")
    hung, turned = load_robot(arm, flex=ceiling), load_robot(arm, flex=upside_down)
    one, other = hung.state(POSE), turned.state(POSE)
    np.testing.assert_allclose(one.gravity_torque, other.gravity_torque, atol=1e-9)
    np.testing.assert_allclose(one.mass_matrix, other.mass_matrix, atol=1e-12)
    flip = np.diag([1.0, -1.0, -1.0])
    np.testing.assert_allclose(one.jacobian, flip @ other.jacobian, atol=1e-12)
    np.testing.assert_allclose(
        one.tool_position, flip @ other.tool_position + [1, 2, 3], atol=1e-12
    )


def test_a_massless_end_is_refused_by_name_and_mended_by_a_tool(arm_text, write, sidecar_text):
    body = arm_text.index('<link name="slide">')
    bare = (
        arm_text[:body] + '<link name="slide"/>' + arm_text[arm_text.index('  <joint name="end') :]
    )
    urdf = write("bare.urdf", bare)
    flex = write("f.toml", sidecar_text)
    with pytest.raises(InputError, match="link slide: joint 'c' is flexible but carries no mass"):
        load_robot(urdf, flex=flex)
    load_robot(urdf, flex=write("t.toml", sidecar_text + "[tool]\nmass = 1.0\n"))


def test_mass_on_the_axis_is_singular_and_named(write):
    urdf = """<robot name="p"><link name="w"/><joint name="j" type="revolute"><parent link="w"/>
    <child link="l"/><axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="1" velocity="1"/>
    </joint><link name="l"><inertial><origin xyz="0 0 0.5"/><mass value="10"/>
    <inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial></link></robot>"""
    with pytest.raises(InputError, match="link l: joint 'j' has no inertia about its axis"):
        load_robot(write("p.urdf", urdf), values={"j": {"stiffness": 1.0}})
