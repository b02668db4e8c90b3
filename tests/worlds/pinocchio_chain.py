"""A chain of Pinocchio's alone, for the worlds of tests: gravity, place, Jacobian, wrong masses."""

from __future__ import annotations

import numpy as np
import pinocchio as pin


def with_wrong_masses(model, rng, sigma):
    """A copy of a model, each body heavier or lighter as a whole, by `sigma` of its mass."""
    found = model.copy()
    for k in range(1, found.njoints):
        factor = 1.0 + sigma * rng.standard_normal()
        found.inertias[k] = pin.Inertia.FromDynamicParameters(
            factor * found.inertias[k].toDynamicParameters()
        )
    return found


class Chain:
    """Some joints of a model; the others stand at zero."""

    def __init__(self, model, tool, joints) -> None:
        self.model, self.data = model, model.createData()
        self.frame = model.getFrameId(tool)
        self.columns = [model.joints[model.getJointId(name)].idx_v for name in joints]

    def _q(self, pose):
        step = np.zeros(self.model.nv)
        step[self.columns] = pose
        return pin.integrate(self.model, pin.neutral(self.model), step)

    def gravity(self, pose):
        """(n,) torques that hold it."""
        whole = pin.computeGeneralizedGravity(self.model, self.data, self._q(pose))
        return np.array(whole)[self.columns]

    def pull(self, pose):
        """(n, n) gravity's change with the joints."""
        whole = pin.computeGeneralizedGravityDerivatives(self.model, self.data, self._q(pose))
        return np.array(whole)[np.ix_(self.columns, self.columns)]

    def place(self, pose):
        """Where the tool is."""
        pin.framesForwardKinematics(self.model, self.data, self._q(pose))
        return pin.SE3(self.data.oMf[self.frame])

    def jacobian(self, pose):
        """(6, n) of the tool's origin, world axes."""
        pin.computeJointJacobians(self.model, self.data, self._q(pose))
        return pin.computeFrameJacobian(
            self.model, self.data, self._q(pose), self.frame, pin.LOCAL_WORLD_ALIGNED
        )[:, self.columns]
