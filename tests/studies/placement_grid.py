"""Brute force for placements: a plain loop over a grid, by `all_branches` and `assess` alone.

Used by the tests and by `benchmarks/placement.py`. Nothing of the placement's own search, batch
kernels or bookkeeping of the work is used.
"""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np

import picchio
from picchio.core.errors import InputError
from picchio.robot.joint import Shaft
from picchio.studies.tasks import Task

# A shaft for arms whose own nobody has published: assumed, so that a life exists.
SHAFT = Shaft(radius=0.008, length=0.02, shear_modulus=79.3e9, sn_curve="42CrMo4-QT-shaft")
# Panels for arms whose shipped task is one pose: 2 rows of 3 rivets, 0.1 m apart, tool down.
PANELS = {"ur10": [0.6, 0.2, 0.5], "panda": [0.45, 0.0, 0.35]}


def with_shafts(robot, shaft=SHAFT):
    joints = tuple(dataclasses.replace(j, shaft=shaft) for j in robot.flexible_joints)
    return dataclasses.replace(robot, flexible_joints=joints)


def paper_panel():
    """The paper's arm and its task: 15 rivets, three directions."""
    robot = picchio.load_robot("fanuc_like_3dof")
    return robot, picchio.load_task(robot.task_path, robot)


def small_panel(name, rows=2, columns=3):
    """An arm of six or seven joints with shafts, and a small panel of rivets."""
    robot = with_shafts(picchio.load_robot(name))
    x, y, z = PANELS[name]
    steps = itertools.product(0.1 * (np.arange(rows) - 0.5 * (rows - 1)),
                              0.1 * (np.arange(columns) - 0.5 * (columns - 1)))  # fmt: skip
    points = [[x + dx, y + dy, z] for dx, dy in steps]
    blows = {"force": 50.0, "period": 0.04, "width": 0.004}
    operation = {"name": "panel", "direction": [0, 0, 1.0], "points": points}
    return robot, picchio.task_from_dict({"excitation": blows, "operation": [operation]}, robot)


def grid_moves(half, counts):
    """Moves (m, 4) on a grid: x, y, z in m, heading in rad, `counts` values each way in all."""
    axes = [np.linspace(-h, h, c) if c > 1 else np.zeros(1) for h, c in zip(half, counts)]  # noqa: B905
    return np.array(list(itertools.product(*axes)))


def moved_places(robot, task, move):
    """Per operation: positions (k, 3) m, tool axes (k, 3) and the force's direction, moved."""
    states = [[robot.state(pose) for pose in op.poses] for op in task.operations]
    every = np.array([s.tool_position for own in states for s in own])
    centre = 0.5 * (every.min(axis=0) + every.max(axis=0))
    c, s = math.cos(move[3]), math.sin(move[3])
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    for op, own in zip(task.operations, states, strict=True):
        at = np.array([s.tool_position for s in own])
        axis = np.array([s.tool_rotation @ np.asarray(robot.tool.axis) for s in own])
        yield (at - centre) @ turn.T + centre + move[:3], axis @ turn.T, turn @ op.direction


def cost_there(robot, task, move, sn_curve=None):
    """Damage of a rivet of the mix and utilisation, of the weakest joint; None out of reach.

    Every rivet takes the pose of least damage, then of least utilisation, of its weakest joint.
    """
    aims = len(robot.joint_names) >= 5
    known, damage, used = {}, 0.0, 0.0
    places = moved_places(robot, task, move)
    for op, (points, axes, direction) in zip(task.operations, places, strict=True):
        branches = []
        for point, axis in zip(points, axes, strict=True):
            key = (*point.round(9), *(axis.round(9) if aims else ()))
            if key not in known:
                try:
                    known[key] = robot.all_branches(point, axis=axis if aims else None)
                except InputError:
                    return None
            branches.append(known[key])
        one = dataclasses.replace(op, poses=np.concatenate(branches), direction=direction)
        # Neither how sure it is nor the steady state is asked for.
        options = {"sn_curve": sn_curve, "uncertainty": False, "steady_check": False}
        told = picchio.assess(robot, Task((one,)), **options).operations[0]
        whole = np.fmax(told.utilisation, told.reducer_utilisation)
        first = 0
        for poses in branches:
            own = slice(first, first + len(poses))
            first += len(poses)
            spent = np.nan_to_num(told.damage_per_rivet[own])
            worst = np.nanmax(whole[own], axis=1)
            c = np.lexsort((worst, spent.max(axis=1)))[0]
            damage = damage + spent[c] * op.rivets / task.rivets_per_pass
            used = max(used, float(worst[c]))
    return float(np.max(damage)), used


def brute_force(robot, task, moves, sn_curve=None):
    """Least damage and, with it, least utilisation over the moves, and how many were in reach."""
    costs = [cost_there(robot, task, move, sn_curve) for move in moves]
    reached = [cost for cost in costs if cost is not None]
    return min(reached), len(reached)
