"""Uncertain lives: sample the inputs, then summarise the lives and attribute their variance.

Nothing here knows a robot: `picchio.studies.uncertainty` runs the model on the samples.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from picchio.core.arrays import FloatArray, as_floats
from picchio.core.errors import InputError

Shape = Literal["normal", "lognormal", "uniform"]


@dataclass(frozen=True)
class Uncertain:
    """One uncertain input.

    Attributes:
        median: its middle value.
        spread: standard deviation: of the value over the median ("normal"), of its natural
            logarithm ("lognormal"); half the width over the median ("uniform").
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

    def at(self, probability: FloatArray) -> FloatArray:
        """Its quantiles at probabilities in (0, 1).

        Args:
            probability: any shape.
        """
        if self.shape == "uniform":
            return self.median * (1.0 + self.spread * (2.0 * probability - 1.0))
        from scipy.special import ndtri

        score = self.spread * ndtri(probability)
        return np.asarray(
            self.median * (np.exp(score) if self.shape == "lognormal" else 1.0 + score)
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
        totals: total-order index: with its interactions.
        samples: how many lives.
    """

    p10: float
    p50: float
    p90: float
    endless: float
    shares: dict[str, float]
    totals: dict[str, float]
    samples: int


@dataclass(frozen=True, eq=False)
class Design:
    """Which values of the inputs to run a model on (Saltelli's scheme on Sobol points).

    Attributes:
        values: {name: (m,)}: the inputs' values, m = (inputs + 2) * samples.
        samples: of each block.
    """

    values: dict[str, FloatArray]
    samples: int

    def summarise(self, lives: npt.ArrayLike, measure: npt.ArrayLike) -> LifeSpread:
        """Quantiles of the lives, and each input's share of the variance of ln measure.

        Args:
            lives: (m,) one for each run, inf allowed.
            measure: (m,) positive and finite: utilisation, since lives may be infinite.

        Raises:
            InputError: a wrong number of them, NaN, or a measure that is not positive.
        """
        names = list(self.values)
        runs = (len(names) + 2) * self.samples
        life = np.asarray(lives, dtype=np.float64)
        size = np.asarray(measure, dtype=np.float64)
        for key, array in (("life", life), ("measure", size)):
            if array.shape != (runs,) or np.isnan(array).any():
                raise InputError(f"the model must give {runs} numbers", key=key)
        if not (np.isfinite(size) & (size > 0)).all():
            raise InputError("must be positive and finite", key="measure")
        log = np.log(size).reshape(-1, self.samples)
        first, total = _sobol(log[0], log[1], log[2:])
        both = life[: 2 * self.samples]
        p10, p50, p90 = np.quantile(both, (0.1, 0.5, 0.9), method="inverted_cdf").tolist()
        return LifeSpread(
            p10=p10,
            p50=p50,
            p90=p90,
            endless=float(np.isinf(both).mean()),
            shares=dict(zip(names, first, strict=True)),
            totals=dict(zip(names, total, strict=True)),
            samples=2 * self.samples,
        )


def design(inputs: Mapping[str, Uncertain], *, samples: int = 1024, seed: int = 0) -> Design:
    """Where to run a model, for `Design.summarise`.

    Saltelli et al., Comput. Phys. Commun. 181 (2010) 259-270, on scrambled Sobol points.

    Args:
        inputs: what is uncertain, by name; independent of each other.
        samples: a power of two.
        seed: of the scrambling; the same seed gives the same points.

    Raises:
        InputError: no inputs, or samples that are no power of two.
    """
    if not inputs:
        raise InputError("needs at least one uncertain input", key="inputs")
    if samples < 8 or samples & (samples - 1):
        raise InputError("must be a power of two, 8 or more", key="samples", value=samples)
    from scipy.stats import qmc

    n = len(inputs)
    points = qmc.Sobol(2 * n, scramble=True, rng=np.random.default_rng(seed)).random(samples)
    points = np.clip(points, 1e-12, 1.0 - 1e-12)
    a, b = points[:, :n], points[:, n:]
    blocks = [a, b]
    for i in range(n):
        mixed = a.copy()
        mixed[:, i] = b[:, i]
        blocks.append(mixed)
    runs = np.concatenate(blocks)
    return Design({name: inputs[name].at(runs[:, i]) for i, name in enumerate(inputs)}, samples)


def _sobol(
    at_a: FloatArray, at_b: FloatArray, mixed: FloatArray
) -> tuple[list[float], list[float]]:
    """First-order (Saltelli 2010) and total (Jansen 1999) indices; zeros without variance."""
    variance = float(np.concatenate((at_a, at_b)).var())
    if variance < 1e-24:
        return [0.0] * len(mixed), [0.0] * len(mixed)
    centre = float(np.concatenate((at_a, at_b)).mean())
    first = [float(np.mean((at_b - centre) * (m - at_a)) / variance) for m in mixed]
    total = [float(0.5 * np.mean((at_a - m) ** 2) / variance) for m in mixed]
    return first, total
