"""The question asked backwards: what may the load, or the shaft, be for a wanted life."""

from __future__ import annotations

import math
from collections.abc import Callable

from picchio.core.arrays import as_floats
from picchio.core.errors import InputError
from picchio.fatigue.counting.cycles import Cycles
from picchio.fatigue.mean_stress import MeanStress, Rule
from picchio.fatigue.miner import damage
from picchio.fatigue.sn.curve import MinerRule, SNCurve


def allowable_factor(
    cycles: Cycles,
    sn_curve: SNCurve,
    allowed_damage: float,
    *,
    steady_stress: float = 0.0,
    steady_scales: bool = False,
    mean_stress: MeanStress | Rule = "none",
    miner: MinerRule | None = None,
) -> float:
    """By which factor the cycles may grow until their damage is `allowed_damage`.

    A linear model's stress is proportional to the force, so the allowable force is the force
    times this factor.

    Args:
        cycles: of shear stress at the present force, Pa, for one unit of work.
        sn_curve: the curve, moved to the wanted probability of survival (`at_survival`).
        allowed_damage: for that unit: 1 / units of the wanted life.
        steady_stress: Pa, a mean that is there anyway: gravity's.
        steady_scales: whether it grows as well (as it does with a thinner shaft).
        mean_stress: a rule or its name.
        miner: as in `damage`.

    Returns:
        the largest factor; inf where no factor does damage (there is no cycle).

    Raises:
        InputError: an allowed damage that is not positive and finite, or a steady stress that
            alone breaks the part.
    """
    limit = float(as_floats(allowed_damage, "allowed_damage"))
    if limit <= 0:
        raise InputError("must be positive", key="allowed_damage", value=allowed_damage)
    if not len(cycles) or float(cycles.range.max()) == 0.0:
        return math.inf

    def spent(factor: float) -> float:
        steady = steady_stress * (factor if steady_scales else 1.0)
        return damage(cycles.scaled(factor).shifted(steady), sn_curve, mean_stress, miner)

    return largest_factor(spent, limit)


def largest_factor(spent: Callable[[float], float], limit: float, tolerance: float = 0.0) -> float:
    """The largest factor whose damage is within a limit, by bisection.

    Args:
        spent: damage at a factor, never falling; an InputError (above the static strength)
            counts as endless damage.
        limit: what may be spent.
        tolerance: relative, of the factor; 0 goes on to the last bit.

    Raises:
        InputError: even a vanishing factor spends more, so what does not scale breaks the part.
    """

    def too_much(factor: float) -> bool:
        try:
            return spent(factor) > limit
        except InputError:
            return True

    low, high = 1.0, 1.0
    while too_much(low):
        high, low = low, low / 2.0
        if low < 1e-12:
            raise InputError("the steady stress alone breaks the part", key="steady_stress")
    while not too_much(high):
        low, high = high, high * 2.0
    while True:
        middle = 0.5 * (low + high)
        if middle in (low, high) or high - low <= tolerance * high:
            return low
        low, high = (low, middle) if too_much(middle) else (middle, high)


def allowable_radius(
    radius: float,
    cycles: Cycles,
    sn_curve: SNCurve,
    allowed_damage: float,
    *,
    steady_stress: float = 0.0,
    mean_stress: MeanStress | Rule = "none",
    miner: MinerRule | None = None,
) -> float:
    """The smallest radius of the solid shaft that bears the same torques.

    Shear stress falls with the cube of the radius. The joint's stiffness is taken to stay as it
    is: the shaft is not its only spring.

    Args:
        radius: the present one, m, that gave `cycles` and `steady_stress`.
        cycles: as in `allowable_factor`.
        sn_curve: likewise.
        allowed_damage: likewise.
        steady_stress: likewise; it changes with the radius, too.
        mean_stress: likewise.
        miner: likewise.

    Returns:
        m; 0 where there is no cycle.
    """
    factor = allowable_factor(
        cycles,
        sn_curve,
        allowed_damage,
        steady_stress=steady_stress,
        steady_scales=True,
        mean_stress=mean_stress,
        miner=miner,
    )
    return 0.0 if math.isinf(factor) else float(radius * factor ** (-1.0 / 3.0))
