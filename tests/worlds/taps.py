"""Taps in time on flexible arms: an independent world, integrated step by step.

Pinocchio's mass matrix and Jacobians at the true bodies and pose; a half-sine blow of unknown
height and width, that begins and ends between samples; SciPy's integration of the state space on a
grid finer than they are. Wrong a little: link masses, joint zeros, where hammer and sensor are,
gains, the modes' damping.
"""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
from scipy.linalg import eigh
from scipy.signal import StateSpace, lsim

from .frfs import Frfs
from .loads import FACTOR, ROBOTS
from .pinocchio_chain import with_wrong_masses
from .robots import load as shipped

FINE = 8  # steps of the integration for one sample


def draw(joints: int, seed: int, *, known: bool = True, rate: float = 2000.0, length: float = 2.0,
         exact: bool = False, noise: float = 0.02, poses: int = 3, taps: int = 2,
         factors=None, late: float | None = None) -> Frfs:  # fmt: skip
    """A campaign of an arm with 3, 6 or 7 joints: taps read by an accelerometer of three axes.

    Args:
        joints: how many.
        seed: of everything drawn.
        known: whether the hammer measures its force.
        rate: Hz.
        length: s, from the blow on.
        exact: whether nothing but stiffness and damping differs from the files.
        noise: m/s^2, of each sample.
        poses: how many.
        taps: at each.
        factors: (n,) of the stiffness; drawn if None.
        late: samples after t = 0 at which a blow begins, less than one; drawn if None.
    """
    rng = np.random.default_rng((seed, joints, 11))
    onsets = np.random.default_rng((seed, joints, 12))
    own = shipped(ROBOTS[joints])
    off = 0.0 if exact else 1.0
    model = with_wrong_masses(own.model, rng, 0.01 * off)
    n = len(own.joints)
    nominal = np.array([curve[0] for curve in own.curves])
    drawn = np.exp(rng.uniform(-1.0, 1.0, n) * math.log(FACTOR))
    truth = nominal * (drawn if factors is None else np.asarray(factors))
    ratio = own.damping_ratio * math.exp(0.5 * rng.standard_normal()) * np.ones(n)
    zero = 3.5e-4 * off * rng.standard_normal(n)
    hook, seat = 1e-3 * off * rng.standard_normal(3), 2e-3 * off * rng.standard_normal(3)
    gain = 1.0 + 0.01 * off * rng.standard_normal()
    low, high = np.maximum(own.lower, -2.0), np.minimum(own.upper, 2.0)
    columns = [model.joints[model.getJointId(name)].idx_v for name in own.joints]
    frame = model.getFrameId(own.tool)
    data = model.createData()
    records = []
    for _ in range(poses):
        pose = rng.uniform(0.85 * low + 0.15 * high, 0.15 * low + 0.85 * high)
        step = np.zeros(model.nv)
        step[columns] = pose + zero
        q = pin.integrate(model, pin.neutral(model), step)
        square = np.ix_(columns, columns)
        mass = np.array(pin.crba(model, data, q))[square]
        pull = np.array(pin.computeGeneralizedGravityDerivatives(model, data, q))[square]
        pin.computeJointJacobians(model, data, q)
        full = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)[:, columns]
        pin.framesForwardKinematics(model, data, q)
        turn = np.array(data.oMf[frame].rotation)
        push = full[:3] + np.cross(full[3:], turn @ hook, axis=0)
        see = full[:3] + np.cross(full[3:], turn @ seat, axis=0)
        squared, shapes = eigh(np.diag(truth), mass)
        energy = truth[:, None] * shapes**2
        modal = (ratio @ energy) / energy.sum(axis=0)
        modal = modal * (1.0 + 0.1 * off * rng.standard_normal(n))
        damp = mass @ shapes @ np.diag(2.0 * modal * np.sqrt(squared)) @ shapes.T @ mass
        inverse = np.linalg.inv(mass)
        stiff = np.diag(truth) + pull
        for _ in range(taps):
            told = rng.standard_normal(3)
            told /= np.linalg.norm(told)
            way = pin.exp3(0.005 * off * rng.standard_normal(3)) @ told
            entry = inverse @ (push.T @ way)
            state = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ stiff, -inverse @ damp]])
            # Acceleration of the sensor in its own axes, and what it reads of turning in gravity.
            tilt = turn.T @ np.cross(full[3:], model.gravity.linear, axis=0)
            out = turn.T @ see @ state[n:] + np.hstack([tilt, np.zeros((3, n))])
            system = StateSpace(state, np.concatenate([np.zeros(n), entry])[:, None], out,
                                (turn.T @ see @ entry)[:, None])  # fmt: skip
            time = np.arange(round(length * rate * FINE)) / (rate * FINE)
            width, height = rng.uniform(0.003, 0.005), own.force * rng.uniform(0.7, 1.5)
            since = time - (onsets.uniform() if late is None else late) / rate
            blow = np.where((since > 0.0) & (since < width),
                            height * np.sin(np.pi * since / width), 0.0)  # fmt: skip
            read = gain * lsim(system, blow, time)[1][::FINE]
            before = round(0.1 * rate)
            count = len(read)
            clock = np.arange(-before, count) / rate
            held = {"time": clock}
            if known:
                held["force"] = np.concatenate([np.zeros(before), blow[::FINE]])
            for k, axis in enumerate("xyz"):
                values = np.concatenate([np.zeros(before), read[:, k]])
                values = values + noise * rng.standard_normal(len(clock))
                held[f"accelerometer.{own.tool}.{axis}"] = values
            table = {"pose": dict(zip(own.joints, pose.tolist(), strict=True)),
                     "direction": told.tolist(), "excitation": {"kind": "tap"}}  # fmt: skip
            records.append((held, table))
    return Frfs(own.name, own.joints, nominal, truth, ratio, records)
