"""How a joint's values are written: its kind decides, here and nowhere else."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class JointUnits:
    """The units and words of one kind of joint, for people; numbers inside are SI.

    Attributes:
        length: of its position: "rad" or "m".
        small: a thousandth of that: "mrad" or "mm".
        spoken: that in full.
        load: of what it carries: "N m" or "N".
        load_word: "torque" or "force".
    """

    length: str
    small: str
    spoken: str
    load: str
    load_word: str

    def of(self, unit: str) -> str:
        """The unit that stands here in place of a turning joint's.

        Args:
            unit: such as "N*m/rad".
        """
        if self is SLIDING:
            for turning, sliding in _IN_PLACE.items():
                unit = unit.replace(turning, sliding)
        return unit


_IN_PLACE = {"N*m": "N", "N m": "N", "kg*m^2": "kg", "kg m^2": "kg", "rad": "m"}
TURNING = JointUnits("rad", "mrad", "milliradians", "N m", "torque")
SLIDING = JointUnits("m", "mm", "millimetres", "N", "force")


def units_of(kind: str) -> JointUnits:
    """The units of a kind of joint.

    Args:
        kind: "prismatic", or any that turns.
    """
    return SLIDING if kind == "prismatic" else TURNING


def labelled(units: Sequence[str], names: Iterable[str]) -> tuple[str, list[str]]:
    """Names to label an axis or a curve with, over joints of both kinds.

    Args:
        units: of each joint's values.
        names: of the joints.

    Returns:
        the unit that most have, and the names; the others with theirs in brackets.
    """
    head, _ = column(units, units)
    return head, [
        name if unit == head else f"{name} [{unit}]"
        for name, unit in zip(names, units, strict=True)
    ]


def column(units: Sequence[str], texts: Iterable[str]) -> tuple[str, list[str]]:
    """A table's column over joints of both kinds.

    Args:
        units: of each cell.
        texts: the numbers; "-" for none.

    Returns:
        the unit that most cells have, for the column's head, and the cells; those that have another
        unit say so.
    """
    head = Counter(units).most_common(1)[0][0]
    return head, [
        text if unit == head or text == "-" else f"{text} {unit}"
        for text, unit in zip(texts, units, strict=True)
    ]
