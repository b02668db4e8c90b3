"""Every way to spoil measured data that still can be read: the right check says so, in one line."""

from dataclasses import replace

import numpy as np
import pytest

from picchio.measurement.quality.checks import CHECKS
from picchio.measurement.quality.report import check
from picchio.robot.loading.load import load_robot

from .broken import SPOILERS, sound

# What needs the robot's joints; the made-up signals are none of its own, so no axes are judged.
NEEDS_ROBOT = ("pose", "joint's limits", "unknown")


@pytest.fixture(scope="module")
def robot():
    return load_robot("fanuc_like_3dof")


@pytest.fixture(scope="module")
def usual():
    return {str(finding) for finding in findings(sound().build())}


def findings(campaign, robot=None):
    report = check(campaign, robot, use_robot=robot is not None)
    assert len(report.records) == len(campaign)  # nothing lost
    return [f for f in report.findings if not (robot is not None and f.check in ("axes", "phase"))]


def test_there_are_enough_of_them():
    assert len(SPOILERS) >= 80
    assert {check for _, check in SPOILERS.values()} >= {
        kind.name for kind in CHECKS if kind.name not in ("axes", "phase")
    }


@pytest.mark.parametrize("seed", [0, *(pytest.param(s, marks=pytest.mark.slow) for s in (1, 2))])
def test_a_sound_campaign_has_nothing_wrong(seed, robot):
    for model in (None, robot):
        assert [str(f) for f in findings(sound(seed).build(), model) if f.severity != "note"] == []


QUICK = list(SPOILERS)[::12]


@pytest.mark.parametrize(
    "name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in SPOILERS]
)
def test_a_spoilt_campaign(name, robot, usual):
    spoil, check = SPOILERS[name]
    draft = sound()
    spoil(draft)
    campaign = draft.build()
    before = [replace(record, clock_tolerance=np.inf).read() for record in campaign]
    needed = robot if any(word in name for word in NEEDS_ROBOT) else None
    new = [f for f in findings(campaign, needed) if str(f) not in usual]
    said = [f for f in new if f.check == check]
    assert said, [str(f) for f in new]
    for finding in said:
        assert "\n" not in str(finding)
        assert len(str(finding)) < 500
    for old, record in zip(before, campaign, strict=True):
        for channel, values in replace(record, clock_tolerance=np.inf).read().items():
            np.testing.assert_array_equal(values, old[channel])
