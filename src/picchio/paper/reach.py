"""Fig. 10: peaks of every joint all over the arm's own plane."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.paper.arm import places_of

if TYPE_CHECKING:
    from picchio.paper.world import World


@dataclass(frozen=True, eq=False)
class ReachMap:
    """Peaks in the x-z plane, on a grid in joint space that ends at the stated joint limits.

    Attributes:
        place: (turns, bends, 3) m, the side of positive x; the other is its mirror image.
        bend: (bends,) rad, joint 3.
        worst: (turns, bends, 3 joints) mrad over all force directions.
        along: by axis "x", "y", "z": the same for a force along it.
    """

    place: FloatArray
    bend: FloatArray
    worst: FloatArray
    along: dict[str, FloatArray]

    @property
    def distance(self) -> FloatArray:
        """(turns, bends) m, from joint 2 to the tool."""
        return np.asarray(np.hypot(self.place[..., 0], self.place[..., 2] - self.hub))

    @property
    def hub(self) -> float:
        """m, height of joint 2."""
        # Straight out along x the tool is as high as joint 2.
        return float(self.place[self.place.shape[0] // 2, 0, 2])

    def top(self, peaks: FloatArray, joint: int) -> FloatArray:
        """The place (3,) m where the joint's peak is largest.

        Args:
            peaks: (..., joints) over the map.
            joint: its index.
        """
        flat = int(peaks[..., joint].argmax())
        return np.asarray(self.place.reshape(-1, 3)[flat])


def reach_map(world: World, turns: int, bends: int) -> ReachMap:
    """Peaks of the steady state over the reach within the stated joint limits.

    Joint 2's range is stated from -pi/2 to pi/2 and joint 3's from -70 to 70 degrees; one elbow
    is shown, as assumed.
    """
    limit = world.printed.arm.limits
    sign = 1.0 if world.given.elbow == "down" else -1.0
    bend = np.linspace(0.0, limit[2], bends)
    q2, q3 = np.meshgrid(np.linspace(-limit[1], limit[1], turns), sign * bend, indexing="ij")
    poses = np.stack([np.zeros_like(q2), q2, q3], axis=-1).reshape(-1, 3)
    shape = (turns, bends, 3)

    def peaks(direction: FloatArray | None) -> FloatArray:
        return 1e3 * world.peaks(poses, direction).peak_deflection.reshape(shape)

    along = {axis: peaks(np.eye(3)[k]) for k, axis in enumerate("xyz")}
    return ReachMap(places_of(poses).reshape(shape), sign * bend, peaks(None), along)
