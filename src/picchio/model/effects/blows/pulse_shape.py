"""Blows rounder than programmed."""

from __future__ import annotations

from picchio.core.errors import InputError
from picchio.model.blows import Blows
from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect, Parameter
from picchio.model.effects.evidence import LACKING


class PulseShape(Effect):
    """Blows are half-sines, or on the way there, instead of rectangles of the same peak and width.

    `blend` is counted from the programmed shape: 1 turns a rectangle into a half-sine, and a
    half-sine into a rectangle.
    """

    name = "pulse_shape"
    where = "blows"
    target_kind = "tool"
    parameters = (
        Parameter("blend", lower=-0.2, upper=1.2, meaning="0 as programmed, 1 the other shape"),
    )
    meaning = "the blows have another shape than programmed"
    takes = "reshaped"
    tried = ({"blend": 1.0},)

    def blows(self, blows: Blows, conditions: Conditions) -> Blows:
        """Blend the shapes.

        Raises:
            InputError: blows whose kind knows no other shape.
        """
        blend = self.values["blend"]
        if blend and blows.other is None:
            raise InputError(LACKING["reshaped"], key=self.name)
        return blows.change(blend=blows.blend + blend * (1.0 - 2.0 * blows.blend))
