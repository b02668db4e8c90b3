"""A world: a robot with its faults under a plan, and what its sensors read before noise."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from . import equations, kernel, outside, robots
from . import plan as plans
from .bench import Bench, nominal_chain, rest
from .blows import Blows
from .effects import EFFECTS
from .errors import Errors
from .sensors import Sensor

TOLERANCE = {"stiffness": 0.05, "damping_ratio": 0.20, "force": 0.05}
_KINKS = (equations.BACKLASH, equations.BILINEAR, equations.HYSTERESIS, equations.COULOMB,
          equations.SMOOTHED)  # fmt: skip
VECTORS = ("accelerometer", "acceleration", "velocity", "displacement")


@dataclass(frozen=True, eq=False)
class Nuisances:
    """Factors on the nominal values: (n,) stiffness, damping ratio, force."""

    stiffness: np.ndarray
    damping_ratio: float
    force: float

    @classmethod
    def none(cls, n):
        """The nominal values."""
        return cls(np.ones(n), 1.0, 1.0)

    @classmethod
    def draw(cls, n, rng, tolerance=None):
        """Normal, none beyond 1.9 standard deviations."""
        sigma = tolerance or TOLERANCE

        def one(size, name):
            value = rng.normal(size=size)
            while (far := np.abs(value) > 1.9).any():
                value = np.where(far, rng.normal(size=size), value)
            return 1.0 + sigma[name] * value

        stiffness = one(n, "stiffness")
        return cls(stiffness, float(one(1, "damping_ratio")[0]), float(one(1, "force")[0]))

    @classmethod
    def of(cls, errors):
        """What errors say about them."""
        return cls(1.0 + errors.stiffness, 1.0 + errors.damping_ratio, 1.0 + errors.force)


@dataclass(frozen=True, eq=False)
class World:
    """A robot with its faults, under a plan.

    Attributes:
        plan: the records.
        nuisances: within tolerance.
        causes: (effect, target, parameters), in the catalogue or outside of it.
        seed: of what happens by chance (late and missed blows, the hum's phase).
        bandwidth: Hz of the sensors; None for endless.
        modal: what the modal damping is made of, "joints" or "all"; see `Bench`.
        step: s, the longest; None to fit the fastest mode.
        errors: what else is not as in the files; None for nothing. Its stiffness, damping ratio and
            force are in `nuisances`.
    """

    plan: plans.Plan
    nuisances: Nuisances
    causes: tuple = ()
    seed: int = 0
    bandwidth: float | None = 5000.0
    modal: str = "joints"
    step: float | None = None
    errors: Errors | None = None

    def bench(self, index, shot=None) -> Bench:
        """Record `index`'s set-up with the causes in it."""
        plan = self.plan
        shot = plan.shots[index] if shot is None else shot
        robot = robots.load(plan.robot)
        chain, pose = nominal_chain(robot.name), np.asarray(shot.pose, float)
        if self.errors is not None:
            chain, pose = self.errors.chain(chain), self.errors.true_pose(pose)
        _, torque, _ = rest(chain, pose)
        hits = plan.hits or 275
        bench = Bench(
            robot=robot,
            pose=pose,
            direction=np.asarray(shot.direction, float) / np.linalg.norm(shot.direction),
            blows=Blows(
                shot.force * self.nuisances.force, plan.period, plan.width, hits, blend=plan.blend
            ),
            chain=chain,
            springs=robot.springs(torque) * self.nuisances.stiffness,
            damping_ratio=robot.damping_ratio * self.nuisances.damping_ratio,
            when=shot.when,
            temperature=shot.temperature,
            mean_temperature=float(np.mean([s.temperature for s in plan.shots])),
            modal=self.modal,
            index=index,
            chance=np.random.default_rng([self.seed, index, 77]),
        )
        if self.errors is not None:
            self._err(bench, shot)
        # a link is scaled before anything is hung on it
        for name, target, parameters in sorted(self.causes, key=lambda c: c[0] != "link_mass"):
            (EFFECTS.get(name) or outside.EFFECTS[name])(bench, target, parameters)
        return bench

    def _err(self, bench, shot):
        """Write what is not exact about a record into its bench, but for bodies and pose."""
        errors, hits = self.errors, bench.blows.hits
        bench.by_mode = 1.0 + errors.damping_by_mode(shot.pose)
        bench.gravity_stiffness = errors.gravity_stiffness
        bench.force_offset = bench.force_offset + errors.tool_point
        bench.sensor_offset = bench.sensor_offset + errors.sensor_position
        bench.direction = errors.true_direction(bench.index, shot)
        bench.blows.scatter = errors.blow_force(bench.index, shot, hits)
        bench.blows.slip = errors.blow_time(bench.index, shot, hits)
        bench.blows.rise = errors.rise_time

    def sensor(self, bench, group):
        """How a channel group reads in a record."""
        sensor = deepcopy(bench.sensors.get(group, Sensor()))
        if self.errors is not None:
            if group.partition(".")[0] in VECTORS:
                askew = Rotation.from_rotvec(self.errors.sensor_angle(group)).as_matrix()
                sensor.turn = askew.T @ sensor.turn
            sensor.gain *= 1.0 + self.errors.sensor_gain(group)
        return replace(sensor, bandwidth=self.bandwidth)

    def motion(self, bench, times, sensors=()):
        """The motion of one record: (stops, outputs on the intervals, less their rest values)."""
        system, rest_values, inner, delayed, fastest = bench.system()
        blows = system[11]
        step = self.step or min(2e-4, max(0.35 / fastest, 1e-5))
        if any(kind in _KINKS for kind, *_ in bench.elements) or bench.points:
            step *= 0.5
        reads = np.concatenate([s.instants(times) for s in sensors] or [times])
        start = bench.floor[5] if bench.floor[4] > 0.0 else 0.0
        end = reads.max() + 0.5 / self.plan.sampling
        edges = [blows[:, 0], blows[:, 0] + blows[:, 1]]
        if bench.blows.rise > 0.0:  # corners, and where a half-sine begins and ends
            rise = bench.blows.rise
            edges += [edges[0] + rise, edges[1] - rise]
            edges += [edges[0] + 0.5 * rise, edges[1] - 0.5 * rise] if blows[:, 3].any() else []
        edges = np.concatenate(edges)
        stops = np.concatenate([[start, end], reads, edges])
        if any(sensor.mount is not None for sensor in sensors):
            # its ringing needs finer parabolas
            stops = np.concatenate([stops, 0.5 * (reads[:-1] + reads[1:])])
        stops = np.unique(np.round(stops[(stops >= start) & (stops <= end)], 10))
        out = kernel.simulate(system, stops, step, inner, delayed)
        return stops, out - rest_values

    def record(self, index, groups, shot=None):
        """{group: (samples, channels)} of one record, without noise; and the bench."""
        bench = self.bench(index, shot)
        times, origin = self.plan.times(), 0.0
        if self.plan.hits is None:  # the last blows of a long train
            origin = (bench.blows.hits - 25) * bench.blows.period
        sensors = {group: replace(self.sensor(bench, group), origin=origin) for group in groups}
        stops, out = self.motion(bench, times, tuple(sensors.values()))
        if not np.isfinite(out).all():
            raise FloatingPointError(f"{self.plan.robot}, {self.causes}: the world blew up")
        phases = np.random.default_rng([self.seed, index, 78]).uniform(
            0.0, 2.0 * np.pi, len(groups)
        )
        read = {}
        for (group, sensor), phase in zip(sensors.items(), phases, strict=True):
            read[group] = sensor.read(stops, out[:, :, columns(group)], times, phase)
            if self.plan.hits is None:
                read[group] = read[group] - read[group].mean(axis=0)
        return read, bench


def columns(group) -> slice:
    """Which outputs of the kernel a channel group shows."""
    kind = group.partition(".")[0]
    if kind in VECTORS:
        at = 3 * VECTORS.index(kind)
        return slice(at, at + 3)
    return slice(12, 13) if kind == "force" else slice(13, None)


def channels(group, robot):
    """The names of a group's channels."""
    if group == "deflection":
        return [f"deflection.{joint}" for joint in robot.joints]
    return [group] if group == "force" else [f"{group}.{axis}" for axis in "xyz"]


def groups_of(sensors, robot):
    """Channel groups by their full names: "accelerometer" is that of the robot's tool frame."""
    out = []
    for name in sensors:
        kind, _, frame = name.partition(".")
        if kind in VECTORS and frame in ("", "tool"):
            name = f"{kind}.{robot.tool}"
        if kind not in (*VECTORS, "force", "deflection"):
            raise ValueError(f"no such sensor: {name}")
        out.append(name)
    return tuple(out)


def clean(world, groups):
    """[{group: (samples, channels)}] of every record, without noise."""
    return [world.record(i, groups)[0] for i in range(len(world.plan.shots))]


def quantities(world, pose=None, direction=None, force=None, index=0, sampling=4000.0):
    """The true deflections on a burst, for life.

    Args:
        world: from `truth["world"]`.
        pose, direction, force: record `index`'s where None.
        index: of the record.
        sampling: Hz of the deflections given back.

    Returns:
        {"time": (m,) s, "deflection": (joints, m) rad, "peak_deflection": {joint: rad}}.
    """
    shot = world.plan.shots[index]
    changes = {
        "pose": None if pose is None else np.asarray(pose, float),
        "direction": None if direction is None else np.asarray(direction, float),
        "force": force,
    }
    shot = replace(shot, **{k: v for k, v in changes.items() if v is not None})
    bench = world.bench(index, shot)
    times = np.arange(0.0, world.plan.times()[-1], 1.0 / sampling)
    stops, out = world.motion(bench, times)
    at = np.searchsorted(stops, times - 1e-9)
    deflection = out[at, 0, equations.OUTPUTS :].T
    peaks = np.abs(out[:, :, equations.OUTPUTS :]).max(axis=(0, 1))
    return {
        "time": times,
        "deflection": deflection,
        "peak_deflection": dict(zip(bench.robot.joints, map(float, peaks), strict=True)),
    }
