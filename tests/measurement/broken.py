"""A sound campaign in memory, and ways to spoil it that leave it readable."""

from dataclasses import dataclass, field

import numpy as np
from scipy.signal import butter, sosfiltfilt

from picchio.campaign.campaign import Campaign
from picchio.campaign.record import Record

from .signals import CHANNELS, EXCITATION, FORCE, LEVELS, PERIOD, POSE, WIDTH, record

RATE = 1000.0
DEFLECTION, OTHER, VELOCITY, ACCELEROMETER = CHANNELS


@dataclass
class Part:
    """One record, still to be changed."""

    file: str
    time: np.ndarray
    arrays: dict
    table: dict
    units: dict = field(default_factory=dict)


@dataclass
class Draft:
    """A campaign, still to be changed."""

    parts: list
    table: dict

    def __getitem__(self, file):
        return next(part for part in self.parts if part.file == file)

    def build(self):
        records = [Record.from_arrays(p.file, p.time, p.arrays, units=p.units, **p.table)
                   for p in self.parts]  # fmt: skip
        return Campaign.from_records(records, **self.table)


def _percussion(file, rng, **options):
    made, _ = record(file, rng, rate=RATE, after=1.6, before=0.15, **options)
    arrays = made.read()
    time = arrays.pop("time")
    table = {"pose": dict(POSE), "direction": options.get("direction", [1.0, 0.0, 0.0])}
    if made.hits is not None:
        table["hits"] = made.hits
        pulse = (np.mod(time + 1e-9, PERIOD) < WIDTH) & (time > -1e-9) & (time < 12 * PERIOD)
        arrays["force"] = FORCE * pulse + rng.normal(size=time.size)
    return Part(file, time, arrays, table)


def _motion(file, rng):
    time = np.arange(4000) / RATE
    q = 0.4 * np.sin(2 * np.pi * 0.5 * time) + 0.2 * np.sin(2 * np.pi * 0.8 * time)
    p = 0.3 * np.cos(2 * np.pi * 0.4 * time)
    noise = lambda s: s * rng.normal(size=time.size)  # noqa: E731
    arrays = {
        "position.joint_1": q + noise(1e-5),
        "position.joint_2": p + noise(1e-5),
        "motor_position.joint_1": q + 1e-4 * np.sin(3 * time) + noise(1e-5),
        "velocity.joint_1": np.gradient(q, time) + noise(1e-3),
        "torque.joint_1": 500 * np.gradient(np.gradient(q, time), time) + noise(5.0),
        "temperature.joint_1": 30.0 + 0.1 * time + noise(0.01),
    }
    return Part(file, time, arrays, {"kind": "motion", "pose": {"joint_3": 0.0}})


def sound(seed=0):
    """The sound campaign: three bursts, of which two repeat each other, one steady, a motion."""
    rng = np.random.default_rng(seed)
    parts = [
        _percussion("r1.csv", rng),
        _percussion("r2.csv", rng),
        _percussion("r3.csv", rng, direction=[0.0, 1.0, 0.0]),
        _percussion("s1.csv", rng, is_steady=True, hits=20),
        _motion("m1.csv", rng),
    ]
    return Draft(parts, {"robot": "fanuc_like_3dof", "tool": "tool",
                         "excitation": dict(EXCITATION)})  # fmt: skip


def _level(name):
    return LEVELS[CHANNELS.index(name)]


def each(change, files=("r1.csv",)):
    """A spoiler that changes arrays: change(part)."""

    def spoil(draft):
        for file in files:
            change(draft[file])

    return spoil


BURSTS = ("r1.csv", "r2.csv", "r3.csv")
ALL = (*BURSTS, "s1.csv")


def clip(name, low=-0.5, high=0.5, noise=0.0, files=BURSTS):
    def change(part):
        x = part.arrays[name]
        limit = np.abs(x).max()
        clipped = np.clip(x, low * limit, high * limit)
        rng = np.random.default_rng(1)
        part.arrays[name] = clipped + noise * _level(name) * rng.normal(size=x.size)

    return each(change, files)


def common_clip(name):
    """One limit for all records, noise on top of it."""

    def spoil(draft):
        limit = 0.5 * max(np.abs(draft[f].arrays[name]).max() for f in ALL)
        for file in ALL:
            rng = np.random.default_rng(len(file))
            x = np.clip(draft[file].arrays[name], -limit, limit)
            draft[file].arrays[name] = x + 0.005 * _level(name) * rng.normal(size=x.size)

    return spoil


def run(name, value=None, file="r1.csv", start=0.3, samples=30):
    def change(part):
        first = int(np.searchsorted(part.time, start))
        x = part.arrays[name]
        x[first : first + samples] = x[first] if value is None else value

    return each(change, (file,))


def replace(name, function, files=("r1.csv",)):
    """New values function(time, values)."""

    def change(part):
        part.arrays[name] = function(part.time, part.arrays[name])

    return each(change, files)


def retime(function, files=("r1.csv",)):
    def change(part):
        part.time = function(part.time)

    return each(change, files)


def cut(first=None, last=None, files=("r1.csv",)):
    def change(part):
        keep = slice(
            None if first is None else int(np.searchsorted(part.time, first)),
            None if last is None else int(np.searchsorted(part.time, last)),
        )
        part.time = part.time[keep]
        part.arrays = {n: v[keep] for n, v in part.arrays.items()}

    return each(change, files)


def drop_samples(part):
    keep = np.ones(part.time.size, bool)
    keep[400:403] = False
    part.time = part.time[keep]
    part.arrays = {n: v[keep] for n, v in part.arrays.items()}


def thin(draft, factor):
    for file in BURSTS:
        part = draft[file]
        part.time = part.time[::factor]
        part.arrays = {n: v[::factor] for n, v in part.arrays.items()}


def rough(name):
    """Content just below half the rate."""
    sos = butter(4, 0.9, "high", output="sos")

    def change(part):
        loud = (part.time > 0) & (part.time < 0.6)
        x = np.random.default_rng(2).normal(size=part.time.size)
        part.arrays[name] += 1.5 * _level(name) * sosfiltfilt(sos, x) * loud

    return each(change, BURSTS)


def spike(name, size, file="r1.csv", at=0.3):
    def change(part):
        part.arrays[name][int(np.searchsorted(part.time, at))] += size

    return each(change, (file,))


def table(**keys):
    def spoil(draft):
        draft.table.update(keys)

    return spoil


def keys(file, **entries):
    def spoil(draft):
        draft[file].table.update(entries)

    return spoil


def blows(**entries):
    return lambda draft: draft.table["excitation"].update(entries)


def rename(old, new, files=BURSTS):
    def change(part):
        part.arrays = {new if n == old else n: v for n, v in part.arrays.items()}

    return each(change, files)


def remove(names, files=("r1.csv",)):
    def change(part):
        for name in names:
            part.arrays.pop(name)

    return each(change, files)


def copy_channel(draft):
    draft["r1.csv"].arrays[OTHER] = draft["r1.csv"].arrays[DEFLECTION].copy()


def copy_record(draft):
    draft["r3.csv"].arrays = {n: v.copy() for n, v in draft["r1.csv"].arrays.items()}


def shuffle_time(part):
    rng = np.random.default_rng(3)
    part.time = part.time + rng.uniform(-0.3, 0.3, part.time.size) / RATE


def rms(draft, name):
    return np.sqrt(np.mean(draft["r1.csv"].arrays[name] ** 2))


def swap_motion(draft):
    arrays = draft["m1.csv"].arrays
    a = arrays["position.joint_2"]
    arrays["motor_position.joint_1"] = a.copy() + 1e-5


def _spoilers():
    found = {}
    for name in CHANNELS:
        level = _level(name)
        found[f"{name} clipped on both sides"] = (clip(name), "clipping")
        found[f"{name} clipped on one side"] = (clip(name, low=-9.0), "clipping")
        found[f"{name} clipped under noise"] = (common_clip(name), "clipping")
        found[f"{name} zero for a while"] = (run(name, 0.0), "dropouts")
        found[f"{name} held for a while"] = (run(name), "dropouts")
        found[f"{name} dead"] = (replace(name, lambda t, x: 0.0 * x, BURSTS), "dropouts")
        found[f"{name} stuck at a value"] = (
            replace(name, lambda t, x: 0.0 * x + x[0], ("r1.csv",)), "dropouts")  # fmt: skip
        found[f"{name} drifts"] = (
            replace(name, lambda t, x, s=level: x + 0.5 * s * t, BURSTS), "drift")  # fmt: skip
        found[f"{name} has an offset"] = (
            replace(name, lambda t, x, s=level: x + 0.5 * s, BURSTS), "drift")  # fmt: skip
        for mains in (50.0, 60.0):
            found[f"{name} hums at {mains:g} Hz"] = (
                replace(name, lambda t, x, s=level, f=mains: x + 0.1 * s * np.sin(
                    2 * np.pi * f * t + 1.0), BURSTS), "hum")  # fmt: skip
        found[f"{name} drowns in noise"] = (
            replace(name, lambda t, x, s=level: x + s * np.random.default_rng(
                int(1e12 * abs(x[7])) % 2**32).normal(size=x.size), ALL), "noise")  # fmt: skip
        found[f"{name} comes in coarse steps"] = (
            replace(name, lambda t, x, s=level: 0.3 * s * np.round(x / s / 0.3), ALL),
            "noise")  # fmt: skip
        found[f"{name} is copied from another channel"] = (
            lambda draft, n=name: draft["r1.csv"].arrays.update(
                {n: draft["r1.csv"].arrays["force"].copy()}), "copies")  # fmt: skip
        found[f"{name} has another scale in a repeat"] = (
            replace(name, lambda t, x: 0.75 * x, ("r2.csv",)), "repeats")  # fmt: skip
        found[f"{name} is missing in one record"] = (remove([name], ("r2.csv",)), "channels")
    return found


SPOILERS = _spoilers() | {
    f"{DEFLECTION} has a spike": (spike(DEFLECTION, 5e-3), "spikes"),
    f"{OTHER} has a spike": (spike(OTHER, -5e-3), "spikes"),
    f"{VELOCITY} has a spike": (spike(VELOCITY, 0.5), "spikes"),
    f"{ACCELEROMETER} has a spike in quiet time": (spike(ACCELEROMETER, 9.0, at=-0.1), "spikes"),
    f"{ACCELEROMETER} has a spike after the blows": (spike(ACCELEROMETER, 9.0, at=1.1), "spikes"),
    "a position has a spike": (spike("position.joint_1", 0.05, "m1.csv", 2.0), "spikes"),
    "a position falls to zero": (run("position.joint_1", 0.0, "m1.csv", 1.2), "dropouts"),
    "a torque falls to zero": (run("torque.joint_1", 0.0, "m1.csv", 1.2, 60), "dropouts"),
    "a torque at its limit": (
        replace("torque.joint_1", lambda t, x: np.clip(x, -1500, 1500), ("m1.csv",)), "clipping"),
    "the force cell is dead": (replace("force", lambda t, x: 0 * x, BURSTS), "dropouts"),
    "gravity is still in": (
        replace(ACCELEROMETER, lambda t, x: x + 9.81, BURSTS), "drift"),
    "a steady record's mean is in": (
        replace(VELOCITY, lambda t, x: x + 0.02, ("s1.csv",)), "drift"),
    "a steady record drifts": (
        replace(VELOCITY, lambda t, x: x + 0.05 * (t - t.mean()), ("s1.csv",)), "drift"),
    "three samples are lost": (each(drop_samples), "clock"),
    "an uneven clock": (each(shuffle_time), "clock"),
    "a clock that drifts": (retime(lambda t: t + 0.02 * t**2), "clock"),
    "a clock one percent fast": (retime(lambda t: 1.01 * t), "clock"),
    "time in milliseconds": (retime(lambda t: 1000.0 * t, ALL), "clock"),
    "t = 0 twenty milliseconds late": (retime(lambda t: t - 0.02), "blows"),
    "t = 0 twenty milliseconds early": (retime(lambda t: t + 0.02), "blows"),
    "t = 0 late, force not measured": (
        lambda d: (remove(["force"], BURSTS)(d), retime(lambda t: t - 0.02)(d)), "blows"),
    "t = 0 early, force not measured": (
        lambda d: (remove(["force"], BURSTS)(d), retime(lambda t: t + 0.03)(d)), "blows"),
    "the force is flipped": (replace("force", lambda t, x: -x, BURSTS), "blows"),
    "the force is in kilonewton": (replace("force", lambda t, x: 1e-3 * x, BURSTS), "blows"),
    "the force is in pounds": (replace("force", lambda t, x: x / 4.448, BURSTS), "blows"),
    "the blows are a third too strong": (replace("force", lambda t, x: 1.33 * x, BURSTS), "blows"),
    "hits miscounted": (lambda d: [d[f].table.update(hits=10) for f in BURSTS], "blows"),
    "a wrong period": (blows(period=0.042), "blows"),
    "a wrong period, steady alone": (
        lambda d: (d.parts.__delitem__(slice(0, 3)), blows(period=0.041)(d)), "blows"),
    "a record that begins too late": (cut(first=0.05), "length"),
    "a record that begins at the second blow": (cut(first=0.041), "length"),
    "a record that ends before the last blow": (cut(last=0.3), "length"),
    "a record that ends with the last blow": (cut(last=0.5), "length"),
    "half a period": (cut(last=0.02, files=("s1.csv",)), "length"),
    "two periods": (cut(last=0.08, files=("s1.csv",)), "length"),
    "sampled four times too slowly": (lambda d: thin(d, 4), "aliasing"),
    "no anti-alias filter": (rough(VELOCITY), "aliasing"),
    "another pose than written": (
        lambda d: d["r2.csv"].arrays.update(
            {n: -v for n, v in d["r2.csv"].arrays.items() if n != "force"}), "repeats"),
    "a record saved twice": (copy_record, "copies"),
    "one sensor on two channels": (copy_channel, "copies"),
    "deflections in degrees": (replace(DEFLECTION, lambda t, x: 57.3 * x, ALL), "units"),
    "deflections in millimetres": (replace(DEFLECTION, lambda t, x: 1e3 * x, ALL), "units"),
    "velocities in millimetres": (replace(VELOCITY, lambda t, x: 1e3 * x, ALL), "units"),
    "accelerations in millimetres": (replace(ACCELEROMETER, lambda t, x: 1e3 * x, ALL), "units"),
    "temperatures in kelvin": (
        replace("temperature.joint_1", lambda t, x: x + 273.15, ("m1.csv",)), "units"),
    "nothing but the force": (remove(CHANNELS), "channels"),
    "a motion without positions": (
        remove(["position.joint_1", "position.joint_2", "motor_position.joint_1"], ("m1.csv",)),
        "channels"),
    "a motion with positions alone": (
        remove(["torque.joint_1", "motor_position.joint_1"], ("m1.csv",)), "channels"),
    "a motion beyond the joint's limits": (
        replace("position.joint_2", lambda t, x: 10 * x, ("m1.csv",)), "poses"),
    "an unknown joint in the pose": (
        keys("r1.csv", pose={"joint_1": 0.3, "joint_9": 0.5}), "poses"),
    "a pose of the wrong length": (keys("r1.csv", pose=[0.3, 0.5]), "poses"),
    "a pose in degrees": (keys("r1.csv", pose={"joint_1": 17.0, "joint_2": 28.0}), "poses"),
    "a pose beyond the limits": (
        keys("r1.csv", pose={"joint_1": 0.3, "joint_2": 3.1, "joint_3": -0.8}), "poses"),
    "a pose that leaves joints out": (keys("r1.csv", pose={"joint_1": 0.3}), "poses"),
    "a direction of another length": (keys("r1.csv", direction=[5.0, 0.0, 0.0]), "poses"),
    "an unknown joint in a channel": (rename(DEFLECTION, "deflection.joint_7"), "channels"),
    "an unknown frame in a channel": (rename(VELOCITY, "velocity.tcp.x"), "channels"),
    "a flipped velocity": (replace("velocity.joint_1", lambda t, x: -x, ("m1.csv",)), "joints"),
    "a velocity in degrees": (
        replace("velocity.joint_1", lambda t, x: 57.3 * x, ("m1.csv",)), "joints"),
    "a flipped motor": (
        replace("motor_position.joint_1", lambda t, x: -x, ("m1.csv",)), "joints"),
    "a motor before its gear": (
        replace("motor_position.joint_1", lambda t, x: 100 * x, ("m1.csv",)), "joints"),
    "another joint's motor": (swap_motion, "joints"),
}  # fmt: skip
