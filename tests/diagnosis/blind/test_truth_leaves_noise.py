"""With every error of an independent world at its true value, the model leaves noise.

The world has its errors in its own terms (`worlds.errors`); here each is put into the numbers that
the diagnosis moves. What is then left is what the model cannot say, however well it is fitted.
"""

import math

import numpy as np
import pytest
import trial

import picchio
from picchio.core.processes import one_thread
from picchio.diagnosis.percussion.data.problem import Problem, residual_under
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.tolerance.nudges import inexact, nudged, principal
from picchio.model.effects.registry import effect_class


def _true_size(problem, one, record, errors):
    """(numbers,) of standard deviations of one inexact number, as the world has drawn it."""
    key, _, where = one.name.partition(".")
    sigma, drawn, pose = getattr(problem.campaign.tolerance, key), errors[key], str(record.pose + 1)
    joints = list(problem.robot.flexible_names)
    alike = math.sqrt(sum(other.pose == record.pose for other in problem.records))
    if key == "link_mass":
        return drawn[where] / sigma
    if key in ("link_com", "link_inertia"):
        link, axis = where.rsplit(".", 1)
        axes = principal(problem.robot.tree.links[link])[1]
        along = np.array(drawn[link])
        return (axes.T @ along if key == "link_com" else along)[int(axis) - 1] / sigma
    if key == "pose":
        return drawn[where] / sigma
    if key == "pose_repeat":
        return drawn[pose][joints.index(where)] / (alike * sigma)
    if key == "damping_by_mode":
        return math.log1p(drawn[pose][int(where) - 1]) / (alike * sigma)
    if key == "direction":
        sides = np.linalg.svd(record.setup.blows.direction[None])[2][1:]
        return sides[int(where) - 1] @ np.array(drawn[record.name]) / sigma
    if key in ("blow_force", "blow_time"):
        return np.array(drawn[record.name]) / sigma
    if key in ("tool_point", "sensor_position"):
        return drawn["tool"]["xyz".index(where[-1])] / sigma
    if key == "sensor_angle":
        group, axis = where.rsplit(".", 1)
        return drawn[group]["xyz".index(axis)] / sigma
    if key == "gravity_stiffness":
        return math.log1p(drawn["robot"]) / sigma
    return drawn[where or "tool"] / sigma  # rise_time, sensor_gain


@pytest.mark.parametrize(
    ("robot", "kind", "draw"),
    [
        ("fanuc_like_3dof", "null", 20003),
        # A filter whose steps are as long as a blow's rise.
        ("fanuc_like_3dof", "pair", 20001),
        # A light wrist, of which a centre of mass is a large part, to the second order as well.
        pytest.param("ur10", "null", 20000, marks=pytest.mark.slow),
        pytest.param("fanuc_r2000ic", "null", 20000, marks=pytest.mark.slow),
    ],
)
@one_thread()
def test_the_truth_leaves_noise(robot, kind, draw):
    case = {"robot": robot, "kind": kind, "snr": 40, "draw": draw, "mismatch": 1.0}
    campaign, truth = trial.make(case, 1)
    problem = Problem(picchio.load_robot(robot), campaign)
    errors = truth["errors"]
    start = Hypothesis.baseline(problem.robot, campaign.tolerance)
    true = []
    for unknown in start.unknowns():
        effect, _, target = start.effects[unknown.effect].label.partition(":")
        key = {
            "joint_stiffness": "stiffness",
            "modal_damping": "damping_ratio",
            "force_amplitude": "force",
        }[effect]
        true.append(math.log1p(errors[key][target]))
    hidden = [effect_class(c["effect"])(c["target"], **c["parameters"]) for c in truth["causes"]]
    model = problem.model.with_effects([*start.at(np.array(true)).effects, *hidden])

    left, samples = 0.0, 0
    for record in problem.records:
        sizes = [
            (one, np.atleast_1d(_true_size(problem, one, record, errors)))
            for one in inexact(problem, record, campaign.tolerance)
        ]
        residual = residual_under(record, model, *nudged(record, sizes))
        left += float((residual**2).sum())
        samples += residual.size
    assert left / samples == pytest.approx(1.0, abs=0.015)
