"""Stiffness that grows with the torque, as catalogues of strain-wave gears give it.

A catalogue gives three stiffnesses K1, K2, K3 and two torques T1, T2: the wind-up against the
torque is three straight lines (for example Harmonic Drive, *Engineering data HFUC*, "torsional
stiffness"). Small vibration about the pose's gravity torque sees the slope there, so the model
takes the **tangent**. The secant, torque over wind-up, is what a static test between zero and
this torque measures, and is given too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True)
class StiffnessCurve:
    """Wind-up in three straight lines.

    Args:
        k1: N m/rad (N/m for a prismatic joint) below `t1`.
        k2: between `t1` and `t2`.
        k3: above `t2`.
        t1: N m (N), the first corner.
        t2: the second corner, above `t1`.
    """

    k1: float
    k2: float
    k3: float
    t1: float
    t2: float

    def tangent(self, torque: ArrayLike) -> NDArray[np.float64]:
        """Slope at a torque, N m/rad; at a corner the line below it. Same shape as `torque`."""
        size = np.abs(np.asarray(torque, dtype=float))
        return np.where(size <= self.t1, self.k1, np.where(size <= self.t2, self.k2, self.k3))

    def wind_up(self, torque: ArrayLike) -> NDArray[np.float64]:
        """Angle at a torque, rad (m for a prismatic joint); odd. Same shape as `torque`."""
        signed = np.asarray(torque, dtype=float)
        size = np.abs(signed)
        angle = (
            np.minimum(size, self.t1) / self.k1
            + np.clip(size - self.t1, 0.0, self.t2 - self.t1) / self.k2
            + np.maximum(size - self.t2, 0.0) / self.k3
        )
        return np.sign(signed) * angle

    def secant(self, torque: ArrayLike) -> NDArray[np.float64]:
        """Torque over wind-up, N m/rad; `k1` at zero. Same shape as `torque`."""
        signed = np.asarray(torque, dtype=float)
        angle = self.wind_up(signed)
        still = angle == 0.0
        return np.where(still, self.k1, signed / np.where(still, 1.0, angle))
