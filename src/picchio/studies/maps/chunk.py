"""One chunk of a workspace map: a pure function, run here or on any worker."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import cast

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.excitation.excitation import Excitation
from picchio.fatigue.shaft_stress import shaft_stress_per_torque, stress_per_torque
from picchio.model.model import Model
from picchio.robot.varied import cases_of
from picchio.studies.maps.places import Listed, Places
from picchio.studies.rivet.life_rules import curves_of
from picchio.studies.rivet.poses import damage_at, peaks_at

# Damage of a rivet all over a map, in one direction or in the worst.

# Half-angles of the search's cones, rad.
_CONES = (0.5, 0.25, 0.12, 0.06, 0.03)
_AROUND = 6


def damage_of(
    model: Model,
    poses: FloatArray,
    excitation: Excitation,
    hits: int,
    direction: FloatArray | None,
    begin: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Damage of a rivet for every joint, and the direction of the force it belongs to.

    Damage is not linear in the force, so its worst direction has no closed form: it is searched,
    beginning where the deflection is worst, on ever narrower cones. Where no direction tried does
    damage, the beginning is kept.

    Args:
        model: with shafts.
        poses: (p, nv) rad or m.
        excitation: the blows.
        hits: of a rivet.
        direction: (p, 3), or None for the worst of each joint.
        begin: (p, n, 3) unit vectors, where to begin the search.

    Returns:
        (p, n) Miner's sums, NaN without a shaft; (p, n, 3) unit vectors.
    """
    curves = curves_of(model.robot)
    n = len(curves)
    if direction is not None:
        unit = direction / np.linalg.norm(direction, axis=1, keepdims=True)
        found = damage_at(model, poses, unit, excitation, hits, curves)
        return found.damage, np.repeat(unit[:, None], n, axis=1)
    best = np.full((len(poses), n), np.nan)
    along = begin.copy()
    for j in range(n):
        if curves[j] is None:
            continue
        only = [curve if k == j else None for k, curve in enumerate(curves)]

        def cost(directions: FloatArray, j: int = j, only: list = only) -> FloatArray:  # type: ignore[type-arg]
            """(p, d) damage of joint j for (p, d, 3) directions."""
            count = directions.shape[1]
            flat = damage_at(
                model, np.repeat(poses, count, axis=0), directions.reshape(-1, 3), excitation,
                hits, only,
            )  # fmt: skip
            return cast(FloatArray, flat.damage[:, j].reshape(len(poses), count))

        best[:, j], along[:, j] = _worst(cost, along[:, j])
    return best, along


def _worst(cost, start: FloatArray) -> tuple[FloatArray, FloatArray]:  # type: ignore[no-untyped-def]
    """The largest cost near a start (p, 3), pose by pose, and where."""
    along = start
    best = cost(along[:, None])[:, 0]
    rows = np.arange(len(along))
    for cone in _CONES:
        # Two axes across the direction, from the world's axis that is least along it.
        least = np.eye(3)[np.abs(along).argmin(axis=1)]
        first = np.cross(along, least)
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        second = np.cross(along, first)
        turn = 2.0 * np.pi * np.arange(_AROUND) / _AROUND
        ring = np.cos(turn)[:, None] * first[:, None] + np.sin(turn)[:, None] * second[:, None]
        tried = np.cos(cone) * along[:, None] + np.sin(cone) * ring
        costs = cost(tried)
        k = costs.argmax(axis=1)
        better = costs[rows, k] > best
        best = np.where(better, costs[rows, k], best)
        along = np.where(better[:, None], tried[rows, k], along)
    return best, along


Columns = dict[str, FloatArray]
LEVELS = {"P10": 0.1, "P50": 0.5, "P90": 0.9}
"""The quantiles of an estimated robot's map, by name."""


@dataclass(frozen=True, eq=False)
class MapJob:
    """All that a chunk needs; it travels to workers as it is.

    Attributes:
        model: the robot, with stiffnesses, and its effects.
        excitation: the blows.
        places: where.
        direction: (3,) unit vector, "worst" for each joint's own, or "normal" for the surface's.
        branch: "all", or words that choose one branch (see `picchio.robot.ik.branch`).
        hits: of a burst from rest; None for the steady state.
        damage: of a rivet of so many hits, counted for every joint; None leaves it out.
    """

    model: Model
    excitation: Excitation
    places: Places
    direction: tuple[float, float, float] | str
    branch: str
    hits: int | None
    damage: int | None = None

    @property
    def fast(self) -> bool:
        """Whether a place takes microseconds: given poses, steady state, nothing integrated."""
        slow = self.model.nonlinear or self.hits is not None or self.damage is not None
        return self.places.kind == "pose" and not slow and not self.cases

    @cached_property
    def cases(self) -> tuple[Model, ...]:
        """Drawn robots, where a spring is an estimate and no place is integrated in time."""
        if self.model.nonlinear:
            return ()
        return tuple(replace(self.model, robot=one) for one in cases_of(self.model.robot))

    def compute(self, first: int, last: int) -> Columns:
        """Rows of the places first to last - 1: one row a point and branch, none out of reach."""
        robot = self.model.robot
        place = np.arange(first, last)
        rows = self.places.rows(first, last)
        if self.places.kind == "pose":
            poses = rows
        else:
            poses, place = self._poses(rows, first)
        direction = self._direction(place)
        found, stiffness = peaks_at(
            self.model, poses, self.excitation, hits=self.hits, direction=direction
        )
        position = robot.tool_positions(poses)
        torque = stiffness * found.peak_deflection
        stress = torque * shaft_stress_per_torque(robot.flexible_joints)
        # Of drives, what stands for the stress is the share of what they bear.
        load = torque * stress_per_torque(robot.flexible_joints)
        rank = np.where(np.isfinite(load).all(axis=1)[:, None], load, torque)
        columns = {
            "place": place,
            "position": position,
            "pose": poses,
            # The joints' signs as one number: bit k is set where joint k's position is negative.
            "branch": ((poses < 0.0) @ (1 << np.arange(poses.shape[1]))).astype(np.int32),
            "natural_frequency": found.natural_frequencies,
            "peak_deflection": found.peak_deflection,
            "peak_torque": torque,
            "peak_shear_stress": stress,
            "worst_direction": found.direction,
            "limiting_joint": np.nan_to_num(rank, nan=-np.inf).argmax(axis=1).astype(np.int32),
        }
        if self.cases:
            columns |= self._band(poses, direction)
        if self.damage is not None:
            columns["damage_per_rivet"], columns["damage_direction"] = damage_of(
                self.model, poses, self.excitation, self.damage, direction, found.direction
            )
        return columns

    def _band(self, poses: FloatArray, direction: FloatArray | None) -> Columns:
        """Quantiles of the drawn robots' peaks, (p, n, 3); each in its own worst direction."""
        peaks = []
        for case in self.cases:
            found, stiffness = peaks_at(
                case, poses, self.excitation, hits=self.hits, direction=direction
            )
            peaks.append((found.peak_deflection, stiffness * found.peak_deflection))
        ends = np.quantile(np.array(peaks), list(LEVELS.values()), axis=0)
        deflection, torque = np.moveaxis(ends, 0, -1)
        return {"peak_deflection_quantiles": deflection, "peak_torque_quantiles": torque}

    def _direction(self, place: FloatArray) -> FloatArray | None:
        if self.direction == "worst":
            return None
        if self.direction == "normal":
            if not isinstance(self.places, Listed) or self.places.normals is None:
                raise InputError("the places have no normals", key="direction", value="normal")
            return self.places.normals[place]
        return np.tile(np.asarray(self.direction, dtype=float), (len(place), 1))

    def _poses(self, points: FloatArray, first: int) -> tuple[FloatArray, FloatArray]:
        from picchio.robot.ik.branch import branch_words, choose_branch
        from picchio.robot.ik.inverse_kinematics import solve_many

        along = self._direction(np.arange(first, first + len(points)))
        axes = None if along is None else -along
        solved = solve_many(self.model.robot, points, axes=axes)
        if self.branch == "all":
            return solved.poses, solved.point + first
        words = branch_words(self.model.robot, self.branch)
        chosen, place = [], []
        for k in np.unique(solved.point):
            try:
                pose = choose_branch(self.model.robot, list(solved.poses[solved.point == k]), words)
            except InputError:
                continue  # this point has no pose on the branch
            chosen.append(pose)
            place.append(k + first)
        return np.array(chosen).reshape(-1, solved.poses.shape[1]), np.array(place, dtype=int)
