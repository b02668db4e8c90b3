"""Frequency response functions of flexible arms: an independent world for stiffness from nothing.

The arm's mass matrix and Jacobians are Pinocchio's at the true bodies and the true pose; the
response is a sum over its modes' state-space poles, not a solution line by line. Never exact:
masses, centres and inertias of links, joint zeros, where hammer and sensor are and point, gains,
each mode's damping.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from scipy.linalg import eig, eigh

from .loads import FACTOR, ROBOTS
from .robots import load as shipped

POSES, TAPS = 3, 3  # of each: taps along three directions, each read in two
BAND = {3: (1.0, 60.0), 6: (2.0, 90.0), 7: (2.0, 160.0)}  # Hz


@dataclass(frozen=True, eq=False)
class Frfs:
    """A drawn campaign.

    Attributes:
        robot: name of the shipped folder.
        joints: names.
        nominal, truth: (n,) N m/rad.
        damping: (n,) true damping ratios of the joints.
        records: (columns, table) of each function.
    """

    robot: str
    joints: tuple[str, ...]
    nominal: np.ndarray
    truth: np.ndarray
    damping: np.ndarray
    records: list[tuple[dict[str, np.ndarray], dict]]


def draw(joints: int, seed: int, *, exact: bool = False, noise: float = 0.01,
         spread: float = 2.0, factors=None, dashpots: bool = False,
         asked=None) -> Frfs:  # fmt: skip
    """A campaign of an arm with 3, 6 or 7 joints.

    Args:
        joints: how many.
        seed: of everything drawn.
        exact: whether nothing but stiffness and damping differs from the files.
        noise: relative, of each line; and as much of a hundredth of the largest line.
        spread: of the damping ratio, a factor.
        factors: (n,) of the stiffness; drawn if None.
        asked: (pose, hit, reads, frame of the sensor or None) of each function, in place of drawn
            ones.
        dashpots: damping by viscous dashpots in the joints in place of the modes' ratios.
    """
    rng = np.random.default_rng((seed, joints, 7))
    own = shipped(ROBOTS[joints])
    off = 0.0 if exact else 1.0
    model = own.model.copy()
    for k in range(1, model.njoints):
        body = model.inertias[k]
        mass = body.mass * (1.0 + 0.01 * off * rng.standard_normal())
        size, axes = np.linalg.eigh(body.inertia)  # each principal moment by itself
        turned = (axes * (size * (1.0 + 0.03 * off * rng.standard_normal(3)))) @ axes.T
        lever = body.lever + 0.002 * off * rng.standard_normal(3)
        model.inertias[k] = pin.Inertia(mass, lever, turned * mass / max(body.mass, 1e-12))
    n = len(own.joints)
    nominal = np.array([curve[0] for curve in own.curves])
    drawn = np.exp(rng.uniform(-1.0, 1.0, n) * math.log(FACTOR))
    truth = nominal * (drawn if factors is None else np.asarray(factors))
    common = math.exp(rng.uniform(-1.0, 1.0) * math.log(spread))
    ratio = own.damping_ratio * common * np.exp(0.2 * rng.standard_normal(n))
    zero = 3.5e-4 * off * rng.standard_normal(n)
    hook, seat = 1e-3 * off * rng.standard_normal(3), 2e-3 * off * rng.standard_normal(3)
    askew = 0.005 * off * rng.standard_normal(3)
    gain = 1.0 + 0.01 * off * rng.standard_normal()
    low, high = np.maximum(own.lower, -2.0), np.minimum(own.upper, 2.0)
    columns = [model.joints[model.getJointId(name)].idx_v for name in own.joints]
    frame = model.getFrameId(own.tool)
    data = model.createData()
    frequency = np.linspace(*BAND[joints], 240)
    w = 2.0 * np.pi * frequency
    records = []
    stops = [None] * POSES
    if asked:
        stops = list({tuple(one[0]): [o for o in asked if tuple(o[0]) == tuple(one[0])]
                      for one in asked}.values())  # fmt: skip
    for stop in stops:
        pose = rng.uniform(0.85 * low + 0.15 * high, 0.15 * low + 0.85 * high)
        pose = pose if stop is None else np.asarray(stop[0][0], dtype=float)
        step = np.zeros(model.nv)
        step[columns] = pose + zero + 1e-4 * off * rng.standard_normal(n)
        q = pin.integrate(model, pin.neutral(model), step)
        square = np.ix_(columns, columns)
        mass = np.array(pin.crba(model, data, q))[square]
        pull = np.array(pin.computeGeneralizedGravityDerivatives(model, data, q))[square]
        pin.computeJointJacobians(model, data, q)
        full = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)[:, columns]
        pin.framesForwardKinematics(model, data, q)
        turn = np.array(data.oMf[frame].rotation)
        push = full[:3] + np.cross(full[3:], turn @ hook, axis=0)

        def seen(name, at=q):
            """Jacobians (3, n) of the sensor, linear and angular, in its frame."""
            where = frame if name is None else model.getFrameId(name)
            own = pin.computeFrameJacobian(model, data, at, where, pin.LOCAL_WORLD_ALIGNED)
            own = own[:, columns]
            lever = np.array(data.oMf[where].rotation) @ seat
            return own[:3] + np.cross(own[3:], lever, axis=0), own[3:]

        if dashpots:
            damp = np.diag(2.0 * ratio * np.sqrt(truth * mass.diagonal()))
        else:
            squared, shapes = eigh(np.diag(truth), mass)
            energy = truth[:, None] * shapes**2
            modal = (ratio @ energy) / energy.sum(axis=0)
            modal = modal * (1.0 + 0.1 * off * rng.standard_normal(n))
            damp = mass @ shapes @ np.diag(2.0 * modal * np.sqrt(squared)) @ shapes.T @ mass
        inverse = np.linalg.inv(mass)
        state = np.block([[np.zeros((n, n)), np.eye(n)],
                          [-inverse @ (np.diag(truth) + pull), -inverse @ damp]])  # fmt: skip
        poles, vectors = eig(state)
        back = np.linalg.inv(vectors)
        for tap in range(TAPS) if stop is None else stop:
            told = rng.standard_normal(3) if stop is None else np.array(tap[1])
            told /= np.linalg.norm(told)
            way = pin.exp3(0.005 * off * rng.standard_normal(3)) @ told
            if stop is None:
                sensors = [(told, None), (np.eye(3)[rng.integers(3)], None)]
            else:
                sensors = [(tap[2], tap[3])]
            for reads, carrier in sensors:
                see, turning = seen(carrier)
                along = pin.exp3(askew) @ reads
                entry = back[:, n:] @ (inverse @ (push.T @ way))
                turned = vectors[:n].T @ (see.T @ along)
                falls = vectors[:n].T @ (turning.T @ np.cross(model.gravity.linear, along))
                each = entry / (1j * w[:, None] - poles)
                value = gain * (-(w**2) * (each @ turned) + each @ falls)
                size = noise * np.abs(value) + 0.01 * noise * np.abs(value).max()
                pair = rng.standard_normal((2, len(w)))
                value = value + size * (pair[0] + 1j * pair[1]) / math.sqrt(2.0)
                known = np.abs(value) ** 2 / (np.abs(value) ** 2 + 2.0 * size**2)
                records.append((
                    {"frequency": frequency, "real": value.real, "imag": value.imag,
                     "coherence": known},
                    {"pose": dict(zip(own.joints, pose.tolist(), strict=True)),
                     "force_direction": told.tolist(), "response_direction": reads.tolist(),
                     **({"response_frame": carrier} if carrier else {})},
                ))  # fmt: skip
    return Frfs(own.name, own.joints, nominal, truth, ratio, records)
