"""Cases of a trial: which causes a campaign hides, drawn by a seed.

A case is what `campaign.make` takes, so that a trial stores no more than a kind and a seed.
"""

from __future__ import annotations

import numpy as np

from . import campaign, detect, draw, outside, robots
from .draw_effect import takes
from .effects import EFFECTS
from .errors import STATED
from .world import World, groups_of

KINDS = {
    "null": 0, "single": 1, "pair": 2, "triple": 3, "outside": 1,
    "filter": 1, "rubbing": 1, "hum": 2,
}  # fmt: skip
_TRIES = 50


def causes(kind, seed, robot="fanuc_like_3dof", effect=None, strength="typical", **options):
    """Causes for `campaign.make(robot, seed, ...)` with the same options.

    Args:
        kind: one of `KINDS`: "filter" is a high-pass of 1 to 3 Hz, digital or analogue, of first or
            second order; "rubbing" is little dry friction (2 to 8 N m at blows of 300 N), ideal or
            smoothed; "hum" is mains hum beside another cause.
        seed: of the campaign.
        robot: its name.
        effect: the first cause's, such as when each is to have its share; drawn where None.
        strength: "typical" or "weak".
        **options: as given to `campaign.make`; `sensors` decide which causes can be drawn.

    Returns:
        [(effect, target, parameters)], no two of them on one joint, channel group or base; with a
        `mismatch`, typical ones are at least `LEAST` of their tolerances off.
    """
    nominal = robots.load(robot)
    wrong = options.get("mismatch", 0.0)
    errors = campaign.errors_of(robot, seed, wrong, options.get("only")) if wrong else None
    sensors = options.pop("sensors", ("accelerometer", "deflection"))
    groups = groups_of(sensors, nominal)
    own = {k: v for k, v in options.items() if k not in campaign.NOT_OF_THE_PLAN}
    plan = campaign.plan_of(robot, seed, **own)
    least = LEAST if strength == "typical" and errors is not None else 0.0
    # the published seeds draw from those outside effects that there were then
    beyond = outside.EFFECTS if "mismatch" in options else outside.FIRST
    names = list(beyond if kind == "outside" else EFFECTS)
    rng = np.random.default_rng([seed, 5])
    if kind == "filter":
        return [_filter(rng, groups)]
    if kind == "rubbing":
        return [_rubbing(rng, nominal, draw.sizes(plan))]
    effect = "mains_hum" if kind == "hum" else effect
    out, taken = [], set()
    while len(out) < KINDS[kind]:
        name = effect if effect is not None and not out else str(rng.choice(names))
        if not takes(name, groups):
            if name == effect:
                raise ValueError(f"{name}: no sensor among {groups} can have it")
            continue
        for _ in range(_TRIES):
            target, parameters = draw.draw(name, robot, rng, strength, plan, groups)
            size = in_tolerances((name, target, parameters), errors, nominal)
            if size is None or size >= least:
                break
        else:  # a wide tolerance, drawn to the other side: beyond all that is usual
            key = _OWN[name][0]
            whole = 1.0 + STATED[key] * float(rng.uniform(1.1, 1.4)) * least
            parameters["scale"] = whole / (1.0 + _drawn(name, target, errors, nominal))
        place = {"tool": name, "robot": name}.get(target, target)
        place = "base" if name == "base_compliance" else place
        if name in {cause[0] for cause in out} or place in taken:
            continue
        taken.add(place)
        out.append((name, target, parameters))
    return out


def _filter(rng, groups):
    """A high-pass as data loggers have it."""
    known = [g for g in groups if g.startswith("acceler")] or [g for g in groups if g != "force"]
    return "sensor_highpass", str(rng.choice(known)), {
        "frequency": float(rng.uniform(1.0, 3.0)),
        "order": float(rng.integers(1, 3)),
        "digital": float(rng.integers(0, 2)),
    }  # fmt: skip


def _rubbing(rng, robot, size):
    """Dry friction that is small beside what the blows do."""
    parameters = {"torque": float(rng.uniform(2.0, 8.0)) * robot.force / 300.0}
    if rng.uniform() < 0.5:
        parameters["smoothing"] = 5e-4
    return "coulomb_friction", str(rng.choice(size.active(0.3))), parameters


# Standard deviations of its tolerance that a typical cause is off at the least.
LEAST = 5.0
# Causes that are a tolerance exceeded: its key, and the parameters that say by how much.
_OWN = {
    "joint_stiffness": ("stiffness", ("scale",)),
    "modal_damping": ("damping_ratio", ("scale",)),
    "force_amplitude": ("force", ("scale",)),
    "link_mass": ("link_mass", ("scale",)),
    "sensor_gain": ("sensor_gain", ("gain",)),
    "force_direction": ("direction", ("rx", "ry", "rz")),
    "tool_offset": ("tool_point", ("x", "y", "z")),
    "sensor_misalignment": ("sensor_angle", ("rx", "ry", "rz")),
    "pulse_jitter": ("blow_time", ("std",)),
}


def in_tolerances(cause, errors=None, robot=None):
    """How far off a cause is, in standard deviations of its stated tolerance.

    Args:
        cause: (effect, target, parameters).
        errors: of the campaign; a factor counts together with what was drawn of its tolerance.
        robot: nominal, with the joints' and links' names.

    Returns:
        A number, or None where the cause is not a tolerance exceeded.
    """
    name, target, parameters = cause
    if name not in _OWN:
        return None
    key, own = _OWN[name]
    values = np.array([parameters[p] for p in own])
    if own in (("scale",), ("gain",)):
        drawn = 0.0 if errors is None else _drawn(name, target, errors, robot)
        values = values * (1.0 + drawn) - 1.0
    return float(np.linalg.norm(values)) / STATED[key]


def _drawn(name, target, errors, robot):
    """Of a factor's tolerance, where the cause is."""
    if name == "joint_stiffness":
        return float(errors.stiffness[robot.joints.index(target)])
    if name == "link_mass":
        return float(errors.link_mass[robot.links().index(target)])
    if name == "sensor_gain":
        return errors.sensor_gain(target)
    return {"modal_damping": errors.damping_ratio, "force_amplitude": errors.force}[name]


def is_detectable(truth, snr_db, beyond=10.0):
    """Whether the causes of a made campaign stand out; see `detect.detectability`."""
    world: World = truth["world"]
    groups = tuple(truth["noise"])
    return detect.detectability(world, groups, snr_db)["bic_gain"] > beyond
