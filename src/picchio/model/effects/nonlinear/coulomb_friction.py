"""Dry friction in a joint."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from picchio.model.effects.effect import Effect, Parameter
from picchio.model.effects.scales import Scales
from picchio.model.motion import TORQUE, Motion
from picchio.model.plant import Changes
from picchio.model.system import ElementKind


class CoulombFriction(Effect):
    """A torque against the deflection's rate, whatever its size; the joint sticks below it."""

    name = "coulomb_friction"
    where = "nonlinear"
    target_kind = "joint"
    parameters = (
        Parameter(
            "torque", "N*m", lower=0.0, upper=1e6, meaning="friction (N for a prismatic joint)"
        ),
        Parameter(
            "smoothing",
            "rad/s",
            lower=0.0,
            upper=5e-3,
            meaning="rate below which it fades",
            size=1e-3,
        ),
    )
    linear = ("torque",)
    meaning = "dry friction between link and motor side"
    urdf: ClassVar[Mapping[str, str]] = {"friction": "torque"}
    motion_meaning = (
        "dry friction between motor and link; a motion does not tell on which side of the gear"
    )
    usual = 2

    def structure(self, plant: Changes) -> None:
        """Add the friction."""
        torque, smoothing = self.values["torque"], self.values["smoothing"]
        plant.add_element(self.target, ElementKind.COULOMB, torque, smoothing)

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """A twentieth of the spring's largest torque, and a fifth of that; ideal and smoothed."""
        torque = scales.stiffness[self.target] * scales.deflection[self.target]
        smooth = min(0.2 * scales.rate[self.target], 5e-4)
        return [
            {"torque": 0.05 * torque},
            {"torque": 0.01 * torque},
            {"torque": 0.05 * torque, "smoothing": smooth},
        ]

    def motion(self, motion: Motion) -> None:
        """Add it to the drive's torque, against the velocity."""
        friction = self.values["torque"] * motion.direction(self.target)
        motion.add(TORQUE, self.target, friction)
