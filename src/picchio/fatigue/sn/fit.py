"""Fit an S-N curve to test data with run-outs; every parameter with a confidence interval."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from statistics import NormalDist
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from picchio.core import spoken
from picchio.core.arrays import FloatArray, as_floats
from picchio.core.errors import InputError, warn_user
from picchio.core.fitted import Fit, FittedValue
from picchio.core.listing import Key, Listing
from picchio.core.processes import one_thread
from picchio.core.results import TableResult
from picchio.fatigue.sn.curve import SNCurve
from picchio.fatigue.sn.library import write_sn_curve
from picchio.fatigue.sn.likelihood import Likelihood, Profile, maximise
from picchio.fatigue.sn.test_table import SNTests, read_sn_tests

METHOD = (
    "maximum likelihood; Basquin's line with an endurance limit; log-normal strength and "
    "life; profile likelihood intervals with Student's t threshold, scatter by the Cox-Reid "
    "adjusted profile"
)

# Beyond, an interval has no ends that these numbers could find.
LOWEST_LEVEL, HIGHEST_LEVEL = 0.01, 0.9999
# What shear stress a tested stress stands for, and the note that says so. Distortion energy: the
# shear strength of ductile steel is 1 / sqrt(3) of the normal one.
_TO_SHEAR = {
    "shear": (1.0, "the tests' stresses are taken as shear (--kind)"),
    "normal": (3.0**-0.5, "normal stresses were divided by sqrt(3) to shear"),
}


@dataclass(frozen=True)
class Estimate:
    """A fitted value and its confidence interval; 0 or inf where the data set no bound."""

    value: float
    low: float
    high: float


_UNITS = {"slope": "", "knee": "cycles", "endurance_limit": "Pa", "design": "Pa", "scatter": ""}


@dataclass(frozen=True, eq=False, repr=False)
class SNFit(TableResult, Fit):
    """A fitted S-N curve; its table is the fitted values with their intervals.

    Attributes:
        tests: what was fitted, their stresses in shear.
        slope: k of N ~ amplitude^-k.
        endurance_limit: Pa, median. Without a knee: the median strength at `reference_cycles`.
        design: Pa, the same at `design_survival`.
        scatter: standard deviation of log10 strength at a given life, free of the bias of maximum
            likelihood. It holds the specimens' strength and the scatter of life by itself, so at
            the endurance limit it is on the safe side.
        knee: cycles at the knee; None where no run-out shows one.
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
            as the intervals are; zeros where there is no knee.
    """

    PLOTS: ClassVar = {"tests": "visuals.plots.sn:plot_sn_fit"}
    LACKS: ClassVar = {"show": "a curve has no place in space"}

    tests: SNTests
    slope: Estimate
    endurance_limit: Estimate
    design: Estimate
    scatter: Estimate
    knee: Estimate | None
    strength_share: float
    design_survival: float
    reference_cycles: float
    level: float
    failures: int
    run_outs: int
    log_likelihood: float
    assumptions: tuple[str, ...]
    covariance: tuple[tuple[float, ...], ...] = ()

    def _headline(self) -> str:
        strength = (
            "endurance limit" if self.knee else f"strength at {self.reference_cycles:g} cycles"
        )
        return (
            f"slope {self.slope.value:.3g}, "
            f"{strength} {1e-6 * self.endurance_limit.value:.4g} MPa, "
            f"{self.failures} failures, {self.run_outs} run-outs"
        )

    def _rows(self) -> list[dict[str, Any]]:
        told = {name: getattr(self, name) for name in _UNITS}
        return [{"name": n, **vars(e), "unit": _UNITS[n]} for n, e in told.items() if e is not None]

    def _fitted(self) -> Iterator[FittedValue]:
        wide = 2.0 * NormalDist().inv_cdf(0.5 + 0.5 * self.level)
        for row in self._rows():
            value, low, high = row["value"], row["low"], row["high"]
            yield FittedValue(
                row["name"],
                value,
                (high - low) / wide,
                row["unit"] or "1",
                0.0,
                note=f"{self.level:.0%} between {low:.5g} and {high:.5g}",
            )
        if self.knee is None:
            yield FittedValue("knee", math.inf, math.nan, "cycles", vary=False)

    def _listing(self) -> Listing:
        """What was fitted, each with its interval."""
        limit = "endurance limit in shear, median [MPa]"
        if not self.knee:
            limit = f"strength in shear at {self.reference_cycles:.3g} cycles, median [MPa]"
        told = {
            "slope": (self.slope, 1.0),
            "knee [cycles]": (self.knee, 1.0),
            limit: (self.endurance_limit, 1e-6),
            f"the same, survival {self.design_survival:g} [MPa]": (self.design, 1e-6),
            "scatter of log10 strength": (self.scatter, 1.0),
        }
        rows = [(name, e.value * f, (e.low * f, e.high * f)) for name, (e, f) in told.items() if e]
        columns: dict[str, Key] = {
            "": lambda row: row[0],
            "value": lambda row: row[1],
            f"{100 * self.level:g} % interval": lambda row: spoken.between(row[2]),
        }
        return Listing.of("S-N fit", rows, columns, note="; ".join(self.assumptions))

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

    def save(self, path: str | Path) -> None:
        """Write the curve at `design_survival` to a TOML file, named after the file.

        Args:
            path: the file; `load_sn_curve` and `--sn-curve` read it.

        Raises:
            OutputError: it cannot be written there.
        """
        write_sn_curve(self.curve(self.design_survival, name=Path(path).stem), path)

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

    def _content(self) -> dict[str, Any]:
        from picchio.core.provenance import provenance

        left_out = ("tests", "covariance")
        return {
            "format": "picchio-sn/1",
            "method": METHOD,
            **{name: value for name, value in vars(self).items() if name not in left_out},
            "provenance": provenance([] if self.tests.file is None else [self.tests.file]),
        }


@one_thread()
def fit_sn(
    tests: str | Path | SNTests,
    *,
    kind: str = "shear",
    level: float = 0.90,
    survival: float = 0.975,
    knee: bool | None = None,
    run_out_cycles: float | None = None,
    **columns: Any,
) -> SNFit:
    """Fit slope, knee, endurance limit and scatter to fatigue tests, by maximum likelihood.

    The model is `picchio.fatigue.sn.likelihood`'s. Intervals invert the profile likelihood with
    the threshold n ln(1 + t^2 / (n - 2)) that is exact for a regression line, n being the number
    of failures that would inform the scatter as much as these tests do; the scatter's inverts the
    adjusted profile likelihood of Cox and Reid (J. R. Statist. Soc. B 49, 1987).

    How often 90 % intervals held the truth in 2,000 sets of 30 tests, and of 100, with about a
    quarter of run-outs (slope, knee, limit, design, scatter; standard error 0.7 points):

    - scatter half strength, half life: 90, 91, 89, 89, 89 %; and 92, 92, 90, 90, 91 %
    - a quarter strength: 89, 89, 94, 89, 88 %; and 90, 90, 92, 90, 89 %
    - all strength: 87, 89, 89, 90, 88 %; and 83, 80, 88, 89, 91 %
    - all life, the limit the same for all: 84, 85, 100, 87, 83 %; and 87, 81, 63, 79, 83 %

    So where the scatter is all of one kind the intervals are too narrow, the more so with many
    tests, and `assumptions` says so where the tests show it.

    Args:
        tests: stress amplitudes (Pa), cycles and outcomes, or a table of them (see
            `read_sn_tests`).
        kind: what the tested stress is: "shear", or "normal" (bending, axial), which is divided
            by sqrt(3) (distortion energy).
        level: of the two-sided intervals.
        survival: probability that the design strength is for.
        knee: True: fit a knee. False: a straight line, run-outs censored. None: a knee where the
            tests have run-outs.
        run_out_cycles: in a table without outcomes, tests that reached this are run-outs.
        columns: of a table, what its columns are, as `read_sn_tests` takes it: `stress`,
            `stress_column`, `stress_unit` (Pa where it is SI), `ratio`, `cycles`, `outcome`.

    Returns:
        each value with its interval; `curve` makes an S-N curve of it.

    Raises:
        InputError: a table that cannot be read, arrays that do not match, values that are not
            positive, a `level` or `survival` that is no probability, an unknown `kind`, or tests
            that cannot show a slope or a scatter.
    """
    if kind not in _TO_SHEAR:
        raise InputError("unknown", key="kind", value=kind, choices=_TO_SHEAR)
    if run_out_cycles is not None and not 0.0 < run_out_cycles < np.inf:
        raise InputError("must be positive", key="run_out_cycles", value=run_out_cycles)
    for key, value in (("survival", survival), ("level", level)):
        if not 0.0 < value < 1.0:
            raise InputError("must lie between 0 and 1", key=key, value=value)
    if not LOWEST_LEVEL <= level <= HIGHEST_LEVEL:
        raise InputError(
            f"must lie between {LOWEST_LEVEL} and {HIGHEST_LEVEL}", key="level", value=level
        )
    given = tests
    if not isinstance(given, SNTests):
        given = read_sn_tests(given, run_out_cycles=run_out_cycles, **columns)
    factor, note = _TO_SHEAR[kind]
    given = dataclasses.replace(
        given,
        amplitude=factor * as_floats(given.amplitude, "amplitude"),
        cycles=as_floats(given.cycles, "cycles"),
    )
    try:
        known = _likelihood(given)
    except InputError as error:
        raise error.placed(file=given.file) from None
    run_outs = int((~known.failed).sum())
    with_knee = run_outs > 0 if knee is None else knee
    notes = [
        note,
        f"{known.failed.sum()} failures, {run_outs} run-outs taken as tests stopped alive",
    ]
    if with_knee:
        notes.append("about half of the scatter is strength unless the tests show otherwise")
    else:
        notes.append("no knee: a straight line")
    if with_knee and run_outs == 0:
        raise InputError("a knee needs run-outs", key="knee", value=knee)
    if knee is None and not with_knee:
        warn_user("no test is a run-out, so the fit has no knee and no endurance limit")
    free = [0, 1, 2, 3, 4] if with_knee else [0, 2, 3]
    known = dataclasses.replace(known, limited=with_knee)
    theta = _best(known, free)
    median = Profile(known, theta, free, level)
    at_quantile = theta.copy()
    z = NormalDist().inv_cdf(survival)
    at_quantile[0] -= z * np.exp(theta[3])
    design = Profile(dataclasses.replace(known, z=z), at_quantile, free, level)

    share = float(1.0 / (1.0 + np.exp(-median.theta[4])))
    if with_knee and not 0.2 < share < 0.8:
        kind = "strength" if share > 0.5 else "life at a given strength"
        notes.append(f"the scatter is nearly all in {kind}: the intervals are too narrow")

    def estimate(profile: Profile, index: int) -> Estimate:
        low, high = profile.interval(index)
        return Estimate(*(float(np.exp(v)) for v in (profile.theta[index], low, high)))

    spread, low, high = (float(np.exp(v) / np.log(10.0)) for v in median.scatter())
    scatter = Estimate(spread, low, high)
    return SNFit(
        tests=dataclasses.replace(given, failed=known.failed),
        slope=estimate(median, 2),
        knee=estimate(median, 1) if with_knee else None,
        endurance_limit=estimate(median, 0),
        design=dataclasses.replace(
            estimate(design, 0),
            # With the same scatter as `curve`, so that both say the same.
            value=float(np.exp(median.theta[0])) * 10.0 ** (-z * spread),
        ),
        scatter=scatter,
        strength_share=share,
        design_survival=survival,
        reference_cycles=float(f"{np.exp(median.theta[1]):.12g}"),
        level=level,
        failures=int(known.failed.sum()),
        run_outs=run_outs,
        log_likelihood=median.value,
        assumptions=(*notes, *given.assumptions),
        covariance=median.covariance(),
    )


def _likelihood(tests: SNTests) -> Likelihood:
    stress, life = tests.amplitude, tests.cycles
    broke = np.asarray(tests.failed)
    if broke.dtype != np.bool_ and not np.isin(broke, (0, 1)).all():
        raise InputError("must be true or false", key="failed", value=tests.failed)
    broke = broke.astype(bool)
    if stress.ndim != 1 or not stress.shape == life.shape == broke.shape:
        raise InputError(
            "amplitude, cycles and failed must be 1-D and equally long",
            key="tests",
            value=(stress.shape, life.shape, broke.shape),
        )
    for key, values in (("amplitude", stress), ("cycles", life)):
        if values.size and values.min() <= 0:
            raise InputError("must be positive", key=key, value=float(values.min()))
    if broke.sum() < 6:
        raise InputError("needs at least 6 failures", key="tests", value=int(broke.sum()))
    if len(np.unique(stress[broke])) < 2:
        raise InputError("needs failures at two stresses or more", key="tests")
    return Likelihood(np.log(stress), np.log(life), broke)


def _best(tests: Likelihood, free: list[int]) -> FloatArray:
    """The maximum, from several starts: the likelihood can have more than one."""
    stress, life = tests.stress[tests.failed], tests.cycles[tests.failed]
    slope = float(np.clip(-np.polyfit(stress, life, 1)[0], 1.0, 60.0))
    # Without a knee the strength is given at a round number of cycles amid the failures.
    decade = np.log(10.0) * np.round(np.mean(life) / np.log(10.0))
    knees = np.quantile(life, [0.4, 0.7, 0.95]) if 1 in free else [decade]
    best: tuple[float, FloatArray] | None = None
    for knee in knees:
        limit = float(np.mean(stress) - (knee - np.mean(life)) / slope)
        spread = max(float(np.std(life + slope * stress)) / slope, 1e-4)
        for share in (-1.0, 2.0) if 4 in free else (0.0,):
            start = np.array([limit, knee, np.log(slope), np.log(spread), share])
            value, theta = maximise(tests, start, free)
            if np.isfinite(value) and (best is None or value > best[0]):
                best = (value, theta)
    if best is None or best[1][3] < np.log(1e-6):
        raise InputError(
            "the tests lie exactly on a line: no scatter can be estimated", key="tests"
        )
    return best[1]
