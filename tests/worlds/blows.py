"""The burst: what the tool was told, and what it does instead."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation


@dataclass
class Blows:
    """A burst of rectangular blows, and how it departs from that.

    Attributes:
        force, period, width: N, s, s, as told; a factor on the force is in `force` already.
        hits: blows.
        drift: change of the force per blow, relative.
        blend: 0 a rectangle, 1 a half-sine.
        late: (hits,) s.
        missed: (hits,) bool.
        rebound: (ratio, delay in s) or None.
        turn: (3,) rotation vector in the tool frame, rad.
        uneven: every other blow is harder by this, the rest weaker, relative.
        swing: (3,) rad per blow, a rotation vector in the world that grows blow by blow.
    """

    force: float
    period: float
    width: float
    hits: int
    drift: float = 0.0
    blend: float = 0.0
    late: np.ndarray | None = None
    missed: np.ndarray | None = None
    rebound: tuple[float, float] | None = None
    turn: np.ndarray = field(default_factory=lambda: np.zeros(3))
    uneven: float = 0.0
    swing: np.ndarray = field(default_factory=lambda: np.zeros(3))

    def table(self, direction, tool_turn):
        """(blows, 7): start, width, height, blend, unit direction in the world."""
        along = tool_turn @ Rotation.from_rotvec(self.turn).as_matrix() @ tool_turn.T @ direction
        rows = []
        for h in range(self.hits):
            if self.missed is not None and self.missed[h]:
                continue
            start = h * self.period + (0.0 if self.late is None else self.late[h])
            size = (
                self.force
                * (1.0 + self.drift * h)
                * (1.0 + (self.uneven if h % 2 else -self.uneven))
            )
            here = Rotation.from_rotvec(h * self.swing).as_matrix() @ along
            rows.append([start, self.width, size, self.blend, *here])
            if self.rebound is not None:
                ratio, delay = self.rebound
                rows.append([start + delay, self.width, ratio * size, self.blend, *here])
        return np.array(rows).reshape(-1, 7)
