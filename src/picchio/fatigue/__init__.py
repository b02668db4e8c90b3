"""Fatigue: stress, S-N curves and their fitting, rainflow, mean stress, Miner, reducers.

Arrays go in and out in SI units (Pa, N m, cycles). Counting compiles on its first call; importing
this package loads neither numba nor scipy.
"""

from __future__ import annotations

from picchio.fatigue.allowable import allowable_factor, allowable_radius
from picchio.fatigue.cycles import Cycles
from picchio.fatigue.damage import damage, life, peak_damage, utilisation
from picchio.fatigue.mean_stress import MeanStress
from picchio.fatigue.rainflow import RainflowCounter, rainflow
from picchio.fatigue.reducer import Reducer, ReducerCheck
from picchio.fatigue.reducer_library import load_reducer, reducer_names
from picchio.fatigue.sn_curve import SNCurve
from picchio.fatigue.sn_fit import SNFit, fit_sn
from picchio.fatigue.sn_library import (
    DEFAULT_SN_CURVE,
    PAPER_SN_CURVE,
    load_sn_curve,
    sn_curve_names,
)
from picchio.fatigue.sn_tests import SNTests, read_sn_tests
from picchio.fatigue.stress import check_shaft, shear_stress, shear_stress_from_deflection

__all__ = [
    "DEFAULT_SN_CURVE",
    "PAPER_SN_CURVE",
    "Cycles",
    "MeanStress",
    "RainflowCounter",
    "Reducer",
    "ReducerCheck",
    "SNCurve",
    "SNFit",
    "SNTests",
    "allowable_factor",
    "allowable_radius",
    "check_shaft",
    "damage",
    "fit_sn",
    "life",
    "load_reducer",
    "load_sn_curve",
    "peak_damage",
    "rainflow",
    "read_sn_tests",
    "reducer_names",
    "shear_stress",
    "shear_stress_from_deflection",
    "sn_curve_names",
    "utilisation",
]
