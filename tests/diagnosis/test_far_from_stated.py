"""Records of blows on an arm whose joints are far from their stated stiffness.

The campaigns are those of the independent worlds; the values judged are what the worlds had, what
they draw within their tolerances included.
"""

import tomllib

import numpy as np
import pytest

import picchio
from picchio.campaign.tables import Tolerance
from picchio.diagnosis.begin import begin
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.search.far import far_from_stated
from picchio.robot.loading.load import load_robot

FACTORS = (0.40, 1.9, 0.55)
DAMPING = 0.4
SENSORS = {
    "deflections": ("deflection",),
    "accelerometer alone": ("accelerometer.tool",),
}


@pytest.fixture(scope="module")
def worlds():
    from worlds import campaign

    return campaign


def far(worlds, *, seed, sensors="deflections", factors=FACTORS, records=12, **options):
    """A campaign, with what the stiffness and the damping ratio are over the stated ones."""
    names = ("joint_1", "joint_2", "joint_3")
    causes = [
        ("joint_stiffness", name, {"scale": factor})
        for name, factor in zip(names, factors, strict=True)
        if factor != 1.0
    ]
    causes.append(("modal_damping", "robot", {"scale": DAMPING}))
    campaign, truth = worlds.make(
        seed=seed, causes=causes, sensors=SENSORS[sensors], records=records, **options
    )
    own = truth["nuisances"]
    stiffness = np.array(factors) * [own["stiffness"][name] for name in names]
    return campaign, stiffness, DAMPING * own["damping_ratio"]


def test_springs_from_nothing_are_near_enough_to_begin_with(worlds):
    campaign, stiffness, _ = far(worlds, seed=11)
    problem = Problem(load_robot("fanuc_like_3dof"), campaign)
    found = far_from_stated(problem, problem.records)
    np.testing.assert_allclose(found.stiffness, stiffness, rtol=0.02)
    assert found.left < 0.1 and found.before > 0.3


def test_a_robot_as_stated_is_left_alone(worlds):
    robot = load_robot("fanuc_like_3dof")
    for causes in ([], [("payload", "tool", {"mass": 5.0})]):
        campaign, _ = worlds.make(seed=12, causes=causes, records=6)
        assert begin(robot, campaign) is None


def test_what_is_not_said_of_a_tolerance_is_as_usual():
    said = Tolerance(stiffness=0.2, pose=0.0)
    left = said.unsaid("stiffness")
    assert left.stiffness == Tolerance().stiffness and left.pose == 0.0
    assert left.model_fields_set == {"pose"}


@pytest.mark.slow
@pytest.mark.parametrize("sensors", SENSORS)
def test_three_stiffnesses_and_the_damping_are_identified(worlds, sensors, tmp_path):
    """0.40, 1.9 and 0.55 of the stated stiffness, 0.4 of the damping: within 1 %."""
    campaign, stiffness, damping = far(worlds, seed=13, sensors=sensors)
    found = picchio.identify("fanuc_like_3dof", campaign)
    stated = load_robot("fanuc_like_3dof")
    for joint, own, factor in zip(found.joints, stated.flexible_joints, stiffness, strict=True):
        assert joint.stiffness.told
        assert joint.stiffness.value == pytest.approx(factor * own.stiffness, rel=0.01)
        assert joint.damping_ratio.value == pytest.approx(damping * own.damping_ratio, rel=0.01)
    assert found.robot is not found.begun.robot and "from nothing" in found.remarks[0]
    told, left = (found.to_dict()[key] for key in ("from_nothing", "residual"))
    assert left["before"] > 0.3 > 0.02 > left["after"]
    assert list(told["stiffness_over_stated"].values()) == pytest.approx(stiffness, rel=0.02)
    # What is written is what later work begins with: another campaign finds nothing wrong.
    sidecar = tmp_path / "flex.toml"
    sidecar.write_text(found.sidecar_text())
    world = worlds.Nuisances(stiffness / np.array(FACTORS), damping / DAMPING, 1.0)
    later, *_ = far(worlds, seed=113, sensors=sensors, records=9, nuisances=world)
    assert picchio.diagnose(stated.name, later, flex=sidecar).verdict == "nothing-wrong"


@pytest.mark.slow
def test_three_stiffnesses_and_the_damping_are_named(worlds):
    campaign, stiffness, damping = far(worlds, seed=14)
    found = picchio.diagnose("fanuc_like_3dof", campaign)
    assert found.verdict == "named"
    told = {(c.effect, c.target): c.parameters["scale"].value for c in found.causes}
    expected = {("joint_stiffness", f"joint_{k + 1}"): size for k, size in enumerate(stiffness)}
    assert told == pytest.approx(expected | {("modal_damping", "robot"): damping}, rel=0.001)


@pytest.mark.slow
def test_stiffness_from_nothing_where_everything_is_a_little_wrong(worlds):
    campaign, stiffness, _ = far(worlds, seed=15, mismatch=1.0)
    found = picchio.identify("fanuc_like_3dof", campaign)
    stated = load_robot("fanuc_like_3dof")
    assert found.diagnosis.verdict == "nothing-wrong"
    for joint, own, factor in zip(found.joints, stated.flexible_joints, stiffness, strict=True):
        half = 0.5 * (joint.stiffness.high - joint.stiffness.low)
        assert joint.stiffness.told and half < 0.05 * joint.stiffness.value
        # Three standard deviations.
        assert abs(joint.stiffness.value - factor * own.stiffness) < 3.0 / 1.645 * half
    # What masses and blows are off by, all springs are off by alike.
    written = tomllib.loads(found.sidecar_text())["posterior"]
    at = [written["names"].index(f"stiffness.{joint.name}") for joint in found.joints]
    assert np.array(written["correlation"])[np.ix_(at, at)].min() > 0.5
