"""What few records cannot tell apart is told as a set, however many numbers it takes to say it."""

from __future__ import annotations

import math
from dataclasses import replace

import follow_up
import numpy as np
import pytest
import trial

import picchio
from picchio.campaign.tables import Tolerance
from picchio.diagnosis.percussion.criteria.equivalence import _effective_parameters
from picchio.diagnosis.percussion.criteria.identifiability import unconstrained_range
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.diagnosis import diagnose_percussion
from picchio.diagnosis.percussion.fit.least_squares import fit
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.measurement.noise.autoregression import AutoRegression
from picchio.model.effects.registry import effect_class
from picchio.prediction.plan import Plan
from picchio.prediction.simulation import simulate
from worlds import campaign as worlds

ACCELEROMETER = "accelerometer.tool"
JOINT, BASE = ("joint_stiffness", "joint_1"), ("base_compliance", "rz")


@pytest.fixture(scope="module")
def arm():
    return picchio.load_robot("fanuc_like_3dof")


def made(cause, seed, **options):
    return worlds.make(seed=seed, causes=[cause], records=3, **options)


@pytest.fixture(scope="module")
def soft_joint():
    """Joint 1 a quarter softer, and no deflections measured."""
    return made((*JOINT, {"scale": 0.73}), 102, sensors=(ACCELEROMETER,))


@pytest.fixture(scope="module")
def first(arm, soft_joint):
    return diagnose_percussion(arm, soft_joint[0]).diagnosis


def test_a_softer_first_joint_may_be_the_base_that_turns_under_it(first):
    assert first.verdict == "ambiguous"
    assert follow_up.told_sets(first) == {frozenset([JOINT]), frozenset([BASE])}


@pytest.mark.slow
def test_the_joints_own_deflection_is_asked_for_and_tells_them_apart(arm, soft_joint, first):
    """In a blow that moves joint 1: one in the arm's plane says nothing of it."""
    campaign, truth = soft_joint
    ask = first.next_measurement
    assert ask["sensor"] == "deflection"
    assert [rival["told"] for rival in ask["rivals"]] == ["either way"]
    across = [-math.sin(ask["pose"]["joint_1"]), math.cos(ask["pose"]["joint_1"]), 0.0]
    assert abs(np.dot(across, ask["direction"])) > 0.3
    after = diagnose_percussion(arm, follow_up.taken(ask, campaign, truth, 5)).diagnosis
    assert after.verdict == "named" and follow_up.told_sets(after) == {frozenset([JOINT])}


@pytest.mark.slow
def test_what_slopes_foretell_is_held_against_a_refit(arm):
    """By slopes another record of the accelerometer tells; the base's own damping hides it."""
    case = {"robot": "fanuc_like_3dof", "kind": "sets", "snr": 40, "draw": 1}
    campaign, truth = trial.make({**case, "effect": JOINT[0]}, 1)
    before = diagnose_percussion(arm, campaign).diagnosis
    assert follow_up.told_sets(before) == {frozenset([JOINT]), frozenset([BASE])}
    ask = before.next_measurement
    assert ask["sensor"] == "deflection"
    after = diagnose_percussion(arm, follow_up.taken(ask, campaign, truth, 5)).diagnosis
    assert after.verdict == "named" and follow_up.told_sets(after) == {frozenset([JOINT])}


@pytest.mark.parametrize("sensors", [(ACCELEROMETER,), (ACCELEROMETER, "deflection")])
@pytest.mark.slow
def test_a_base_that_turns_is_found_and_may_be_the_servo_of_the_joint_above(sensors, arm):
    """Nothing resists joint 1 and such a base turning against each other: it has no mass."""
    true = {"stiffness": 9e5, "damping": 400.0}
    campaign, _ = made((*BASE, true), 103, sensors=sensors)
    found = diagnose_percussion(arm, campaign).diagnosis
    servo = ("servo_compliance", "joint_1")
    assert (
        frozenset([BASE]) in follow_up.told_sets(found) <= {frozenset([BASE]), frozenset([servo])}
    )
    (cause,) = found.causes
    assert (cause.effect, cause.target) == BASE
    stiffness = cause.parameters["stiffness"]
    assert abs(stiffness.value - true["stiffness"]) < 3.0 * stiffness.std
    # Without deflections it is known no better than the spring of joint 1 that it adds to.
    assert stiffness.std < (0.005 if "deflection" in sensors else 0.3) * true["stiffness"]


@pytest.fixture(scope="module")
def struck(arm):
    """One short record of an accelerometer, too noisy to tell more than first-order changes."""
    blows = {"kind": "pulse_train", "force": 300.0, "period": 0.04, "width": 0.004, "hits": 2}
    plan = Plan(
        poses=[[0.3, 0.5, -0.8]], directions=[[0.6, 0.0, 0.8]], sample_rate=1000.0, quiet=0.3,
        length=0.15, excitation=blows, sensor=[{"channels": ACCELEROMETER, "noise": 1.0}],
    )  # fmt: skip
    return Problem(arm, simulate(arm, plan).campaign)


GAIN = effect_class("sensor_gain")(ACCELEROMETER)
FORCE = effect_class("force_amplitude")("tool")
STIFFNESS = effect_class("joint_stiffness")("joint_2")


def fitted(problem, causes, force_tolerance, records=None):
    """The nominal model with causes that do nothing, and its Jacobian."""
    hypothesis = Hypothesis.baseline(problem.robot, Tolerance(force=force_tolerance))
    for cause in causes:
        hypothesis = hypothesis.plus(cause)
    chosen = records or problem.records
    return fit(problem, hypothesis, chosen, None, iterations=0, with_jacobian=True)


@pytest.mark.parametrize(
    ("causes", "force_tolerance", "numbers"),
    [
        ((GAIN, STIFFNESS), 1e-6, 2.0),
        ((GAIN, FORCE), 0.05, 1.0),  # only their product
        ((GAIN,), 1e-6, 1.0),  # the force is known
        ((GAIN,), 1e3, 0.0),  # the force might be all
    ],
)
def test_numbers_count_as_far_as_the_records_tell_them(struck, causes, force_tolerance, numbers):
    found = fitted(struck, causes, force_tolerance)
    assert _effective_parameters(struck, found) == pytest.approx(numbers, abs=5e-3)


@pytest.mark.parametrize(("louder", "seen"), [(0.95, True), (1.05, False)])
def test_a_number_that_nobody_would_see_move_does_not_count(struck, louder, seen):
    """Noise so large that a gain, moved by half an e-fold, is just seen, or just not."""
    found = fitted(struck, (GAIN,), 0.0)
    vector = found.hypothesis.vector()
    vector[-1] += 0.5
    there = struck.residuals(found.hypothesis.at(vector).effects)
    change = sum(((a - b) ** 2).sum() for a, b in zip(there, found.residuals, strict=True))
    factor = louder * math.sqrt(change)
    records = [
        replace(record, noise={
            name: replace(
                noise, std=factor * noise.std,
                model=AutoRegression(noise.model.reflection, factor**2 * noise.model.variance),
            )
            for name, noise in record.noise.items()
        })
        for record in struck.records
    ]  # fmt: skip
    slope = 1.0 / (louder * (math.exp(0.5) - 1.0))  # of the residuals all in all
    numbers = 1.0 - 1.0 / (1.0 + 9.0 * slope**2) if seen else 0.0
    faint = fitted(struck, (GAIN,), 0.0, records)
    assert _effective_parameters(struck, faint) == pytest.approx(numbers, abs=2e-3)


def test_a_rotor_of_next_to_no_inertia_is_no_number(arm, soft_joint):
    """Its slope is rounding, and was taken for knowledge: a servo was then no rival of a base."""
    problem = Problem(arm, soft_joint[0])
    values = {"stiffness": 1e6, "rotor_inertia": 1.002e-9, "damping": 420.0}
    servo = effect_class("servo_compliance")("joint_1", **values)
    hypothesis = Hypothesis.baseline(arm, soft_joint[0].tolerance).plus(servo)
    found = fit(problem, hypothesis, problem.records, None, iterations=0, with_jacobian=True)
    numbers = {u.name: k for k, u in enumerate(hypothesis.unknowns()) if u.prior is None}
    assert unconstrained_range(problem, found, numbers["stiffness"]) == 0.0
    far = unconstrained_range(problem, found, numbers["rotor_inertia"])
    assert 1e-4 < values["rotor_inertia"] * math.exp(far) < 10.0  # kg m^2; the arm's are 10 to 100

    def changes(distance):
        moved = hypothesis.vector()
        moved[numbers["rotor_inertia"]] += distance
        there = problem.residuals(hypothesis.at(moved).effects)
        return sum(float(((a - b) ** 2).sum()) for a, b in zip(there, found.residuals, strict=True))

    assert changes(far - 1.0) < 1.0 <= changes(far)
