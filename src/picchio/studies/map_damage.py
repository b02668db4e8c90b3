"""Damage of a rivet all over a map, in one direction or in the worst."""

from __future__ import annotations

from typing import cast

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.excitation import Excitation
from picchio.robot import FlexibleRobot
from picchio.studies.batch_damage import batch_damage
from picchio.studies.curves import curves_of

# Half-angles of the search's cones, rad.
_CONES = (0.5, 0.25, 0.12, 0.06, 0.03)
_AROUND = 6


def damage_of(
    robot: FlexibleRobot,
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
        robot: with shafts.
        poses: (p, nv) rad or m.
        excitation: the blows.
        hits: of a rivet.
        direction: (p, 3), or None for the worst of each joint.
        begin: (p, n, 3) unit vectors, where to begin the search.

    Returns:
        (p, n) Miner's sums, NaN without a shaft; (p, n, 3) unit vectors.
    """
    curves = curves_of(robot)
    n = len(curves)
    if direction is not None:
        unit = direction / np.linalg.norm(direction, axis=1, keepdims=True)
        found = batch_damage(robot, poses, unit, excitation, hits, curves)
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
            flat = batch_damage(
                robot, np.repeat(poses, count, axis=0), directions.reshape(-1, 3), excitation,
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
