"""The arm made from the data file is the arm that ships, and its poses reach their points."""

import numpy as np
import pytest

import picchio
from picchio.fatigue.shaft_stress import check_shaft
from picchio.paper.printed import printed
from picchio.paper.world import (
    Assumptions,
    arm,
    places_of,
    poses_at,
    random_worlds,
    rivet_points,
)


@pytest.fixture(scope="module")
def shipped():
    return picchio.load_robot("fanuc_like_3dof")


def poses(count=20):
    return np.random.default_rng(1).uniform(-1.2, 1.2, (count, 3))


def test_it_is_the_robot_that_ships(shipped):
    ours = arm(Assumptions())
    for pose in poses():
        a, b = ours.state(pose), shipped.state(pose)
        np.testing.assert_allclose(a.mass_matrix, b.mass_matrix, rtol=1e-12)
        np.testing.assert_allclose(a.jacobian, b.jacobian, atol=1e-14)
        np.testing.assert_allclose(a.gravity_torque, b.gravity_torque, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(ours.stiffness, shipped.stiffness)
    np.testing.assert_allclose(ours.upper, shipped.upper)


def test_inertias_about_the_joints_take_the_links_share_off():
    about = {key: arm(Assumptions(inertia_about=key)) for key in ("cg", "joint")}
    straight = [robot.state([0.0, 0.0, 0.0]).mass_matrix for robot in about.values()]
    off = straight[0] - straight[1]
    # m c^2 of links 2 and 3, by hand.
    assert off[2, 2] == pytest.approx(45 * 0.4**2)
    assert off[1, 1] == pytest.approx(45 * 0.4**2 + 30 * 0.4**2)
    assert straight[1][2, 2] == pytest.approx(9.5)  # Table 1's own number


def test_each_shaft_is_its_joints_whole_spring():
    given = Assumptions(stress_per_twist=20e9, shear_modulus=80e9)
    for joint in arm(given).flexible_joints:
        assert check_shaft(joint.stiffness, joint.shaft) == pytest.approx(0.0, abs=1e-12)
        assert joint.shaft.shear_modulus * joint.shaft.radius / joint.shaft.length == pytest.approx(
            20e9
        )


@pytest.mark.parametrize("elbow", ["down", "up"])
def test_poses_reach_their_points(shipped, elbow):
    points = rivet_points(Assumptions())
    found = poses_at(points, elbow)
    for pose, point in zip(found, points, strict=True):
        np.testing.assert_allclose(shipped.tool_position(pose), point, atol=1e-12)
    np.testing.assert_allclose(places_of(found), points, atol=1e-12)
    branch = shipped.inverse_kinematics(points[0], branch=f"elbow-{elbow}")
    np.testing.assert_allclose(found[0], branch, atol=1e-6)


def test_out_of_reach_is_no_pose():
    assert np.isnan(poses_at([[2.0, 0.0, 0.4]])[0, 1:]).all()
    assert np.isfinite(poses_at([[1.6, 0.0, 0.4]])).all()


def test_the_pattern_has_the_papers_rivets():
    points = rivet_points(Assumptions())
    assert len(points) == printed().task.rivets
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    np.testing.assert_allclose(steps, Assumptions().pitch)  # the path never jumps


def test_random_worlds_repeat_and_reach():
    first, again = random_worlds(12, seed=3), random_worlds(12, seed=3)
    assert [w.given for w in first] == [w.given for w in again]
    assert len({w.given.period for w in first}) == 12
    for world in first:
        assert np.isfinite(world.rivet_stress).all()
