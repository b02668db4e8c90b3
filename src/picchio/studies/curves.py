"""Which S-N curve belongs to which joint."""

from __future__ import annotations

from picchio.fatigue import DEFAULT_SN_CURVE, SNCurve, load_sn_curve
from picchio.robot import FlexibleRobot


def curves_of(
    robot: FlexibleRobot, override: str | SNCurve | None = None
) -> tuple[SNCurve | None, ...]:
    """The S-N curve of every flexible joint; None for a joint without a shaft.

    Args:
        robot: whose shafts name their curves; one that names none has the default.
        override: a curve, its name or its file, for all joints.

    Raises:
        InputError: an unknown name, or a file that is missing or wrong.
    """
    loaded: dict[str, SNCurve] = {}
    curves: list[SNCurve | None] = []
    for joint in robot.flexible_joints:
        if joint.shaft is None:
            curves.append(None)
        elif isinstance(override, SNCurve):
            curves.append(override)
        else:
            name = override or joint.shaft.sn_curve or DEFAULT_SN_CURVE
            if name not in loaded:
                loaded[name] = load_sn_curve(name)
            curves.append(loaded[name])
    return tuple(curves)
