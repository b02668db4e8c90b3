"""Puts a known effect into real motion records.

Written apart from the diagnosis: it imports nothing of picchio's model, prediction or diagnosis;
Pinocchio gives the payload's torque, SciPy shifts and filters.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
from scipy.interpolate import CubicSpline
from scipy.signal import butter, filtfilt

from picchio.campaign.campaign import Campaign
from picchio.campaign.record import Record

Change = Callable[[dict[str, np.ndarray], float], dict[str, np.ndarray]]


def inject(campaign: Campaign, change: Change) -> Campaign:
    """The campaign with every record changed."""
    records = []
    for record in campaign:
        read = record.read()
        time = read.pop("time")
        units = {name: record.channel(name).unit for name in record.channels}
        changed = change(read, record.clock.rate)
        records.append(Record.from_arrays(record.file, time, changed, units=units, kind="motion"))
    return Campaign.from_records(records, robot=campaign.table.robot)


def delay(group: str, seconds: float) -> Change:
    """Channels of a group answer later."""

    def change(read, rate):
        out = dict(read)
        for name, values in read.items():
            if name.partition(".")[0] == group:
                t = np.arange(values.size) / rate
                out[name] = CubicSpline(t, values)(np.clip(t - seconds, 0.0, t[-1]))
        return out

    return change


def gain(joint: str, factor: float) -> Change:
    """A drive reports more than its torque."""

    def change(read, rate):
        name = f"torque.{joint}"
        return {**read, name: factor * read[name]} if name in read else read

    return change


def ripple(joint: str, per_radian: float, amplitude: float, kind: str = "position") -> Change:
    """A torque that goes with the sine of the joint's angle times `per_radian`."""

    def change(read, rate):
        angle = smooth(read[f"{kind}.{joint}"], rate)
        wave = amplitude * np.sin(per_radian * angle + 0.7)
        return {**read, f"torque.{joint}": read[f"torque.{joint}"] + wave}

    return change


def payload(
    urdf: str, frame: str, mass: float, kind: str = "position", cutoff: float = 10.0
) -> Change:
    """What a point mass at a frame adds to every drive's torque, by Pinocchio."""
    bare = pin.buildModelFromUrdf(urdf)
    loaded = bare.copy()
    body = bare.frames[bare.getFrameId(frame)]
    point = pin.Inertia(mass, body.placement.translation, np.zeros((3, 3)))
    loaded.appendBodyToJoint(body.parentJoint, point, pin.SE3.Identity())
    names = list(bare.names)[1:]

    def change(read, rate):
        q = np.array([smooth(read[f"{kind}.{name}"], rate, cutoff) for name in names])
        v = np.gradient(q, 1.0 / rate, axis=1)
        a = np.gradient(v, 1.0 / rate, axis=1)
        states = zip(q.T, v.T, a.T, strict=True)
        extra = np.array([_difference(bare, loaded, *state) for state in states])
        out = dict(read)
        for i, name in enumerate(names):
            if f"torque.{name}" in out:
                out[f"torque.{name}"] = out[f"torque.{name}"] + extra[:, i]
        return out

    return change


def _difference(bare, loaded, q, v, a):
    full = _configuration(bare, q)
    data, other = bare.createData(), loaded.createData()
    return pin.rnea(loaded, other, full, v, a) - pin.rnea(bare, data, full, v, a)


def _configuration(model, q):
    """Angles as Pinocchio has them: a continuous joint is a cosine and a sine."""
    return pin.integrate(model, pin.neutral(model), q)


def smooth(series, rate, cutoff=10.0):
    b, a = butter(2, cutoff / (rate / 2.0))
    return filtfilt(b, a, series)
