"""What can be wrong, in the world's own terms: each effect writes into a record's bench.

An effect is a function of (bench, target, parameters). Names, parameters and units are the
campaign contract's; sizes are drawn in `draw.py`.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from . import equations
from .bench import Bench
from .chain import merge

EFFECTS: dict = {}


def effect(function):
    """Make an effect known by its function's name."""
    EFFECTS[function.__name__] = function
    return function


# ---- structure


@effect
def joint_stiffness(bench: Bench, joint, p):
    bench.springs[bench.joint(joint)] *= p["scale"]


@effect
def modal_damping(bench: Bench, _, p):
    bench.damping_ratio *= p["scale"]


@effect
def joint_damping(bench: Bench, joint, p):
    if bench.dampers is None:
        bench.dampers = np.zeros(len(bench.springs))
    bench.dampers[bench.joint(joint)] += p["damping"]


@effect
def payload(bench: Bench, _, p):
    chain, body = bench.chain, bench.chain.tool
    own = chain.mass[body], chain.com[body], chain.inertia[body]
    more = p["mass"], chain.tool_offset, np.zeros((3, 3))
    bench.chain = chain.with_body(body, *merge(own, more))


@effect
def link_mass(bench: Bench, link, p):
    chain, body = bench.chain, bench.body(link)
    bench.chain = chain.with_body(
        body, p["scale"] * chain.mass[body], chain.com[body], p["scale"] * chain.inertia[body]
    )


@effect
def joint_inertia(bench: Bench, joint, p):
    bench.armature[joint] = bench.armature.get(joint, 0.0) + p["inertia"]


@effect
def servo_compliance(bench: Bench, joint, p):
    bench.servos[joint] = p["rotor_inertia"], p["stiffness"], p["damping"]


@effect
def base_compliance(bench: Bench, axis, p):
    direction = np.eye(3)["xyz".index(axis[-1])]
    bench.chain = bench.chain.on_moving_base(f"base.{axis}", direction, axis[0] != "r")
    bench.soft[f"base.{axis}"] = p["stiffness"], p["damping"]
    # About the first joint's axis only a base of its own resists: alone it would swing at 1 kHz.
    if axis == "rz" and bench.chain.mass[0] == 0.0:
        bench.armature[f"base.{axis}"] = p["stiffness"] / (2.0 * np.pi * 1000.0) ** 2


@effect
def transverse_compliance(bench: Bench, joint, p):
    line = bench.chain.axis[bench.chain.names.index(joint)]
    across = np.linalg.svd(line[None])[2][1:]
    for i, axis in enumerate(across):
        bench.chain = bench.chain.insert(joint, f"{joint}.hinge{i}", axis)
        bench.soft[f"{joint}.hinge{i}"] = p["stiffness"], p["damping"]


@effect
def tool_offset(bench: Bench, _, p):
    bench.force_offset = bench.force_offset + np.array([p["x"], p["y"], p["z"]])


@effect
def cable(bench: Bench, link, p):
    joint = bench.chain.names[bench.body(link)]
    bench.points.append(
        (equations.TETHER, joint, np.zeros(3), p["stiffness"], p["damping"], 0.0, None)
    )


# ---- nonlinear


@effect
def backlash(bench: Bench, joint, p):
    bench.elements.append((equations.BACKLASH, joint, p["gap"], 0.0))


@effect
def hardening(bench: Bench, joint, p):
    bench.elements.append((equations.CUBIC, joint, p["cubic"], 0.0))


@effect
def hysteresis(bench: Bench, joint, p):
    bench.elements.append((equations.HYSTERESIS, joint, p["torque"], p["deflection"]))


@effect
def coulomb_friction(bench: Bench, joint, p):
    """The ideal law; with `smoothing` (rad/s) torque tanh(v / smoothing), as some simulators do."""
    if p.get("smoothing"):
        bench.elements.append((equations.SMOOTHED, joint, p["torque"], p["smoothing"]))
    else:
        bench.elements.append((equations.COULOMB, joint, p["torque"], 0.0))


@effect
def workpiece_contact(bench: Bench, _, p):
    bench.points.append(
        (equations.CONTACT, None, None, p["stiffness"], p["damping"], p["preload"], None)
    )


# ---- blows


@effect
def force_amplitude(bench: Bench, _, p):
    bench.blows.force *= p["scale"]


@effect
def force_drift(bench: Bench, _, p):
    bench.blows.drift += p["per_hit"]


@effect
def pulse_width(bench: Bench, _, p):
    bench.blows.width *= p["scale"]


@effect
def pulse_shape(bench: Bench, _, p):
    bench.blows.blend = p.get("blend", 1.0)


@effect
def pulse_rate(bench: Bench, _, p):
    bench.blows.period *= p["scale"]


@effect
def pulse_jitter(bench: Bench, _, p):
    bench.blows.late = p["std"] * bench.chance.normal(size=bench.blows.hits)
    bench.blows.late[0] = 0.0


@effect
def missed_hits(bench: Bench, _, p):
    bench.blows.missed = bench.chance.uniform(size=bench.blows.hits) < p["fraction"]
    bench.blows.missed[0] = False


@effect
def rebound(bench: Bench, _, p):
    bench.blows.rebound = p["ratio"], p["delay"]


@effect
def force_direction(bench: Bench, _, p):
    bench.blows.turn = np.array([p["rx"], p["ry"], p["rz"]])


# ---- over time


@effect
def stiffness_drift(bench: Bench, joint, p):
    bench.springs[bench.joint(joint)] *= 1.0 + p["per_day"] * bench.when


@effect
def thermal_stiffness(bench: Bench, joint, p):
    warmer = bench.temperature - bench.mean_temperature
    bench.springs[bench.joint(joint)] *= 1.0 + p["per_kelvin"] * warmer


# ---- sensors


@effect
def sensor_gain(bench: Bench, group, p):
    bench.sensor(group).gain *= p["gain"]


@effect
def sensor_axes(bench: Bench, group, p):
    bench.sensor(group).turn = axes(p["axes"]) @ bench.sensor(group).turn


@effect
def sensor_misalignment(bench: Bench, group, p):
    turn = Rotation.from_rotvec([p["rx"], p["ry"], p["rz"]]).as_matrix()
    bench.sensor(group).turn = turn.T @ bench.sensor(group).turn


@effect
def sensor_delay(bench: Bench, group, p):
    bench.sensor(group).delay += p["delay"]


@effect
def clock_drift(bench: Bench, group, p):
    bench.sensor(group).rate += p["rate"]


@effect
def sensor_highpass(bench: Bench, group, p):
    """Of first order and analogue; or Butterworth of `order` 2; or `digital`, as p says."""
    sensor = bench.sensor(group)
    sensor.highpass, sensor.order = p["frequency"], int(p.get("order", 1))
    sensor.digital = bool(p.get("digital", 0.0))


@effect
def sensor_lowpass(bench: Bench, group, p):
    bench.sensor(group).lowpass = p["frequency"]


@effect
def sensor_clipping(bench: Bench, group, p):
    bench.sensor(group).limit = p["limit"]


@effect
def mount_resonance(bench: Bench, group, p):
    bench.sensor(group).mount = p["frequency"], p["damping_ratio"]


@effect
def mains_hum(bench: Bench, group, p):
    bench.sensor(group).hum = p["amplitude"], p["frequency"]


def axes(word):
    """(3, 3) of a word such as "y-xz": each letter is what x, y, z really show."""
    rows, sign = [], 1.0
    for letter in word:
        if letter == "-":
            sign = -1.0
        else:
            rows.append(sign * np.eye(3)["xyz".index(letter)])
            sign = 1.0
    return np.array(rows)
