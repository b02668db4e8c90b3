"""A mass that hangs at a link on a spring of its own."""

from __future__ import annotations

import math
from collections.abc import Sequence

from picchio.model.effects.effect import Effect, Parameter
from picchio.model.effects.evidence import Evidence
from picchio.model.effects.scales import Scales
from picchio.model.effects.structure.springs import yielding
from picchio.model.plant import Changes


class Absorber(Effect):
    """A mass at a link's origin, or the tool frame's, that a spring and a damper hold.

    They are the same in all directions; the mass has three coordinates of its own.
    """

    name = "absorber"
    where = "structure"
    target_kind = "link"
    parameters = (
        Parameter("mass", "kg", lower=0.0, upper=1e4, meaning="that swings"),
        # Faster than that it is a mass that moves with the link: a payload.
        Parameter("frequency", "Hz", neutral=10.0, lower=0.5, upper=40.0, logarithmic=True,
                  meaning="at which it swings where the link stands still"),
        Parameter("damping_ratio", neutral=0.04, lower=1e-4, upper=0.7, logarithmic=True,
                  meaning="of that swing"),
        yielding.MODAL_SHARE,
    )  # fmt: skip
    meaning = "a hose or a tool pack swings on a spring of its own"
    mark = "hose"
    source = "Den Hartog, Mechanical Vibrations, 4th ed. 1956, sec. 3.2"

    @classmethod
    def targets(cls, evidence: Evidence) -> list[str]:
        """The link that carries the tool: what hangs elsewhere hardly swings."""
        robot = evidence.robot
        return [robot.link_of(robot.tool_frame)]

    def structure(self, plant: Changes) -> None:
        """Hang the mass."""
        if self.values["mass"] > 0.0:
            plant.modal_share = self.values["modal_share"]
            mass, w = self.values["mass"], 2.0 * math.pi * self.values["frequency"]
            drag = 2.0 * self.values["damping_ratio"] * mass * w
            plant.add_hanging(self.target, mass, mass * w * w, drag)

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """One per cent of what moves, at four frequencies: a resonance is narrow."""
        return self._swinging(scales, (8.0, 12.0, 18.0, 27.0))

    def early_trials(self, scales: Scales) -> list[dict[str, float]]:
        """From 5 to 37 Hz, a fifth apart."""
        return self._swinging(scales, [5.0 * 1.2**i for i in range(12)])

    def _swinging(self, scales: Scales, rates: Sequence[float]) -> list[dict[str, float]]:
        return [{"mass": 0.01 * scales.mass, "frequency": f} for f in rates]
