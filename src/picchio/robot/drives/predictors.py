"""What a URDF says of each drive: the inertia and the weight that it moves, levers, limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from picchio.core import spoken
from picchio.core.errors import InputError
from picchio.robot.spread import is_estimate

if TYPE_CHECKING:
    from picchio.robot.flexible_robot import FlexibleRobot

Array = NDArray[np.float64]

QUANTITIES = (
    "inertia",
    "gravity_torque",
    "lever",
    "effort",
    "speed",
    "payload",
)
"""What is read of a joint, in the order of the columns; `meaning` has it in words."""
OF_STIFFNESS = ("inertia", "gravity_torque", "payload")
"""Of these, what predicts the stiffness. Levers and limits made the prediction worse, as robots
that were left out tell (`python benchmarks/drive_priors.py --nested`)."""
OF_EFFORT = ("inertia", "gravity_torque", "lever", "speed", "payload")
"""What predicts an effort limit that is not known."""

meaning = {
    "inertia": "the inertia it carries when the arm is stretched",
    "gravity_torque": "the arm's own weight that it holds when stretched",
    "lever": "the tool's distance from its axis",
    "effort": "its effort limit",
    "speed": "its speed limit",
    "payload": "the robot's payload",
}

_POSES, _SEED = 400, 0
_WRIST = 3  # axes of a wrist: the last ones of an arm that has more than twice as many or as many
_NOTHING = 1e-6  # below this share of the robot's largest, a torque or lever is rounding


@dataclass(frozen=True, eq=False)
class Predictors:
    """What is known of n joints, from the base to the tool.

    Attributes:
        names: of the joints.
        values: (n, 6) natural logarithms in the order of `QUANTITIES`: kg m^2, N m, m, N m, rad/s,
            kg; NaN where not known.
        place: (n, 2) zeros and ones: the first joint, a joint of the wrist.
        refused: why an effort limit that the file gives is no evidence, by joint.
    """

    names: tuple[str, ...]
    values: Array
    place: Array
    refused: Mapping[str, str] = field(default_factory=dict)


def places(joints: int) -> Array:
    """The places of an arm's joints in its chain, (n, 2): the first joint, those of the wrist.

    The last three of six joints or more are a wrist's.

    Args:
        joints: n, from the base to the tool.
    """
    index = np.arange(joints)
    wrist = (index >= joints - _WRIST) & (joints >= 2 * _WRIST)
    return np.stack([index == 0, wrist], axis=1).astype(float)


def predictors(
    robot: FlexibleRobot, payload: float | None = None, reach: float | None = None
) -> Predictors:
    """What a loaded robot says of the rotary joints that move its tool.

    Inertia is the largest diagonal entry of the mass matrix, gravity's torque and the tool's
    distance from the axis the largest magnitudes, over 400 poses within the limits (within half a
    turn where there are none). Of a wrist, inertia and gravity's torque are left out: what a URDF
    has there depends on the tool, and often on the wrist, that it leaves out. A limit of zero is
    one that the file does not know, and so are those that `placeholders` refuses. The payload is
    the robot's: it stands with the first joint, once.

    Args:
        robot: it may be rigid.
        payload: kg, the robot's rated payload.
        reach: m, the tool's largest distance from the first axis, where the URDF's is not right:
            all levers scale with it.

    Returns:
        the joints' logarithms.

    Raises:
        InputError: no rotary joint moves the tool; payload or reach not positive.
    """
    for key, value in (("payload", payload), ("reach", reach)):
        if value is not None and not (np.isfinite(value) and value > 0.0):
            raise InputError("must be positive", key=key, value=value)
    rigid, frame = robot.rigid, robot.rigid.frame(robot.tool_point)
    inertia, gravity, lever, turn = (np.zeros(rigid.nv) for _ in range(4))
    for pose in _drawn_poses(robot):
        jacobian = rigid.jacobian(pose, frame)
        inertia = np.maximum(inertia, np.diag(rigid.mass_matrix(pose)))
        gravity = np.maximum(gravity, np.abs(rigid.gravity_torque(pose)))
        lever = np.maximum(lever, np.linalg.norm(jacobian[:3], axis=0))
        turn = np.maximum(turn, np.linalg.norm(jacobian[3:], axis=0))
    chain = np.flatnonzero(turn > 0.5)  # a rotary joint turns the tool by as much as itself
    if not len(chain):
        raise InputError("no rotary joint moves the tool, and no other kind of drive was measured",
                         key="tool", value=robot.tool_frame)  # fmt: skip
    names = tuple(rigid.joint_names[k] for k in chain)
    joints = [robot.tree.joints[name] for name in names]
    place = places(len(names))
    refused = placeholders(robot)
    wrist = place[:, 1] > 0.0
    lever = lever[chain] * (1.0 if reach is None else reach / lever[chain].max())
    columns = np.stack(
        [
            np.where(wrist, 0.0, inertia[chain]),
            np.where(wrist | (gravity[chain] < _NOTHING * gravity.max()), 0.0, gravity[chain]),
            np.where(lever < _NOTHING * lever.max(), 0.0, lever),
            [0.0 if joint.name in refused else joint.effort for joint in joints],
            [joint.velocity for joint in joints],
            place[:, 0] * (payload or 0.0),
        ],
        axis=1,
    )
    known = (columns > 0.0) & np.isfinite(columns)
    values = np.full(columns.shape, np.nan)
    values[known] = np.log(columns[known])
    return Predictors(
        names, values, place, {name: refused[name] for name in names if name in refused}
    )


def placeholders(robot: FlexibleRobot) -> dict[str, str]:
    """The effort limits that somebody filled in so that the file could be read.

    They are evidence together or not at all, since one hand wrote them: a number that stands at
    every joint tells nothing of any, and a file in which a joint could not hold the arm's own
    links (without tool and gun; over 400 poses within the limits) does not know its drives.

    Args:
        robot: it may be rigid.

    Returns:
        why, by joint that moves the tool, rotary and sliding ones apart; empty where the limits
        may stand.
    """
    chain = [
        joint for joint in robot.tree.chain(robot.tool_frame) if joint.name in robot.joint_names
    ]
    # An estimated weight is no evidence against a limit.
    masses = (text for key, text in robot.origins.items() if key.endswith(".mass"))
    weighed = not any(map(is_estimate, masses))
    own = dict(zip(robot.joint_names, _own_weight(robot) * weighed, strict=True))
    found: dict[str, str] = {}
    for slides in (False, True):
        given = [joint for joint in chain if (joint.type == "prismatic") == slides
                 and 0.0 < joint.effort < np.inf]  # fmt: skip
        unit = "N" if slides else "N m"
        weak = [joint for joint in given if joint.effort < own[joint.name]]
        # Of a lone joint, the rest of the file tells.
        every = [joint for joint in robot.tree.joints.values()
                 if (joint.type == "prismatic") == slides]  # fmt: skip
        rest = [joint.effort for joint in every if 0.0 < joint.effort < np.inf]
        alike = [joint.effort for joint in given] if len(given) > 1 else rest
        if given and len(alike) > 1 and len(set(alike)) == 1:
            why = f"{given[0].effort:g} {unit} stands at every joint: a placeholder"
        elif weak:
            worst = max(weak, key=lambda joint: own[joint.name] / joint.effort)
            why = (
                f"{worst.name} could not hold the arm's own links: they take "
                f"{spoken.number(own[worst.name])} {unit}, and its limit is {worst.effort:g} {unit}"
            )
        else:
            continue
        found |= {joint.name: why for joint in given}
    return found


def _own_weight(robot: FlexibleRobot) -> Array:
    """What each joint holds of the arm alone at most, (nv,) N m or N."""
    load = robot.tool.mass + (robot.gun.mass if robot.gun else 0.0)
    frame = robot.rigid.frame(robot.tool_point)
    pull = load * np.array(robot.mounting.gravity)
    most = np.zeros(robot.rigid.nv)
    for pose in _drawn_poses(robot):
        torque = robot.rigid.gravity_torque(pose)
        if load:
            torque = torque + robot.rigid.jacobian(pose, frame)[:3].T @ pull
        most = np.maximum(most, np.abs(torque))
    return most


def _drawn_poses(robot: FlexibleRobot) -> Array:
    """400 poses within the limits, (400, nv); within half a turn where there are none."""
    lower = np.where(np.isfinite(robot.lower), robot.lower, -np.pi)
    upper = np.where(np.isfinite(robot.upper), robot.upper, np.pi)
    rng = np.random.default_rng(_SEED)
    poses: Array = lower + (upper - lower) * rng.random((_POSES, robot.rigid.nv))
    return poses
