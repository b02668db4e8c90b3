"""Fatigue: stress, S-N curves, rainflow counting, mean stress, Miner's rule.

Arrays go in and out in SI units (Pa, N m, cycles). Counting compiles on its first call; importing
this package loads neither numba nor scipy.
"""

from __future__ import annotations

from picchio.fatigue.cycles import Cycles
from picchio.fatigue.damage import damage, life, peak_damage, utilisation
from picchio.fatigue.mean_stress import MeanStress
from picchio.fatigue.rainflow import RainflowCounter, rainflow
from picchio.fatigue.sn_curve import SNCurve
from picchio.fatigue.sn_library import (
    DEFAULT_SN_CURVE,
    PAPER_SN_CURVE,
    load_sn_curve,
    sn_curve_names,
)
from picchio.fatigue.stress import check_shaft, shear_stress, shear_stress_from_deflection

__all__ = [
    "DEFAULT_SN_CURVE",
    "PAPER_SN_CURVE",
    "Cycles",
    "MeanStress",
    "RainflowCounter",
    "SNCurve",
    "check_shaft",
    "damage",
    "life",
    "load_sn_curve",
    "peak_damage",
    "rainflow",
    "shear_stress",
    "shear_stress_from_deflection",
    "sn_curve_names",
    "utilisation",
]
