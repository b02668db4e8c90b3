"""A fitted S-N curve: its parameters with their intervals, and how sure the line is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from picchio.fatigue._types import FloatArray, as_floats
from picchio.fatigue.sn_curve import SNCurve

METHOD = (
    "maximum likelihood; Basquin's line with an endurance limit; log-normal strength and "
    "life; profile likelihood intervals with Student's t threshold, scatter by the Cox-Reid "
    "adjusted profile"
)


@dataclass(frozen=True)
class Estimate:
    """A fitted value and its confidence interval; an end that the data do not bound is 0 or inf."""

    value: float
    low: float
    high: float

    def to_dict(self) -> dict[str, float | None]:
        """For JSON; an infinite end is None."""
        return {
            name: (float(v) if np.isfinite(v) else None)
            for name, v in (("value", self.value), ("low", self.low), ("high", self.high))
        }


@dataclass(frozen=True)
class SNFit:
    """A fitted S-N curve.

    Attributes:
        slope: k of N ~ amplitude^-k.
        knee: cycles at the knee; None where no run-out shows one.
        endurance_limit: Pa, median. Without a knee: the median strength at `reference_cycles`.
        design: Pa, the same at `design_survival`.
        scatter: standard deviation of log10 strength at a given life, free of the bias of maximum
            likelihood. It holds the specimens' strength and the scatter of life by itself, so at
            the endurance limit it is on the safe side.
        strength_share: share of the scatter's variance that is the specimens' strength, which
            alone counts at the endurance limit (maximum likelihood; few tests show it badly).
        design_survival: the probability that `design` is for.
        reference_cycles: where the strengths are given.
        level: of the intervals, two-sided.
        failures: number of failed specimens.
        run_outs: number of survivors.
        log_likelihood: at the maximum, natural, density in ln cycles, penalty included.
        assumptions: what was assumed, in words.
        covariance: (3, 3) of ln endurance limit, ln knee and ln slope, widened for small samples
            as the intervals are; zeros for a knee that is none.
    """

    slope: Estimate
    knee: Estimate | None
    endurance_limit: Estimate
    design: Estimate
    scatter: Estimate
    strength_share: float
    design_survival: float
    reference_cycles: float
    level: float
    failures: int
    run_outs: int
    log_likelihood: float
    assumptions: tuple[str, ...]
    covariance: tuple[tuple[float, ...], ...] = ()

    def _repr_html_(self) -> str:
        from picchio.core.html import sheet

        told = {
            "slope k": (self.slope, 1.0),
            "knee [cycles]": (self.knee, 1.0),
            "endurance limit, median [MPa]": (self.endurance_limit, 1e-6),
            f"the same at {100 * self.design_survival:g} % survival [MPa]": (self.design, 1e-6),
            "scatter of log10 strength": (self.scatter, 1.0),
        }
        rows = [(name, e.value * f, e.low * f, e.high * f) for name, (e, f) in told.items() if e]
        columns = ("", "best", f"{100 * self.level:g} % from", "to")
        title = f"S-N fit: {self.failures} failures, {self.run_outs} run-outs"
        return sheet(title, None, columns, rows, "; ".join(self.assumptions))

    def curve(self, survival: float = 0.5, name: str = "fitted") -> SNCurve:
        """The fitted curve as an `SNCurve`, moved to a probability of survival.

        Args:
            survival: of a specimen; the fit's own uncertainty is not in it (see `design.low`).
            name: what to call it.
        """
        median = SNCurve(
            name=name,
            strength=self.endurance_limit.value,
            cycles=self.reference_cycles,
            slopes=(self.slope.value,),
            knees=(self.reference_cycles,) if self.knee is not None else (),
            survival=0.5,
            scatter=self.scatter.value,
            source=f"fitted to {self.failures} failures and {self.run_outs} run-outs by picchio",
            assumptions=self.assumptions,
        )
        return median if survival == 0.5 else median.at_survival(survival)

    def band(self, cycles: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Where the median line itself may lie: pointwise interval at `level`.

        By 4,000 draws of limit, knee and slope from their normal approximation, so near the
        parameters' own intervals and not equal to them.

        Args:
            cycles: (k,) lives.

        Returns:
            lowest and highest median strength (k,), Pa.
        """
        at = np.log(as_floats(cycles, "cycles"))
        knee = np.log(self.reference_cycles)
        centre = np.array([np.log(self.endurance_limit.value), knee, np.log(self.slope.value)])
        rng = np.random.default_rng(0)
        draws = rng.multivariate_normal(centre, self.covariance, 4000, check_valid="ignore")
        above = (draws[:, 1:2] - at) / np.exp(draws[:, 2:3])
        if self.knee is not None:
            above = np.maximum(above, 0.0)
        tail = 50.0 * (1.0 - self.level)
        low, high = np.percentile(np.exp(draws[:, :1] + above), [tail, 100.0 - tail], axis=0)
        return low, high

    def to_dict(self) -> dict[str, Any]:
        """The `picchio-sn/1` record."""
        names = ("slope", "endurance_limit", "design", "scatter")
        return {
            "format": "picchio-sn/1",
            "method": METHOD,
            **{name: getattr(self, name).to_dict() for name in names},
            "knee": None if self.knee is None else self.knee.to_dict(),
            "strength_share": self.strength_share,
            "design_survival": self.design_survival,
            "reference_cycles": self.reference_cycles,
            "level": self.level,
            "failures": self.failures,
            "run_outs": self.run_outs,
            "log_likelihood": self.log_likelihood,
            "assumptions": list(self.assumptions),
        }
