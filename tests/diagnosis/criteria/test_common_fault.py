"""What all sensors have alike is hardly a fault of each of them."""

import numpy as np
import pytest

import picchio
from picchio.campaign.tables import Tolerance
from picchio.diagnosis.percussion.criteria.common_fault import common_faults
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.model.effects.registry import effect_class

BOTH = ("accelerometer.tool", "deflection")


def found(*causes):
    """(hypothesis with causes (name, group, values), covariance of 1e-3 of every unknown)."""
    robot = picchio.load_robot("fanuc_like_3dof")
    hypothesis = Hypothesis.baseline(robot, Tolerance())
    for name, group, values in causes:
        hypothesis = hypothesis.plus(effect_class(name)(group, **values))
    return hypothesis, 1e-6 * np.eye(len(hypothesis.unknowns()))


@pytest.mark.parametrize(
    ("name", "values", "other"),
    [
        ("sensor_gain", {"gain": 0.78}, {"gain": 0.781}),
        ("sensor_delay", {"delay": 8e-4}, {"delay": 8.1e-4}),
        ("sensor_lowpass", {"frequency": 90.0}, {"frequency": 91.0}),
    ],
)
def test_the_same_fault_of_all_sensors_is_none_of_theirs(name, values, other):
    alike = found((name, BOTH[0], values), (name, BOTH[1], other))
    assert common_faults(*alike, BOTH) == (name,)


A, B = (("sensor_gain", group) for group in BOTH)
LATE = ("sensor_delay", BOTH[1], {"delay": 1e-3})


@pytest.mark.parametrize(
    ("causes", "groups"),
    [
        # one of two sensors; the only one there is; two that differ; two kinds of fault
        ([(*A, {"gain": 0.78})], BOTH),
        ([(*A, {"gain": 0.78})], BOTH[:1]),
        ([(*A, {"gain": 0.78}), (*B, {"gain": 0.74})], BOTH),
        ([(*A, {"gain": 0.9}), (*B, {"gain": 1.11})], BOTH),
        ([(*A, {"gain": 0.9}), LATE], BOTH),
        # a cause that is no sensor's
        ([("joint_damping", "joint_1", {"damping": 9.0})], ("joint_1",)),
    ],
)
def test_a_sensors_own_fault_stays_its_own(causes, groups):
    assert common_faults(*found(*causes), groups) == ()


def test_values_that_are_hardly_known_agree_by_chance():
    hypothesis, covariance = found(
        ("sensor_gain", BOTH[0], {"gain": 0.9}), ("sensor_gain", BOTH[1], {"gain": 0.9})
    )
    assert common_faults(hypothesis, covariance, BOTH) == ("sensor_gain",)
    assert common_faults(hypothesis, 900.0 * covariance, BOTH) == ()
    # Both unsure, for a reason that they share (the force): the difference is known well.
    shared = 900.0 * covariance
    shared[-2, -1] = shared[-1, -2] = 899.9 * covariance[0, 0]
    assert common_faults(hypothesis, shared, BOTH) == ("sensor_gain",)
