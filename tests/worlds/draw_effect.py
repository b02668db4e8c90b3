"""The sizes of every effect of the catalogue: typical, or a share of that."""

from __future__ import annotations

import numpy as np

AXES = ("yxz", "xzy", "zyx", "-xyz", "x-yz", "xy-z", "x-zy", "xz-y", "-yxz", "y-xz", "-x-yz")
VECTORS = ("accelerometer", "acceleration", "velocity", "displacement")


def draw_effect(name, rng, size, plan, groups, target, factor):
    """(target, parameters); arguments as in `draw.draw`, `size` a `draw.Sizes`."""
    draw = _BY_TARGET[name]
    kind = draw.__name__
    if target is None:
        target = _target(kind, name, rng, size, groups)
    return target, draw(name, target, rng, size, plan, factor)


def takes(name, groups):
    """Whether an effect, in the catalogue or outside, has a place among these channel groups."""
    known = [g.partition(".")[0] for g in groups]
    if name in ("sensor_axes", "sensor_misalignment", "cross_talk"):
        return any(k in VECTORS for k in known)
    if name == "mount_resonance":
        return any(k.startswith("acceler") for k in known)
    return any(k != "force" for k in known)


def _target(kind, name, rng, size, groups):
    if kind == "_joint":
        joints = size.active(0.3)
        if name == "backlash":
            # a joint that carries more than it vibrates never leaves its edge
            free = [j for j in joints if size.load[size.index(j)] < 1.0]
            joints = free or [size.joints[int(np.argmin(size.load))]]
        return str(rng.choice(joints))
    if kind == "_sensor":
        known = [g for g in groups if g != "force" or name in ("sensor_gain", "sensor_delay")]
        if name in ("sensor_axes", "sensor_misalignment"):
            known = [g for g in known if g.partition(".")[0] in VECTORS]
        if name == "mount_resonance":
            known = [g for g in known if g.startswith("acceler")]
        if not known:
            raise ValueError(f"{name}: no sensor among {groups} can have it")
        return str(rng.choice(known))
    if name == "link_mass":
        return str(rng.choice([link for link, (share, _) in size.links.items() if share > 0.1]))
    if name == "cable":
        return size.moving_link(rng)[0]
    if name == "base_compliance":
        return str(rng.choice(list(size.base)))
    return "robot" if name == "modal_damping" else "tool"


def _way(rng, length):
    vector = rng.normal(size=3)
    return [float(v) for v in length * vector / np.linalg.norm(vector)]


def _scale(rng, factor, low, high):
    """A factor such as 0.75 or 1.3; `factor` shrinks what differs from one."""
    return float(1.0 + factor * (rng.uniform(*(low if rng.uniform() < 0.5 else high)) - 1.0))


def _beyond(rng, factor, low, high, sigma):
    """The same, but never so near one that the tolerance explains it."""
    if factor == 1.0:
        return _scale(rng, 1.0, low, high)
    sign = rng.choice([-1.0, 1.0])
    return float(1.0 + sign * sigma * rng.uniform(2.4, 3.2))


def _joint(name, joint, rng, size, plan, factor):
    j = size.index(joint)
    k, m, peak = float(size.springs[j]), float(size.inertia[j]), float(size.peak[j])
    few = factor * rng.uniform(0.7, 1.4)
    if name == "joint_stiffness":
        return {"scale": _beyond(rng, factor, (0.65, 0.75), (1.35, 1.5), 0.05)}
    if name == "joint_damping":
        return {"damping": few * float(size.damper[j])}
    if name == "joint_inertia":
        return {"inertia": 0.15 * few * m}
    if name == "servo_compliance":
        servo, rotor = k * rng.uniform(4.0, 6.0) / factor, m * rng.uniform(0.2, 0.4)
        damping = 0.2 * np.sqrt(servo * rotor) * rng.uniform(0.7, 1.3)
        return {"rotor_inertia": rotor, "stiffness": servo, "damping": float(damping)}
    if name == "transverse_compliance":
        stiffness = k * rng.uniform(3.0, 5.0) / factor
        return {"stiffness": stiffness, "damping": float(0.06 * np.sqrt(stiffness * m))}
    if name == "backlash":
        return {"gap": factor * rng.uniform(0.5, 1.0) * float(size.rms[j])}
    if name == "hardening":
        # a softening spring must not give way at the hardest blow
        share = rng.uniform(0.1, 0.2) if rng.uniform() < 0.7 else rng.uniform(-0.08, -0.05)
        return {"cubic": factor * share * k / float(size.most[j]) ** 2}
    if name == "hysteresis":
        return {"torque": factor * rng.uniform(0.05, 0.1) * k * peak, "deflection": 0.2 * peak}
    if name == "coulomb_friction":
        return {"torque": factor * rng.uniform(0.03, 0.08) * k * peak}
    if name == "stiffness_drift":
        span = plan.shots[-1].when - plan.shots[0].when
        return {"per_day": -factor * rng.uniform(0.2, 0.3) / span}
    warm = [s.temperature for s in plan.shots]
    sign = -1.0 if rng.uniform() < 0.8 else 1.0
    return {"per_kelvin": sign * factor * rng.uniform(0.2, 0.3) / (max(warm) - min(warm))}


def _robot(name, target, rng, size, plan, factor):
    if name == "modal_damping":
        return {"scale": _beyond(rng, factor, (0.42, 0.5), (1.8, 2.2), 0.20)}
    if name == "payload":
        return {"mass": factor * rng.uniform(0.015, 0.03) * size.mass}
    if name == "link_mass":
        return {"scale": _scale(rng, factor, (0.82, 0.87), (1.13, 1.18))}
    if name == "base_compliance":
        f = rng.uniform(12.0, 25.0) / np.sqrt(factor)
        inertia = size.base[target]
        stiffness = (2.0 * np.pi * f) ** 2 * inertia
        return {"stiffness": stiffness, "damping": float(0.06 * np.sqrt(stiffness * inertia))}
    if name == "tool_offset":
        return dict(zip("xyz", _way(rng, factor * rng.uniform(0.02, 0.04)), strict=True))
    if name == "cable":
        stiffness = factor * rng.uniform(0.05, 0.1) * size.links[target][1]
        return {"stiffness": stiffness, "damping": size.drag(stiffness)}
    if name == "workpiece_contact":
        stiffness = factor * rng.uniform(0.5, 1.0) * size.tool_stiffness
        preload = stiffness * rng.uniform(0.3, 0.6) * size.tool_peak
        return {"stiffness": stiffness, "damping": size.drag(stiffness), "preload": preload}
    if name == "force_amplitude":
        return {"scale": _beyond(rng, factor, (0.65, 0.75), (1.25, 1.35), 0.05)}
    if name == "force_drift":
        return {"per_hit": factor * float(rng.choice([-1, 1])) * rng.uniform(0.015, 0.03)}
    if name == "pulse_width":
        return {"scale": _scale(rng, factor, (0.7, 0.8), (1.2, 1.3))}
    if name == "pulse_shape":
        return {} if factor == 1.0 else {"blend": factor}
    if name == "pulse_rate":
        return {"scale": _scale(rng, factor, (0.965, 0.98), (1.02, 1.035))}
    if name == "pulse_jitter":
        return {"std": factor * rng.uniform(0.001, 0.002)}
    if name == "missed_hits":
        return {"fraction": 0.15 if factor == 1.0 else 0.15 * 0.2}
    if name == "rebound":
        delay = rng.uniform(0.3, 0.5) * plan.period
        return {"ratio": factor * rng.uniform(0.2, 0.4), "delay": delay}
    angles = _way(rng, factor * np.radians(rng.uniform(5.0, 10.0)))
    return dict(zip(("rx", "ry", "rz"), angles, strict=True))


def _sensor(name, group, rng, size, plan, factor):
    if name == "sensor_gain":
        return {"gain": _scale(rng, factor, (0.75, 0.85), (1.15, 1.25))}
    if name == "sensor_axes":
        return {"axes": str(rng.choice(AXES))}
    if name == "sensor_misalignment":
        angles = _way(rng, factor * np.radians(rng.uniform(4.0, 8.0)))
        return dict(zip(("rx", "ry", "rz"), angles, strict=True))
    if name == "sensor_delay":
        return {"delay": factor * rng.uniform(0.001, 0.003)}
    if name == "clock_drift":
        return {"rate": factor * float(rng.choice([-1, 1])) * rng.uniform(0.003, 0.01)}
    if name == "sensor_highpass":
        return {"frequency": factor * rng.uniform(0.5, 2.0)}
    if name == "sensor_lowpass":
        return {"frequency": rng.uniform(30.0, 60.0) / factor}
    if name == "sensor_clipping":
        return {"limit": (1.0 - factor * rng.uniform(0.3, 0.5)) * size.top[group]}
    if name == "mount_resonance":
        return {"frequency": rng.uniform(60.0, 150.0) / np.sqrt(factor), "damping_ratio": 0.05}
    amplitude = factor * rng.uniform(0.05, 0.1) * size.strength[group]
    return {"amplitude": amplitude, "frequency": float(rng.choice([50.0, 60.0]))}


_BY_TARGET = (
    dict.fromkeys(
        (
            "joint_stiffness", "joint_damping", "joint_inertia", "servo_compliance",
            "transverse_compliance", "backlash", "hardening", "hysteresis", "coulomb_friction",
            "stiffness_drift", "thermal_stiffness",
        ), _joint)
    | dict.fromkeys(
        (
            "modal_damping", "payload", "link_mass", "base_compliance", "tool_offset", "cable",
            "workpiece_contact", "force_amplitude", "force_drift", "pulse_width", "pulse_shape",
            "pulse_rate", "pulse_jitter", "missed_hits", "rebound", "force_direction",
        ), _robot)
    | dict.fromkeys(
        (
            "sensor_gain", "sensor_axes", "sensor_misalignment", "sensor_delay", "clock_drift",
            "sensor_highpass", "sensor_lowpass", "sensor_clipping", "mount_resonance", "mains_hum",
        ), _sensor)
)  # fmt: skip
