"""A shift of riveting whose damage is known: scipy's oscillators, `rainflow`'s counting.

Nothing of picchio's computes here. Masses, levers and damping are those of `worlds`. Everything is
a little wrong in the logs: noise on the force and the angles, no blow like another, rivets at
times that fit no sample.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas
import rainflow
from scipy.linalg import eigh
from scipy.signal import cont2discrete, lfilter

from worlds import bench, robots
from worlds.arm import jacobian_column

BEGIN = 1_772_352_000_000_000_000  # 2026-03-01T08:00:00Z, ns
STEP = 1e-4  # s, of the truth
SLOPE, STRENGTH, CYCLES = 8.0, 90e6, 2e6  # Pa: a curve without limit
CURVE = f"""format = "picchio-sn-curve/1"
name = "steep"
kind = "shear"
strength = {STRENGTH}
cycles = {CYCLES}
slopes = [{SLOPE}]
knees = []
source = "a test"
"""
POSES = np.array([[0.3, 1.1, -1.0], [-0.4, 0.7, -0.6], [0.8, 0.9, -1.3]])
DIRECTIONS = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, 1.0, 0.0]])
RADIUS = (0.01765, 0.0132, 0.0132)


def oscillators(name, pose, stiffness=1.0, damping=1.0):
    """Natural frequencies rad/s, mode shapes, damping ratio, levers (3, n) of the tool's point.

    Of a robot whose springs and damping are so many times the nominal ones.
    """
    robot = robots.load(name)
    chain = bench.nominal_chain(name)
    mass, gravity, work = bench.rest(chain, pose)
    springs = robot.springs(gravity) * stiffness
    squared, shapes = eigh(np.diag(springs), mass)
    tool = bench.rest(chain, pose)[2]
    del work
    body = len(pose)
    turn, place = tool[0][body], tool[1][body]
    import pinocchio as pin

    frame = robot.model.frames[robot.model.getFrameId(robot.tool)].placement
    assert isinstance(frame, pin.SE3)
    point = place + turn @ frame.translation
    levers = np.array(
        [jacobian_column(chain.arrays(), tool, i, body, *point) for i in range(len(pose))]
    ).T
    return np.sqrt(squared), shapes, robot.damping_ratio * damping, levers, springs


@dataclass
class Rivet:
    """Blows at a pose: begin s, their times after it, peaks N, widths s."""

    begin: float
    place: int
    times: np.ndarray
    peaks: np.ndarray
    widths: np.ndarray

    def force(self, time):
        """N, half-sines."""
        total = np.zeros_like(time)
        for t, peak, width in zip(self.times, self.peaks, self.widths, strict=True):
            u = (time - self.begin - t) / width
            on = (u > 0.0) & (u < 1.0)
            total[on] += peak * np.sin(np.pi * u[on])
        return total


def rivets(count, rng, *, force=2000.0, apart=4.0, places=3):
    """Twelve uneven blows each."""
    return [
        Rivet(0.7 + i * apart + rng.uniform(0.0, 0.3), int(rng.integers(places)),
              0.04 * np.arange(12) + rng.uniform(-3e-4, 3e-4, 12),
              force * rng.uniform(0.7, 1.1, 12), 0.005 * rng.uniform(0.95, 1.05, 12))
        for i in range(count)
    ]  # fmt: skip


def truth(name, made, after=12.0, *, load=1.0, **world):
    """Miner's sum of each joint: of all rivets as one history, and of each stay by itself.

    While the robot stays at a place it rings on from rivet to rivet; elsewhere it begins at rest.
    The stresses are `load` times as large (of each joint); `world` as of `oscillators`.
    """
    changes = [k for k in range(1, len(made)) if made[k].place != made[k - 1].place]
    stays = [made[a:b] for a, b in zip([0, *changes], [*changes, len(made)], strict=True)]
    histories = []
    for stay in stays:
        begin, end = stay[0].begin - 0.01, stay[-1].begin  # the first blow may come early
        omega, shapes, ratio, levers, springs = oscillators(name, POSES[stay[0].place], **world)
        time = begin + np.arange(0.0, end - begin + after, STEP)
        force = sum(rivet.force(time) for rivet in stay)
        push = shapes.T @ levers.T @ DIRECTIONS[stay[0].place]
        joints = np.zeros((len(omega), time.size))
        for k, w in enumerate(omega):
            plant = ([push[k]], [1.0, 2.0 * ratio * w, w * w])
            b, a, _ = cont2discrete(plant, STEP, method="foh")
            joints += np.outer(shapes[:, k], lfilter(np.ravel(b), a, force))
        joints *= np.broadcast_to(load, len(joints))[:, None]
        radius = np.array(RADIUS)
        histories.append(joints * springs[:, None] * (2.0 / (np.pi * radius**3))[:, None])
    n = len(histories[0])
    whole = [cost(np.concatenate([h[j] for h in histories])) for j in range(n)]
    alone = [sum(cost(h[j]) for h in histories) for j in range(n)]
    return np.array(whole), np.array(alone)


def felt(name, made, length, **world):
    """(m, 3) m/s^2, the tool point's acceleration, world axes; a sample each `STEP`.

    As of a robot that comes to each rivet at rest.
    """
    time = np.arange(0.0, length, STEP)
    total = np.zeros((time.size, 3))
    for rivet in made:
        omega, shapes, ratio, levers, _ = oscillators(name, POSES[rivet.place], **world)
        push = shapes.T @ levers.T @ DIRECTIONS[rivet.place]
        force = rivet.force(time)
        for k, w in enumerate(omega):
            plant = ([1.0, 0.0, 0.0], [1.0, 2.0 * ratio * w, w * w])
            b, a, _ = cont2discrete(plant, STEP, method="foh")
            total += np.outer(lfilter(np.ravel(b), a, push[k] * force), levers @ shapes[:, k])
    return total


def cost(stress):
    """Miner's sum of a history."""
    return sum(
        count / (CYCLES * (0.5 * size / STRENGTH) ** -SLOPE)
        for size, _, count, _, _ in rainflow.extract_cycles(stress)
        if size > 0.0
    )


def log(made, rng, *, rate=5000.0, length=None, noise=3.0):
    """A table: stamp ns, the force along x, y, z, q1, q2, q3: 20 samples and more a blow."""
    end = length or made[-1].begin + 3.0
    time = np.arange(int(end * rate)) / rate
    force = sum(np.outer(rivet.force(time), DIRECTIONS[rivet.place]) for rivet in made)
    force = force + noise * rng.standard_normal(force.shape)
    begins = np.array([rivet.begin - 0.5 for rivet in made])
    where = np.maximum(np.searchsorted(begins, time) - 1, 0)
    pose = POSES[np.array([rivet.place for rivet in made])[where]]
    pose = pose + 2e-5 * rng.standard_normal(pose.shape)
    stamps = BEGIN + np.rint(time * 1e9).astype(np.int64)
    columns = dict(zip(("fx", "fy", "fz", "q1", "q2", "q3"), (*force.T, *pose.T), strict=True))
    return pandas.DataFrame({"stamp": stamps, **columns})


MAPPING = """format = "picchio-mapping/1"
[[channel]]
from = "fx"
to = "force.x"
[[channel]]
from = "fy"
to = "force.y"
[[channel]]
from = "fz"
to = "force.z"
[[channel]]
from = "q1"
to = "position.joint_1"
[[channel]]
from = "q2"
to = "position.joint_2"
[[channel]]
from = "q3"
to = "position.joint_3"
[blows]
threshold = 150.0
foot = 12.0
frame = "world"
"""
