"""Lives as distributions, and where a resonance makes a life turn."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from picchio.core import spoken
from picchio.core.arrays import FloatArray
from picchio.core.html import sheet
from picchio.core.results import TableResult
from picchio.fatigue.uncertain_lives import LifeSpread, Uncertain
from picchio.studies.uncertainty.measurements import Measurement

# A life that falls and rises again by more than this along a stiffness is shown.
_TURN = 0.02
# A life known to no better than so many powers of ten is said to be hardly known.
_WIDE = 2.0


@dataclass(frozen=True)
class LifeScan:
    """The robot's life against one stiffness, everything else as stated.

    Attributes:
        factor: (k,) on the stiffness.
        life: (k,) rivets of the task's mix; infinite where the life is unlimited.
    """

    factor: FloatArray
    life: FloatArray

    @property
    def turns(self) -> bool:
        """Whether the life both falls and rises as the stiffness grows: a resonance."""
        with np.errstate(invalid="ignore"):
            steps = np.diff(np.log(np.minimum(self.life, 1e300)))
        return bool((steps > _TURN).any() and (steps < -_TURN).any())

    def turning_points(self) -> FloatArray:
        """Where the life turns.

        Returns:
            indices of the ends and of the local extremes, ascending.
        """
        log = np.log(np.minimum(self.life, 1e300))
        slope = np.sign(np.round(np.diff(log), 6))
        moving = np.flatnonzero(slope)
        turns = moving[1:][slope[moving[1:]] != slope[moving[:-1]]]
        return np.unique(np.concatenate([[0], turns, [log.size - 1]]))


@dataclass(frozen=True, repr=False)
class UncertainLife(TableResult):
    """Lives as distributions.

    Attributes:
        joints: of each joint with a shaft, rivets of the task's mix.
        robot: of the weakest joint, sample by sample.
        inputs: what was varied: factors on the nominal values ("absolute": the values); of
            "strength", ln is the specimens' standard normal score, which each curve's own scatter
            multiplies.
        sources: where each spread is from.
        estimated: the inputs that are estimates.
        scans: stiffnesses along which the life is not monotone (resonance): life against a factor.
        assumptions: what was taken for granted.
        seed: of the samples.
        lives: (samples,) of the robot, replicate after replicate; not in the JSON.
        intervals: of each flexible joint the P10 and P90 of what its parts bear: "utilisation",
            "yield_utilisation" and "reducer_utilisation", where it has such a part, and
            "peak_torque", N m (N of a slide), gravity and blows together.
        utilisation: P10, P50 and P90 of the robot's highest fatigue utilisation (of its limits,
            where no part has a curve).
        ends_first: of each flexible joint the share of the samples in which it ends the life.
        measure_first: what a measurement would leave of the interval, the best one first.
    """

    PLOTS: ClassVar = {
        "life": "visuals.plots.life:plot_life_spread",
        "scan": "visuals.plots.results:plot_scan",
    }

    joints: dict[str, LifeSpread]
    robot: LifeSpread
    inputs: dict[str, Uncertain]
    sources: dict[str, str]
    estimated: tuple[str, ...]
    scans: dict[str, LifeScan]
    assumptions: tuple[str, ...]
    seed: int
    lives: FloatArray = field(default_factory=lambda: np.empty(0))
    intervals: dict[str, dict[str, tuple[float, float]]] = field(default_factory=dict)
    utilisation: dict[str, float] = field(default_factory=dict)
    ends_first: dict[str, float] = field(default_factory=dict)
    measure_first: tuple[Measurement, ...] = ()

    def spread_words(self, name: str) -> str:
        """How much an input varies, in words.

        Args:
            name: of the input.
        """
        each = self.inputs[name]
        if name == "strength":
            return "as the specimens do"
        if each.shape != "lognormal":
            return f"+- {each.spread:.3g}"
        text = f"a factor of {math.exp(each.spread):.3g}"
        return f"{text} (estimate)" if name in self.estimated else text

    def doubt(self) -> str:
        """Why the life is an interval, in a sentence."""
        most = max(self.robot.shares, key=lambda name: self.robot.shares[name])
        count = len(self.estimated)
        who = f"{count} input{'s are estimates' if count > 1 else ' is an estimate'}"
        text = (
            f"{who if count else 'inputs have spreads'}, results are 80 % ranges; {most} matters "
            f"most ({100 * self.robot.shares[most]:.0f} % of the variance)"
        )
        wide = "" if math.isnan(self.decades) else f"is {spoken.factor(self.decades)} wide"
        if math.isinf(self.robot.p90) and math.isfinite(self.robot.p10):
            wide = "is open upwards"
        elif not self.decades > _WIDE:
            return text
        return (
            f"{text}; the interval {wide}: it tells which joints are weak, and hardly how long "
            "they last"
        )

    @property
    def decades(self) -> float:
        """Width from P10 to P90 of the robot's life, powers of ten; NaN where it is unlimited."""
        low, high = self.robot.p10, self.robot.p90
        if not (low > 0.0 and high < math.inf):
            return math.nan
        return math.log10(high / low)

    def _repr_html_(self) -> str:
        rows = [
            (name, *(spoken.count(s.rounded(key)) for key in s.quantiles), 100 * s.endless)
            for name, s in {**self.joints, "robot": self.robot}.items()
        ]
        columns = ("rivets to failure", "P10", "P50", "P90", "without end [%]")
        facts = {"varied": ", ".join(self.inputs)}
        return sheet("How sure the life is", facts, columns, rows, head=self._headline())

    def _headline(self) -> str:
        lives = (spoken.count(self.robot.rounded(key)) for key in self.robot.quantiles)
        return "rivets to failure P10 {}, P50 {}, P90 {}".format(*lives)

    def _rows(self) -> list[dict[str, Any]]:
        spreads = {**self.joints, "robot": self.robot}
        return [
            {"name": name, "p10": s.p10, "p50": s.p50, "p90": s.p90, "endless": s.endless}
            for name, s in spreads.items()
        ]

    def _content(self) -> dict[str, Any]:
        return {key: value for key, value in vars(self).items() if key != "lives"}
