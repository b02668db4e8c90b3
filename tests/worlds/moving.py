"""Logs of a robot that moves: Newton's and Euler's equations, body by body, in the world's axes.

No package computes the dynamics: of Pinocchio only placements, axes and the files' inertias are
taken (`chain.from_pinocchio`).
"""

from __future__ import annotations

import numpy as np

from picchio.campaign.campaign import Campaign
from picchio.campaign.record import Record

GRAVITY = np.array([0.0, 0.0, -9.81])
RATE, DURATION = 200.0, 15.0


def torques(chain, q, v, a):
    """(n, m) torque of every joint; q, v, a are (n, m)."""
    n, samples = q.shape
    turn, omega, alpha, origin, accel, line = ([None] * (n + 1) for _ in range(6))
    turn[0] = np.broadcast_to(np.eye(3), (samples, 3, 3))
    omega[0] = alpha[0] = origin[0] = np.zeros((samples, 3))
    accel[0] = np.broadcast_to(-GRAVITY, (samples, 3))
    for i in range(n):
        p = chain.parent[i]
        lever = turn[p] @ chain.offset[i]
        frame = turn[p] @ chain.rotation[i]
        line[i + 1] = frame @ chain.axis[i]
        spin = line[i + 1] * v[i][:, None]
        turn[i + 1] = frame @ rotations(chain.axis[i], q[i])
        omega[i + 1] = omega[p] + spin
        alpha[i + 1] = alpha[p] + line[i + 1] * a[i][:, None] + np.cross(omega[p], spin)
        origin[i + 1] = origin[p] + lever
        accel[i + 1] = (
            accel[p] + np.cross(alpha[p], lever) + np.cross(omega[p], np.cross(omega[p], lever))
        )
    force = [np.zeros((samples, 3)) for _ in range(n + 1)]
    moment = [np.zeros((samples, 3)) for _ in range(n + 1)]
    out = np.empty((n, samples))
    for i in range(n - 1, -1, -1):
        k, w = i + 1, omega[i + 1]
        lever = turn[k] @ chain.com[i]
        here = accel[k] + np.cross(alpha[k], lever) + np.cross(w, np.cross(w, lever))
        inertia = turn[k] @ chain.inertia[i] @ turn[k].transpose(0, 2, 1)
        own = chain.mass[i] * here
        force[k] = force[k] + own
        moment[k] = (
            moment[k]
            + np.cross(lever, own)
            + np.einsum("mij,mj->mi", inertia, alpha[k])
            + np.cross(w, np.einsum("mij,mj->mi", inertia, w))
        )
        out[i] = np.einsum("mi,mi->m", moment[k], line[k])
        p = chain.parent[i]
        force[p] = force[p] + force[k]
        moment[p] = moment[p] + moment[k] + np.cross(origin[k] - origin[p], force[k])
    return out


def rotations(axis, angles):
    """(m, 3, 3) about one axis, by Rodrigues."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    s, c = np.sin(angles)[:, None, None], np.cos(angles)[:, None, None]
    return np.eye(3) + s * cross + (1.0 - c) * cross @ cross


def waves(rng, joints, t):
    """(n, m) angles, velocities and accelerations of sums of sines."""
    q, v, a = (np.zeros((joints, t.size)) for _ in range(3))
    for i in range(joints):
        q[i] += rng.uniform(-0.8, 0.8)
        for frequency in (0.13, 0.29, 0.47, 0.71):
            w = 2.0 * np.pi * (frequency + rng.uniform(0.0, 0.06))
            size, phase = rng.uniform(0.15, 0.4), rng.uniform(0.0, 6.28)
            q[i] += size * np.sin(w * t + phase)
            v[i] += size * w * np.cos(w * t + phase)
            a[i] -= size * w * w * np.sin(w * t + phase)
    return q, v, a


def campaign(chain, seed, more=None, records=3, noise=0.01):
    """Records of a chain's motion.

    Args:
        chain: the true robot; its coordinates are all joints of the robot.
        seed: of motion and noise.
        more: (v, a, q) -> (n, m) torques of what is in the drives.
        records: how many.
        noise: of a torque, over its own spread.
    """
    rng, t = np.random.default_rng(seed), np.arange(int(DURATION * RATE)) / RATE
    made = []
    for number in range(records):
        q, v, a = waves(rng, len(chain.names), t)
        torque = torques(chain, q, v, a)
        if more is not None:
            torque = torque + more(v, a, q)
        torque += noise * torque.std(axis=1, keepdims=True) * rng.normal(size=torque.shape)
        angle = q + 2e-6 * rng.normal(size=q.shape)
        channels = {}
        for i, name in enumerate(chain.names):
            channels |= {f"motor_position.{name}": angle[i], f"torque.{name}": torque[i]}
        made.append(Record.from_arrays(f"m{number}.csv", t, channels, kind="motion"))
    return Campaign.from_records(made)
