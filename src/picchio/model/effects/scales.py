"""How large things are in a campaign, so that an effect can be tried at a size that matters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Scales:
    """Sizes seen in the baseline's prediction of a campaign.

    Attributes:
        stiffness: joint -> N m/rad.
        inertia: joint -> kg m^2, the mass matrix's diagonal, mean over the poses.
        deflection: joint -> rad, largest.
        rate: joint -> rad/s, largest.
        gravity: joint -> N m, smallest gravity torque over the poses, absolute.
        mass: kg, of all that moves.
        compliance: m/N, of the tool along the blows, mean.
        travel: m, of the tool along the blow, largest.
        force: N, of the blows.
        period: s.
        width: s.
        days: over which the records are spread.
        kelvin: over which their temperatures are spread.
        reading: channel group -> (RMS, largest) in its unit.
        step: s, between samples.
        link_stiffness: link -> N/m, static stiffness at the link's origin, mean.
    """

    stiffness: Mapping[str, float]
    inertia: Mapping[str, float]
    deflection: Mapping[str, float]
    rate: Mapping[str, float]
    gravity: Mapping[str, float]
    mass: float
    compliance: float
    travel: float
    force: float
    period: float
    width: float
    days: float
    kelvin: float
    reading: Mapping[str, tuple[float, float]]
    step: float
    link_stiffness: Mapping[str, float]
