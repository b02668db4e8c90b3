"""Targets and sizes: drawn so that a typical effect matters on this robot and plan."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from . import equations, outside, robots
from . import plan as plans
from .arm import jacobian_column
from .bench import nominal_chain, rest
from .draw_effect import draw_effect
from .effects import EFFECTS
from .world import Nuisances, World, columns

WEAK = 0.15


@dataclass(frozen=True, eq=False)
class Sizes:
    """What the healthy robot does under a plan; joints' arrays are (n,).

    Attributes:
        joints: names. springs: N m/rad. inertia: mean M_jj, kg m^2. load: largest gravity torque
        over k rms, per joint. rms, peak, most: rad, the peaks' mean and largest over records.
        speed: rad/s, mean peak. damper: N m s/rad for a ratio of 0.03. frequencies: Hz, mean.
        mass: kg, of the arm.
        base: axis -> inertia about it or mass. links: link -> (share of inertia, static stiffness
        of its origin in N/m or None where it stands still). tool_stiffness: N/m, mean along the
        blows. tool_peak: m, mean peak along the blows. shake: m/s^2, RMS of the tool.
        top, strength: channel group -> largest reading, RMS.
    """

    joints: tuple[str, ...]
    springs: np.ndarray
    inertia: np.ndarray
    load: np.ndarray
    rms: np.ndarray
    peak: np.ndarray
    most: np.ndarray
    speed: np.ndarray
    damper: np.ndarray
    frequencies: np.ndarray
    mass: float
    base: dict
    links: dict
    tool_stiffness: float
    tool_peak: float
    shake: float
    top: dict
    strength: dict

    def index(self, joint) -> int:
        """Of a joint."""
        return self.joints.index(joint)

    def active(self, share=0.15):
        """The joints that move enough for a fault in them to show."""
        return [j for j, r in zip(self.joints, self.rms, strict=True) if r > share * self.rms.max()]

    def moving_link(self, rng):
        """A link whose origin moves, and the arm's static stiffness there, N/m."""
        known = [(name, k) for name, (_, k) in self.links.items() if k is not None]
        soft = min(k for _, k in known)
        known = [pair for pair in known if pair[1] < 30.0 * soft]
        return known[rng.integers(len(known))]

    def drag(self, stiffness):
        """N s/m for a ratio of about 0.05 at the first mode beside this stiffness."""
        return 0.1 * stiffness / (2.0 * np.pi * self.frequencies[0])


@lru_cache(maxsize=8)
def sizes(plan) -> Sizes:
    """Of the nominal robot, from the first record of each pose."""
    robot = robots.load(plan.robot)
    chain, n = nominal_chain(robot.name), len(robot.joints)
    world = World(plan, Nuisances.none(n))
    times = plan.times()
    times = times[times > 0.0]
    base = {axis: [] for axis in ("rx", "ry", "rz", "x", "y", "z")}
    soft, inertias, frequencies, springs, loads = [], [], [], [], []
    touch, rms, peak, speed, along, raw = [], [], [], [], [], []
    for i in range(0, len(plan.shots), 3):
        bench = world.bench(i)
        mass, torque, work = rest(chain, bench.pose)
        springs.append(bench.springs)
        loads.append(np.abs(torque))
        inertias.append(np.diag(mass))
        k = np.diag(bench.springs)
        w2 = np.linalg.eigvals(np.linalg.solve(mass, k)).real
        frequencies.append(np.sort(np.sqrt(w2)) / (2.0 * np.pi))
        for axis in base:
            moved = chain.on_moving_base("b", np.eye(3)["xyz".index(axis[-1])], axis[0] != "r")
            base[axis].append(rest(moved, np.concatenate([[0.0], bench.pose]))[0][0, 0])

        def compliance(body, point, work=work, k=k):
            columns = [jacobian_column(chain.arrays(), work, j, body, *point) for j in range(n)]
            jacobian = np.array(columns).T
            return jacobian @ np.linalg.inv(k) @ jacobian.T

        soft.append([np.trace(compliance(b, work[1][b])) / 3.0 for b in range(1, n + 1)])
        body = chain.tool + 1
        tool = work[1][body] + work[0][body] @ chain.tool_offset
        touch.append(bench.direction @ compliance(body, tool) @ bench.direction)
        stops, out = world.motion(bench, times)
        # at t > 0 the stops are the samples and a few edges: near enough even for a mean square
        x, rate = out[:, 0, equations.OUTPUTS :], np.diff(stops)
        rms.append((x**2).mean(axis=0))
        peak.append(np.abs(x).max(axis=0))
        speed.append(np.abs(np.diff(x, axis=0) / rate[:-1, None]).max(axis=0))
        along.append(np.abs(out[:, 0, 9:12] @ bench.direction).max())
        raw.append(out[:, 0])
    names = ("accelerometer", "acceleration", "velocity", "displacement", "force", "deflection")
    groups = {"force": "force", "deflection": "deflection"}
    top, strength = {}, {}
    for name in names:
        parts = [r[:, columns(name)] for r in raw]
        group = groups.get(name, f"{name}.{robot.tool}")
        top[group] = float(max(np.abs(p).max() for p in parts))
        strength[group] = float(np.sqrt(np.mean([np.mean(p**2) for p in parts])))
    spring = np.mean(springs, axis=0)
    inertia = np.mean(inertias, axis=0)
    rms = np.sqrt(np.mean(rms, axis=0))
    yields = np.mean(soft, axis=0)
    share = _link_shares(chain, [s.pose for s in plan.shots[::3]])
    return Sizes(
        joints=robot.joints,
        springs=spring,
        inertia=inertia,
        load=np.median(loads, axis=0) / (spring * rms),
        rms=rms,
        peak=np.mean(peak, axis=0),
        most=np.max(peak, axis=0),
        speed=np.mean(speed, axis=0),
        damper=2.0 * 0.03 * np.sqrt(spring * inertia),
        frequencies=np.mean(frequencies, axis=0),
        mass=float(chain.mass.sum()),
        base={axis: float(np.mean(values)) for axis, values in base.items()},
        links={
            link: (float(share[i]), 1.0 / yields[i] if yields[i] > 1e-12 else None)
            for i, link in enumerate(robot.links())
        },
        tool_stiffness=float(1.0 / np.mean(touch)),
        tool_peak=float(np.mean(along)),
        shake=strength[f"acceleration.{robot.tool}"],
        top=top,
        strength=strength,
    )


def _link_shares(chain, poses):
    """(n,) largest share of a link in any M_jj, mean over poses."""
    out = []
    for pose in poses:
        whole = np.diag(rest(chain, pose)[0])
        row = []
        for i in range(len(chain.mass)):
            light = chain.with_body(i, 0.0, chain.com[i], 0.0 * chain.inertia[i])
            part = (whole - np.diag(rest(light, pose)[0])) / whole
            # a joint far out that hardly moves does not count
            row.append(part[: max(2, len(whole) // 2 + 1)].max())
        out.append(row)
    return np.mean(out, axis=0)


def draw(
    effect,
    robot="fanuc_like_3dof",
    rng=None,
    strength="typical",
    plan=None,
    groups=None,
    target=None,
):
    """(target, parameters) of an effect, in the catalogue or outside of it.

    Args:
        effect: its name.
        robot: its name.
        rng: numpy Generator.
        strength: "typical"; "weak" is 15 % of that, but never within the tolerance.
        plan: what the sizes refer to; a standard one of this robot where None.
        groups: channel groups that are measured.
        target: drawn where None.
    """
    rng = np.random.default_rng() if rng is None else rng
    plan = _standard(robot) if plan is None else plan
    size = sizes(plan)
    if groups is None:
        groups = (f"accelerometer.{robots.load(plan.robot).tool}", "deflection")
    factor = {"typical": 1.0, "weak": WEAK}[strength]
    if effect in outside.EFFECTS:
        found, parameters = outside.draw(effect, rng, size, groups, size.active(0.3), factor)
        return (target or found), plain(parameters)
    if effect not in EFFECTS:
        raise KeyError(f"no effect {effect!r}; there are {', '.join([*EFFECTS, *outside.EFFECTS])}")
    target, parameters = draw_effect(effect, rng, size, plan, groups, target, factor)
    return target, plain(parameters)


def plain(parameters):
    """Numbers as Python's own, for JSON."""
    return {
        name: value if isinstance(value, str) else float(value)
        for name, value in parameters.items()
    }


@lru_cache(maxsize=4)
def _standard(robot):
    return plans.make(robot, np.random.default_rng(0))
