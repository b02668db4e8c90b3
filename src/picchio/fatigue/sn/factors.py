"""Factors that turn a polished specimen's shear strength into a part's, and estimated curves.

Each factor multiplies strength: `curve.scaled(factor, why)`. Stresses stay nominal: torque over
the full round section.
"""

from __future__ import annotations

import math
from typing import Literal, get_args

from picchio.core.arrays import as_floats
from picchio.core.errors import InputError
from picchio.fatigue.sn.curve import SNCurve

Finish = Literal["ground", "machined", "hot-rolled", "as-forged"]
FINISHES: tuple[Finish, ...] = get_args(Finish)
_FINISH = {
    "ground": (1.58, -0.085),
    "machined": (4.51, -0.265),
    "hot-rolled": (57.7, -0.718),
    "as-forged": (272.0, -0.995),
}
SHEAR_FACTOR = 0.577
"""f_W,tau of steel, von Mises: 1 / sqrt 3."""
FATIGUE_FACTOR = 0.45
"""f_W,sigma of steel, tension-compression, over R_m (FKM)."""


def fkm_shear_strength(tensile_strength: float) -> float:
    """FKM's fully reversed shear strength of a polished steel specimen, Pa.

    tau_W = 0.577 * 0.45 * R_m; FKM guideline (2012), as in pyLife 2.3.1's `fkm_linear.constants`.
    That it holds for survival 97.5 % is from memory, unverified.

    Args:
        tensile_strength: R_m of the part's own size class, Pa.
    """
    return SHEAR_FACTOR * FATIGUE_FACTOR * _positive(tensile_strength, "tensile_strength")


def fkm_surface_factor(roughness: float, tensile_strength: float) -> float:
    """FKM's roughness factor in shear, of steel.

    K_R,tau = 1 - 0.577 * 0.22 lg(Rz / um) lg(2 R_m / 400 MPa); FKM guideline (2012), constants as
    in pyLife 2.3.1's `fkm_linear.constants`.

    Args:
        roughness: mean roughness depth Rz, m; below 1 um counts as polished.
        tensile_strength: R_m, Pa.

    Returns:
        1 for a polished surface, less for a rough one.
    """
    depth = max(1.0, _positive(roughness, "roughness") * 1e6)
    strength = _positive(tensile_strength, "tensile_strength") / 1e6
    loss = 0.22 * math.log10(depth) * math.log10(max(1.0, 2.0 * strength / 400.0))
    return 1.0 - SHEAR_FACTOR * loss


def shigley_surface_factor(finish: Finish, tensile_strength: float) -> float:
    """Marin surface factor k_a = a S_ut^b, at most 1.

    Shigley's Mechanical Engineering Design, 9th ed., table 6-2.

    Args:
        finish: one of `FINISHES`.
        tensile_strength: S_ut, Pa.
    """
    if finish not in _FINISH:
        raise InputError("unknown finish", key="finish", value=finish, choices=FINISHES)
    a, b = _FINISH[finish]
    return min(1.0, float(a * (_positive(tensile_strength, "tensile_strength") / 1e6) ** b))


def shigley_size_factor(diameter: float) -> float:
    """Marin size factor k_b in bending and torsion.

    1.24 d^-0.107 up to 51 mm and 1.51 d^-0.157 up to 254 mm, d in mm; Shigley's, 9th ed.,
    equation 6-20. At most 1.

    Args:
        diameter: m, at most 0.254.
    """
    d = _positive(diameter, "diameter") * 1e3
    if d > 254.0:
        raise InputError("the factor is known up to 0.254 m", key="diameter", value=diameter)
    return min(1.0, 1.24 * d**-0.107 if d <= 51.0 else 1.51 * d**-0.157)


def shigley_torsion_curve(
    tensile_strength: float, diameter: float, finish: Finish, *, yield_strength: float
) -> SNCurve:
    """Shigley's estimate of a shaft's S-N curve in torsion.

    From 0.9 * 0.67 S_ut at 1e3 cycles to S_se = k_a k_b 0.59 S_e' at 1e6, S_e' = 0.5 S_ut and at
    most 700 MPa; Shigley's Mechanical Engineering Design, 9th ed., sections 6-7 to 6-9 (k_c = 0.59
    in torsion, S_su = 0.67 S_ut), with f = 0.9 of its earlier editions. Survival 50 %.

    Args:
        tensile_strength: S_ut, Pa.
        diameter: of the shaft, m.
        finish: of its surface.
        yield_strength: S_y, Pa.
    """
    ultimate = 0.67 * _positive(tensile_strength, "tensile_strength")
    base = min(0.5 * tensile_strength, 700e6)
    surface = shigley_surface_factor(finish, tensile_strength)
    limit = surface * shigley_size_factor(diameter) * 0.59 * base
    return SNCurve(
        name=f"shigley-torsion-{tensile_strength / 1e6:.0f}",
        strength=limit,
        cycles=1e6,
        slopes=(3.0 / math.log10(0.9 * ultimate / limit),),
        knees=(1e6,),
        survival=0.5,
        scatter=SHIGLEY_SCATTER,
        ultimate_shear=ultimate,
        yield_shear=SHEAR_FACTOR * _positive(yield_strength, "yield_strength"),
        tensile_strength=tensile_strength,
        source="Shigley's Mechanical Engineering Design, 9th ed., sections 6-7 to 6-9",
        assumptions=(f"{finish} shaft of {diameter * 1e3:.4g} mm",),
    )


SHIGLEY_SCATTER = 0.035
"""Of log10 strength: Shigley's reliability factor k_e = 1 - 0.08 z has 8 % standard deviation."""


def key_factor(tensile_strength: float) -> float:
    """Fatigue strength of a keyed shaft in torsion over that of the plain one.

    1 / beta_tau, beta_tau = 0.56 * 3 (sigma_B / 1000 MPa)^0.38 + 0.1; DIN 743-2, table 1, one
    feather key with hub, reference diameter 40 mm, as implemented in github.com/hanslhansl/din743
    (commit 200ffd8). Two keys: 15 % more notch effect there, which is left out here.

    Args:
        tensile_strength: sigma_B of the shaft, Pa.
    """
    ratio = _positive(tensile_strength, "tensile_strength") / 1e9
    return 1.0 / (0.56 * 3.0 * ratio**0.38 + 0.1)


def spline_factor(tensile_strength: float) -> float:
    """Fatigue strength of a splined shaft in torsion over that of the plain one.

    1 / beta_tau, beta_tau = exp(4.2e-7 (sigma_B / MPa)^2); DIN 743-2, table 1, straight-sided and
    serrated splines, on the root diameter, reference diameter 29 mm, as implemented in
    github.com/sydgtfzguhgfhtr/ME_Wellennachweis (commit 080e852). On the safe side for involute
    splines, of which that has 1 + 0.75 (beta_tau - 1).

    Args:
        tensile_strength: sigma_B of the shaft, Pa.
    """
    strength = _positive(tensile_strength, "tensile_strength") / 1e6
    return math.exp(-4.2e-7 * strength**2)


def _positive(value: float, key: str) -> float:
    number = float(as_floats(value, key))
    if number <= 0:
        raise InputError("must be positive", key=key, value=value)
    return number
