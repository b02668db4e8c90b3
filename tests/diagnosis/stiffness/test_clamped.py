"""The tool held fast while motors press: closed form, blind trials, a fit with loads, bad input."""

import math
from dataclasses import replace

import blind_stiffness
import numpy as np
import pytest

import picchio
from picchio.campaign.campaign import Campaign
from picchio.campaign.record import Record
from picchio.core.errors import InputError
from picchio.diagnosis.stiffness.static import identify_static


@pytest.fixture(scope="module")
def worlds():
    """The independent worlds of presses and of loads."""
    from worlds import loads, presses

    return presses, loads


def widths(found) -> np.ndarray:
    """(n,) standard deviations of the logarithms."""
    return np.array([math.log(j.stiffness.high / j.stiffness.low) / 3.29 for j in found.joints])


def test_the_closed_form_is_the_worlds_equilibrium(worlds):
    """Newton's solution; a fixture that yields and no friction."""
    world = worlds[0].draw(6, 1, exact=True)
    found = picchio.identify(world.robot, blind_stiffness.press_campaign(world))
    values = [joint.stiffness.value for joint in found.joints]
    np.testing.assert_allclose(values, world.truth, rtol=3e-3)
    assert all(joint.stiffness.told for joint in found.joints)
    # The drives' constants are known to 3 %, and so are the joints, as far as none vouches for
    # another by what it feels of it.
    assert (widths(found) > 0.015).all()


@pytest.mark.slow
def test_blind_trials(worlds):
    """Eighteen campaigns; 90 in `benchmarks/stiffness.py --clamped`."""
    found = blind_stiffness.summary(blind_stiffness.press_trial(worlds[0], 18, first=400)[0])
    assert found["told"] >= 0.8 * found["joints"]
    assert found["told_within_10_percent"] >= 0.95
    assert found["median_error"] <= 0.05
    assert found["coverage_told"] >= 0.85
    assert found["wrong_confident"] * found["told"] <= 2


def test_pressing_one_way_alone_leaves_friction_open(worlds):
    both, one = (
        picchio.identify(world.robot, blind_stiffness.press_campaign(world))
        for world in (worlds[0].draw(3, 9, one_way=way) for way in (False, True))
    )
    assert (widths(one) > 1.3 * widths(both)).all()


@pytest.mark.slow
def test_loads_and_presses_are_one_fit(worlds):
    """A scale tells what the drives' constants are, and the interval is narrower than of either."""
    loads = worlds[1].draw(3, 3)
    pressed = worlds[0].draw(3, 3, factors=loads.truth / loads.nominal)
    records = [Record.from_columns("loads.csv", loads.columns, kind="static"),
               *blind_stiffness.press_campaign(pressed).records]  # fmt: skip
    robot = picchio.load_robot(loads.robot)
    found, *alone = (
        identify_static(robot, Campaign.from_records(part), search=False)
        for part in (records, records[:1], records[1:])
    )
    assert (widths(found) < np.minimum(*map(widths, alone))).all()
    for joint, truth in zip(found.joints, loads.truth, strict=True):
        assert joint.stiffness.told
        assert abs(math.log(joint.stiffness.value / truth)) < 0.05
    content = found.to_dict()
    assert content["nuisances"]["torque_gain.joint_2"]["std"] < 0.028
    assert "3 motors that press in 2 records" in found.remarks[0]
    page = picchio.report(found).html()
    assert "p1.csv: joint_3" in page
    # A diagnosis of work has no use for tests.
    with pytest.raises(InputError, match="clamped and static records"):
        picchio.diagnose(loads.robot, Campaign.from_records(records))


def press(**changed):
    """A record of one motor; columns by name, None to leave one out."""
    time = np.arange(400) / 50.0
    turn = 1e-3 * np.sin(time)
    columns = {"motor_position.joint_1": turn, "torque.joint_1": 1e5 * turn} | changed
    columns = {name: x for name, x in columns.items() if x is not None}
    record = Record.from_arrays("p.csv", time, columns, kind="clamped", pose={"joint_1": 0.0})
    return Campaign.from_records([record])


@pytest.mark.parametrize(
    ("changed", "match"),
    [
        ({"motor_position.joint_1": None, "position.joint_1": np.sin(np.arange(400))},
         "motor_position.joint_1 is needed"),
        ({"motor_position.joint_1": np.zeros(400)}, "no motor turns"),
        ({"motor_position.joint_9": np.zeros(400)}, "no joint of this name"),
    ],
)  # fmt: skip
def test_a_record_that_tells_nothing_is_refused(changed, match):
    with pytest.raises(InputError, match=match):
        picchio.identify("fanuc_like_3dof", press(**changed))


def test_a_record_needs_torque_and_pose():
    with pytest.raises(InputError, match="no motor that presses"):
        press(**{"torque.joint_1": None})
    record = press().records[0]
    table = record.table.model_copy(update={"pose": None})
    with pytest.raises(InputError, match="needs this key"):
        Campaign.from_records([replace(record, table=table)])


def test_one_record_is_told_to_leave_nothing_out_and_a_wrong_pose_is_placed(tmp_path):
    campaign = press(**{"torque.joint_1": 200.0 * np.sin(np.arange(400) / 50.0)})
    (said, *_) = picchio.identify("fanuc_like_3dof", campaign).remarks
    assert said.startswith("1 motor that presses in 1 record. Nothing could be left out")
    campaign.save(tmp_path)
    file = tmp_path / "campaign.toml"
    file.write_text(file.read_text().replace("joint_1 = 0.0", "joint_7 = 0.0"))
    with pytest.raises(InputError, match=r"campaign\.toml: record\[0\]\.pose.*joint_7"):
        picchio.identify("fanuc_like_3dof", picchio.load_campaign(tmp_path))
