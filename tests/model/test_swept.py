"""What points and links add, against Pinocchio's own dynamics of the same wide model."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import picchio
from picchio.model.geometry import Geometry

STEP = 1e-4
POINT = (0.11, -0.06, 0.23)  # m, in the link


# Hinged and sliding joints, fingers that mimic others, a gantry.
@pytest.mark.parametrize("name", ["fanuc_r2000ic", "kinova", "tiago", "emps"])
def test_a_point_mass_is_pinocchios(name):
    robot = picchio.load_robot(name)
    pose = robot.pose(np.random.default_rng(1).uniform(-0.8, 0.8, robot.rigid._follow.shape[1]))
    geometry = Geometry.of(robot, pose)
    chain = geometry.chain
    columns, q = chain._columns, chain._q(pose)
    for link in list(chain._frames)[-2:]:
        joint, placement = chain._frame(link)
        model = chain._model.copy()
        for i in range(model.njoints):
            model.inertias[i] = pin.Inertia.Zero()
        mass = pin.Inertia(1.0, np.array(POINT), np.zeros((3, 3)))
        model.inertias[joint] = placement.act(mass)
        data = model.createData()

        def matrices(at, model=model, data=data):
            full = np.array(pin.crba(model, data, at))
            slope = np.array(pin.computeGeneralizedGravityDerivatives(model, data, at))
            return columns.T @ full @ columns, columns.T @ slope @ columns

        found = geometry.inertia(link, POINT)
        gravity = columns.T @ np.array(pin.computeGeneralizedGravity(model, data, q))
        here = matrices(q)
        sides = [(matrices(q + STEP * s), matrices(q - STEP * s)) for s in columns.T]
        by_step = [np.array([(a[k] - b[k]) / (2 * STEP) for a, b in sides]) for k in (0, 1)]
        for one, other in (
            (found.mass, here[0]),
            (found.mass_gradient, by_step[0]),
            (found.gravity, gravity),
            (found.gravity_gradient, here[1]),
            (found.gravity_curvature, by_step[1]),
        ):
            assert one == pytest.approx(other, abs=1e-8 * max(np.abs(other).max(), 1e-3))


def test_of_some_coordinates_it_is_a_part_of_all():
    robot = picchio.load_robot("kinova")
    geometry = Geometry.of(robot, np.full(6, 0.3))
    taken = (0, 3, 5, 7)
    link = robot.tool_frame
    whole, part = geometry.inertia(link, POINT), geometry.inertia(link, POINT, taken)
    for name, own in vars(part).items():
        expected = getattr(whole, name)[np.ix_(*[taken] * own.ndim)]
        assert own == pytest.approx(expected, abs=1e-12 * np.abs(expected).max())


def test_a_frames_motion_is_that_of_its_place():
    """The Jacobian against where the frame stands, its gradient against the Jacobian nearby."""
    robot = picchio.load_robot("kinova_gen3")
    pose = np.linspace(-0.7, 0.9, len(robot.flexible_names))
    geometry = Geometry.of(robot, pose)
    chain, link = geometry.chain, robot.tool_frame
    found = geometry.motion(link)
    jacobian, _, axes = chain.placed(pose, link)
    assert found.jacobian == pytest.approx(jacobian, abs=1e-10)
    assert found.rotation == pytest.approx(axes, abs=1e-12)
    for k in range(len(robot.flexible_names)):
        ahead, behind = pose.copy(), pose.copy()
        ahead[k] += STEP
        behind[k] -= STEP
        nearby = [chain.placed(p, link) for p in (ahead, behind)]
        moved = (nearby[0][1] - nearby[1][1]) / (2 * STEP)
        assert found.jacobian[:3, k] == pytest.approx(moved, abs=1e-7)
        slope = (nearby[0][0] - nearby[1][0]) / (2 * STEP)
        assert found.gradient[k] == pytest.approx(slope, abs=1e-7)
