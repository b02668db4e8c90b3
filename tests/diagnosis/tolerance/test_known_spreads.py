"""A diagnosis of later data starts from what an identification found."""

import math

import numpy as np
import pytest

import picchio
from picchio.campaign.tables import Tolerance
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.fit.least_squares import fit_growing, prior_cost, prior_precision
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from worlds import campaign as worlds

ROBOT = "fanuc_like_3dof"
SENSORS = ("accelerometer.tool", "deflection")
NAMES = [f"stiffness.joint_{k}" for k in (1, 2, 3)]
SIZES = np.array([0.004, 0.02, 0.01])
CORRELATION = np.array([[1.0, 0.6, 0.0], [0.6, 1.0, -0.3], [0.0, -0.3, 1.0]])


@pytest.fixture(scope="module")
def sidecar(tmp_path_factory):
    """As `picchio identify` writes it, values as stated."""
    nominal = picchio.load_robot(ROBOT)
    lines = ['format = "picchio-sidecar/1"']
    for k, joint in enumerate(nominal.flexible_joints):
        lines += [f"[joint.{joint.name}]", f"stiffness = {joint.stiffness}",
                  f"stiffness_spread = {math.exp(SIZES[k])}",
                  f"damping_ratio = {joint.damping_ratio}",
                  "damping_ratio_spread = 1.1"]  # fmt: skip
    lines += ["[posterior]", f"names = {NAMES}", f"correlation = {CORRELATION.tolist()}"]
    file = tmp_path_factory.mktemp("flex") / "flex.toml"
    file.write_text("\n".join(lines))
    return file


def test_the_prior_is_the_sidecars_posterior(sidecar):
    robot = picchio.load_robot(ROBOT, flex=sidecar)
    hypothesis = Hypothesis.baseline(robot, Tolerance())
    labels = [hypothesis.effects[u.effect].label for u in hypothesis.unknowns()]
    at = [labels.index(f"joint_stiffness:joint_{k}") for k in (1, 2, 3)]
    precision = prior_precision(hypothesis)
    covariance = CORRELATION * np.outer(SIZES, SIZES)
    np.testing.assert_allclose(np.linalg.inv(precision[np.ix_(at, at)]), covariance,
                               rtol=1e-4, atol=1e-9)  # fmt: skip
    damping = labels.index("modal_damping:robot")
    assert precision[damping, damping] == pytest.approx(math.log(1.1) ** -2)
    # A value that is freed to be a cause takes its correlations with it.
    freed = hypothesis.plus(hypothesis.effects[at[1]])
    left = prior_precision(freed)
    assert not left[at[1]].any()
    np.testing.assert_allclose(left[at[0], at[0]], SIZES[0] ** -2, rtol=1e-5)
    moved = np.zeros(len(labels))
    moved[at[0]], moved[at[1]] = 0.004, 0.012
    assert prior_cost(hypothesis.at(moved)) == pytest.approx(1.0, rel=1e-3)  # along 0.6


def test_what_the_campaign_states_and_what_is_guessed(sidecar):
    robot = picchio.load_robot(ROBOT, flex=sidecar)
    stated = Hypothesis.baseline(robot, Tolerance(stiffness=0.05))
    assert stated.known.labels == ("modal_damping:robot",)
    guess = {"joint_1": {"stiffness": 1e5, "damping_ratio": 0.03, "estimated": True}}
    guessed = picchio.load_robot(ROBOT, values=guess)
    assert guessed.spreads and not Hypothesis.baseline(guessed, Tolerance()).known.labels


def test_what_a_tolerance_passes_an_identification_does_not(sidecar):
    """A world whose joints are off by some 5 %, as any are that nobody measured."""
    campaign, _ = worlds.make(robot=ROBOT, seed=21, sensors=SENSORS, records=2)
    springs = {f"joint_stiffness:joint_{k}" for k in (1, 2, 3)}
    for flex, asked in ((None, set()), (sidecar, springs)):
        robot = picchio.load_robot(ROBOT, flex=flex)
        plain = Tolerance(**campaign.tolerance.model_dump(exclude={"stiffness"}))
        found = fit_growing(Problem(robot, campaign), Hypothesis.baseline(robot, plain))
        assert found.hypothesis.at_ends & springs == asked
