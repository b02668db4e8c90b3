"""Motion records made by Pinocchio and a few lines of physics, for the tests beside."""

import numpy as np
import pinocchio as pin

from picchio.campaign.campaign import Campaign
from picchio.campaign.record import Record

RATE, DURATION = 500.0, 10.0
ARM = "fanuc_like_3dof"


def campaign(robot, effect, seed, noise=0.05):
    """Two records of all joints; torque noise relative to each torque's own spread."""
    rng = np.random.default_rng(seed)
    bare = robot.rigid._model
    model = bare.copy()
    frame = bare.frames[bare.getFrameId(robot.tool_frame)]
    model.appendBodyToJoint(
        frame.parentJoint,
        pin.Inertia(effect.get("payload", 0.0), np.zeros(3), np.zeros((3, 3))),
        frame.placement,
    )
    t = np.arange(int(DURATION * RATE)) / RATE
    records = []
    for number in range(2):
        q = np.array([wave(rng, t) for _ in robot.joint_names])
        v = np.gradient(q, 1 / RATE, axis=1)
        a = np.gradient(v, 1 / RATE, axis=1)
        data = model.createData()
        torque = np.array([pin.rnea(model, data, *x) for x in zip(q.T, v.T, a.T, strict=True)]).T
        torque = add(torque, effect, q, v)
        torque += noise * torque.std(axis=1, keepdims=True) * rng.normal(size=torque.shape)
        measured = q + 1e-6 * rng.normal(size=q.shape)
        channels = {}
        for j, joint in enumerate(robot.joint_names):
            channels[f"motor_position.{joint}"] = measured[j]
            channels[f"torque.{joint}"] = torque[j]
        records.append(Record.from_arrays(f"m{number}.csv", t, channels, kind="motion"))
    return Campaign.from_records(records)


def wave(rng, t):
    x = np.full(t.size, rng.uniform(-0.5, 0.5))
    for frequency in (0.11, 0.23, 0.37, 0.51):
        f = frequency + rng.uniform(0.0, 0.05)
        x += rng.uniform(0.1, 0.25) * np.sin(2 * np.pi * f * t + rng.uniform(0.0, 6.28))
    return x


def add(torque, effect, q, v):
    out = torque.copy()
    for (kind, joint), size in ((k, s) for k, s in effect.items() if k != "payload"):
        if kind == "coulomb":
            out[joint] += size * np.sign(v[joint])
        elif kind == "viscous":
            out[joint] += size * v[joint]
        elif kind == "offset":
            out[joint] += size
        elif kind == "ripple":
            out[joint] += size * np.sin(60.0 * q[joint])
        elif kind == "gain":
            out[joint] *= size
    return out
