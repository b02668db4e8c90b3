"""Records whose force a load cell has read, in a world that is a little wrong everywhere.

Half-sines of 4 ms, 12 records of 1 s at 2 kHz, no sample at t = 0: a force that acted half a sample
late left 12 % of the signal, and was told as sensors that are late.
"""

import pytest
import trial

import picchio
from picchio.diagnosis.percussion.diagnosis import diagnose_percussion

CASE = {"robot": "fanuc_like_3dof", "snr": 40, "mismatch": 1,
        "sensors": ("accelerometer", "deflection", "force")}  # fmt: skip


@pytest.fixture(scope="module")
def arm():
    return picchio.load_robot("fanuc_like_3dof")


@pytest.mark.slow
def test_nothing_wrong_is_nothing_wrong(arm):
    campaign, _ = trial.make({**CASE, "kind": "null", "draw": 91201}, 1)
    found = diagnose_percussion(arm, campaign).diagnosis
    assert found.verdict == "nothing-wrong"
    assert found.remainder.within_tolerance


@pytest.mark.slow
def test_what_is_wrong_is_named(arm):
    case = {**CASE, "kind": "single", "effect": "sensor_gain", "draw": 91202}
    campaign, truth = trial.make(case, 1)
    found = diagnose_percussion(arm, campaign).diagnosis
    assert found.verdict == "named"
    (cause,), (hidden,) = found.causes, truth["causes"]
    assert (cause.effect, cause.target) == (hidden["effect"], hidden["target"])
    gain = cause.parameters["gain"]
    assert abs(gain.value - hidden["parameters"]["gain"]) < 4.0 * gain.std < 0.2
