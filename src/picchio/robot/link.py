"""What a sidecar says of the links' masses."""

from __future__ import annotations

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from picchio.core.arrays import symmetric
from picchio.core.toml import Finite, FiniteVector, NotNegative, Positive, StrictModel
from picchio.robot.spread import with_spreads


def _can_be(six: tuple[float, ...]) -> tuple[float, ...]:
    principal = np.linalg.eigvalsh(symmetric(six))
    if principal[0] < -1e-9 * max(abs(principal).max(), 1e-12):
        raise ValueError("the inertia is not positive semidefinite")
    return six


LIGHTEST, HEAVIEST = 1e-6, 1e6  # kg: beyond any part of a robot on either side


def _in_kilograms(value: float) -> float:
    if value != 0.0 and not LIGHTEST <= value <= HEAVIEST:
        raise ValueError(f"is neither 0 nor within {LIGHTEST:g} to {HEAVIEST:g} kg")
    return value


Mass = Annotated[NotNegative, AfterValidator(_in_kilograms)]
SixInertias = Annotated[
    tuple[Finite, ...], Field(min_length=6, max_length=6), AfterValidator(_can_be)
]
"""ixx, ixy, ixz, iyy, iyz, izz of a body, kg m^2: those of some body."""


@with_spreads
class LinkEntry(StrictModel):
    """One link's mass, in place of the URDF's.

    Attributes:
        mass: kg, and alone, the URDF's inertia grows or shrinks with it.
        com: m, centre of mass in the link's frame.
        inertia: kg m^2, about the centre of mass, along the link's axes: ixx, ixy, ixz, iyy, iyz,
            izz.
        source: where the values come from.
        estimated: true if the values were not measured.
    """

    mass: Mass | None = None
    com: FiniteVector | None = None
    inertia: SixInertias | None = None
    source: str | None = None
    estimated: bool = False

    @model_validator(mode="after")
    def _says_something(self) -> Self:
        if self.model_fields_set <= {"source", "estimated"}:
            raise ValueError("give mass, com or inertia")
        return self


class LinkMasses(StrictModel):
    """A total mass, spread over the links by the volume of their shapes.

    Attributes:
        total_mass: kg, of the whole robot, its base included, as data sheets give it.
        shapes: whose volume counts: "collision" or "visual", the convex hull of each.
        source: where the mass comes from.
    """

    total_mass: Positive
    shapes: Literal["collision", "visual"] = "collision"
    source: str | None = None
