"""The linear model against the full nonlinear arm, by two simulators that are not picchio's."""

import importlib.util

import numpy as np
import pytest

import picchio
from picchio.model.linear_system import LinearSystem

SPRINGS = np.array([2.4e5, 1e5, 1e5])
BLOWS = {"period": 0.040, "width": 0.004}
POSE = [0.3, 1.1, -1.0]
TIMES = np.linspace(0.0, 1.2, 601)


@pytest.fixture(scope="module")
def world(repository):
    path = repository / "tests" / "worlds" / "nonlinear_arm.py"
    spec = importlib.util.spec_from_file_location("nonlinear_arm", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def robot():
    return picchio.load_robot("fanuc_like_3dof")


def ours(robot, pose, direction, force, times, gravity_stiffness, damping=None):
    system = picchio.Model(robot, gravity_stiffness).linear_system(robot.pose(pose))
    if damping is not None:
        values = {name: getattr(system, name) for name in system.__dataclass_fields__}
        system = LinearSystem(**(values | {"damping_matrix": damping}))
    modes = picchio.modal_analysis(system)
    response = picchio.response_from_rest(modes, picchio.PulseTrain(force, **BLOWS), 12)
    return response.deflection(times, direction)


def relative_rms(ours, truth):
    return np.sqrt(((ours - truth) ** 2).sum() / (truth**2).sum())


@pytest.mark.parametrize("pose", [[0, 0.5, -0.8], POSE, [0.7, 0.0, 0.0]])
@pytest.mark.parametrize("direction", [[1, 0, 0], [0, 1, 0], [0, 0, 1]])
def test_the_nonlinear_arm_agrees_and_the_difference_shrinks_with_the_force(
    world, robot, pose, direction, repository
):
    urdf = repository / "robots" / "fanuc_like_3dof" / "robot.urdf"
    errors, without = {}, {}
    for force in (300.0, 30.0):
        truth = world.integrate_aba(
            urdf, SPRINGS, 0.03, pose, direction, force, 0.040, 0.004, 12, TIMES
        )
        errors[force] = relative_rms(ours(robot, pose, direction, force, TIMES, True), truth)
        without[force] = relative_rms(ours(robot, pose, direction, force, TIMES, False), truth)
    print(
        f"{pose} {direction}: 300 N {100 * errors[300.0]:.4f} %, 30 N {100 * errors[30.0]:.4f} %, "
        f"without gravity stiffness {100 * without[300.0]:.3f} %, {100 * without[30.0]:.3f} %"
    )
    assert errors[300.0] <= 0.003
    # In proportion to the force, down to the integrator's own error.
    assert errors[30.0] <= 0.12 * errors[300.0] + 1e-8


def test_mujoco_agrees_too(world, robot, repository):
    urdf = repository / "robots" / "fanuc_like_3dof" / "robot.urdf"
    direction = [0.48, -0.6, 0.64]
    errors = {}
    for force in (300.0, 30.0):
        times, truth = world.integrate_mujoco(
            urdf, SPRINGS, POSE, direction, force, 0.040, 0.004, 12, 1e-4, 0.8
        )
        found = ours(robot, POSE, direction, force, times, True, damping=np.zeros((3, 3)))
        errors[force] = relative_rms(found, truth)
    print(f"MuJoCo, undamped: { ({f: f'{100 * e:.4f} %' for f, e in errors.items()}) } rms")
    assert errors[300.0] <= 0.003
    assert errors[30.0] <= 0.12 * errors[300.0] + 1e-5
