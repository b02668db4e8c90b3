"""Records whose force a load cell has read, in a world that is a little wrong everywhere.

Half-sines of 4 ms, 12 records of 1 s at 2 kHz, no sample at t = 0: a force that acted half a sample
late left 12 % of the signal, and was told as sensors that are late.
"""

import numpy as np
import pytest
import trial

import picchio
from picchio.core.processes import one_thread
from picchio.diagnosis.percussion import diagnosis as concluding
from picchio.diagnosis.percussion.conclude.left_open import fitted_spread, nominal_spread
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.diagnosis import diagnose_percussion
from picchio.diagnosis.percussion.fit.least_squares import fit
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.residual import percussion_residual, transfers
from picchio.diagnosis.percussion.tolerance.linearise import settled
from picchio.diagnosis.result import Gain
from picchio.excitation.pulse_train import PulseTrain
from picchio.model.blows import Blows
from picchio.model.conditions import Conditions
from picchio.model.effects.registry import effect_class

CASE = {"robot": "fanuc_like_3dof", "snr": 40, "mismatch": 1,
        "sensors": ("accelerometer", "deflection", "force")}  # fmt: skip


@pytest.fixture(scope="module")
def arm():
    return picchio.load_robot("fanuc_like_3dof")


@pytest.fixture(scope="module")
def few(arm, worlds):
    sensors = ("accelerometer", "deflection", "force")
    campaign, _ = worlds.make(records=6, seed=11, mismatch=1.0, sensors=sensors, programmed=False,
                              blend=1.0, sampling=2000.0, hits=3, ring=0.3)  # fmt: skip
    return Problem(arm, campaign)


def test_what_the_force_sensor_reads_says_nothing_of_the_tool(arm, few):
    """Its gain is fitted, and leaves blows that a study states as they are."""
    here = Hypothesis.nominal(few)
    names = [effect.name for effect in here.effects]
    assert "force_reading" in names and "force_amplitude" not in names
    assert here.tolerance == few.campaign.tolerance
    assert "force_amplitude" in [e.name for e in Hypothesis.baseline(arm, here.tolerance).effects]

    reading = effect_class("force_reading")("tool", scale=1.1)
    stated = Blows.of(PulseTrain(300.0, 0.04, 0.004), 3, np.array([0.0, 0.0, 1.0]))
    read = few.records[0].setup.blows
    assert reading.blows(stated, Conditions()) is stated
    assert reading.blows(read, Conditions()).peak == pytest.approx(1.1 * read.peak)

    late = effect_class("force_delay")("tool", delay=0.5e-3)
    for each in (reading, late):
        assert "not the loads" in each.without_load(Conditions())
    assert late.blows(stated, Conditions()) is stated
    moved, was = late.blows(read, Conditions()).force(), read.force()
    times = np.linspace(0.01, 0.1, 200)
    assert moved(times - 0.5e-3) == pytest.approx(was(times), rel=1e-9, abs=1e-6)


def test_of_a_stated_force_as_little_is_known_after_it_was_read(arm, few):
    """A life's interval has the tolerance of the tool's force before and after alike."""

    burst = Blows.of(PulseTrain(300.0, 0.04, 0.004), 3, np.array([0.0, 0.0, 1.0]))

    def peak(found, vector):
        blows = burst
        for effect in found.effects(vector):
            blows = effect.blows(blows, Conditions())
        return blows.peak

    def spread(found):
        """Of the logarithm of how hard the blows are: each number moved by one deviation."""
        steps = np.diag(np.sqrt(found.covariance.diagonal()))
        moved = [peak(found, found.centre + step) for step in steps]
        return np.linalg.norm(np.log(np.divide(moved, peak(found, found.centre))))

    tolerance = few.campaign.tolerance
    both = np.hypot(tolerance.force, tolerance.blow_force)
    with one_thread():
        found = fit(few, Hypothesis.nominal(few), few.records, None, with_jacobian=True)
        assert spread(fitted_spread(few, found)) == pytest.approx(tolerance.force, rel=0.05)
        found = settled(few, found, few.records, rounds=1)
        assert few.marginal is not None
        assert spread(fitted_spread(few, found)) == pytest.approx(both, rel=0.05)
        assert spread(nominal_spread(few)) == pytest.approx(both, rel=0.05)


def test_response_over_a_force_that_is_read_is_shown(arm, few):
    """The force drives the prediction and is no channel of it: it is there for all that."""
    found = percussion_residual(arm, few.campaign)
    records, shown = transfers(found.fit, found.predictions)
    assert records and shown
    assert all("force" not in record.values for record in records)
    one = next(iter(shown.values()))
    tells = (one.coherence > 0.99) & (one.frequency < 60.0)
    assert tells.sum() > 5
    apart = np.linalg.norm((one.measured - one.simulated)[tells])
    assert apart < 0.2 * np.linalg.norm(one.measured[tells])


@pytest.mark.parametrize(("held_out", "stands"), [(-0.01, False), (0.5, False), (0.7, True)])
def test_a_cause_that_helps_little_held_out_is_dropped_where_little_was_left(
    arm, few, monkeypatch, held_out, stands
):
    """What is told then is the nominal model, its values and its verdict."""

    def one_more(search):
        delay = effect_class("sensor_delay")("deflection", delay=1e-5)
        search.best = search.fit(search.best.hypothesis.plus(delay), iterations=4)

    class Told(Gain):
        explained = held_out

    as_it_is = concluding.holdout_gain
    monkeypatch.setattr(concluding, "run_search", one_more)
    monkeypatch.setattr(concluding, "holdout_gain", lambda *given: Told(**vars(as_it_is(*given))))
    found = diagnose_percussion(arm, few.campaign, workers=1)
    assert bool(found.extended.hypothesis.causes) == stands
    if not stands:
        assert found.diagnosis.verdict == "nothing-wrong" and not found.diagnosis.causes
        assert set(found.diagnosis.nuisances) >= {"stiffness.joint_1", "force_reading"}
        gain = found.diagnosis.gain  # of one model, judged twice
        assert gain.extended_nrmse == pytest.approx(gain.baseline_nrmse, rel=1e-12)


@pytest.mark.slow
@pytest.mark.minutes
@pytest.mark.parametrize("draw", [91201, 91206])
def test_nothing_wrong_is_nothing_wrong(arm, draw):
    """In draw 91206 the slopes of all records say nothing of values that fewer have told."""
    campaign, _ = trial.make({**CASE, "kind": "null", "draw": draw}, 1)
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


@pytest.mark.minutes
@pytest.mark.slow
@pytest.mark.parametrize(("seed", "late", "within"), [(91300, 2e-3, 2e-6), (91301, 6e-4, 5e-6)])
def test_a_force_sensor_that_is_late_is_told_as_that(arm, worlds, seed, late, within):
    """And not as all other sensors being early; to a hundredth of a sample, whole ones or not."""
    campaign, _ = worlds.make(seed=seed, mismatch=1.0, snr_db=40.0, sensors=CASE["sensors"],
                              causes=[("sensor_delay", "force", {"delay": late})],
                              **trial.READ)  # fmt: skip
    found = diagnose_percussion(arm, campaign).diagnosis
    (cause,) = found.causes
    assert (found.verdict, cause.effect) == ("named", "force_delay")
    delay = cause.parameters["delay"]
    assert delay.value == pytest.approx(late, abs=within)
    assert 4.0 * delay.std < 1e-5
