"""What an S-N curve must hold."""

from __future__ import annotations

from typing import TYPE_CHECKING

from picchio.core.errors import InputError
from picchio.fatigue._types import as_floats

if TYPE_CHECKING:
    from picchio.fatigue.sn_curve import SNCurve

_POSITIVE = (
    "strength", "cycles", "slopes", "knees", "ultimate_shear", "yield_shear", "tensile_strength",
)  # fmt: skip


def check_curve(curve: SNCurve) -> None:
    """Refuse values that are no curve.

    Raises:
        InputError: names the attribute.
    """
    from picchio.fatigue.sn_curve import MINER_RULES

    if curve.kind != "shear":
        raise InputError("must be a shear curve", key="kind", value=curve.kind)
    if curve.miner not in MINER_RULES:
        raise InputError("unknown rule", key="miner", value=curve.miner, choices=MINER_RULES)
    for name in _POSITIVE:
        value = getattr(curve, name)
        if value is not None and (as_floats(value, name) <= 0).any():
            raise InputError("must be positive", key=name, value=value)
    if curve.scatter is not None and float(as_floats(curve.scatter, "scatter")) < 0:
        raise InputError("must not be negative", key="scatter", value=curve.scatter)
    if curve.survival is not None:
        check_probability(curve.survival)
    if not curve.slopes or len(curve.slopes) - len(curve.knees) not in (0, 1):
        raise InputError(
            "needs as many knees as slopes (endurance limit) or one fewer",
            key="knees",
            value=curve.knees,
        )
    if any(b <= a for a, b in zip(curve.knees, curve.knees[1:], strict=False)):
        raise InputError("must ascend", key="knees", value=curve.knees)
    if len(curve.knees) == len(curve.slopes) and curve.cycles > curve.knees[-1]:
        raise InputError("lies beyond the last knee", key="cycles", value=curve.cycles)


def check_probability(value: float) -> float:
    """A probability of survival.

    Raises:
        InputError: not between 0 and 1.
    """
    number = float(as_floats(value, "survival"))
    if not 0.0 < number < 1.0:
        raise InputError("must lie between 0 and 1", key="survival", value=value)
    return number
