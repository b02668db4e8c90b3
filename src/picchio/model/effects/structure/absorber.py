"""A mass that hangs at a link on a spring of its own."""

from __future__ import annotations

from collections.abc import Sequence

from picchio.model.effects.effect import Effect, Parameter
from picchio.model.effects.evidence import Evidence
from picchio.model.effects.scales import Scales
from picchio.model.effects.structure import yielding
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
        Parameter("stiffness", "N/m", neutral=float("inf"), lower=1e-3, upper=1e12,
                  logarithmic=True, meaning="of what holds it"),
        Parameter("damping", "N*s/m", lower=1e-9, upper=1e9, logarithmic=True,
                  meaning="of what holds it"),
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
            names = ("mass", "stiffness", "damping")
            plant.add_hanging(self.target, *(self.values[name] for name in names))

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """One per cent of what moves, at 8, 12, 18 and 27 Hz: a resonance is narrow."""
        return self._swinging(scales, (50.0, 75.0, 113.0, 170.0))

    def early_trials(self, scales: Scales) -> list[dict[str, float]]:
        """From 6 to 60 Hz, a fifth apart."""
        return self._swinging(scales, [38.0 * 1.2**i for i in range(13)])

    def _swinging(self, scales: Scales, rates: Sequence[float]) -> list[dict[str, float]]:
        m = 0.01 * scales.mass
        return [{"mass": m, "stiffness": m * w * w, "damping": 0.08 * m * w} for w in rates]
