from __future__ import annotations

import math
import sys

import FLife
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from picchio.core.errors import InputError, PicchioError
from picchio.fatigue.counting.counter import rainflow
from picchio.fatigue.miner import damage, life
from picchio.fatigue.sn.curve import SNCurve
from picchio.fatigue.spectral_life import METHODS, gaussian_bias, narrow_band_life, spectral_life

CURVE = SNCurve(name="c", strength=200e6, cycles=1e6, slopes=(5.0,), knees=(1e6,))


def spectrum(low: float, high: float, rms: float = 40e6) -> tuple[np.ndarray, np.ndarray]:
    f = np.linspace(0.5, 60.0, 4000)
    psd = ((f > low) & (f < high)).astype(float)
    return f, psd * rms**2 / np.trapezoid(psd, f)


def test_narrow_band_closed_form_is_flifes() -> None:
    f, psd = spectrum(9.0, 11.0)
    assert spectral_life(f, psd, CURVE, "Narrowband") == pytest.approx(
        narrow_band_life(f, psd, CURVE), rel=1e-3
    )


def test_counting_a_gaussian_record_agrees_with_dirlik() -> None:
    # A Gaussian record of the spectrum, counted: Miner elementary, as the spectral methods.
    f, psd = spectrum(4.0, 20.0)
    rng, rate, seconds = np.random.default_rng(0), 400.0, 4000.0
    n = int(rate * seconds)
    grid = np.fft.rfftfreq(n, 1.0 / rate)
    amplitude = np.sqrt(np.interp(grid, f, psd, left=0.0, right=0.0) * rate * n / 2.0)
    phase = rng.standard_normal((2, len(grid)))
    record = np.fft.irfft(amplitude * (phase[0] + 1j * phase[1]) / math.sqrt(2.0), n)
    counted = life(damage(rainflow(record), CURVE, miner="elementary") / seconds)
    assert spectral_life(f, psd, CURVE, "Dirlik") == pytest.approx(counted, rel=0.1)
    assert narrow_band_life(f, psd, CURVE) < counted


@pytest.mark.parametrize("method", METHODS)
def test_every_method_scales_as_basquin(method: str) -> None:
    f, psd = spectrum(4.0, 20.0)
    ratio = spectral_life(f, psd, CURVE, method) / spectral_life(f, 4.0 * psd, CURVE, method)
    assert ratio == pytest.approx(2.0**5, rel=1e-6)


@given(st.floats(2.0, 12.0))
def test_bias_on_a_periodic_stress(slope: float) -> None:
    # A sine of rms sigma has amplitude sqrt(2) sigma: nu (sqrt 2 sigma)^k / C against Miles.
    curve = SNCurve(name="c", strength=200e6, cycles=1e6, slopes=(slope,))
    f = np.linspace(9.99, 10.01, 2001)
    psd = np.full_like(f, (40e6) ** 2 / 0.02)
    sine = float(curve.cycles_to_failure(math.sqrt(2.0) * 40e6)) / 10.0
    assert sine / narrow_band_life(f, psd, curve) == pytest.approx(gaussian_bias(slope), rel=1e-4)
    assert gaussian_bias(8.0) == pytest.approx(24.0)


def test_bad_spectra_are_named() -> None:
    f, psd = spectrum(4.0, 20.0)
    two = SNCurve(name="two", strength=200e6, cycles=1e6, slopes=(5.0, 9.0), knees=(1e6,))
    for call, key in (
        (lambda: spectral_life(f, psd[1:], CURVE), "psd"),
        (lambda: spectral_life(f[::-1], psd, CURVE), "frequency"),
        (lambda: spectral_life(f, -psd, CURVE), "psd"),
        (lambda: spectral_life(f, psd, two), r"two\.slopes"),
        (lambda: spectral_life(f, psd, CURVE, "Dirlk"), "did you mean 'Dirlik'"),
        (lambda: gaussian_bias(-1.0), "slope"),
    ):
        with pytest.raises(InputError, match=key):
            call()


def test_without_flife_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    assert FLife is not None
    monkeypatch.setitem(sys.modules, "FLife", None)
    with pytest.raises(PicchioError, match="pip install FLife"):
        spectral_life(*spectrum(4.0, 20.0), CURVE)
