"""Another checkout's diagnosis, for comparison: it is that code which runs, on the same records."""

from pathlib import Path

import other_code
import pytest

from picchio.campaign.tables import Tolerance
from worlds import campaign as worlds

ROBOT = "fanuc_like_3dof"
HERE = Path(__file__).resolve().parents[3]


def test_a_checkout_diagnoses_the_same_records():
    hidden = [("joint_stiffness", "joint_1", {"scale": 1.5})]
    campaign, _ = worlds.make(robot=ROBOT, seed=3, causes=hidden, records=3)
    assert campaign.tolerance != Tolerance()
    told = other_code.diagnose(HERE, ROBOT, campaign)
    sets = [told["claimed"], *told["alternatives"]]
    assert any(["joint_stiffness", "joint_1"] in each for each in sets)


def test_code_that_is_not_the_checkouts_is_refused(tmp_path):
    campaign, _ = worlds.make(robot=ROBOT, seed=3, records=3)
    with pytest.raises(RuntimeError, match="the code that runs is"):
        other_code.diagnose(tmp_path, ROBOT, campaign)
