"""A test plan: where the robot stands, which way and how hard it is hit, and when."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from . import robots
from .bench import nominal_chain, rest


@dataclass(frozen=True, eq=False)
class Shot:
    """One record: pose (n,) rad, unit direction (3,), N, days since the first, deg C."""

    pose: np.ndarray
    direction: np.ndarray
    force: float
    when: float
    temperature: float


@dataclass(frozen=True, eq=False)
class Plan:
    """The records of a campaign, and how they are taken.

    Attributes:
        robot: its name.
        shots: the records.
        hits, period, width: the burst; no `hits` means a steady record.
        sampling: Hz.
        quiet, ring: s before the first blow, and after the burst.
        offset: of the samples from t = 0, in steps.
        blend: what a blow is like that nothing is wrong with: 0 a rectangle, 1 a half-sine.
    """

    robot: str
    shots: tuple[Shot, ...]
    hits: int | None = 12
    period: float = 0.040
    width: float = 0.004
    sampling: float = 1000.0
    quiet: float = 0.15
    ring: float = 0.75
    offset: float = 0.5
    force: float = field(default=300.0)
    blend: float = 0.0

    def times(self):
        """(m,) s of the samples."""
        step = 1.0 / self.sampling
        burst = (self.hits or 25) * self.period
        first = -round(self.quiet * self.sampling) if self.hits else 0
        last = round((burst + (self.ring if self.hits else 0.0)) * self.sampling)
        return (np.arange(first, last) + self.offset) * step


def make(robot="fanuc_like_3dof", rng=None, records=18, **options) -> Plan:
    """Poses spread over the workspace, three directions and levels at each, over some days."""
    rng = np.random.default_rng(0) if rng is None else rng
    nominal = robots.load(robot)
    force = options.pop("force", nominal.force)
    options.setdefault("sampling", 1000.0 if len(nominal.joints) <= 3 else 2000.0)
    per_pose = 3
    count = -(-records // per_pose)
    where = _poses(nominal, rng, count)
    towards = _directions(rng, records)
    order = rng.permutation(records)
    when = np.cumsum(np.concatenate([[0.0], rng.uniform(0.15, 0.45, records - 1)]))
    warm = rng.uniform(15.0, 20.0)
    level = np.linspace(0.0, 1.0, records)[rng.permutation(records)]
    temperature = 26.0 + warm * (level - 0.5) + rng.normal(0.0, 0.5, records)
    shots = []
    for i in range(records):
        scale = 1.0 if i % per_pose == 0 else rng.uniform(0.5, 1.5)
        shots.append(
            Shot(
                np.round(where[i // per_pose], 4),
                np.round(towards[order[i]], 6),
                float(np.round(force * scale, 1)),
                float(when[i]),
                float(np.round(temperature[i], 2)),
            )
        )
    return Plan(robot, tuple(shots), force=force, **options)


def _poses(robot, rng, count):
    """Of many drawn, those that are farthest from each other."""
    lower, upper = robot.lower, robot.upper
    reach = np.minimum(upper - lower, 2.0 * np.pi * 0.9)
    centre = 0.5 * (lower + upper)
    chosen = []
    while len(chosen) < 40 * count:
        pose = centre + 0.45 * reach * rng.uniform(-1.0, 1.0, lower.size)
        if _usable(robot, pose):
            chosen.append(pose)
    pool = np.array(chosen)
    scaled = pool / reach
    picked = [int(rng.integers(len(pool)))]
    while len(picked) < count:
        distance = np.linalg.norm(scaled[:, None] - scaled[picked][None], axis=2).min(axis=1)
        # one of the farthest, not always the farthest: the corners are no better than the rest
        best = np.argsort(distance)[-max(3, len(pool) // 10) :]
        picked.append(int(rng.choice(best)))
    return pool[picked]


def _usable(robot, pose) -> bool:
    """Not near a singularity, not in the floor, not where a stiffness is about to change."""
    chain = nominal_chain(robot.name)
    _, torque, work = rest(chain, pose)
    if robot.near_a_corner(torque):
        return False
    body = chain.tool + 1
    tool = work[1][body] + work[0][body] @ chain.tool_offset
    jacobian = np.array(
        [np.cross(work[2][i + 1], tool - work[1][i + 1]) for i in range(len(pose))]
    ).T
    size = np.linalg.svd(jacobian, compute_uv=False)
    longest = np.linalg.norm(work[1][1:] - work[1][1], axis=1).max() + 0.1
    return size[2] > 0.2 * size[0] and tool[2] > 0.1 * longest and size[2] > 0.15 * longest


def _directions(rng, count):
    """(count, 3) unit vectors spread over the sphere, turned at random."""
    i = np.arange(count) + 0.5
    z = 1.0 - 2.0 * i / count
    angle = np.pi * (1.0 + 5.0**0.5) * i
    ring = np.sqrt(1.0 - z * z)
    points = np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=1)
    points = points + 0.15 * rng.normal(size=points.shape)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return (points / np.linalg.norm(points, axis=1, keepdims=True)) @ turn.T
