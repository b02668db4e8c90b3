"""An arm whose URDF gives no masses, or gives a joint none: what is estimated, what stays rigid."""

from __future__ import annotations

import re

import numpy as np
import pytest

import picchio
from picchio.core.arrays import symmetric
from picchio.core.errors import InputError, PicchioWarning
from picchio.robot.estimate import masses
from picchio.robot.estimate.masses import estimated_masses, weighted
from picchio.robot.estimate.rigid import left_rigid
from picchio.robot.estimate.sidecar import estimated_sidecar
from picchio.robot.loading.find import find_robot
from picchio.robot.loading.load import load_robot
from picchio.robot.urdf.shapes import link_ends


@pytest.fixture
def bare(tmp_path):
    """The UR10's URDF without its inertials."""
    text = find_robot("ur10").urdf.read_text()
    path = tmp_path / "bare.urdf"
    path.write_text(re.sub(r"<inertial>.*?</inertial>", "", text, flags=re.DOTALL))
    return path


def test_an_arm_without_masses_is_as_heavy_as_such_arms_are(bare):
    with pytest.warns(PicchioWarning, match="nobody measured the masses, and the stiffness"):
        robot = load_robot(bare)
    lengths = np.linalg.norm(link_ends(robot.tree, robot.tool_frame), axis=1)
    carried = [body.mass for body in robot.tree.links.values() if body is not None]
    expected = masses.AT_ONE_METRE * lengths.sum() ** masses.GROWTH
    assert sum(carried) == pytest.approx(expected, rel=0.01)
    assert carried[0] > carried[-1] > 0.0
    known = load_robot("ur10", allow_rigid=True)
    # Stiffness follows from the masses, and is surer where these are known.
    spread = {one.name: one.size for one in robot.spreads.values()}
    sure = estimated_sidecar(known).joint["elbow_joint"].model_dump()["stiffness_spread"]
    assert np.exp(spread["stiffness.elbow_joint"]) > 1.2 * sure
    found = picchio.assess(robot, picchio.load_task(known.task_path, robot))
    assert found.verdict.estimated
    assert found.uncertainty is not None
    assert 0.0 < found.uncertainty.utilisation["p10"] < found.uncertainty.utilisation["p90"]


def test_given_masses_are_never_estimated(bare):
    assert estimated_masses(load_robot("ur10", allow_rigid=True)) == {}
    robot = load_robot(bare, allow_rigid=True)
    links = estimated_masses(robot)
    assert estimated_masses(weighted(robot, links)) == {}
    # What start writes, loads as the same masses, marked as estimates.
    found = picchio.start(bare)
    flex, _ = found.save(bare.parent)
    again = load_robot(bare, flex=flex)
    assert again.tree.links["forearm_link"].mass == links["forearm_link"].mass
    assert "picchio's estimate" in again.origins["link.forearm_link.mass"]


def test_rods_have_the_inertia_of_rods(bare):
    robot = load_robot(bare, allow_rigid=True)
    ends = link_ends(robot.tree, robot.tool_frame)
    rod = estimated_masses(robot)["upper_arm_link"]
    end = ends[1]
    length, size = float(np.linalg.norm(end)), float(np.linalg.norm(ends, axis=1).sum())
    own = rod.mass * (masses._RADIUS * size) ** 2
    assert np.linalg.eigvalsh(symmetric(rod.inertia)).tolist() == pytest.approx(
        [own, own + rod.mass * length**2 / 12, own + rod.mass * length**2 / 12], rel=0.02
    )
    np.testing.assert_allclose(rod.com, 0.5 * end, atol=1e-3)


def test_a_joint_that_moves_no_mass_stays_rigid_and_is_told(tmp_path):
    text = find_robot("ur10").urdf.read_text()
    last = re.search(r'<link name="wrist_3_link">.*?</link>', text, flags=re.DOTALL)[0]
    without = re.sub(r"<inertial>.*?</inertial>", "", last, flags=re.DOTALL)
    path = tmp_path / "light.urdf"
    path.write_text(text.replace(last, without))
    robot = load_robot(path)
    assert "wrist_3_joint" not in robot.flexible_names
    assert len(robot.flexible_names) == 5
    assert left_rigid(robot) == (("wrist_3_joint", "moves no mass that the URDF gives", True),)


def test_nothing_to_estimate_masses_by_is_refused(tmp_path):
    path = tmp_path / "point.urdf"
    path.write_text(
        '<robot name="p"><link name="a"/><link name="b"/><joint name="j" type="continuous">'
        '<parent link="a"/><child link="b"/></joint></robot>'
    )
    with pytest.raises(InputError, match=r"no joint that moves the tool moves a mass.*--flex"):
        load_robot(path)


def test_a_gripper_without_masses_is_no_arm(tmp_path):
    path = tmp_path / "finger.urdf"
    path.write_text(
        '<robot name="finger"><link name="palm"/><link name="tip"/>'
        '<joint name="knuckle" type="revolute"><parent link="palm"/><child link="tip"/>'
        '<origin xyz="0 0 0.03"/><axis xyz="1 0 0"/>'
        '<limit effort="10" velocity="2" lower="0" upper="1"/></joint>'
        '<link name="pad"/><joint name="end" type="fixed"><parent link="tip"/>'
        '<child link="pad"/><origin xyz="0 0.03 0"/></joint></robot>'
    )
    with pytest.raises(InputError, match="no masses, and 30 mm from joint to joint are no arm"):
        load_robot(path)
