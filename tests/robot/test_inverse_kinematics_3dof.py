"""Inverse kinematics of the 3-DoF arm against its closed form."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from picchio.core.errors import InputError
from picchio.robot.loading.load import load_robot

ROBOT = load_robot("fanuc_like_3dof")


def closed_form(point: np.ndarray) -> list[np.ndarray]:
    """Every pose within the limits, from the law of cosines (two links of 0.8 m, z up)."""
    x, y, z = point
    poses = []
    for flipped, elbow in itertools.product((False, True), (1.0, -1.0)):
        radius = -np.hypot(x, y) if flipped else np.hypot(x, y)
        q1 = np.arctan2(y, x) + (np.pi if flipped else 0.0)
        q1 = (q1 + np.pi) % (2 * np.pi) - np.pi
        height = z - 0.4
        cosine = (radius**2 + height**2 - 2 * 0.8**2) / (2 * 0.8**2)
        if abs(cosine) > 1:
            continue
        q3 = elbow * np.arccos(cosine)
        q2 = np.arctan2(height, radius) - np.arctan2(0.8 * np.sin(q3), 0.8 + 0.8 * np.cos(q3))
        q2 = (q2 + np.pi) % (2 * np.pi) - np.pi
        pose = np.array([q1, q2, q3])
        if (pose >= ROBOT.lower).all() and (pose <= ROBOT.upper).all():
            poses.append(pose)
    return poses


inside = st.tuples(st.floats(-3.1, 3.1), st.floats(-1.55, 1.55), st.floats(-1.2, 1.2))


@settings(max_examples=150, deadline=None)
@given(inside)
def test_all_branches_are_those_of_the_closed_form(pose):
    point = ROBOT.state(pose).tool_position
    # Near the outstretched arm and joint_1's axis branches meet: there is nothing to count.
    if abs(pose[2]) < 0.05 or np.hypot(point[0], point[1]) < 0.05:
        return
    expected = closed_form(point)
    found = ROBOT.all_branches(point)
    margin = min(np.min([np.minimum(p - ROBOT.lower, ROBOT.upper - p)[1:] for p in expected]), 1.0)
    if margin > 1e-6:
        assert len(found) == len(expected)
    for wanted in expected:
        assert min(np.abs(np.angle(np.exp(1j * (wanted - q)))).max() for q in found) < 1e-6
    for q in found:
        np.testing.assert_allclose(ROBOT.state(q).tool_position, point, atol=1e-8)
        assert ROBOT.limit_violations(q) == []


def test_a_point_overhead_has_the_flipped_shoulder():
    point = [0.1, 0.0, 1.9]
    assert len(closed_form(np.array(point))) == 2
    found = ROBOT.all_branches(point)
    assert sorted(abs(q[0]) for q in found) == pytest.approx([0, np.pi])


def test_elbows():
    up = ROBOT.inverse_kinematics([1.1, 0.3, 1.2], branch="elbow-up")
    down = ROBOT.inverse_kinematics([1.1, 0.3, 1.2], branch="elbow-down")
    assert up[2] < 0 < down[2]
    height = [ROBOT.frame_placement(q, "joint_3")[0][2] for q in (up, down)]
    assert height[0] > height[1]
    np.testing.assert_array_equal(
        up, ROBOT.inverse_kinematics([1.1, 0.3, 1.2], branch=["joint_3-"])
    )


def test_the_same_every_time():
    first = ROBOT.all_branches([1.2, -0.5, 0.8])
    again = load_robot("fanuc_like_3dof").all_branches([1.2, -0.5, 0.8])
    np.testing.assert_array_equal(first, again)


@pytest.mark.parametrize(
    ("point", "distance"),
    [((2.0, 0.0, 0.4), 0.4), ((0.0, 0.0, 3.0), 1.0), ((3.0, 4.0, 0.4), 3.4)],
)
def test_out_of_reach_says_how_far(point, distance):
    with pytest.raises(InputError, match="out of reach") as caught:
        ROBOT.inverse_kinematics(point)
    assert f"{distance:.4g} m away" in str(caught.value)


def test_outstretched_is_reached():
    np.testing.assert_allclose(ROBOT.inverse_kinematics([1.6, 0, 0.4]), 0, atol=1e-3)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"point": [1, 2]}, "three numbers"),
        ({"point": [1, 2, float("nan")]}, "must be finite"),
        ({"point": "abc"}, "must be"),
        ({"point": [1.2, 0, 1], "axis": [0, 0, 0]}, "length zero"),
        ({"point": [1.2, 0, 1], "branch": "elbow-sideways"}, "valid: any, elbow-up"),
        ({"point": [1.2, 0, 1], "branch": []}, "no branch"),
        ({"point": [1.5, 0, 0.4], "branch": "joint_1-, joint_1+, joint_3+, joint_3-"}, "branch"),
    ],
)
def test_bad_questions(arguments, says):
    with pytest.raises(InputError) as caught:
        ROBOT.inverse_kinematics(**arguments)
    assert says in str(caught.value)
