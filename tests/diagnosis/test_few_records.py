"""Three records of one pose, one accelerometer: cases that were once missed, and why not again."""

from __future__ import annotations

import pytest
import trial

import picchio
from picchio.diagnosis.percussion.diagnose import diagnose_percussion

FEW = {"robot": "fanuc_like_3dof", "kind": "few", "snr": 40, "draw": 0}


@pytest.fixture(scope="module")
def arm():
    return picchio.load_robot("fanuc_like_3dof")


@pytest.mark.parametrize(
    ("effect", "within"),
    [
        # The resonance lay between the two sizes that were screened.
        ("base_compliance", {"stiffness": 0.005}),
        # Its damping ran off to nothing, from where no slope led back.
        ("servo_compliance", {"stiffness": 0.05, "rotor_inertia": 0.05, "damping": 0.2}),
        # Some blows' times were found only once a second cause stood beside.
        ("pulse_jitter", {}),
        # The blows' shape came with it, by what the model is not exact to.
        ("mount_resonance", {"frequency": 0.002}),
    ],
)
def test_what_is_hidden_is_named_alone(effect, within, arm):
    campaign, truth = trial.make({**FEW, "effect": effect}, 1)
    found = diagnose_percussion(arm, campaign).diagnosis
    (true,) = truth["causes"]
    assert found.verdict == "named"
    (cause,) = found.causes
    assert (cause.effect, cause.target) == (effect, true["target"])
    for name, error in within.items():
        assert cause.parameters[name].value == pytest.approx(true["parameters"][name], rel=error)
