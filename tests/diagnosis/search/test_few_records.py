"""Three records of one pose, one accelerometer: cases that were once missed, and why not again."""

from __future__ import annotations

import pytest
import trial

import picchio
from picchio.diagnosis.percussion.diagnosis import diagnose_percussion

FEW = {"robot": "fanuc_like_3dof", "kind": "few", "snr": 40}


@pytest.fixture(scope="module")
def arm():
    return picchio.load_robot("fanuc_like_3dof")


@pytest.mark.parametrize(
    ("effect", "draw", "within"),
    [
        # The resonance lay between the two sizes that were screened.
        ("base_compliance", 0, {"stiffness": 0.005}),
        # Its damping ran off to nothing, from where no slope led back.
        ("servo_compliance", 0, {"stiffness": 0.05, "rotor_inertia": 0.05, "damping": 0.2}),
        # Some blows' times were found only once a second cause stood beside.
        pytest.param("pulse_jitter", 0, {}, marks=pytest.mark.slow),
        # The blows' shape came with it, by what the model is not exact to.
        pytest.param(
            "mount_resonance",
            0,
            {"frequency": 0.002},
            marks=(pytest.mark.slow, pytest.mark.minutes),
        ),
        # The blow is missing late in one record: the first part of both showed nothing.
        ("missed_hits", 1, {}),
        # Two records that were fitted say drift as well; the one held out knows better.
        ("thermal_stiffness", 1, {"per_kelvin": 0.002}),
    ],
)
def test_what_is_hidden_is_named_alone(effect, draw, within, arm):
    campaign, truth = trial.make({**FEW, "effect": effect, "draw": draw}, 1)
    found = diagnose_percussion(arm, campaign).diagnosis
    (true,) = truth["causes"]
    assert found.verdict == "named"
    (cause,) = found.causes
    assert (cause.effect, cause.target) == (effect, true["target"])
    for name, error in within.items():
        assert cause.parameters[name].value == pytest.approx(true["parameters"][name], rel=error)
