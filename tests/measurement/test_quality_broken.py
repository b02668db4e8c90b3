"""Every way to spoil measured data that still can be read: the right check says so, in one line."""

import ast
import inspect
import string
import textwrap
from dataclasses import replace

import numpy as np
import pytest

from picchio.measurement.quality.check import catalogue
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


@pytest.mark.parametrize("kind", CHECKS, ids=lambda kind: kind.name)
def test_every_finding_has_its_words_and_they_what_they_are_filled_in_with(kind):
    tree = ast.parse(textwrap.dedent(inspect.getsource(kind)))
    texts = {n.value for n in ast.walk(tree) if isinstance(n, ast.Constant)}  # keys among them
    says = {key: entry for key, entry in catalogue()[kind.name].items() if key != "what"}
    assert says.keys() <= texts
    for call in ast.walk(tree):
        if not (isinstance(call, ast.Call) and ast.unparse(call.func) == "self.found"):
            continue
        told = [n.value for n in ast.walk(call.args[0]) if isinstance(n, ast.Constant)]
        keys = [key for key in told if isinstance(key, str)]
        assert set(keys) <= says.keys()
        given = {word.arg for word in call.keywords} | ({"value"} if len(call.args) > 3 else set())
        for key in keys:
            text = "".join(says[key].get(part, "") for part in ("message", "advice", "unit"))
            assert {name for _, name, _, _ in string.Formatter().parse(text) if name} <= given


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
