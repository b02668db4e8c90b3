"""Effects that no catalogue has, for worlds where nothing may be named.

As in `effects.py`; `draw` gives a target and sizes that show clearly in the data.
"""

from __future__ import annotations

import numpy as np

from . import equations
from .bench import Bench

EFFECTS: dict = {}
# Those that the published seeds draw from.
FIRST = (
    "tuned_mass", "coupled_joints", "quadratic_damping", "loose_bolt", "gyroscopic_spindle",
    "swinging_direction", "softening_quadratic", "delayed_feedback", "second_touch",
    "nonlinear_sensor", "floor_vibration", "uneven_blows", "fading_gain", "cross_talk",
)  # fmt: skip


def effect(function):
    """Make an outside effect known by its function's name."""
    EFFECTS[function.__name__] = function
    return function


@effect
def tuned_mass(bench: Bench, _, p):
    """A sprung mass on the tool: mass kg, frequency Hz, damping ratio, along x, y, z (tool)."""
    chain = bench.chain
    axis = np.array([p["x"], p["y"], p["z"]])
    axis = axis / np.linalg.norm(axis)
    bench.chain = chain.hang(
        "tuned mass", chain.tool, chain.tool_rotation, chain.tool_offset, axis, True, p["mass"]
    )
    w = 2.0 * np.pi * p["frequency"]
    bench.soft["tuned mass"] = p["mass"] * w * w, 2.0 * p["damping_ratio"] * p["mass"] * w


@effect
def coupled_joints(bench: Bench, joints, p):
    """Off-diagonal stiffness (N m/rad) between two joints."""
    n = len(bench.springs)
    bench.coupling = np.zeros((n, n)) if bench.coupling is None else bench.coupling
    i, j = (bench.joint(name) for name in joints)
    bench.coupling[i, j] += p["stiffness"]
    bench.coupling[j, i] += p["stiffness"]


@effect
def quadratic_damping(bench: Bench, joint, p):
    """Torque c |v| v, N m s^2/rad^2."""
    bench.elements.append((equations.QUADRATIC_DAMPER, joint, p["damping"], 0.0))


@effect
def loose_bolt(bench: Bench, joint, p):
    """Stiffness that differs by `stiffness` N m/rad where the deflection is positive."""
    bench.elements.append((equations.BILINEAR, joint, p["stiffness"], 0.0))


@effect
def gyroscopic_spindle(bench: Bench, _, p):
    """Angular momentum x, y, z (kg m^2/s) in the tool frame."""
    chain = bench.chain
    momentum = chain.tool_rotation @ np.array([p["x"], p["y"], p["z"]])
    bench.chain = chain.with_spin(chain.tool, momentum)


@effect
def swinging_direction(bench: Bench, _, p):
    """The force's direction turns in the world from blow to blow: rad per blow about x, y, z."""
    bench.blows.swing = np.array([p["x"], p["y"], p["z"]])


@effect
def softening_quadratic(bench: Bench, joint, p):
    """Torque q x |x|, N m/rad^2, q below zero."""
    bench.elements.append((equations.QUADRATIC, joint, p["quadratic"], 0.0))


@effect
def delayed_feedback(bench: Bench, joint, p):
    """Torque g x(t - delay), N m/rad and s."""
    bench.elements.append((equations.DELAYED, joint, p["stiffness"], p["delay"]))


@effect
def second_touch(bench: Bench, link, p):
    """A link's origin meets a stop along x, y, z (world): N/m, N s/m, no preload."""
    normal = np.array([p["x"], p["y"], p["z"]])
    joint = bench.robot.joints[bench.robot.links().index(link)]
    bench.points.append(
        (equations.CONTACT, joint, np.zeros(3), p["stiffness"], p["damping"], 0.0, normal)
    )


@effect
def nonlinear_sensor(bench: Bench, group, p):
    """Reading + square reading^2."""
    bench.sensor(group).square = p["square"]


@effect
def floor_vibration(bench: Bench, _, p):
    """The floor shakes along x, y, z (m/s^2) at a frequency (Hz), all the time."""
    phase = bench.chance.uniform(0.01, 2.0 * np.pi)
    bench.floor = np.array([p["x"], p["y"], p["z"], p["frequency"], phase, -3.5, 2.5])


@effect
def uneven_blows(bench: Bench, _, p):
    """Every other blow is harder by `share`, the others weaker."""
    bench.blows.uneven = p["share"]


@effect
def fading_gain(bench: Bench, group, p):
    """The gain changes by `rate` (1/s) after the first blow."""
    bench.sensor(group).fade = p["rate"]


@effect
def cross_talk(bench: Bench, group, p):
    """One axis leaks into another, which does not leak back: (3, 3) with one entry."""
    leak = np.eye(3)
    leak["xyz".index(p["into"]), "xyz".index(p["from"])] = p["share"]
    bench.sensor(group).turn = leak @ bench.sensor(group).turn


@effect
def mid_link_bending(bench: Bench, link, p):
    """A link yields half-way along: N m/rad, N m s/rad, about an axis across it at `angle`, rad."""
    body, name = bench.body(link), f"{link}.bend"
    bench.chain = bench.chain.split(body, name, 0.5, p["angle"])
    bench.soft[name] = p["stiffness"], p["damping"]


@effect
def counterbalance(bench: Bench, joint, p):
    """A spring hangs on a joint: `stiffness` N m/rad by the cosine of how far it has turned."""
    n, i = len(bench.springs), bench.joint(joint)
    bench.coupling = np.zeros((n, n)) if bench.coupling is None else bench.coupling
    bench.coupling[i, i] += p["stiffness"] * np.cos(bench.pose[i] - p["angle"])


# What the catalogue has of them by now: a trial of what is outside leaves these out.
IN_CATALOGUE = {
    "tuned_mass": {"absorber"},
    "coupled_joints": {"belt_coupling"},
    "loose_bolt": {"loose_bolt"},
    "counterbalance": {"counterbalance"},
    "mid_link_bending": {"link_bending"},
}


def draw(name, rng, size, groups, joints, factor=1.0):
    """(target, parameters) of an outside effect.

    Args:
        name: of the effect.
        rng: numbers.
        size: `draw.Sizes` of the plan.
        groups: channel groups that are measured.
        joints: those whose faults show.
        factor: 1 for a typical size; less for a weak one.
    """
    joint = str(rng.choice(joints))
    j = size.index(joint)
    k = size.springs[j]
    sign = float(rng.choice([-1.0, 1.0]))
    group = str(rng.choice([g for g in groups if g != "force"]))
    vectors = [g for g in groups if g not in ("force", "deflection")]
    way = rng.normal(size=3)
    way /= np.linalg.norm(way)
    xyz = dict(zip("xyz", map(float, way), strict=True))

    def between(low, high):
        return float(factor * rng.uniform(low, high))

    def along(length):
        return dict(zip("xyz", map(float, length * way), strict=True))

    if name == "tuned_mass":
        f = float(size.frequencies[:3].mean() * rng.uniform(0.7, 1.5))
        ratio = {"damping_ratio": 0.02, "frequency": f}
        return "tool", {"mass": between(0.03, 0.06) * size.mass, **ratio, **xyz}
    if name == "coupled_joints":
        other = str(rng.choice([name for name in joints if name != joint]))
        both = np.sqrt(k * size.springs[size.index(other)])
        return (joint, other), {"stiffness": sign * between(0.15, 0.25) * float(both)}
    if name == "quadratic_damping":
        return joint, {"damping": between(0.5, 1.5) * size.damper[j] / size.speed[j]}
    if name == "loose_bolt":
        return joint, {"stiffness": -between(0.3, 0.45) * k}
    if name == "gyroscopic_spindle":
        w = 2.0 * np.pi * size.frequencies[0]
        least = min(size.inertia[size.index(name)] for name in joints)
        return "tool", along(between(0.2, 0.4) * w * float(least))
    if name == "swinging_direction":
        return "tool", along(np.radians(between(1.5, 2.5)))
    if name == "softening_quadratic":
        return joint, {"quadratic": -between(0.12, 0.2) * k / size.most[j]}
    if name == "delayed_feedback":
        delay = float(rng.uniform(0.1, 0.25) / size.frequencies[0])
        return joint, {"stiffness": -between(0.03, 0.05) * k, "delay": delay}
    if name == "second_touch":
        link, stiffness = size.moving_link(rng)
        stiffness *= between(0.3, 0.6)
        return link, {"stiffness": stiffness, "damping": size.drag(stiffness), **xyz}
    if name == "nonlinear_sensor":
        return group, {"square": sign * between(0.1, 0.2) / size.top[group]}
    if name == "floor_vibration":
        length = between(0.08, 0.16) * size.shake
        return "floor", {**along(length), "frequency": float(rng.uniform(6.0, 23.0))}
    if name == "uneven_blows":
        return "tool", {"share": sign * between(0.1, 0.2)}
    if name == "fading_gain":
        return group, {"rate": sign * between(0.2, 0.4)}
    if name == "cross_talk":
        first, second = rng.choice(list("xyz"), 2, replace=False)
        share = sign * between(0.1, 0.2)
        return str(rng.choice(vectors)), {"into": str(first), "from": str(second), "share": share}
    if name == "mid_link_bending":
        link = list(size.links)[j]
        stiffness = float(k * rng.uniform(2.0, 4.0) / factor)
        damping = float(0.06 * np.sqrt(stiffness * size.inertia[j]))
        return link, {"stiffness": stiffness, "damping": damping, "angle": float(rng.uniform(0, 3))}
    if name == "counterbalance":
        return joint, {"stiffness": between(0.25, 0.4) * k, "angle": float(rng.uniform(-0.5, 0.5))}
    raise KeyError(name)
