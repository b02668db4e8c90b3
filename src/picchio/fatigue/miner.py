"""Damage by Miner's rule, and utilisation."""

from __future__ import annotations

import math

import numpy as np

from picchio.core.arrays import as_floats
from picchio.core.errors import InputError
from picchio.fatigue.counting.cycles import Cycles
from picchio.fatigue.mean_stress import MeanStress, Rule, as_rule
from picchio.fatigue.sn.curve import MinerRule, SNCurve


def damage(
    cycles: Cycles,
    sn_curve: SNCurve,
    mean_stress: MeanStress | Rule = "none",
    miner: MinerRule | None = None,
) -> float:
    """Miner's sum (Palmgren 1924, Miner 1945): each cycle costs one over its life.

    Args:
        cycles: of shear stress, Pa.
        sn_curve: the curve.
        mean_stress: a rule or its name; see `picchio.fatigue.mean_stress`.
        miner: what cycles below the endurance limit do, if not as the curve says.

    Returns:
        the damage; 1 is failure. It adds over histories and is proportional to counts.

    Raises:
        InputError: see `MeanStress.equivalent_amplitude`.
    """
    curve = sn_curve if miner is None else sn_curve.with_miner(miner)
    amplitude = as_rule(mean_stress).equivalent_amplitude(cycles.amplitude, cycles.mean, curve)
    return math.fsum(cycles.count / curve.cycles_to_failure(amplitude))


def utilisation(
    cycles: Cycles, sn_curve: SNCurve, mean_stress: MeanStress | Rule = "none"
) -> float:
    """Largest equivalent amplitude over the curve's allowable; always finite.

    It ranks parts where no finite life exists. Half cycles count like whole ones.

    Args:
        cycles: of shear stress, Pa.
        sn_curve: the curve, whose `allowable` is the endurance limit or the strength at 1e7.
        mean_stress: a rule or its name.

    Returns:
        0 where there is no cycle.

    Raises:
        InputError: see `MeanStress.equivalent_amplitude`.
    """
    amplitude = as_rule(mean_stress).equivalent_amplitude(cycles.amplitude, cycles.mean, sn_curve)
    return float(amplitude.max()) / sn_curve.allowable if len(amplitude) else 0.0


def peak_damage(peak_stress: float, hits: float, sn_curve: SNCurve) -> float:
    """The paper's rule: the peak stress is the amplitude, and each hit is one cycle.

    Nie et al., RCIM 37 (2016) 292-301, section 3.4: damage h / N(peak).

    Args:
        peak_stress: Pa, either sign.
        hits: h, hits in all.
        sn_curve: the curve, `nie-2016` in the paper.

    Raises:
        InputError: a stress that is not finite, or a negative number of hits.
    """
    number = float(as_floats(hits, "hits"))
    if number < 0:
        raise InputError("must not be negative", key="hits", value=hits)
    amplitude = abs(float(as_floats(peak_stress, "peak_stress")))
    cycles = float(sn_curve.cycles_to_failure(amplitude))
    # A stress so absurd that the life underflows fails at once.
    return number / cycles if cycles > 0.0 else math.inf * number if number else 0.0


def life(damage_per_unit: float) -> float:
    """How many units (rivets, passes, hours) until Miner's sum is one; inf without damage.

    Args:
        damage_per_unit: not negative.

    Raises:
        InputError: negative or NaN.
    """
    value = float(as_floats(damage_per_unit, "damage", finite=False))
    if value < 0:
        raise InputError("must not be negative", key="damage", value=damage_per_unit)
    return math.inf if value == 0 else float(np.divide(1.0, value))
