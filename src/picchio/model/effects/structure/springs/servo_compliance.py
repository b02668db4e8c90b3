"""The motor side of a joint yields."""

from __future__ import annotations

from collections.abc import Sequence

from picchio.model.effects.effect import Effect, Parameter
from picchio.model.effects.scales import Scales
from picchio.model.effects.structure.springs import yielding
from picchio.model.plant import Changes


class ServoCompliance(Effect):
    """The motor side is held by a servo of finite stiffness, and has the rotor's inertia.

    B th'' + d th' + k_servo th = k (x - th); the joint's deflection is x - th.
    """

    name = "servo_compliance"
    where = "structure"
    target_kind = "joint"
    parameters = (
        yielding.stiffness("of the servo, after the gear", upper=1e12),
        Parameter("rotor_inertia", "kg*m^2", lower=1e-9, upper=1e5, logarithmic=True,
                  meaning="after the gear"),
        yielding.damping("of the servo, after the gear", upper=1e7),
        yielding.MODAL_SHARE,
    )  # fmt: skip
    meaning = "the drive does not hold its side of the spring: servo or brake yields"
    mark = "spring"
    source = "Spong, J. Dyn. Sys. Meas. Control 109 (1987) 310, doi:10.1115/1.3143860"

    def structure(self, plant: Changes) -> None:
        """Add the motor side as a coordinate."""
        plant.modal_share = self.values["modal_share"]
        values = self.values
        plant.add_motor(
            self.target, values["rotor_inertia"], values["stiffness"], values["damping"]
        )

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """A servo some times stiffer than the spring, with light and heavy rotors."""
        return self._servos(scales, (6.0,))

    def early_trials(self, scales: Scales) -> list[dict[str, float]]:
        """Twice to fifty times as stiff as the spring."""
        return self._servos(scales, [2.0 * 1.9**i for i in range(6)])

    def _servos(self, scales: Scales, times: Sequence[float]) -> list[dict[str, float]]:
        k, m = scales.stiffness[self.target], scales.inertia[self.target]
        return [
            {
                "stiffness": n * k,
                "rotor_inertia": part * m,
                "damping": 0.2 * (n * k * part * m) ** 0.5,
            }
            for n in times
            for part in (0.1, 0.6)
        ]
