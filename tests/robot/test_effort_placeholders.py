"""Effort limits that somebody filled in are no evidence of what a drive bears."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from picchio.robot.drives.predictors import placeholders
from picchio.robot.loading.find import find_robot
from picchio.robot.loading.load import load_robot

pytestmark = pytest.mark.filterwarnings("ignore::picchio.PicchioWarning")

# kg, m along z to the next joint, axis
LINKS = [(9.0, 0.3, "z"), (14.0, 0.6, "y"), (6.0, 0.5, "y"), (2.0, 0.1, "z"), (1.5, 0.1, "y")]
GRAVITY = 9.81


def arm(efforts, links=LINKS, rail=None):
    """A chain of rods along z; the first joint's axis is vertical; optionally on a slide."""
    axis = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}
    text = ['<robot name="rods"><link name="l0"/>']
    at, parent = 0.1, "l0"
    if rail is not None:
        text.append(
            '<link name="sled"><inertial><mass value="20"/><inertia ixx="1" ixy="0" ixz="0" '
            'iyy="1" iyz="0" izz="1"/></inertial></link><joint name="rail" type="prismatic">'
            '<parent link="l0"/><child link="sled"/><axis xyz="1 0 0"/>'
            f'<limit lower="0" upper="2" effort="{rail}" velocity="1"/></joint>'
        )
        parent = "sled"
    for k, ((mass, length, about), effort) in enumerate(zip(links, efforts, strict=True), 1):
        i = mass * length**2 / 12
        text.append(
            f'<link name="l{k}"><inertial><origin xyz="0 0 {length / 2}"/><mass value="{mass}"/>'
            f'<inertia ixx="{i}" ixy="0" ixz="0" iyy="{i}" iyz="0" izz="{0.1 * i}"/></inertial>'
            f'</link><joint name="j{k}" type="revolute"><parent link="{parent}"/>'
            f'<child link="l{k}"/><origin xyz="0 0 {at}"/><axis xyz="{axis[about]}"/>'
            f'<limit lower="-3" upper="3" effort="{effort}" velocity="2"/></joint>'
        )
        at, parent = length, f"l{k}"
    text.append(
        f'<link name="tool0"/><joint name="t" type="fixed"><parent link="{parent}"/>'
        f'<child link="tool0"/><origin xyz="0 0 {at}"/></joint></robot>'
    )
    return "".join(text)


def loaded(tmp_path, text, **given):
    file = tmp_path / "rods.urdf"
    file.write_text(text)
    return load_robot(file, **given)


def drives(robot):
    """What is known of them."""
    spreads = {name: (spread.value, spread.size) for name, spread in robot.spreads.items()}
    springs = [(j.stiffness, j.damping_ratio, j.strength) for j in robot.flexible_joints]
    return spreads, springs, robot.posterior


REFUSED = {
    "ten everywhere": [10] * 5,
    "a hundred everywhere": [100] * 5,
    "a thousand everywhere": [1000] * 5,
    "two thousand everywhere": [2000] * 5,
    "the shoulder could not hold the arm": [60, 30, 20, 10, 10],
    "one joint could not": [300, 400, 20, 40, 40],
    "motor side": [3.2, 3.1, 1.1, 0.4, 0.4],
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_placeholder_counts_as_unknown(tmp_path, case):
    with pytest.warns(UserWarning, match="effort limits are not believed"):
        robot = loaded(tmp_path, arm(REFUSED[case]))
    assert drives(robot) == drives(loaded(tmp_path, arm([0] * 5)))


KNOWN = {
    "as a maker gives them": [330, 330, 150, 56, 56],
    "one of them unknown": [330, 330, 150, 0, 56],
    "just above its weight": None,
}


def shoulder_weight(links=LINKS):
    """N m, of the arm about j2 when stretched: a beam's moments, by hand."""
    at, total = 0.0, 0.0
    for mass, length, _ in links[1:]:
        total += mass * GRAVITY * (at + length / 2)
        at += length
    return total


@pytest.mark.parametrize("case", KNOWN)
def test_limits_that_hold_the_arm_are_evidence(tmp_path, case):
    efforts = KNOWN[case] or [200, math.ceil(shoulder_weight()), 80, 30, 30]
    robot = loaded(tmp_path, arm(efforts))
    assert placeholders(robot) == {}
    peaks = [joint.strength.repeated_peak_torque for joint in robot.flexible_joints]
    known = np.array(efforts) > 0
    ratio = np.array(peaks)[known] / np.array(efforts)[known]
    assert np.ptp(ratio) < 0.02 * ratio.mean()  # each follows from its own limit


@pytest.mark.parametrize("share", [0.6, 0.8, 1.05])
def test_the_weight_is_the_arms_own(tmp_path, share):
    # Over the poses drawn the stretched arm is nearly met; a tool's weight is no part of it.
    efforts = [400, share * shoulder_weight(), 400, 300, 300]
    flex = tmp_path / "f.toml"
    flex.write_text('format = "picchio-sidecar/1"\n[tool]\nmass = 40.0\n')
    found = placeholders(loaded(tmp_path, arm(efforts), flex=flex))
    assert bool(found) == (share < 1.0)
    if found:
        told = float(re.search(r"they take ([\d.]+) N m", found["j2"])[1])
        assert 0.85 * shoulder_weight() < told <= 1.001 * shoulder_weight()


@pytest.mark.parametrize("rail", [10, 5000])
def test_a_slide_is_judged_apart(tmp_path, rail):
    robot = loaded(tmp_path, arm([10] * 5, rail=rail))
    assert set(placeholders(robot)) == {f"j{k}" for k in range(1, 6)}


@pytest.mark.parametrize("name", ["ur10", "panda", "kuka_iiwa14", "xarm7"])
def test_makers_limits_are_believed(name):
    assert placeholders(load_robot(find_robot(name).urdf, allow_rigid=True)) == {}
