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
        scatter, slip: (hits,) of the force, relative, and of the start, s: never exact.
        rise: s, the force's way up and, after `width`, down; the height and the impulse stay.
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
    scatter: np.ndarray | None = None
    slip: np.ndarray | None = None
    rise: float = 0.0

    def table(self, direction, tool_turn):
        """(blows, 8): start, length, height, blend, unit direction in the world, rise."""
        along = tool_turn @ Rotation.from_rotvec(self.turn).as_matrix() @ tool_turn.T @ direction
        rows, length = [], self.width + self.rise
        for h in range(self.hits):
            if self.missed is not None and self.missed[h]:
                continue
            start = h * self.period + (0.0 if self.late is None else self.late[h])
            if self.slip is not None:
                start += self.slip[h]
            size = (
                self.force
                * (1.0 + self.drift * h)
                * (1.0 + (self.uneven if h % 2 else -self.uneven))
            )
            if self.scatter is not None:
                size *= 1.0 + self.scatter[h]
            here = Rotation.from_rotvec(h * self.swing).as_matrix() @ along
            rows.append([start, length, size, self.blend, *here, self.rise])
            if self.rebound is not None:
                ratio, delay = self.rebound
                rows.append([start + delay, length, ratio * size, self.blend, *here, self.rise])
        return np.array(rows).reshape(-1, 8)
