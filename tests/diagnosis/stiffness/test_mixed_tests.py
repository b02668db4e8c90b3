"""Static loadings and frequency response functions in one campaign."""

import math

import blind_stiffness
import numpy as np
import pytest

import picchio
from picchio.campaign.campaign import Campaign
from picchio.campaign.record import Record
from picchio.diagnosis.identify import method_for
from picchio.diagnosis.stiffness.mixed import with_stiffness
from picchio.diagnosis.stiffness.prior import prior_of


@pytest.fixture(scope="module")
def worlds():
    """The independent worlds of loads and of responses."""
    from worlds import frfs, loads

    return loads, frfs


def test_what_was_told_is_known_before_the_next():
    robot = picchio.load_robot("fanuc_like_3dof")
    rng = np.random.default_rng(1)
    root = 0.1 * rng.standard_normal((3, 3))
    mean, covariance = rng.standard_normal(3), root @ root.T
    known = with_stiffness(robot, mean, covariance)
    np.testing.assert_allclose(known.stiffness, robot.stiffness * np.exp(mean))
    np.testing.assert_allclose(prior_of(known).covariance, covariance, rtol=1e-6)
    assert known.flexible_joints[0].shaft == robot.flexible_joints[0].shaft


def both(worlds, other: float) -> tuple[Campaign, np.ndarray]:
    """Loads of an arm with one truth, functions of one whose second joint is `other` of it."""
    loads, frfs = worlds
    pulled = loads.draw(3, 3)
    factors = pulled.truth / pulled.nominal * [1.0, other, 1.0]
    tapped = frfs.draw(3, 3, factors=factors)
    return Campaign.from_records([
        Record.from_columns("loads.csv", pulled.columns, kind="static"),
        *blind_stiffness.frf_campaign(tapped).records[:4],
    ], robot=pulled.robot), pulled.truth  # fmt: skip


def test_both_kinds_tell_more_than_one(worlds, tmp_path):
    campaign, truth = both(worlds, 1.0)
    found = picchio.identify(campaign.robot, campaign)
    alone = found.loads
    for joint, one, k in zip(found.joints, alone.joints, truth, strict=True):
        assert joint.stiffness.told
        assert joint.stiffness.low < k < joint.stiffness.high
        assert abs(math.log(joint.stiffness.value / k)) < 0.05
        wide = math.log(one.stiffness.high / one.stiffness.low)
        assert math.log(joint.stiffness.high / joint.stiffness.low) < wide
    assert not found.doubt
    content = found.to_dict()
    assert content["method"] == "static and frf" and content["damping"]["convention"] == "modal"
    assert "frf" in content["noise"] and len(content["noise"]) == 2
    assert content["residual"]["after"] < 0.2 and content["residual"]["functions"]["after"] < 0.1
    (tmp_path / "flex.toml").write_text(found.sidecar_text())
    robot = picchio.load_robot(campaign.robot, flex=tmp_path / "flex.toml")
    np.testing.assert_allclose(
        robot.stiffness, [joint.stiffness.value for joint in found.joints], rtol=1e-9
    )
    assert len(robot.posterior.names) == 6
    compared = found.compared()
    assert len(compared) == 1 + 4
    for one in compared:
        left = np.linalg.norm(one.measured - one.fitted) / np.linalg.norm(one.measured)
        assert left < 0.25 and one.left < 0.25
    page = picchio.report(found, warnings=["a < b"]).html()
    modes = found.modes()
    assert page.count("<svg") == 5 + len(modes) and "a &lt; b" in page
    assert 2 <= len(modes) <= 6
    for mode in modes:
        assert mode.mac > 0.9 and abs(mode.fitted / mode.measured - 1.0) < 0.05
        assert np.abs(mode.shape).max() == pytest.approx(1.0)
    functions = [one for one in compared if one.coherence is not None]
    assert len(functions) == 4 and all(one.coherence.max() <= 1.0 for one in functions)
    poses = found.by_pose()
    assert sum(one.readings for one in poses if one.where.startswith("loads.csv")) == 15
    assert sum(one.readings for one in poses if one.where.startswith("pose")) == 4
    for joint in found.joints:
        assert joint.name in page


def test_a_contradiction_is_told(worlds):
    campaign, _ = both(worlds, 1.4)
    found = picchio.identify(campaign.robot, campaign)
    assert "loads and functions disagree: joint_2" in found.doubt


def test_each_kind_alone_goes_its_own_way(worlds):
    campaign, _ = both(worlds, 1.0)
    functions = Campaign.from_records([r for r in campaign if r.kind == "frf"])
    assert method_for(functions).name == "frf"
    loads = Campaign.from_records([r for r in campaign if r.kind == "static"])
    assert method_for(loads).name == "static"
