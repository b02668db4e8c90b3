"""A world: the printed data, with a value assumed for everything that the paper leaves out."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.excitation.pulse_train import PulseTrain
from picchio.fatigue.shaft_stress import stress_per_torque
from picchio.model.model import Model
from picchio.paper.arm import arm, poses_at, rivet_points
from picchio.paper.assumptions import INPUTS, Assumptions
from picchio.paper.printed import Printed, printed
from picchio.paper.reach import ReachMap, reach_map
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.studies.rivet.poses import peaks_at
from picchio.studies.tasks import Operation
from picchio.vibration.batch.peaks import BatchPeaks


@dataclass(frozen=True, eq=False)
class World:
    """The paper's arm and blows under one set of assumptions.

    Attributes:
        given: the assumptions.
        fine: whether Fig. 10's maps are fine enough to be drawn.
    """

    given: Assumptions
    fine: bool = False

    @property
    def printed(self) -> Printed:
        """What the paper prints."""
        return printed()

    @cached_property
    def robot(self) -> FlexibleRobot:
        """The arm."""
        return arm(self.given)

    @cached_property
    def model(self) -> Model:
        """The arm as a vibrating system, as the paper has it: no gravity stiffness."""
        return Model(self.robot)

    @cached_property
    def blows(self) -> PulseTrain:
        """The pulse train of eq. 12."""
        return PulseTrain(self.printed.task.force, self.given.period, self.given.width)

    def peaks(
        self, poses: ArrayLike, direction: ArrayLike | None = None, hits: int | None = None
    ) -> BatchPeaks:
        """Peaks at poses (p, 3): the worst direction's, or along one; steady, or of a burst.

        Args:
            poses: (p, 3) rad.
            direction: (3,) of the force; the worst one where None.
            hits: of a burst; None for a steady train.

        Returns:
            deflections and torques, (p, 3) each.
        """
        rows = np.ascontiguousarray(poses, dtype=float)
        return peaks_at(self.model, rows, self.blows, hits=hits, direction=direction)[0]

    def stress(self, deflection: FloatArray) -> FloatArray:
        """The shear stress in MPa of deflections in rad, by Eqs. 14-17.

        Args:
            deflection: rad, any shape.
        """
        return np.asarray(deflection) * (self.given.stress_per_twist / 1e6)

    @cached_property
    def path_poses(self) -> FloatArray:
        """(4, 3) rad, Fig. 9's vertical path."""
        heights = self.printed.task.path_heights
        points = [(self.given.path_x, 0.0, z) for z in heights]
        return self._reached(poses_at(points, self.given.elbow), "path_x")

    @cached_property
    def rivet_poses(self) -> FloatArray:
        """(15, 3) rad, Fig. 12's rivets."""
        return self._reached(poses_at(rivet_points(self.given), self.given.elbow), "panel_x")

    @cached_property
    def path_peaks(self) -> BatchPeaks:
        """Over all directions, on the vertical path."""
        return self.peaks(self.path_poses)

    @cached_property
    def reach(self) -> ReachMap:
        """Fig. 10's maps."""
        return reach_map(self, 41, 24) if self.fine else reach_map(self, 25, 13)

    def path_radii(self, angle: FloatArray, towards: ArrayLike = (0.0, 0.0, 1.0)) -> FloatArray:
        """Peaks on the vertical path under forces from +x by some angles towards a direction.

        Args:
            angle: (k,) rad.
            towards: (3,), square to x.

        Returns:
            (k, 4 poses, 3 joints) rad.
        """
        cut = np.outer(np.cos(angle), (1.0, 0.0, 0.0)) + np.outer(
            np.sin(angle), np.asarray(towards)
        )
        return np.array([self.peaks(self.path_poses, n).peak_deflection for n in cut])

    def rivet_peaks(self, hits: int | None = None) -> FloatArray:
        """Largest deflections at the rivets, (3 directions, 15 rivets, 3 joints) rad.

        Args:
            hits: of a burst from rest; None for the steady state.
        """
        directions = self.printed.directions
        return np.array([self.peaks(self.rivet_poses, n, hits).peak_deflection for n in directions])

    @cached_property
    def rivet_stress(self) -> FloatArray:
        """(3 directions, 15 rivets, 3 joints) MPa: Figs. 13-15 (b)."""
        return self.stress(self.rivet_peaks())

    @cached_property
    def sweep(self) -> tuple[FloatArray, FloatArray]:
        """Joint 2 from full down to full up, joint 3 straight: (k,) rad, (k, 3) N m to hold it."""
        limit = self.printed.arm.limits[1]
        angle = np.linspace(-limit, limit, 181)
        return angle, np.abs([self.robot.gravity_torque([0.0, q, 0.0]) for q in angle])

    @property
    def share_held(self) -> float:
        """Share of that sweep in which joint 2's stated actuator is strong enough."""
        return float((self.sweep[1][:, 1] <= self.printed.arm.actuator_torques[1]).mean())

    @cached_property
    def gravity_stress(self) -> FloatArray:
        """(15, 3) MPa, gravity's steady stress in the shafts at the rivets."""
        torque = np.abs([self.robot.gravity_torque(pose) for pose in self.rivet_poses])
        return np.asarray(torque * stress_per_torque(self.robot.flexible_joints) / 1e6)

    def operations(self) -> tuple[Operation, ...]:
        """The three operations of section 4.3."""
        return tuple(
            Operation(row.direction, np.array(row.force_direction), self.blows,
                      self.printed.task.hits_per_rivet, self.rivet_poses)
            for row in self.printed.table2
        )  # fmt: skip

    def _reached(self, poses: FloatArray, key: str) -> FloatArray:
        if np.isnan(poses).any():
            raise InputError("puts rivets out of the arm's reach", key=f"--assume {key}",
                             value=getattr(self.given, key))  # fmt: skip
        return poses


def random_worlds(count: int, seed: int = 0, base: Assumptions | None = None) -> list[World]:
    """Worlds with every unreported input drawn from its range (a Latin hypercube).

    Patterns that the arm cannot reach are drawn closer.

    Args:
        count: how many.
        seed: of the draw.
        base: gives what is not drawn: the shaft and the harmonics, which no peak depends on but
            by a factor that is the same for all joints.
    """
    rng = np.random.default_rng(seed)
    fixed = {"harmonics", "shear_modulus", "stress_per_twist", "rows", "columns"}
    drawn = [entry for entry in INPUTS if entry.name not in fixed]
    rank = np.argsort(rng.random((len(drawn), count)), axis=1)
    share = (rank + rng.random(rank.shape)) / count
    worlds = []
    for row in share.T:
        changes = {entry.name: entry.at(u) for entry, u in zip(drawn, row, strict=True)}
        given = (base or Assumptions()).but(**changes)
        while np.isnan(poses_at(rivet_points(given))).any():
            given = given.but(
                panel_x=0.9 * given.panel_x, panel_y=0.9 * given.panel_y, pitch=0.9 * given.pitch
            )
        worlds.append(World(given))
    return worlds
