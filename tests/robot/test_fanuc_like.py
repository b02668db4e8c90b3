"""The shipped 3-DoF arm against MuJoCo, closed forms and the reference figures of issue 2."""

from __future__ import annotations

import pickle
import threading

import mujoco
import numpy as np
import pytest
from scipy.linalg import eigh

from picchio.core.errors import InputError
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.loading.load import load_robot

NAME = "fanuc_like_3dof"
POSES = [(0.0, 0.5, -0.8), (0.3, 1.1, -1.0), (0.7, 0.0, 0.0), (-2.1, -0.6, 1.2)]


@pytest.fixture(scope="module")
def robot() -> FlexibleRobot:
    return load_robot(NAME)


@pytest.fixture(scope="module")
def mjcf(robot: FlexibleRobot) -> mujoco.MjModel:
    # MuJoCo would fuse the tool link into link_3; its place is needed.
    text = robot.source.read_text().replace(
        'xmlns:picchio="urn:picchio:1">',
        'xmlns:picchio="urn:picchio:1"><mujoco><compiler fusestatic="false"/></mujoco>',
    )
    return mujoco.MjModel.from_xml_string(text)


@pytest.mark.parametrize("q", POSES)
def test_matrices_agree_with_mujoco(robot, mjcf, q):
    data = mujoco.MjData(mjcf)
    data.qpos[:] = q
    mujoco.mj_forward(mjcf, data)
    mass = np.zeros((3, 3))
    mujoco.mj_fullM(mjcf, data, mass)
    linear, angular = np.zeros((3, 3)), np.zeros((3, 3))
    tool = mjcf.body("tool").id
    mujoco.mj_jac(mjcf, data, linear, angular, data.body("tool").xpos, tool)
    state = robot.state(q)
    np.testing.assert_allclose(state.mass_matrix, mass, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(state.jacobian, linear, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(state.gravity_torque, data.qfrc_bias, rtol=1e-10, atol=1e-9)
    np.testing.assert_allclose(state.tool_position, data.body("tool").xpos, atol=1e-12)
    np.testing.assert_allclose(
        state.tool_rotation.ravel(), data.body("tool").xmat, rtol=0, atol=1e-12
    )
    np.testing.assert_allclose(robot.frame_jacobian(q, "tool")[3:], angular, atol=1e-12)


@pytest.mark.parametrize("q", POSES)
def test_gravity_stiffness_is_the_slope_of_the_closed_form(robot, q):
    """V = g [30 (0.4 s2) + 45 (0.8 s2 + 0.4 s23)] + const, derived by hand."""

    def torque(q2: float, q3: float) -> np.ndarray:
        far = 45 * 0.4 * np.cos(q2 + q3)
        return 9.81 * np.array([0.0, (30 * 0.4 + 45 * 0.8) * np.cos(q2) + far, far])

    np.testing.assert_allclose(robot.state(q).gravity_torque, torque(q[1], q[2]), atol=1e-9)
    step = 1e-6
    slope = np.zeros((3, 3))
    slope[:, 1] = (torque(q[1] + step, q[2]) - torque(q[1] - step, q[2])) / (2 * step)
    slope[:, 2] = (torque(q[1], q[2] + step) - torque(q[1], q[2] - step)) / (2 * step)
    np.testing.assert_allclose(robot.gravity_stiffness(q), slope, atol=1e-5)


@pytest.mark.parametrize(
    ("q", "hertz"),
    [
        (POSES[0], (5.3950, 9.2223, 19.6827)),
        (POSES[1], (5.5717, 12.4426, 18.4203)),
        (POSES[2], (5.0954, 8.3785, 23.1202)),
    ],
)
def test_natural_frequencies_of_the_issue(robot, q, hertz):
    state = robot.state(q)
    squared = eigh(np.diag(state.stiffness), state.mass_matrix, eigvals_only=True)
    np.testing.assert_allclose(np.sqrt(squared) / (2 * np.pi), hertz, atol=5e-5)


def test_table_1_and_the_shafts(robot):
    assert robot.joint_names == robot.flexible_names == ("joint_1", "joint_2", "joint_3")
    assert robot.stiffness.tolist() == [2.4e5, 1e5, 1e5]
    assert robot.damping_ratio.tolist() == [0.03] * 3
    assert robot.tool_frame == "tool"
    assert [joint.effort_limit for joint in robot.flexible_joints] == [200, 200, 120]
    for joint in robot.flexible_joints:
        assert joint.shaft is not None
        assert joint.shaft.torsional_stiffness == pytest.approx(joint.stiffness, rel=5e-3)
        level = joint.shaft.shear_modulus * joint.shaft.radius / joint.shaft.length
        assert level == pytest.approx(27.8e9, rel=2e-3)
    assert robot.task_path is None or robot.task_path.name == "task.toml"


def test_sidecar_example_says_what_the_annotation_says(robot):
    folder = robot.source.parent
    other = load_robot(folder / "robot.urdf", flex=folder / "flex.toml")
    assert other.flexible_joints == robot.flexible_joints
    assert robot.origins["joint_1.stiffness"] == "robot.urdf, picchio annotation"
    assert other.origins["joint_1.stiffness"].startswith("flex.toml: stiffness: Nie et al.")


def test_immutable_and_picklable(robot):
    state = robot.state(POSES[0])
    with pytest.raises(AttributeError):
        robot.name = "other"
    with pytest.raises(ValueError, match="read-only"):
        robot.stiffness[0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        state.mass_matrix[0, 0] = 1.0
    copy = pickle.loads(pickle.dumps(robot))
    np.testing.assert_array_equal(copy.state(POSES[0]).mass_matrix, state.mass_matrix)
    assert copy.flexible_joints == robot.flexible_joints


def test_threads_share_a_robot(robot):
    expected = [robot.state(q).mass_matrix for q in POSES]
    wrong: list[int] = []

    def work(which: int) -> None:
        for _ in range(300):
            if not np.array_equal(robot.state(POSES[which]).mass_matrix, expected[which]):
                wrong.append(which)

    threads = [threading.Thread(target=work, args=(i,)) for i in range(len(POSES))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


def test_poses(robot):
    np.testing.assert_array_equal(robot.pose({"joint_2": 0.5}), [0, 0.5, 0])
    np.testing.assert_array_equal(robot.pose([1, 2, 3]), [1, 2, 3])
    assert robot.limit_violations([0, 1.6, -1.3]) == ["joint_2", "joint_3"]
    assert robot.limit_violations([np.pi, 0, 0]) == []


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ([1, 2], "3 numbers (joint_1, joint_2, joint_3), got 2"),
        ([1, 2, float("nan")], "joint_3: is not a finite number, got nan"),
        ([1, "x", 3], "joint_2: is not a finite number, got 'x'"),
        ({"joint_9": 1.0}, "did you mean"),
        ({"joint_1": float("inf")}, "joint_1: is not a finite number"),
        (3.0, "a pose is a list of numbers"),
        ("home", "no pose of this name"),
        (np.array([[1.0, 2.0, 3.0]]), "3 numbers"),
    ],
)
def test_bad_poses(robot, values, says):
    with pytest.raises(InputError) as caught:
        robot.state(values)
    assert says in str(caught.value)


def test_unknown_frames_are_errors_not_crashes(robot):
    for call in (robot.frame_placement, robot.frame_jacobian):
        with pytest.raises(InputError, match="no such frame"):
            call([0, 0, 0], "nowhere")
    with pytest.raises(InputError, match="no frame of this name"):
        load_robot(NAME, tool="nowhere")
    # A joint's name means the link it carries.
    np.testing.assert_allclose(robot.frame_placement([0, 0, 0], "joint_3")[0], [0.8, 0, 0.4])
