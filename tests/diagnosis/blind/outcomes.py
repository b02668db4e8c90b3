"""What a verdict is worth in a world that is a little wrong everywhere.

- right: the claimed set, or one of at most three alternatives, is what was hidden, each cause up to
  what no record of the campaign tells it from, and perhaps a tolerance truly exceeded; with nothing
  hidden, `nothing-wrong`; where the true cause is not in the catalogue, `unexplained`.
- wrong: a cause is claimed (`named`, `partial`) that is neither hidden, nor in the class of one
  that is, nor a tolerance truly exceeded.
- undecided: the rest.
"""

from __future__ import annotations

from itertools import permutations

import numpy as np
from scipy.spatial.transform import Rotation

from picchio.model.effects.registry import catalogue
from worlds import errors

CLAIMS = ("named", "partial")
MOST = 3  # alternatives, for one of them to count
EXCEEDED = 3.8  # standard deviations beyond which a tolerance is a cause
# Of one target: what says the same of it, the first in other words.
SAME = (
    {"payload", "payload_body"},
    {"link_mass", "link_inertia"},
    {"joint_stiffness", "servo_compliance"},  # a motor without inertia that yields
    {"sensor_axes", "sensor_misalignment"},
)
# A tolerance -> the effects that a cause is called when it is exceeded, beside its own name.
CALLED = {
    "stiffness": {"joint_stiffness"},
    "damping_ratio": {"modal_damping"},
    "damping_by_mode": {"modal_damping"},
    "force": {"force_amplitude"},
    "link_mass": {"link_inertia"},
    "link_com": {"link_inertia"},
    "direction": {"force_direction"},
    "tool_point": {"tool_offset"},
    "sensor_angle": {"sensor_misalignment"},
    "blow_time": {"pulse_jitter"},
}
# Drawn for every pose or record, where a cause has one target for all of them.
_MANY = ("damping_by_mode", "pose_repeat", "direction", "blow_force", "blow_time")


def in_series(first="joint_1"):
    """Springs one above the other about one axis, of which no sensor at the tool tells one.

    The first joint's bearing yields as the floor under it tilts.

    Args:
        first: the first joint's name.
    """
    return (
        {("base_compliance", "rz"), ("servo_compliance", first), ("joint_stiffness", first)},
        {("transverse_compliance", first), ("base_compliance", "rx"), ("base_compliance", "ry")},
    )


def alike(one, other, groups, first="joint_1"):
    """Whether no record of a campaign tells two causes, (effect, target) each, from each other.

    Args:
        one, other: (effect, target).
        groups: channel groups that are measured.
        first: the first joint's name.
    """
    if one == other or any({one, other} <= pairs for pairs in in_series(first)):
        return True
    if one[1] == other[1] and any({one[0], other[0]} <= names for names in SAME):
        return True
    # one sensor cannot tell its own gain from the force's
    seen = [group for group in groups if group != "force"]
    twins = {("force_amplitude", "tool"), *(("sensor_gain", group) for group in seen)}
    return len(seen) == 1 and {one, other} <= twins


def same_set(claimed, true, groups, first="joint_1"):
    """Whether two sets of causes say the same; groups and first joint as in `alike`."""
    claimed, true = sorted(map(tuple, claimed)), sorted(map(tuple, true))
    return len(claimed) == len(true) and any(
        all(alike(a, b, groups, first) for a, b in zip(order, true, strict=True))
        for order in permutations(claimed)
    )


def judge(case, truth, row):
    """What is added to a row of `trial.judge`: outcome, false and exceeded.

    Args:
        case: as in `trial`.
        truth: of its campaign.
        row: verdict, claimed, alternatives.
    """
    groups, first = tuple(truth["noise"]), next(iter(truth["nuisances"]["stiffness"]))
    # What is outside the catalogue, or left out of it, is not in it, whatever it has learnt since.
    known = () if case["kind"] in ("outside", "left-out") else catalogue()
    causes = [(c["effect"], c["target"]) for c in truth["causes"]]
    hidden = [cause for cause in causes if cause[0] in known]
    beyond = errors.beyond(truth["errors"], EXCEEDED)

    def is_hidden(cause):
        return any(alike(cause, true, groups, first) for true in hidden)

    def exceeded(cause):
        return any(_is(cause, key, target) for key, target, _ in beyond)

    claimed = [tuple(cause) for cause in row["claimed"]]
    false = [list(cause) for cause in claimed if not (is_hidden(cause) or exceeded(cause))]
    alternatives = row.get("alternatives", [])
    sets = [claimed, *(alternatives if len(alternatives) <= MOST else [])]
    # A tolerance that is truly exceeded is a part of the truth, too; it need not be claimed.
    sets = [
        [cause for cause in map(tuple, each) if is_hidden(cause) or not exceeded(cause)]
        for each in sets
    ]
    outcome = "undecided"
    if row["verdict"] in CLAIMS and false:
        outcome = "wrong"
    elif not truth["causes"]:
        outcome = "right" if row["verdict"] == "nothing-wrong" else "undecided"
    elif not hidden:
        outcome = "right" if row["verdict"] == "unexplained" else "undecided"
    elif row["verdict"] not in ("nothing-wrong", "unexplained"):
        outcome = (
            "right" if any(same_set(each, hidden, groups, first) for each in sets) else outcome
        )
    return {
        "outcome": outcome,
        "false": false,
        "exceeded": [[key, str(target), round(size, 2)] for key, target, size in beyond],
    }


def known(diagnosis, robot, truth):
    """By how many of its standard deviations each stiffness and the damping told is off.

    Args:
        diagnosis: whose fitted nuisances are judged; causes are judged elsewhere.
        robot: as its files have it.
        truth: of the campaign.
    """
    drawn = truth["nuisances"]
    true = {
        f"stiffness.{joint.name}": joint.stiffness * drawn["stiffness"][joint.name]
        for joint in robot.flexible_joints
    }
    true["damping_ratio"] = float(np.mean(robot.damping_ratio)) * drawn["damping_ratio"]
    for cause in truth["causes"]:  # whose own value is judged
        true.pop({"joint_stiffness": f"stiffness.{cause['target']}",
                  "modal_damping": "damping_ratio"}.get(cause["effect"]), None)  # fmt: skip
    return {
        name: round((value.value - true[name]) / value.std, 3)
        for name, value in diagnosis.nuisances.items()
        if name in true and value.std > 0.0
    }


def _is(cause, key, target):
    """Whether a cause is a tolerance, exceeded."""
    effect, where = cause
    if effect != key and effect not in CALLED.get(key, ()):
        return False
    return key in _MANY or target in (where, "robot", "tool")


def true_value(cause, parameter, truth):
    """What a parameter of a cause truly is, with what was drawn of the same thing's tolerance.

    Args:
        cause: of `truth["causes"]`.
        parameter: its name.
        truth: of the campaign.
    """
    effect, target, values = cause["effect"], cause["target"], cause["parameters"]
    value, nuisances, drawn = float(values[parameter]), truth["nuisances"], truth["errors"]
    if parameter == "scale":
        factor = {
            "joint_stiffness": nuisances["stiffness"].get(target, 1.0),
            "modal_damping": nuisances["damping_ratio"],
            "force_amplitude": nuisances["force"],
            "link_mass": 1.0 + drawn.get("link_mass", {}).get(target, 0.0),
        }
        return value * factor.get(effect, 1.0)
    if drawn and effect == "sensor_gain":
        return value * (1.0 + drawn["sensor_gain"][target])
    if drawn and effect == "tool_offset":
        return value + drawn["tool_point"]["tool"]["xyz".index(parameter)]
    if drawn and effect == "sensor_misalignment":
        own = Rotation.from_rotvec([values[name] for name in ("rx", "ry", "rz")])
        both = own * Rotation.from_rotvec(np.array(drawn["sensor_angle"][target]))
        return float(both.as_rotvec()[("rx", "ry", "rz").index(parameter)])
    return value
