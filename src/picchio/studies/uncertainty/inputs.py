"""What is uncertain of a robot at work: how much each value varies, and who says so."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from picchio.core.errors import InputError
from picchio.fatigue.uncertain_lives import Uncertain
from picchio.model.model import Model
from picchio.robot.spread import Spread
from picchio.studies.rivet.variation import WornParts
from picchio.studies.tasks import Task

# Relative, as the campaign's tolerances; the width and the model's error are judgements.
DEFAULT_INPUTS: dict[str, Uncertain] = {
    "stiffness": Uncertain(1.0, 0.05),
    "damping_ratio": Uncertain(1.0, 0.20),
    "force": Uncertain(1.0, 0.05),
    "width": Uncertain(1.0, 0.05),
    "model": Uncertain(1.0, 0.10),
}


def default_inputs(task: Task) -> dict[str, Uncertain]:
    """`DEFAULT_INPUTS`, without the width where a blow of the task states none.

    Args:
        task: the work.

    Returns:
        the factors by name.
    """
    known = all(operation.excitation.width is not None for operation in task.operations)
    return {name: each for name, each in DEFAULT_INPUTS.items() if known or name != "width"}


@dataclass(frozen=True)
class Input:
    """One thing that varies.

    Attributes:
        name: as results call it.
        uncertain: its distribution.
        source: where its spread is from.
        key: one of `OF_JOINTS`, or what is varied as a whole.
        joints: the flexible joints whose key it is; empty for what has no joint.
        spread: a value that needs another robot; None otherwise.
        estimated: an estimate without a stated spread.
    """

    name: str
    uncertain: Uncertain
    source: str
    key: str
    joints: tuple[int, ...] = ()
    spread: Spread | None = None
    estimated: bool = False


_OF_A_JOINT = {("stiffness",): "stiffness", ("damping_ratio",): "damping_ratio",
               ("shaft", "radius"): "radius",
               ("strength", "repeated_peak_torque"): "bears"}  # fmt: skip
OF_JOINTS = tuple(_OF_A_JOINT.values())
"""What of a joint is varied by a factor, without another robot."""
# What no life depends on; a drive's momentary peak goes with its repeated one.
_IDLE = {("strength", "rated_torque"), ("strength", "momentary_peak_torque")}


def inputs_of(
    model: Model,
    task: Task,
    stress: WornParts,
    given: Mapping[str, Uncertain] | None,
    notes: list[str],
) -> tuple[Input, ...]:
    """What varies: what is asked for, what the robot's files state, and the curves' scatter.

    Args:
        model: the robot and its effects.
        task: its work.
        stress: the joints with shafts, and their curves.
        given: what is asked for, by name; the defaults where None.
        notes: what is left out is added to these.

    Raises:
        InputError: something is asked for that nothing is called.
    """
    robot = model.robot
    default = default_inputs(task)
    asked = dict(default if given is None else given)

    def source(name: str) -> str:
        same = asked.get(name) == DEFAULT_INPUTS.get(name)
        return "picchio's default" if same else "as asked for"

    said = {name: source(name) for name in asked}
    if "width" not in asked and "width" not in default:
        notes.append("blows that state no width keep theirs")
    own = dict(robot.spreads)
    for joint in robot.flexible_joints:
        for key in ("stiffness", "damping_ratio"):
            each = Spread("joint", joint.name, (key,), getattr(joint, key), 0.0, True)
            if each.name in asked:
                own.setdefault(each.name, each)
    found = []
    taken: dict[str, set[int]] = {"stiffness": set(), "damping_ratio": set()}
    index = {joint.name: j for j, joint in enumerate(robot.flexible_joints)}
    for name, spread in own.items():
        if spread.path in _IDLE:
            continue
        shape = "lognormal" if spread.log else "absolute"
        middle = 1.0
        if not spread.log:
            value = spread.value
            middle = value[spread.component or 0] if isinstance(value, tuple) else value
        uncertain = Uncertain(middle, spread.size, shape)  # type: ignore[arg-type]
        replaced = asked.pop(name, None)
        told = replaced or uncertain
        part = _OF_A_JOINT.get(spread.path) if spread.table == "joint" else None
        where = said[name] if replaced else spread.source
        guess = spread.estimated and replaced is None
        if part is None:
            found.append(Input(name, told, where, name, (), spread, guess))
            continue
        taken.setdefault(part, set()).add(index[spread.owner])
        found.append(Input(name, told, where, part, (index[spread.owner],), None, guess))
    for name, uncertain in asked.items():
        if name not in DEFAULT_INPUTS:
            choices = [*DEFAULT_INPUTS, *own, *(f"stiffness.{j}" for j in index)]
            raise InputError("unknown input", key="inputs", value=name,
                             choices=dict.fromkeys(choices))  # fmt: skip
        others = tuple(j for j in index.values() if j not in taken.get(name, ()))
        if name in taken:
            if not others:
                continue
            found.append(Input(name, uncertain, said[name], name, others))
        else:
            found.append(Input(name, uncertain, said[name], name))
    if any(curve.scatter for curve in stress.curves):
        # A rank: ln of it is the specimen's standard normal score; each curve has its scatter.
        found.append(
            Input("strength", Uncertain(1.0, 1.0), "scatter of the S-N curves", "strength")
        )
    return tuple(found)
