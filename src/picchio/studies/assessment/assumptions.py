"""What an assessment takes for granted, a sentence each, to print with its result."""

from __future__ import annotations

from picchio.fatigue.reducer import Reducer
from picchio.fatigue.sn.curve import SNCurve
from picchio.model.model import Model
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.studies.rivet.life_rules import LifeRule


def assumptions_of(
    rule: LifeRule,
    model: Model,
    curves: tuple[SNCurve | None, ...],
    reducers: tuple[Reducer | None, ...],
) -> tuple[str, ...]:
    """Every assumption behind a result, estimates and defaults of the robot among them."""
    described = [curve.describe() for curve in dict.fromkeys(c for c in curves if c is not None)]
    named = [r for r in dict.fromkeys(reducers) if r is not None]
    unchecked = [
        joint.name
        for joint, reducer in zip(model.robot.flexible_joints, reducers, strict=True)
        if reducer is None
    ]
    lines = [
        f"gravity stiffness {'on' if model.gravity_stiffness else 'off'}",
        *(
            ("gravity is balanced: it leaves no torque in the joints",)
            if model.gravity_balanced
            else ()
        ),
        "the motor side of every joint stands still while the tool hits",
        *(f"the model has the effect {effect!r}" for effect in model.effects),
        *model.without_load(),
        *_estimates(model.robot),
        *(rule.assumptions() if described else ("each rivet starts from rest and rings down",)),
        *(f"S-N curve {text}" for text in described),
    ]
    if named:
        lines += [
            "reducers: the peak torque of gravity and blows against the catalogue's limits for "
            "repeated and momentary peaks, gravity's torque against the rated torque; a joint that "
            "stands still under blows risks false brinelling, which no catalogue covers",
            *(f"reducer {r.name}: {r.manufacturer}, {r.kind}; {r.source}" for r in named),
        ]
    if unchecked:
        lines.append(f"no reducer is checked in {', '.join(unchecked)}: none is named or known")
    return tuple(lines)


def _estimates(robot: FlexibleRobot) -> list[str]:
    """What of the robot is an estimate or a default, one line a source."""
    said: dict[str, list[str]] = {}
    for joint in robot.flexible_joints:
        if joint.estimated:
            source = robot.origins.get(f"{joint.name}.stiffness", "marked as an estimate")
            said.setdefault(f"stiffness is an estimate ({source})", []).append(joint.name)
        damping = robot.origins.get(f"{joint.name}.damping_ratio", "")
        if "default" in damping:
            text = f"damping ratio {joint.damping_ratio:g} is assumed ({damping})"
            said.setdefault(text, []).append(joint.name)
    return [f"{', '.join(names)}: {text}" for text, names in said.items()]
