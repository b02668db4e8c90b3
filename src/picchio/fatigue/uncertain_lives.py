"""Uncertain lives: draw the inputs, then summarise the lives and attribute their variance.

Nothing here knows a robot: `picchio.studies.uncertainty` runs the model on the draws.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np

from picchio.core import spoken
from picchio.core.arrays import FloatArray, as_floats
from picchio.core.errors import InputError

Shape = Literal["normal", "lognormal", "uniform", "absolute"]
QUANTILES = {"p10": 0.1, "p50": 0.5, "p90": 0.9}
REPLICATES = 16
"""Sobol sequences, scrambled independently: how their results differ is the sampling error."""
# Of the two-sided sampling intervals.
_SURE = 0.95


@dataclass(frozen=True)
class Uncertain:
    """One uncertain input.

    Attributes:
        median: its middle value.
        spread: standard deviation: of the value over the median ("normal"), of its natural
            logarithm ("lognormal"); of the value itself ("absolute"); half the width over the
            median ("uniform").
        shape: of its distribution.
    """

    median: float
    spread: float
    shape: Shape = "lognormal"

    def __post_init__(self) -> None:
        if self.shape not in get_args(Shape):
            raise InputError(
                "unknown shape", key="shape", value=self.shape, choices=get_args(Shape)
            )
        as_floats(self.median, "median")
        if float(as_floats(self.spread, "spread")) < 0:
            raise InputError("must not be negative", key="spread", value=self.spread)

    def at(self, score: FloatArray) -> FloatArray:
        """Its values at scores of a standard normal distribution.

        Args:
            score: any shape.
        """
        if self.shape == "absolute":
            return np.asarray(self.median + self.spread * score)
        if self.shape == "uniform":
            from scipy.special import ndtr

            return np.asarray(self.median * (1.0 + self.spread * (2.0 * ndtr(score) - 1.0)))
        moved = self.spread * score
        return np.asarray(
            self.median * (np.exp(moved) if self.shape == "lognormal" else 1.0 + moved)
        )


@dataclass(frozen=True)
class LifeSpread:
    """Summary of an uncertain life.

    Attributes:
        p10: the life that 90 % of the samples exceed; inf where infinite.
        p50: the median.
        p90: the life that 10 % exceed.
        endless: share of samples with infinite life.
        shares: first-order Sobol index of each input: the share of the variance of ln measure
            that it explains alone.
        totals: total-order index: with its interactions; empty where it was not asked for.
        samples: how many lives.
        sampling: of each quantile the 95 % interval (low, high) that so many samples leave.
    """

    p10: float
    p50: float
    p90: float
    endless: float
    shares: dict[str, float]
    totals: dict[str, float]
    samples: int
    sampling: dict[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def quantiles(self) -> dict[str, float]:
        """P10, P50 and P90."""
        return {name: getattr(self, name) for name in QUANTILES}

    def rounded(self, quantile: str) -> float:
        """A quantile with the digits that its sampling error allows.

        Args:
            quantile: "p10", "p50" or "p90".
        """
        value = self.quantiles[quantile]
        low, high = self.sampling.get(quantile, (value, value))
        if not (math.isfinite(value) and value > 0.0):
            return value
        error = max(0.5 * (high - low) / value, 1e-4)
        digits = 1 - math.floor(math.log10(error)) if error < 0.2 else 1
        return float(f"{value:.{min(digits, 4) - 1}e}")

    @property
    def told(self) -> str:
        """The life as an interval in words: from P10 to P90, about the median."""
        p10, p50, p90 = (spoken.count(self.rounded(name)) for name in QUANTILES)
        if p10 == p90:
            return p50
        return f"{p10} to {p90} (median {p50})"

    def settled(self, factor: float) -> bool:
        """Whether every quantile's sampling interval is narrow.

        Args:
            factor: the largest ratio of an interval's ends.
        """
        return all(
            high == low or (high < math.inf and high <= factor * low)
            for low, high in self.sampling.values()
        )


class Draws:
    """Standard normal scores of some inputs: scrambled Sobol points, in independent replicates.

    Args:
        inputs: how many inputs.
        seed: of the scrambling; the same seed gives the same points.
        most: scores that may be asked for, so that few are begun with; no bound if not given.

    Raises:
        InputError: no input.
    """

    def __init__(self, inputs: int, seed: int = 0, most: int | None = None) -> None:
        from scipy.stats import qmc

        if inputs < 1:
            raise InputError("needs at least one uncertain input", key="inputs")
        seeds = np.random.SeedSequence(seed).spawn(REPLICATES + 1)
        self._engines = [
            qmc.Sobol(inputs, scramble=True, rng=np.random.default_rng(s)) for s in seeds[:-1]
        ]
        self._other = np.random.default_rng(seeds[-1])
        self.scores = np.empty((REPLICATES, 0, inputs))
        # Sobol points are even in powers of two only.
        few = 16 if most is None else min(16, max(2, most // REPLICATES))
        self._first = 1 << (few.bit_length() - 1)

    def more(self) -> FloatArray:
        """As many scores again as there are, (replicates, new, inputs); at first 16 or fewer."""
        from scipy.special import ndtri

        count = self.scores.shape[1] or self._first
        points = np.array([engine.random(count) for engine in self._engines])
        new = np.asarray(ndtri(np.clip(points, 1e-12, 1.0 - 1e-12)))
        self.scores = np.concatenate([self.scores, new], axis=1)
        return new

    def mixed(self, each: int) -> FloatArray:
        """The first scores of every replicate with one input redrawn: (inputs, m, inputs).

        Args:
            each: scores of a replicate; m is `REPLICATES` times as many.
        """
        base = self.scores[:, :each].reshape(-1, self.scores.shape[2])
        blocks = np.repeat(base[None], base.shape[1], axis=0)
        for i, block in enumerate(blocks):
            block[:, i] = self._other.standard_normal(len(base))
        return blocks


def summarise(
    names: Sequence[str],
    scores: FloatArray,
    lives: FloatArray,
    measure: FloatArray,
    mixed: FloatArray | None = None,
) -> LifeSpread:
    """Quantiles of the lives with their sampling error, and each input's share of the variance.

    A quantile's sampling interval is where the pooled distribution passes p +- t s: s is the
    standard error of the share of samples below the quantile, from the replicates (Woodruff,
    J. Amer. Statist. Assoc. 47 (1952) 635-646; replicates of scrambled nets: Owen, Monte Carlo
    theory, methods and examples, ch. 17). It holds for infinite lives, too.

    Args:
        names: of the d inputs.
        scores: (replicates, n, d), as of `Draws`.
        lives: (replicates, n), inf allowed.
        measure: (replicates, n) positive and finite: utilisation, since lives may be infinite.
        mixed: (d, m) the measure where each input was redrawn, for total-order indices.

    Returns:
        the summary, one quantile's sampling interval each.

    Raises:
        InputError: a wrong number of them, NaN, or a measure that is not positive.
    """
    for key, array in (("life", lives), ("measure", measure)):
        if array.shape != scores.shape[:2] or np.isnan(array).any():
            raise InputError(f"the model must give {scores.shape[:2]} numbers", key=key)
    if not (np.isfinite(measure) & (measure > 0)).all():
        raise InputError("must be positive and finite", key="measure")
    found = {name: _quantile(lives, p) for name, p in QUANTILES.items()}
    log = np.log(measure)
    every = scores.reshape(-1, scores.shape[2])
    totals = {}
    variance = float(log.var())
    if mixed is not None:
        base = log[:, : mixed.shape[1] // REPLICATES].ravel()
        moved = 0.5 * ((base - np.log(mixed)) ** 2).mean(axis=1)  # Jansen 1999
        totals = {
            name: float(part / variance) if variance > 1e-24 else 0.0
            for name, part in zip(names, moved, strict=True)
        }
    return LifeSpread(
        **{name: value for name, (value, _) in found.items()},
        endless=float(np.isinf(lives).mean()),
        shares={name: _share(every[:, i], log.ravel()) for i, name in enumerate(names)},
        totals=totals,
        samples=lives.size,
        sampling={name: interval for name, (_, interval) in found.items()},
    )


def _quantile(lives: FloatArray, p: float) -> tuple[float, tuple[float, float]]:
    """The pooled quantile and its sampling interval."""
    from scipy.stats import t as student

    pooled = np.sort(lives, axis=None)

    def at(level: float) -> float:
        index = math.ceil(level * pooled.size) - 1
        return float(pooled[min(max(index, 0), pooled.size - 1)])

    value = at(p)
    # Of many equal lives (endless ones) the share below them counts, too.
    below = [(lives <= value).mean(axis=1), (lives < value).mean(axis=1)]
    error = max(float(share.std(ddof=1)) for share in below) / math.sqrt(len(lives))
    reach = float(student.ppf(0.5 + 0.5 * _SURE, len(lives) - 1)) * error + 0.5 / pooled.size
    low = at(p - reach) if p > reach else 0.0
    high = at(p + reach) if p + reach < 1.0 else math.inf
    return value, (low, high)


def _share(score: FloatArray, log: FloatArray) -> float:
    """First-order index from the samples themselves: variance of the means of equal slices.

    Less what slices of noise would have (the adjusted correlation ratio; Plischke, Borgonovo and
    Smith, Eur. J. Oper. Res. 226 (2013) 536-550).
    """
    variance = float(log.var())
    if variance < 1e-24:
        return 0.0
    slices = int(np.clip(log.size // 32, 4, 64))
    parts = np.array_split(log[np.argsort(score, kind="stable")], slices)
    means, sizes = np.array([part.mean() for part in parts]), np.array([len(p) for p in parts])
    ratio = float((sizes * (means - log.mean()) ** 2).sum() / log.size / variance)
    noise = (slices - 1) / (log.size - 1)
    return max((ratio - noise) / (1.0 - noise), 0.0)
