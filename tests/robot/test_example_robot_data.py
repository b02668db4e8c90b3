"""All 69 URDFs of example-robot-data: 68 load as Pinocchio loads them, one is refused truly."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from lxml import etree

from picchio.core.errors import InputError, PicchioWarning
from picchio.robot.loading.find import example_robot, example_robots, find_robot, shipped_robots
from picchio.robot.loading.load import load_robot

from .trees import load_tree

URDFS = example_robots()
BROKEN = "ur3"


def test_there_are_69():
    assert len(URDFS) == 69


def load_any(path: Path):
    frame = load_tree(path).leaves()[-1]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PicchioWarning)
        return load_robot(path, tool=frame, allow_rigid=True)


def follow(path: Path, names: list[str], pose: dict[str, float]) -> np.ndarray:
    """Every joint's position, the mimicking ones worked out from the XML by recursion."""
    joints = {j.get("name"): j for j in etree.parse(str(path)).getroot().findall("joint")}

    def position(name: str) -> float:
        if name in pose:
            return pose[name]
        mimic = joints[name].find("mimic")
        factor, offset = float(mimic.get("multiplier", 1)), float(mimic.get("offset", 0))
        return factor * position(mimic.get("joint")) + offset

    return np.array([position(name) for name in names])


@pytest.mark.parametrize("name", sorted(set(URDFS) - {BROKEN}))
def test_loads_and_agrees_with_pinocchios_own_reader(name):
    path = URDFS[name]
    robot = load_any(path)
    # Pinocchio's own reading of the whole file, where every joint is free.
    oracle = pin.buildModelFromUrdf(str(path))
    data = oracle.createData()
    every = list(oracle.names)[1:]

    def configuration(positions: np.ndarray) -> np.ndarray:
        q = pin.neutral(oracle)
        for joint, angle in zip(list(oracle.joints)[1:], positions, strict=True):
            if joint.nq == 2:
                q[joint.idx_q : joint.idx_q + 2] = np.cos(angle), np.sin(angle)
            else:
                q[joint.idx_q] = angle
        return q

    rng = np.random.default_rng(1)
    pose = {joint: float(rng.uniform(-1, 1)) for joint in robot.joint_names}
    rest = follow(path, every, pose)
    moves = [follow(path, every, {**pose, joint: pose[joint] + 1.0}) - rest for joint in pose]
    spread = np.array(moves).reshape(len(pose), len(every)).T
    full = robot.pose(pose)

    q = configuration(rest)
    expected = spread.T @ pin.crba(oracle, data, q) @ spread
    scale = np.abs(expected).max(initial=1e-12)
    np.testing.assert_allclose(robot.rigid.mass_matrix(full), expected, atol=1e-9 * scale)

    frame = oracle.getFrameId(robot.tool_frame, pin.FrameType.BODY)
    pin.framesForwardKinematics(oracle, data, q)
    position, rotation = robot.frame_placement(full, robot.tool_frame)
    np.testing.assert_allclose(position, data.oMf[frame].translation, atol=1e-9)
    np.testing.assert_allclose(rotation, data.oMf[frame].rotation, atol=1e-9)

    torque = robot.rigid.gravity_torque(full)
    step = 1e-6
    for row, joint in enumerate(robot.joint_names):
        up, down = (
            pin.computePotentialEnergy(
                oracle, data, configuration(follow(path, every, {**pose, joint: pose[joint] + h}))
            )
            for h in (step, -step)
        )
        assert torque[row] == pytest.approx((up - down) / (2 * step), rel=1e-4, abs=1e-4)


def test_ur3_is_refused_with_its_true_reason():
    with pytest.raises(InputError, match="the robot has no name"):
        load_robot(URDFS[BROKEN])


def test_names_with_and_without_robot():
    assert example_robot("ur10") == URDFS["ur10_robot"]
    assert find_robot("anymal_c_simple/anymal").urdf == URDFS["anymal_c_simple/anymal"]
    with pytest.raises(InputError, match="did you mean 'talos_left_arm'"):
        find_robot("talos_left_hand")


def test_package_addresses():
    address = "package://example-robot-data/robots/ur_description/urdf/ur10_robot.urdf"
    assert find_robot(address).urdf == URDFS["ur10_robot"]
    with pytest.raises(InputError, match="no package root has this file"):
        find_robot("package://example-robot-data/robots/none.urdf")


@pytest.mark.parametrize("name", sorted(shipped_robots()))
def test_every_shipped_robot_loads(name):
    robot = load_robot(name)
    assert len(robot.flexible_joints) >= (1 if name == "emps" else 3)
    state = robot.state(np.clip(0.3, robot.lower, robot.upper))
    assert np.linalg.eigvalsh(state.mass_matrix)[0] > 0
    for joint in robot.flexible_names:
        assert robot.origins[f"{joint}.stiffness" if f"{joint}.stiffness" in robot.origins
                             else f"{joint}.stiffness_curve"]  # fmt: skip


def test_unlisted_mimic_leader_is_told():
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        load_robot("alex_psyonic_hands", tool="LeftPsyonicAbilityBaseLink", allow_rigid=True)
    assert any("mimics 'index_q1', which is no movable joint" in str(w.message) for w in said)
    assert {w.category for w in said} == {PicchioWarning}
