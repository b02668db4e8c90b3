from __future__ import annotations

import math

import numpy as np
import pytest

from picchio.core.errors import InputError
from picchio.robot.annotations.flexibility import Source, flexible_joints
from picchio.robot.drives.priors import drive_priors
from picchio.robot.estimate.sidecar import _rounded, estimated_sidecar
from picchio.robot.loading.load import load_robot
from picchio.robot.spread import Posterior


def test_an_estimated_sidecar_is_the_priors_to_three_digits() -> None:
    robot = load_robot("panda", allow_rigid=True)
    sidecar, priors = estimated_sidecar(robot, payload=3.0), drive_priors(robot, payload=3.0)
    assert list(sidecar.joint) == [joint.name for joint in priors.joints]
    for prior in priors.joints:
        entry = sidecar.joint[prior.name]
        assert entry.estimated
        assert prior.reasons[0] in str(entry.source)
        for key in ("stiffness", "stiffness_spread", "damping_ratio", "damping_ratio_spread"):
            value = getattr(entry, key)
            assert value == pytest.approx(getattr(prior, key), rel=5.1e-3)
            assert float(f"{value:.3g}") == value
        for key in ("repeated_peak_torque", "repeated_peak_torque_spread", "rated_torque"):
            assert getattr(entry.strength, key) == pytest.approx(getattr(prior, key), rel=5.1e-3)
    assert sidecar.tool is not None
    assert sidecar.tool.frame == robot.tool_frame
    exact, kept = priors.posterior(), sidecar.posterior
    assert kept is not None
    assert kept.names == exact.names
    np.testing.assert_allclose(kept.correlation, exact.correlation, atol=5.1e-4)


def test_a_robot_takes_an_estimated_sidecar_as_any_other() -> None:
    robot = load_robot("ur10", allow_rigid=True)
    sidecar = estimated_sidecar(robot, reducers={"elbow_joint": "CSG-25-100-2UH"})
    joints, _, spreads = flexible_joints(robot.tree, [Source("estimate", sidecar)])
    joint = joints["elbow_joint"]
    assert joint.estimated
    assert joint.reducer is not None
    assert joint.reducer.name == "CSG-25-100-2UH"
    assert joint.strength is not None
    assert joint.strength.repeated_peak_torque == joint.reducer.repeated_peak_torque
    sizes = {spread.name: spread.size for spread in spreads}
    factor = getattr(sidecar.joint["elbow_joint"], "stiffness_spread")  # noqa: B009  made by a decorator
    assert "strength.repeated_peak_torque.elbow_joint" not in sizes
    assert "strength.repeated_peak_torque.wrist_1_joint" in sizes
    assert sizes["stiffness.elbow_joint"] == pytest.approx(math.log(factor))


def test_rounding_leaves_correlations_that_can_be() -> None:
    """Nearly perfect ones, of ten values: rounded alone they are no variables'."""
    rng = np.random.default_rng(3)
    root = np.hstack([np.ones((10, 1)), 0.01 * rng.standard_normal((10, 2))])
    root /= np.linalg.norm(root, axis=1, keepdims=True)
    matrix = root @ root.T
    np.fill_diagonal(matrix, 1.0)
    assert np.linalg.eigvalsh(matrix.round(3))[0] < -1e-6
    names = tuple(f"stiffness.joint_{k}" for k in range(10))
    exact = Posterior(
        names=names, correlation=tuple(map(tuple, (0.5 * (matrix + matrix.T)).tolist()))
    )
    found = np.array(_rounded(exact).correlation)
    np.testing.assert_allclose(found, matrix, atol=0.02)


def test_a_robot_without_a_turning_joint_is_refused() -> None:
    with pytest.raises(InputError, match="no rotary joint"):
        estimated_sidecar(load_robot("emps", allow_rigid=True))
