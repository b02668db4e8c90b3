"""Nonlinear elements between two sides of a joint, or between tool and workpiece.

Each is a kind and at most six numbers, so that compiled code can take a list of them; the forces
are in `picchio.vibration.integration.element_kernel`.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum


class ElementKind(IntEnum):
    """What an element does."""

    BACKLASH = 0
    CUBIC = 1
    BOUC_WEN = 2
    COULOMB = 3
    CONTACT = 4


@dataclass(frozen=True)
class Element:
    """One nonlinear element.

    Attributes:
        kind: what it does.
        parameters: BACKLASH: stiffness, gap, rest deflection, rest torque; CUBIC: N m/rad^3;
            BOUC_WEN: torque, yield deflection; COULOMB: torque; CONTACT: stiffness, damping,
            preload. SI.
    """

    kind: ElementKind
    parameters: tuple[float, ...]
