"""What a fit assumed of gravity's stiffness is part of its model, and every command honours it."""

import json

import numpy as np
import pytest
from scipy.linalg import eigh

import picchio
from picchio.model.model import Model

POSES = ([0.3, 0.5, -0.8], [0.0, 1.1, -0.2], [-0.7, 0.2, -1.3])


def saved(folder, line):
    path = folder / "fitted.toml"
    path.write_text(f'format = "picchio-model/1"\nrobot = "fanuc_like_3dof"\n{line}\n')
    return path


def by_hand(robot, pose, gravity):
    """Hz, of K and, by finite differences of the holding torque, dg/dq."""
    step, n = 1e-6, len(robot.stiffness)
    rows = [
        (robot.gravity_torque(pose + step * e) - robot.gravity_torque(pose - step * e)) / (2 * step)
        for e in np.eye(n)
    ]
    mass, _ = robot.mass_and_jacobian(np.asarray(pose)[None])
    springs = np.diag(robot.stiffness) + gravity * np.array(rows).T
    return np.sqrt(eigh(springs, mass[0], eigvals_only=True)) / (2 * np.pi)


@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize(
    ("line", "asked", "counts"),
    [
        ("gravity_stiffness = true", None, True), ("gravity_stiffness = false", None, False),
        ("", None, False), ("gravity_stiffness = true", False, False), ("", True, True),
    ],
)  # fmt: skip
def test_a_saved_model_says_whether_gravity_stiffens(tmp_path, pose, line, asked, counts):
    robot = picchio.load_robot(saved(tmp_path, line))
    model = Model.of(robot, gravity_stiffness=asked)
    assert model.gravity_stiffness is counts
    at = robot.pose(pose)
    expected = by_hand(robot, at, float(counts))
    assert not np.allclose(by_hand(robot, at, 0.0), by_hand(robot, at, 1.0), rtol=1e-5)
    system = model.linear_system(at)
    squares = eigh(system.stiffness_matrix, system.mass_matrix, eigvals_only=True)
    found = np.sqrt(squares) / (2 * np.pi)
    np.testing.assert_allclose(np.sort(found), expected, rtol=1e-6)


@pytest.mark.parametrize(
    ("line", "typed", "counts"),
    [
        ("gravity_stiffness = true", (), True),
        ("gravity_stiffness = true", ("--no-gravity-stiffness",), False),
        ("gravity_stiffness = false", ("--gravity-stiffness",), True),
        ("", (), False),
    ],
)
def test_commands_honour_it(in_process, tmp_path, line, typed, counts):
    model = saved(tmp_path, line)
    done = in_process("assess", model, *typed, "--json", "-")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["inputs"]["options"]["gravity_stiffness"] is counts


def test_a_model_that_is_written_says_it():
    from picchio.robot.loading.saved_model import saved_model_text

    text = saved_model_text("ur10", [], gravity_stiffness=True)
    assert "gravity_stiffness = true" in text
    assert "gravity" not in saved_model_text("ur10", [])
