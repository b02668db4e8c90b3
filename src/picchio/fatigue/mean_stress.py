"""Mean stress: the fully reversed amplitude that does the same damage.

In shear the sign of the mean cannot matter, so its magnitude counts. A smooth ductile shaft in
torsion shows no effect of the mean below yield (Smith 1942; Sines 1959; Shigley's Mechanical
Engineering Design, 10th ed., section 6-12), so `none` is the default; the rules belong to
notched, keyed and splined shafts.

With a: amplitude, m: |mean|, S_u: ultimate_shear, S_y: yield_shear of the curve:

| rule | amplitude that counts |
|---|---|
| none | a |
| goodman | a / (1 - m / S_u) |
| gerber | a / (1 - (m / S_u)^2) |
| soderberg | a / (1 - m / S_y) |
| morrow | a / (1 - m / S_f), S_f the fatigue strength coefficient in shear |
| walker | (a + m)^(1 - gamma) a^gamma |
| swt | sqrt((a + m) a): Smith, Watson and Topper; Walker with gamma = 1/2 |
| fkm | by the mean stress sensitivity M_tau, in three ranges of the stress ratio |
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from picchio.core.arrays import FloatArray, as_floats
from picchio.core.errors import InputError
from picchio.fatigue.sn.curve import SNCurve

Rule = Literal["none", "goodman", "gerber", "soderberg", "morrow", "walker", "swt", "fkm"]
RULES: tuple[Rule, ...] = get_args(Rule)

_FKM_SHEAR_FACTOR = 0.577


@dataclass(frozen=True)
class MeanStress:
    """A mean stress rule and its constants.

    Attributes:
        rule: one of `RULES`.
        fatigue_strength_coefficient: Pa, in shear, for `morrow`.
        walker_exponent: gamma in [0, 1], for `walker`; 1 means no effect of the mean.
        sensitivity: M_tau for `fkm`; None takes it from the curve's tensile strength.
    """

    rule: Rule = "none"
    fatigue_strength_coefficient: float | None = None
    walker_exponent: float | None = None
    sensitivity: float | None = None

    def __post_init__(self) -> None:
        if self.rule not in RULES:
            raise InputError("unknown rule", key="mean_stress", value=self.rule, choices=RULES)
        gamma = self.walker_exponent
        if gamma is not None and not 0.0 <= gamma <= 1.0:
            raise InputError("must lie in [0, 1]", key="walker_exponent", value=gamma)
        for name in ("fatigue_strength_coefficient", "sensitivity"):
            value = getattr(self, name)
            if value is not None and float(as_floats(value, name)) <= 0:
                raise InputError("must be positive", key=name, value=value)

    def equivalent_amplitude(
        self, amplitude: npt.ArrayLike, mean: npt.ArrayLike, sn_curve: SNCurve
    ) -> FloatArray:
        """The fully reversed amplitude that does the damage of `amplitude` about `mean`.

        Args:
            amplitude: (...) Pa, not negative.
            mean: (...) Pa, either sign.
            sn_curve: gives the static strengths.

        Returns:
            (...) Pa; at least `amplitude`.

        Raises:
            InputError: a mean at or above the static strength that the rule divides by, or a
                missing constant that the rule needs.
        """
        a, m = np.broadcast_arrays(
            as_floats(amplitude, "amplitude"), np.abs(as_floats(mean, "mean"))
        )
        if (a < 0).any():
            raise InputError("must not be negative", key="amplitude", value=float(a.min()))
        if self.rule == "none":
            return a.copy()
        if self.rule in ("swt", "walker"):
            given = 0.5 if self.rule == "swt" else self.walker_exponent
            gamma = self._need(given, "walker_exponent")
            return np.asarray((a + m) ** (1.0 - gamma) * a**gamma)
        if self.rule == "fkm":
            big = self.sensitivity
            if big is None:
                key = f"{sn_curve.name}.tensile_strength"
                big = fkm_sensitivity(self._need(sn_curve.tensile_strength, key))
            return _fkm(a, m, big)
        if self.rule == "morrow":
            key, strength = "fatigue_strength_coefficient", self.fatigue_strength_coefficient
        elif self.rule == "soderberg":
            key, strength = f"{sn_curve.name}.yield_shear", sn_curve.yield_shear
        else:
            key, strength = f"{sn_curve.name}.ultimate_shear", sn_curve.ultimate_shear
        return self._divide(a, m, self._need(strength, key))

    def _divide(self, a: FloatArray, m: FloatArray, strength: float) -> FloatArray:
        if m.size and float(m.max()) >= strength:
            raise InputError(
                f"the mean shear stress reaches the {strength / 1e6:.4g} MPa static "
                f"strength of the {self.rule} rule: the part fails statically",
                key="mean_stress",
                value=float(m.max()),
            )
        ratio = m / strength
        return np.asarray(a / (1.0 - (ratio**2 if self.rule == "gerber" else ratio)))

    def _need(self, value: float | None, key: str) -> float:
        if value is None:
            raise InputError(f"the mean stress rule {self.rule} needs it", key=key)
        return float(value)


def fkm_sensitivity(tensile_strength: float) -> float:
    """FKM's mean stress sensitivity of steel in shear, M_tau = 0.577 (0.35e-3 R_m / MPa - 0.1).

    FKM guideline (2012), mean stress sensitivity with a_M = 0.35 and b_M = -0.1 for steel, and the
    shear fatigue factor f_W,tau = 0.577: all three as in pyLife 2.3.1's `fkm_linear.constants`.

    Args:
        tensile_strength: R_m, Pa.

    Returns:
        M_tau; 0 for soft steel, for which the formula would be negative.
    """
    return max(0.0, _FKM_SHEAR_FACTOR * (0.35e-3 * tensile_strength / 1e6 - 0.1))


def _fkm(a: FloatArray, m: FloatArray, sensitivity: float) -> FloatArray:
    """FKM's fields II (R <= 0), III (0 < R < 0.5) and IV (R >= 0.5), continuous in between.

    II and III are pyLife's `fkm_goodman`; IV constant: engineering assumption, no source.
    """
    big = sensitivity
    alternating = a + big * m
    pulsating = (1.0 + big) * (a + big / 3.0 * m) / (1.0 + big / 3.0)
    high = a * 3.0 * (1.0 + big) ** 2 / (3.0 + big)
    return np.asarray(np.where(m <= a, alternating, np.where(m < 3.0 * a, pulsating, high)))


def as_rule(mean_stress: MeanStress | Rule) -> MeanStress:
    """A rule, from its name if need be."""
    return mean_stress if isinstance(mean_stress, MeanStress) else MeanStress(mean_stress)
