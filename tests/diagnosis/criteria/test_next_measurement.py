"""What to measure next: it is asked for, taken in the world, and tells the rivals apart."""

from __future__ import annotations

import follow_up
import pytest
import trial

import picchio
from picchio.diagnosis.percussion.diagnosis import diagnose_percussion
from picchio.prediction.simulation import simulate

FEW = {"robot": "fanuc_like_3dof", "kind": "few", "snr": 40, "draw": 0}
CLEAR = 30.0  # chi-square


@pytest.fixture(scope="module")
def arm():
    return picchio.load_robot("fanuc_like_3dof")


@pytest.mark.parametrize("effect", ["force_amplitude", "sensor_gain"])
@pytest.mark.slow
def test_what_is_asked_for_tells_force_from_gain(effect, arm, tmp_path):
    """One accelerometer cannot tell a harder blow from a sensor that reads too much."""
    campaign, truth = trial.make({**FEW, "effect": effect})
    first = diagnose_percussion(arm, campaign).diagnosis
    assert first.verdict == "ambiguous"
    force, gain = ("force_amplitude", "tool"), ("sensor_gain", "accelerometer.tool")
    assert follow_up.told_sets(first) == {frozenset([force]), frozenset([gain])}
    ask = first.next_measurement
    assert ask["sensor"] == "deflection"
    # Force has a tolerance, by which a gain may be made up for in part.
    (rival,) = ask["rivals"]
    assert rival["told"] in ("either way", "one way")
    assert rival["chi_square"] < rival["chi_square_at_best"]
    assert rival["chi_square_at_best"] > 100.0 * CLEAR
    after = diagnose_percussion(arm, follow_up.taken(ask, campaign, truth, 5)).diagnosis
    assert after.verdict == "named"
    assert [(c.effect, c.target) for c in after.causes] == [force if effect in force else gain]
    assert not after.alternatives
    file = tmp_path / "next.toml"
    file.write_text(ask["plan"])
    (record,) = simulate(arm, file).campaign.records
    assert {c.partition(".")[0] for c in record.channels} == {"accelerometer", "deflection"}
    assert record.hits == campaign.records[0].hits
    assert record.clock.step == pytest.approx(campaign.records[0].clock.step)
    assert list(record.direction) == pytest.approx(ask["direction"])
    assert record.excitation.force == pytest.approx(ask["force"])


@pytest.mark.slow
def test_what_differs_by_the_day_or_by_the_weather_is_asked_for_on_such_a_day(arm):
    """Between two records of one day it grew warmer as time went by."""
    campaign, truth = trial.make({**FEW, "effect": "stiffness_drift", "records": 2}, 1)
    first = diagnose_percussion(arm, campaign).diagnosis
    drift, thermal = ("stiffness_drift", "joint_2"), ("thermal_stiffness", "joint_2")
    assert follow_up.told_sets(first) == {frozenset([drift]), frozenset([thermal])}
    ask = first.next_measurement
    assert {"temperature", "days"} & set(ask)
    assert min(rival["chi_square"] for rival in ask["rivals"]) > CLEAR
    assert ("temperatures" in ask["plan"], "times" in ask["plan"]) == (
        "temperature" in ask, "days" in ask
    )  # fmt: skip
    after = diagnose_percussion(arm, follow_up.taken(ask, campaign, truth, 5)).diagnosis
    assert after.verdict == "named" and not after.alternatives
    assert [(c.effect, c.target) for c in after.causes] == [drift]


def test_what_a_record_held_out_tells_apart_is_no_alternative(arm):
    """Two records that are fitted leave drift and warmth alike; the third, held out, does not."""
    campaign, _ = trial.make({**FEW, "effect": "stiffness_drift"}, 1)
    found = diagnose_percussion(arm, campaign).diagnosis
    assert found.verdict == "named"
    assert follow_up.told_sets(found) == {frozenset([("stiffness_drift", "joint_3")])}
    assert found.causes[0].confidence > 0.99


def test_what_no_measurement_tells_apart_is_said(arm):
    """Joint 1 turns its link about one fixed axis: the link's mass is an inertia there."""
    campaign, _ = trial.make({**FEW, "effect": "joint_inertia"})
    found = diagnose_percussion(arm, campaign).diagnosis
    assert found.verdict == "ambiguous"
    assert follow_up.told_sets(found) == {
        frozenset([("joint_inertia", "joint_1")]), frozenset([("link_mass", "link_1")])
    }  # fmt: skip
    ask = found.next_measurement
    assert ask["why"].startswith("nothing that was tried tells")
    assert [rival["told"] for rival in ask["rivals"]] == ["no"]
    assert max(rival["chi_square"] for rival in ask["rivals"]) < CLEAR


@pytest.mark.parametrize("draw", range(5))
def test_noise_known_from_little_quiet_time_raises_no_alarm(draw, arm):
    campaign, _ = trial.make({**FEW, "kind": "few-null", "draw": draw})
    assert diagnose_percussion(arm, campaign).diagnosis.verdict == "nothing-wrong"
