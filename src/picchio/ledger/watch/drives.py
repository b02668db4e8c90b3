"""What a moving arm shows of its drives: friction, an offset of the torque, lost motion."""

from __future__ import annotations

import numpy as np

from picchio.core.arrays import FloatArray, IndexArray
from picchio.ledger.samples import Samples
from picchio.model.model import Model

_SMOOTH = 0.08  # s, over which angles are smoothed and differentiated
_SLOWEST = 0.02  # rad/s or m/s: a joint that moves slower may stick
_SHARE = 0.2  # of its usual largest speed: likewise
_MOST = 600  # samples of a stretch and joint: more make no reading much better
_LEAST = 30  # each way


def drives(samples: Samples, model: Model) -> list[tuple[str, int, float]]:
    """Friction, torque offset and lost motion of the joints that move in a stretch, both ways.

    What a drive's torque is more than the bodies' motion takes is fitted by a friction that turns
    with the speed's sign, one that grows with it, and an offset. Lost motion is by how much the
    motor's angle is ahead of the link's as the joint turns back, the spring's part by the torque
    taken out.

    Args:
        samples: with torques, or with angles of both sides.
        model: the robot, and its effects.

    Returns:
        (name, ns, value): "friction.<joint>" N m at the usual speed, "offset.<joint>" share of the
        largest torque of gravity, "lost_motion.<joint>" rad.
    """
    stamps, poses = samples.pose_stamps, samples.poses
    names = model.robot.joint_names
    torques = {n: samples.others[f"torque.{n}"] for n in names if f"torque.{n}" in samples.others}
    sides = {n: samples.others[f"position.{n}"] for n in names if f"position.{n}" in samples.others}
    if stamps.size < 2 * _LEAST or not (torques or sides):
        return []
    step = float(np.median(np.diff(stamps))) * 1e-9
    window = 2 * round(0.5 * _SMOOTH / step) + 1
    if window < 5 or window >= stamps.size:
        return []
    from scipy.signal import savgol_filter

    speed = savgol_filter(poses, window, 2, deriv=1, delta=step, axis=0)
    even = np.abs(np.diff(stamps) * 1e-9 / step - 1.0) < 0.5
    sound = np.convolve(np.append(even, True), np.ones(window), "same") > window - 0.5
    found: list[tuple[str, int, float]] = []
    for name in sorted(torques.keys() | sides.keys()):
        j = names.index(name)
        own = speed[:, j]
        usual = float(np.quantile(np.abs(own[sound]), 0.99)) if sound.any() else 0.0
        moving = np.flatnonzero(sound & (np.abs(own) > max(_SLOWEST, _SHARE * usual)))
        if min((own[moving] > 0.0).sum(), (own[moving] < 0.0).sum()) < _LEAST:
            continue
        rows = moving[:: max(1, moving.size // _MOST)]
        v, when = own[rows], int(np.median(stamps[rows]))
        there = name in torques and torques[name][0].size > 1
        torque = _at(torques[name], stamps[rows]) if there else None
        if torque is not None:
            turned = savgol_filter(poses, window, 2, deriv=2, delta=step, axis=0)[rows]
            needed = model.robot.rigid.inverse_dynamics(poses[rows], speed[rows], turned)[:, j]
            table = np.column_stack([np.sign(v), v, np.ones_like(v)])
            dry, slope, offset = np.linalg.lstsq(table, torque - needed, rcond=None)[0]
            friction = dry + slope * float(np.median(np.abs(v)))
            if friction > 0.0:
                found.append((f"friction.{name}", when, float(friction)))
            weight = float(np.abs(needed).max())
            if weight > 0.0:
                found.append((f"offset.{name}", when, float(offset / weight)))
        if name in sides and sides[name][0].size > 1:
            ahead = poses[rows, j] - _at(sides[name], stamps[rows])
            columns = [np.sign(v), np.ones_like(v)] + ([] if torque is None else [torque])
            gap = 2.0 * np.linalg.lstsq(np.column_stack(columns), ahead, rcond=None)[0][0]
            if gap > 0.0:
                found.append((f"lost_motion.{name}", when, float(gap)))
    return found


def _at(series: tuple[IndexArray, FloatArray], stamps: IndexArray) -> FloatArray:
    """(m,) a series at other stamps, by straight lines."""
    own, values = series
    return np.interp((stamps - own[0]).astype(float), (own - own[0]).astype(float), values)
