"""One pose under one force, answered at once: what a hand that drags the tool waits for.

The numbers are those of `picchio.assess` on a task of this one place, by the compiled kernels alone
and without its report: tens of microseconds to some milliseconds instead of half a second.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.excitation.excitation import Excitation
from picchio.fatigue.shaft_stress import shaft_stress_per_torque, stress_per_torque
from picchio.fatigue.sn.curve import SNCurve
from picchio.fatigue.uncertain_lives import Draws
from picchio.model.many_poses import ManyPoses
from picchio.model.model import Model
from picchio.robot.spread import root_of
from picchio.studies.rivet.life_rules import curves_of
from picchio.studies.rivet.pose import need_springs
from picchio.studies.rivet.poses import BatchDamage, damage_at, peaks_at, raised
from picchio.studies.rivet.variation import WornParts
from picchio.studies.tasks import Operation, Task
from picchio.studies.uncertainty.drawn import interval
from picchio.studies.uncertainty.sampler import Sampler


@dataclass(frozen=True, eq=False)
class Place:
    """Where the tool hits, how, and which way: a task of one rivet.

    Attributes:
        pose: (nv,) rad or m.
        direction: (3,) unit vector of the force, world.
        excitation: the blows.
        hits: of a rivet.
    """

    pose: FloatArray
    direction: FloatArray
    excitation: Excitation
    hits: int

    @property
    def task(self) -> Task:
        """The same as a task."""
        here = Operation("here", self.direction, self.excitation, self.hits, self.pose[None])
        return Task((here,))


@dataclass(frozen=True, eq=False)
class Instant:
    """What one rivet does to the n flexible joints; from rest, ring-down included.

    Attributes:
        natural_frequencies: (n,) Hz.
        peak_deflection: (n,) rad, under the force as it acts.
        worst_deflection: (n,) rad, over all directions; NaN of a nonlinear model.
        worst_direction: (n, 3) unit vectors that give it, either sign; NaN likewise.
        peak_torque: (n,) N m, largest magnitude of gravity, feed force and blows together.
        stress: (n,) Pa, peak shear stress of the vibration; NaN without a shaft.
        utilisation: (n,) of shaft or drive in fatigue; NaN without either.
        drive_utilisation: (n,) torque over the limit of reducer or drive that binds; NaN without.
        damage: (n,) of one rivet; NaN as `utilisation`.
    """

    natural_frequencies: FloatArray
    peak_deflection: FloatArray
    worst_deflection: FloatArray
    worst_direction: FloatArray
    peak_torque: FloatArray
    stress: FloatArray
    utilisation: FloatArray
    drive_utilisation: FloatArray
    damage: FloatArray

    @property
    def life(self) -> FloatArray:
        """(n,) rivets to failure; infinite without damage, NaN without shaft and drive."""
        with np.errstate(divide="ignore"):
            return np.where(self.damage > 0.0, 1.0 / self.damage, self.damage * 0.0 + np.inf)

    @property
    def governing(self) -> FloatArray:
        """(n,) the larger of the two utilisations; NaN where neither is known."""
        return np.fmax(self.utilisation, self.drive_utilisation)


class Use(NamedTuple):
    """What one rivet uses of the n flexible joints at p poses.

    Attributes:
        damage: extremes, stiffness and damage.
        peak: (p, n) rad, largest deflection.
        torque: (p, n) N m, largest magnitude, gravity and feed force included.
        fatigue: (p, n) utilisation of shaft or drive in fatigue; NaN without either.
        drives: (p, n) torque over the limit of reducer or drive that binds; NaN without.
    """

    damage: BatchDamage
    peak: FloatArray
    torque: FloatArray
    fatigue: FloatArray
    drives: FloatArray


def use_at(
    model: Model,
    poses: FloatArray,
    direction: FloatArray,
    excitation: Excitation,
    hits: int,
    curves: Sequence[SNCurve | None],
) -> Use:
    """What one rivet from rest uses of every joint at many poses.

    Args:
        model: the robot and its effects.
        poses: (p, nv) rad or m, taken unchecked.
        direction: (3,) or (p, 3) unit vectors of the force, world.
        excitation: the blows.
        hits: of a rivet.
        curves: of the n joints; None without a shaft or drive.

    Returns:
        its arrays.

    Raises:
        InputError: as `damage_at`.
    """
    joints = model.robot.flexible_joints
    found = damage_at(model, poses, direction, excitation, hits, curves)
    springs, low, high = found.stiffness, found.lowest, found.highest
    static = found.many.static_torque(excitation.preload, direction)
    torque = np.fmax(np.abs(static + springs * low), np.abs(static + springs * high))
    per = stress_per_torque(joints)
    allowable = np.array([np.nan if curve is None else curve.allowable for curve in curves])
    lifted = raised(curves, np.nan_to_num(per * static))
    drives = np.full_like(torque, np.nan)
    for j, joint in enumerate(joints):
        if joint.ratings is not None:
            shares = joint.ratings.shares(torque[:, j], np.abs(static[:, j]))
            drives[:, j] = np.max(list(shares.values()), axis=0)
    fatigue = 0.5 * springs * (high - low) * per * lifted / allowable
    return Use(found, np.fmax(np.abs(low), np.abs(high)), torque, fatigue, drives)


@dataclass(eq=False)
class InstantStudy:
    """A model, ready to be asked again and again.

    Args:
        model: the robot and its effects.
        place: where it is asked first; what is uncertain is found there.

    Raises:
        InputError: no flexible joint, a curve that cannot be read.
    """

    model: Model
    place: Place
    compiled: bool = field(init=False)
    curves: tuple[SNCurve | None, ...] = field(init=False)
    _sampler: Sampler | None = field(init=False, default=None)
    _scores: FloatArray = field(init=False, default_factory=lambda: np.empty((0, 0)))

    def __post_init__(self) -> None:
        robot = self.model.robot
        need_springs(robot)
        self.curves = curves_of(robot)
        self.compiled = ManyPoses(self.model, self.place.pose[None]).compiled
        worn = WornParts.of(robot, None, needed=False)
        if not worn.joints:
            return
        self._sampler = Sampler.of(self.model, self.place.task, worn, None, [])
        names = [each.name for each in self._sampler.inputs]
        draws = Draws(len(names))
        draws.more()
        draws.more()
        # Replicates in turns, so that the first rows are spread over all of them.
        scores = draws.scores.transpose(1, 0, 2).reshape(-1, len(names))
        self._scores = scores @ root_of(names, robot.posterior)

    @property
    def fast(self) -> bool:
        """Whether compiled code takes all of it; otherwise it is no answer while dragging."""
        return self.compiled and (self._sampler is None or not self._sampler.rebuilt)

    def values(self, place: Place) -> Instant:
        """What one rivet does there.

        Args:
            place: pose, direction and blows.

        Raises:
            InputError: a mode without damping; blows that an effect cannot take.
        """
        model, poses = self.model, np.ascontiguousarray(place.pose[None])
        used = use_at(
            model, poses, place.direction, place.excitation, place.hits, self.curves
        )  # fmt: skip
        springs, peak = used.damage.stiffness[0], used.peak[0]
        worst, along = np.full(len(peak), np.nan), np.full((len(peak), 3), np.nan)
        if not model.nonlinear:
            peaks, _ = peaks_at(model, poses, place.excitation, hits=place.hits)
            worst, along = peaks.peak_deflection[0], peaks.direction[0]
        return Instant(
            natural_frequencies=used.damage.natural_frequencies[0],
            peak_deflection=peak,
            worst_deflection=worst,
            worst_direction=along,
            peak_torque=used.torque[0],
            stress=springs * peak * shaft_stress_per_torque(model.robot.flexible_joints),
            utilisation=used.fatigue[0],
            drive_utilisation=used.drives[0],
            damage=used.damage.damage[0],
        )

    def life_intervals(self, place: Place, samples: int) -> FloatArray:
        """The P10 and P90 (n, 2) of every joint's life there, rivets; NaN without shaft and drive.

        What varies is what `picchio.uncertain_life` varies; the cases are always the same ones, so
        that the ends do not jump about while the tool is dragged.

        Args:
            place: pose, direction and blows.
            samples: cases; at most 512.
        """
        ends = np.full((len(self.model.robot.flexible_joints), 2), np.nan)
        if self._sampler is None:
            return ends
        self._sampler = self._sampler.elsewhere(place.task)
        drawn = self._sampler.run(self._scores[:samples])
        for column, lives in zip(self._sampler.stress.columns, drawn.lives, strict=True):
            ends[column] = interval(lives)
        return ends

    def envelope(self, place: Place, directions: FloatArray, pieces: int = 4) -> Iterator[Any]:
        """Peak of every joint by direction, in pieces, so that something else may be done between.

        Args:
            place: pose and blows; its direction does not matter.
            directions: (d, 3) unit vectors.
            pieces: how many.

        Yields:
            (n, d / pieces) rad each, exact in time.
        """
        for part in np.array_split(directions, pieces):
            poses = np.tile(place.pose, (len(part), 1))
            found, _ = peaks_at(
                self.model, poses, place.excitation, hits=place.hits, direction=part
            )
            yield found.peak_deflection.T
