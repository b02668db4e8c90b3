"""No trial, whatever it does, ends a diagnosis: it has failed, and a debug log tells."""

from __future__ import annotations

import logging

import numpy as np
import pytest
import trial

import picchio
from picchio.diagnosis.attempt import attempt
from picchio.diagnosis.percussion.diagnosis import diagnose_percussion
from picchio.model.effects.registry import catalogue

CASE = {"robot": "fanuc_like_3dof", "kind": "single", "effect": "payload", "snr": 40, "draw": 0,
        "records": 3}  # fmt: skip
SEARCH = "picchio.diagnosis.percussion.search"
# Each kind of trial, and whether the payload can still be found without it.
KINDS = {
    f"{SEARCH}.screen.Screen.suspect": False,
    f"{SEARCH}.screen.Screen._changes": False,
    f"{SEARCH}.trials.fit_short": False,
    f"{SEARCH}.trials.fit_long": False,
    f"{SEARCH}.exchange._exchanged": True,
    f"{SEARCH}.restart.fit_growing": True,
    f"{SEARCH}.select.bic_difference": True,
    "picchio.diagnosis.percussion.diagnosis.next_measurement": True,
}


def _breaks(*args, **kwargs):
    raise np.linalg.LinAlgError("SVD did not converge")


@pytest.fixture(scope="module")
def campaign():
    return trial.make(CASE)[0]


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_trial_may_fail(campaign, monkeypatch, kind):
    monkeypatch.setattr(kind, _breaks)
    robot = picchio.load_robot("fanuc_like_3dof")
    without = [e for e in catalogue() if e not in ("payload", "joint_stiffness")]
    found = diagnose_percussion(robot, campaign, without=without, workers=1).diagnosis
    assert found.verdict in ("named", "ambiguous", "partial", "unexplained")
    if KINDS[kind]:
        assert ("payload", "tool") in [(c.effect, c.target) for c in found.causes]
    else:
        assert found.verdict == "unexplained"


def test_what_failed_is_in_the_debug_log(caplog):
    with caplog.at_level(logging.DEBUG, logger="picchio.diagnosis"):
        assert attempt("hysteresis:joint_2", _breaks) is None
    assert caplog.messages == ["hysteresis:joint_2 failed: LinAlgError: SVD did not converge"]
