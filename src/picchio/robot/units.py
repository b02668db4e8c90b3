"""How a joint's values are written: its kind decides, here and nowhere else."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
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


def shared(units: Iterable[str]) -> str:
    """The unit that most of a column's cells have, for its head; the others carry their own.

    Args:
        units: of each cell.
    """
    return Counter(units).most_common(1)[0][0]


def written(text: str, unit: str, head: str) -> str:
    """A cell of a column: with its unit where that is not the head's.

    Args:
        text: the number.
        unit: the cell's.
        head: the column's.
    """
    return text if unit == head or text == "-" else f"{text} {unit}"
