"""Mass matrix, Jacobian and gravity of real arms against MuJoCo's reading of the same URDF."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from lxml import etree
from scipy.linalg import eigh

from picchio.robot.loading.find import example_robots
from picchio.robot.loading.load import load_robot

# name, tool frame, how many joints of the arm, what their names have in common
ARMS = [
    ("ur5_robot", "tool0", 6, ""),
    ("ur10_robot", "tool0", 6, ""),
    ("panda", "panda_hand_tcp", 7, "panda_joint"),
    ("kinova", "j2s6s200_end_effector", 6, ""),
    ("xarm7", "link_eef", 7, ""),
    ("z1", "link06", 6, "joint"),
    ("tiago", "arm_tool_link", 7, "arm_"),
    ("talos_left_arm", "gripper_left_base_link", 6, "arm_left"),
    # One limb of a humanoid and of a quadruped; the rest is rigid, the base held.
    ("talos_reduced", "gripper_left_base_link", 7, "arm_left"),
    ("anymal_c_simple/anymal", "LF_FOOT", 3, "LF_"),
    ("go1", "FR_foot", 3, "FR_"),
]


def mujoco_model(path) -> mujoco.MjModel:
    root = etree.parse(str(path)).getroot()
    for link in root.findall("link"):
        for tag in ("visual", "collision"):
            for element in link.findall(tag):
                link.remove(element)
    # Tiago's antennas, fixed to the base, have inertias that MuJoCo refuses.
    for link in root.findall("link"):
        if link.get("name").startswith("base_antenna"):
            link.remove(link.find("inertial"))
    mimics = [joint for joint in root.findall("joint") if joint.find("mimic") is not None]
    for joint in mimics:
        joint.remove(joint.find("mimic"))
    extra = etree.SubElement(root, "mujoco")
    # MuJoCo insists on masses everywhere; a nanogram is below every tolerance here.
    etree.SubElement(
        extra, "compiler", fusestatic="false", balanceinertia="true",
        boundmass="1e-12", boundinertia="1e-15",
    )  # fmt: skip
    return mujoco.MjModel.from_xml_string(etree.tostring(root, encoding="unicode"))


@pytest.mark.parametrize(("name", "frame", "count", "prefix"), ARMS)
def test_arm(name, frame, count, prefix):
    path = example_robots()[name]
    moving = [j.get("name") for j in etree.parse(str(path)).getroot().findall("joint")
              if j.get("type") in ("revolute", "continuous", "prismatic")]  # fmt: skip
    names = [joint for joint in moving if joint.startswith(prefix)][:count]
    assert len(names) == count
    stiffness = {joint: {"stiffness": 1e4} for joint in names}
    robot = load_robot(path, tool=frame, values=stiffness)
    assert sorted(robot.flexible_names) == sorted(names)

    model = mujoco_model(path)
    data = mujoco.MjData(model)
    address = [model.joint(joint).dofadr[0] for joint in robot.flexible_names]
    rng = np.random.default_rng(7)
    for _ in range(5):
        pose = dict(zip(names, rng.uniform(-1.5, 1.5, count), strict=True))
        data.qpos[:] = 0.0
        for joint, value in pose.items():
            data.qpos[model.joint(joint).qposadr[0]] = value
        mujoco.mj_forward(model, data)
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        jacobian = np.zeros((3, model.nv))
        body = data.body(frame)
        mujoco.mj_jac(model, data, jacobian, None, body.xpos, model.body(frame).id)
        mass = full[np.ix_(address, address)]

        state = robot.state(pose)
        np.testing.assert_allclose(state.mass_matrix, mass, atol=1e-6 * np.abs(mass).max())
        np.testing.assert_allclose(state.jacobian, jacobian[:, address], atol=1e-9)
        np.testing.assert_allclose(state.tool_position, body.xpos, atol=1e-9)
        bias = data.qfrc_bias[address]
        np.testing.assert_allclose(
            state.gravity_torque, bias, atol=1e-6 * max(1.0, np.abs(bias).max())
        )
        ours = eigh(np.diag(state.stiffness), state.mass_matrix, eigvals_only=True)
        theirs = eigh(1e4 * np.eye(count), mass, eigvals_only=True)
        np.testing.assert_allclose(ours, theirs, rtol=1e-4)

        # Gravity's slope: MuJoCo's bias force, differentiated.
        step = 1e-5
        slope = np.zeros((count, count))
        for column, joint in enumerate(robot.flexible_names):
            place = model.joint(joint).qposadr[0]
            ends = []
            for sign in (1.0, -1.0):
                data.qpos[place] = pose[joint] + sign * step
                mujoco.mj_forward(model, data)
                ends.append(data.qfrc_bias[address].copy())
            data.qpos[place] = pose[joint]
            slope[:, column] = (ends[0] - ends[1]) / (2 * step)
        np.testing.assert_allclose(
            robot.gravity_stiffness(pose), slope, atol=1e-4 * max(1.0, np.abs(slope).max())
        )
