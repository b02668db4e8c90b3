"""Is a residual noise? Tests of whiteness whose false alarms come at the rate stated.

Every test takes a series that should be white and Gaussian, with the variance given or not, and
returns the probability of what it saw, or more, if that were so. Residuals of coloured noise are
whitened first (`Noise.whiten`).

Sources: the ratio of the means of exponential variates (P. A. P. Moran, Biometrika 38, 1951), here
of periodogram ordinates; Wald and Wolfowitz' runs; the cumulated periodogram
(M. S. Bartlett, An Introduction to Stochastic Processes, 1955), a Kolmogorov-Smirnov distance;
R. A. Fisher's largest ordinate (1929).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError

_FEWEST = 16
_BANDS = 8


@dataclass(frozen=True)
class TestResult:
    """What one test saw.

    Attributes:
        name: of the test.
        statistic: what it computed; see the test.
        probability: of that or more, if the series is white noise.
        where: what stands out, for people.
    """

    __test__ = False  # pytest: no test class

    name: str
    statistic: float
    probability: float
    where: str = ""


@dataclass(frozen=True)
class Whiteness:
    """All tests of one series together.

    Attributes:
        results: one a test.
        level: how often white noise may raise the alarm, all tests together.
    """

    results: tuple[TestResult, ...]
    level: float

    @property
    def worst(self) -> TestResult:
        """The least probable."""
        return min(self.results, key=lambda result: result.probability)

    @property
    def probability(self) -> float:
        """Of all results together, by Cauchy's combination, which holds for related tests.

        Y. Liu and J. Xie, JASA 115, 2020.
        """
        given = np.clip([result.probability for result in self.results], 1e-15, 1.0 - 1e-15)
        score = float(np.tan((0.5 - given) * np.pi).mean())
        return float(np.arctan2(1.0, score) / np.pi)

    @property
    def alarm(self) -> bool:
        """True where this is not white noise, at `level`."""
        return self.probability < self.level

    def __getitem__(self, name: str) -> TestResult:
        """The test of this name."""
        for result in self.results:
            if result.name == name:
                return result
        raise InputError("no such test", value=name, choices=[r.name for r in self.results])


def whiteness(series: ArrayLike, *, std: float | None = None, rate: float = 1.0,
              level: float = 0.01) -> Whiteness:  # fmt: skip
    """Every test of one series.

    Args:
        series: (m,) what should be white noise of mean zero.
        std: what its standard deviation should be; then each band is tested against it, too.
        rate: samples a second, Hz; for what is said of frequencies.
        level: false alarms of all tests together.

    Raises:
        InputError: fewer than 16 samples, or not one-dimensional.
    """
    x = _series(series)
    results = [flatness(x), runs(x), cumulated_periodogram(x), largest_line(x, rate=rate)]
    if std is not None:
        results.append(band_levels(x, std, rate=rate))
    return Whiteness(tuple(results), level)


def _series(series: ArrayLike) -> FloatArray:
    x = np.asarray(series, dtype=np.float64)
    if x.ndim != 1 or x.size < _FEWEST:
        raise InputError(f"a test of whiteness needs {_FEWEST} samples or more", value=x.shape)
    return x


def _ordinates(x: FloatArray) -> FloatArray:
    """(k,) periodogram over its mean's expectation, without frequency zero and Nyquist."""
    power = np.abs(np.fft.rfft(x)) ** 2 / x.size
    return power[1 : (x.size + 1) // 2]


def flatness(series: ArrayLike) -> TestResult:
    """Spectral flatness: geometric over arithmetic mean of the periodogram.

    White noise gives exp(-0.5772) = 0.56 on average. The logarithm's first three moments are
    known exactly (the ordinates are exponential, their ratios independent of their mean); its
    distribution is taken as the gamma distribution that has them.
    """
    from scipy.special import polygamma
    from scipy.stats import gamma

    ordinates = _ordinates(_series(series))
    n = ordinates.size
    if not (ordinates > 0.0).all():
        return TestResult("spectral flatness", 0.0, 0.0, "nothing at some frequencies")
    spread = float(np.log(ordinates.mean()) - np.log(ordinates).mean())
    mean = float(polygamma(0, n) - np.log(n) + np.euler_gamma)
    variance = float(polygamma(1, 1) / n - polygamma(1, n))
    third = float(polygamma(2, n) - polygamma(2, 1) / n**2)
    shape = 4.0 * variance**3 / third**2
    z = (spread - mean) / np.sqrt(variance)
    probability = float(gamma.sf(shape + z * np.sqrt(shape), shape))
    return TestResult("spectral flatness", float(np.exp(-spread)), probability)


def runs(series: ArrayLike) -> TestResult:
    """Runs on one side of the median: few when the series is slow, many when it alternates."""
    from scipy.stats import norm

    x = _series(series)
    x = x - np.median(x)
    above = x[x != 0.0] > 0.0
    n1 = int(above.sum())
    n2 = above.size - n1
    if not n1 or not n2:
        return TestResult("runs", 0.0, 0.0, "all on one side")
    count = 1 + int((above[1:] != above[:-1]).sum())
    mean = 1.0 + 2.0 * n1 * n2 / (n1 + n2)
    variance = (mean - 1.0) * (mean - 2.0) / (n1 + n2 - 1.0)
    z = (count - mean) / np.sqrt(variance)
    words = "too few runs: slow" if z < 0.0 else "too many runs: it alternates"
    return TestResult("runs", float(z), float(2.0 * norm.sf(abs(z))), words)


def cumulated_periodogram(series: ArrayLike) -> TestResult:
    """How far the cumulated periodogram is from a straight line: finds any smooth colour."""
    from scipy.stats import kstest

    ordinates = _ordinates(_series(series))
    total = ordinates.sum()
    if total == 0.0:
        return TestResult("cumulated periodogram", 1.0, 0.0, "it is zero")
    found = kstest((np.cumsum(ordinates) / total)[:-1], "uniform")
    return TestResult("cumulated periodogram", float(found.statistic), float(found.pvalue))


def largest_line(series: ArrayLike, *, rate: float = 1.0) -> TestResult:
    """Fisher's test: the largest ordinate's share; finds a hum, or a mode left over."""
    ordinates = _ordinates(_series(series))
    count, largest = ordinates.size, int(ordinates.argmax())
    total = ordinates.sum()
    if total == 0.0:
        return TestResult("largest line", 1.0, 0.0, "it is zero")
    share = float(ordinates[largest] / total)
    # The exact sum alternates and cancels; its first term bounds it, and is exact where it counts.
    tail = count * (1.0 - share) ** (count - 1)
    pairs = 0.5 * count * (count - 1) * max(0.0, 1.0 - 2.0 * share) ** (count - 1)
    probability = tail - pairs if tail < 0.2 else -np.expm1(-tail)
    frequency = (largest + 1) * rate / np.size(series)
    where = f"{frequency:.4g} Hz" if rate != 1.0 else f"{frequency:.4g} of the rate"
    return TestResult("largest line", share, float(np.clip(probability, 0.0, 1.0)), where)


def band_levels(series: ArrayLike, std: float, *, rate: float = 1.0, bands: int = _BANDS,
                edges: Sequence[float] | None = None) -> TestResult:  # fmt: skip
    """The power of each band against that of white noise of this standard deviation.

    Args:
        series: (m,).
        std: the standard deviation it should have.
        rate: samples a second, Hz.
        bands: how many, of equal width.
        edges: Hz, of the bands, instead.
    """
    from scipy.stats import chi2

    x = _series(series)
    if not std > 0.0:
        raise InputError("must be positive", key="std", value=std)
    ordinates = _ordinates(x) / std**2
    frequency = np.arange(1, ordinates.size + 1) * rate / x.size
    limits = np.asarray(edges if edges is not None else np.linspace(0.0, rate / 2.0, bands + 1))
    results = []
    for low, high in zip(limits[:-1], limits[1:], strict=True):
        inside = ordinates[(frequency > low) & (frequency <= high)]
        if inside.size:
            power = 2.0 * inside.sum()
            tails = chi2.cdf(power, 2 * inside.size), chi2.sf(power, 2 * inside.size)
            results.append((2.0 * min(tails), float(inside.mean()), low, high))
    if not results:
        raise InputError("no frequency of the series lies in the bands", key="edges")
    least, level, low, high = min(results)
    unit = "Hz" if rate != 1.0 else "of the rate"
    return TestResult(
        "level by band",
        level,
        float(-np.expm1(len(results) * np.log1p(-min(least, 1.0 - 1e-16)))),
        f"{np.sqrt(level):.3g} times the noise from {low:.4g} to {high:.4g} {unit}",
    )
