"""Life under random stress from its power spectrum: a cross-check on counting, by FLife.

The methods presume a stationary Gaussian stress. Blows are periodic, not random: a sine of the
same power does Gamma(1 + k / 2) times less damage than the narrow-band Gaussian stress (24 times
at k = 8, `gaussian_bias`), so on periodic blows a spectral life is far too short, and on single
blows with long silence, whose peaks are rarer and higher than a Gaussian's, it may be too long.
Use it for random feed forces and chatter, or to check a count of such a record.

FLife is an optional extra: `pip install FLife`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from picchio.core.arrays import FloatArray, as_floats
from picchio.core.errors import InputError, PicchioError
from picchio.fatigue.sn.curve import SNCurve

METHODS = (
    "Dirlik", "TovoBenasciutti", "ZhaoBaker", "WirschingLight", "Narrowband", "OrtizChen",
    "Alpha075",
)  # fmt: skip


def spectral_life(
    frequency: npt.ArrayLike, psd: npt.ArrayLike, sn_curve: SNCurve, method: str = "Dirlik"
) -> float:
    """Time to failure under a stationary Gaussian stress.

    The curve's first line is taken on for ever (Miner elementary): spectral methods know no limit.

    Args:
        frequency: (n,) Hz, ascending from 0 or above.
        psd: (n,) one-sided power spectral density of the shear stress, Pa^2/Hz.
        sn_curve: of one slope.
        method: one of `METHODS`, as FLife names them.

    Returns:
        s.

    Raises:
        InputError: spectra that do not match, a curve of several slopes, an unknown method.
        PicchioError: FLife is not installed.
    """
    f, g = _spectrum(frequency, psd)
    slope, constant = _basquin(sn_curve)
    if method not in METHODS:
        raise InputError("unknown method", key="method", value=method, choices=METHODS)
    flife = _flife()
    # FLife's numbers overflow in Pa^k; MPa keeps them small.
    data = flife.SpectralData(input={"PSD": g / 1e12, "f": f})
    return float(getattr(flife, method)(data).get_life(C=constant, k=slope))


def narrow_band_life(frequency: npt.ArrayLike, psd: npt.ArrayLike, sn_curve: SNCurve) -> float:
    """Time to failure if the stress were narrow-banded: the closed form of Miles (1954).

    1 / T = nu_0 (sqrt(2 m_0))^k Gamma(1 + k / 2) / C, nu_0 = sqrt(m_2 / m_0). It bounds the
    Gaussian wide-band life from below. Arguments and errors as `spectral_life`.
    """
    f, g = _spectrum(frequency, psd)
    slope, constant = _basquin(sn_curve)
    m0, m2 = (float(np.trapezoid(g / 1e12 * f**order, f)) for order in (0, 2))
    rate = math.sqrt(m2 / m0)
    power = (2.0 * m0) ** (slope / 2.0) * math.gamma(1.0 + slope / 2.0)
    return constant / (rate * power)


def gaussian_bias(slope: float) -> float:
    """Damage of a narrow-band Gaussian stress over that of a sine of equal power.

    Gamma(1 + k / 2): by how much a spectral method overrates steady periodic vibration.

    Args:
        slope: k of the S-N curve.
    """
    number = float(as_floats(slope, "slope"))
    if number <= 0:
        raise InputError("must be positive", key="slope", value=slope)
    return math.gamma(1.0 + number / 2.0)


def _spectrum(frequency: Any, psd: Any) -> tuple[FloatArray, FloatArray]:
    f, g = as_floats(frequency, "frequency"), as_floats(psd, "psd")
    if f.ndim != 1 or f.shape != g.shape or len(f) < 2:
        raise InputError("frequency and psd must be 1-D and equally long", key="psd")
    if f[0] < 0 or (np.diff(f) <= 0).any():
        raise InputError("must ascend from 0 or above", key="frequency")
    if (g < 0).any() or not g.any():
        raise InputError("must not be negative, nor zero everywhere", key="psd")
    return f, g


def _basquin(sn_curve: SNCurve) -> tuple[float, float]:
    """Slope k, and C of N = C amplitude^-k with the amplitude in MPa."""
    if len(sn_curve.slopes) != 1:
        raise InputError(
            "spectral methods need one slope", key=f"{sn_curve.name}.slopes", value=sn_curve.slopes
        )
    slope = sn_curve.slopes[0]
    return slope, sn_curve.cycles * (sn_curve.strength / 1e6) ** slope


def _flife() -> Any:
    try:
        import FLife  # type: ignore[import-untyped]
    except ImportError:
        raise PicchioError("spectral_life needs FLife: pip install FLife") from None
    return FLife
