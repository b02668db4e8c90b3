"""The fit to static loadings: robust, with all that is never exact as numbers of its own.

The most probable springs and nuisances under normal priors, with the rows' errors distributed as
Student's t (Lange, Little and Taylor, JASA 84 (1989) 881, doi:10.1080/01621459.1989.10478852): a
row that does not fit pulls ever less. Gauss-Newton with the rows' weights; the instruments' noise
and the tails are those of the highest evidence (Laplace's approximation; MacKay, Neural Comp. 4
(1992) 415, doi:10.1162/neco.1992.4.3.415).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from typing import Any, NamedTuple, Protocol

import numpy as np
from scipy.optimize import minimize_scalar, nnls
from scipy.special import gammaln
from scipy.stats import chi2
from scipy.stats import t as student

from picchio.core.arrays import BoolArray, FloatArray, IndexArray
from picchio.diagnosis.stiffness.presses import Press
from picchio.diagnosis.stiffness.prior import Prior, Spring, Suspect
from picchio.diagnosis.stiffness.statics import Table, Yield

TAILS = (3.0, 6.0, 15.0, math.inf)
"""Degrees of freedom that are tried; infinite: normal."""
_NOISE_STD = math.log(10.0) / 1.645  # the instrument's stated noise is right within a factor of ten
_LEAST_NOISE = 1e-9  # m or rad, of files that are exact
_PLAY = 1e-3  # rad or m: what play a joint may have, one standard deviation
_STEPS, _ROUNDS = 60, 12


@dataclass(frozen=True, eq=False)
class Problem:
    """The loadings of all records, the prior, and the springs beside the joints.

    Attributes:
        tables: a record each.
        prior: of the joints.
        noise: by group of readings, the stated standard deviation, m or rad.
        causes: what there is beside the joints' springs.
        gravity: whether gravity's change with the deflection counts.
        robust: whether rows may be outliers.
    """

    tables: tuple[Table | Press, ...]
    prior: Prior
    noise: dict[str, float]
    causes: tuple[Suspect, ...] = ()
    gravity: bool = True
    robust: bool = True

    @cached_property
    def extra(self) -> tuple[Spring, ...]:
        """The springs beside the joints': what every such record has, then the causes'."""
        own = tuple(spring for table in self.tables for spring in table.always)
        return own + tuple(cause.spring for cause in self.causes if cause.spring is not None)

    @cached_property
    def groups(self) -> tuple[str, ...]:
        """What is read with, in the order of its noise."""
        return tuple(sorted({group for table in self.tables for group in table.groups}))

    @cached_property
    def steps(self) -> tuple[str, ...]:
        """The numbers that are never exact, by name."""
        names = [name for table in self.tables for name, size in table.step.items()
                 if size > 0.0 or name in self.loose]  # fmt: skip
        return (*dict.fromkeys(names), *(f"play.{j}" for one in self.causes for j in one.play))

    @cached_property
    def loose(self) -> dict[str, float]:
        """Standard deviations, SI, of what is less exact than the tolerances have it."""
        return {name: size for cause in self.causes for name, size in cause.loose}

    def size_of(self, name: str) -> float:
        """The standard deviation, SI, of a number that is never exact.

        Args:
            name: of `steps`.
        """
        if name.startswith("play."):
            return _PLAY
        own = next(table.unit[name] * table.step[name] for table in self.tables
                   if name in table.step)  # fmt: skip
        return self.loose.get(name, own)

    @cached_property
    def zeros(self) -> tuple[tuple[int, int, int], ...]:
        """(table, set, reading) of each zero that is not known."""
        return tuple(
            (k, int(number), reading)
            for k, table in enumerate(self.tables)
            for number in np.unique(table.set[table.set >= 0])
            for reading in range(table.values.shape[1])
        )

    @property
    def joints(self) -> int:
        """How many joints yield."""
        return len(self.prior.covariance)

    @property
    def springs(self) -> int:
        """How many stiffnesses are sought: first the joints', then the others."""
        return self.joints + len(self.extra)

    @cached_property
    def precision(self) -> FloatArray:
        """(p, p) of all numbers before the tests; their means are zero."""
        count = self.springs + len(self.steps) + len(self.zeros)
        found = np.eye(count)
        n = self.joints
        found[:n, :n] = np.linalg.inv(self.prior.covariance)
        for k, spring in enumerate(self.extra):
            found[n + k, n + k] = spring.std**-2
        return found

    @cached_property
    def rows(self) -> int:
        """Loadings in all."""
        return sum(len(table) for table in self.tables)

    def predict(
        self, at: FloatArray, known: Sequence[Predicted] | None = None, slopes: bool = True
    ) -> list[Predicted]:
        """What is read, and how it changes with every number.

        Args:
            at: (p,) logarithms of the springs over the stated ones; then the other numbers, in
                standard deviations.
            known: at a place not far off; see `yields`.
            slopes: not used: values rest on them.
        """
        n, found = self.joints, []
        for k, table in enumerate(self.tables):
            coordinates = [
                (table.names.index(name), n + j)
                for j, spring in enumerate(self.extra)
                for name in spring.coordinates
                if name in table.names
            ]
            active = [*range(n), *(index for index, _ in coordinates)]
            owner = np.array([*range(n), *(spring for _, spring in coordinates)], dtype=np.intp)
            scale = np.exp(np.clip(at[: self.springs], -12.0, 12.0))
            base = [spring.stiffness for spring in self.extra]
            stiffness = np.column_stack(
                [table.spring * scale[:n]]
                + [np.full(len(table), base[s - n] * scale[s]) for s in owner[n:]]
            )
            out = table.yields(
                active, stiffness, gravity=self.gravity,
                known=known[k].yielded if known is not None else None,
            )  # fmt: skip
            slope = np.zeros((*out.values.shape, len(at)))
            for column, spring in enumerate(owner):
                slope[..., spring] += out.by_spring[..., column]
            values = out.values.copy()
            for j, name in enumerate(self.steps, start=self.springs):
                if name in out.by_step:
                    loose = self.loose.get(name)
                    steps = table.step[name] if loose is None else loose / table.unit[name]
                    slope[..., j] = steps * out.by_step[name]
                elif name.startswith("play."):
                    slope[..., j] = _PLAY * table.play(int(name.removeprefix("play.")))
                values += at[j] * slope[..., j]
            first = self.springs + len(self.steps)
            for j, (which, number, reading) in enumerate(self.zeros, start=first):
                if which == k:
                    zero = table.zero[reading]
                    slope[table.set == number, reading, j] = zero
                    values[table.set == number, reading] += zero * at[j]
            own = out.own @ out.own.swapaxes(1, 2)
            found.append(Predicted(table.values - values, slope, own, out))
        return found


class Rows(Protocol):
    """Rows of readings that are fitted together."""

    @property
    def values(self) -> FloatArray:
        """(m, r) as measured."""

    @property
    def groups(self) -> tuple[str, ...]:
        """(r,) what each reading is read with."""

    def __len__(self) -> int: ...


class Fitted(Protocol):
    """What `climb` needs of a problem; see `Problem`."""

    @property
    def tables(self) -> Sequence[Rows]:
        """The rows."""

    @property
    def noise(self) -> Mapping[str, float]:
        """By group, as stated."""

    @property
    def groups(self) -> tuple[str, ...]:
        """What is read with."""

    @property
    def rows(self) -> int:
        """Rows in all."""

    @property
    def springs(self) -> int:
        """How many numbers, the first, are logarithms that no step may change by much."""

    @property
    def precision(self) -> FloatArray:
        """(p, p) of all numbers before the tests."""

    def predict(
        self, at: FloatArray, known: Sequence[Predicted] | None = None, slopes: bool = True
    ) -> list[Predicted]:
        """Residuals and their slopes.

        Args:
            at: (p,) the numbers.
            known: at a place not far off.
            slopes: False where none is needed: they may be left empty.

        Returns:
            one for each table.
        """


@dataclass(frozen=True, eq=False)
class Predicted:
    """A table's residual.

    Attributes:
        residual: (m, r) m or rad, measured less predicted.
        slope: (m, r, p) of the prediction; (m, r, 0) where none was asked for.
        own: (m, r, r) covariance of what is drawn for each row anew, or (m, r) variances where
            no two readings share it; None for none.
        yielded: what it rests on.
    """

    residual: FloatArray
    slope: FloatArray
    own: FloatArray | None
    yielded: Yield | None = None


@dataclass(frozen=True, eq=False)
class Fit:
    """What the loadings say.

    Attributes:
        problem: what was fitted.
        mean: (p,) the most probable numbers, see `Problem.predict`.
        covariance: (p, p) about it.
        evidence: log probability of the data.
        noise: by group of readings, m or rad.
        tails: degrees of freedom of the rows' errors.
        chi2: (rows,) squared residual over its covariance.
        weight: (rows,) 1 of what fits; near 0 of outliers.
        readings: (rows,) of each row.
        freedom: of the noise: how many readings more than numbers.
        information: (rows, springs) each row's squared slope over its covariance, by spring.
        data_information: (p, p) of the loadings alone, what is known before them left out.
    """

    problem: Any
    mean: FloatArray
    covariance: FloatArray
    evidence: float
    noise: dict[str, float]
    tails: float
    chi2: FloatArray
    weight: FloatArray
    readings: FloatArray
    freedom: float
    information: FloatArray
    data_information: FloatArray

    @property
    def std(self) -> FloatArray:
        """(springs,) standard deviations of the logarithms."""
        return np.sqrt(np.diag(self.covariance))[: self.problem.springs]

    def half(self, level: float = 0.90) -> float:
        """How many standard deviations an interval reaches to either side.

        Args:
            level: of the interval, two-sided.
        """
        return float(student.ppf(0.5 + 0.5 * level, max(self.freedom, 3.0)))

    @property
    def outliers(self) -> BoolArray:
        """(rows,) what would turn up in 1 of 100 such tables without any outlier."""
        level = 1.0 - 0.01 / max(len(self.chi2), 1)
        return np.asarray(self.chi2 > chi2.ppf(level, self.readings))


def fit(problem: Problem, rows: BoolArray | None = None, *, start: Fit | None = None) -> Fit:
    """The most probable springs.

    Args:
        problem: the loadings and what is known before.
        rows: (rows,) which loadings count; all if None.
        start: where to begin; None tries several places: the stated values, half and twice of
            them, and those of plain non-negative least squares in the compliances.

    Returns:
        the best of them, with the tails of the highest evidence.
    """
    places = [start.mean] if start is not None else _starts(problem, rows)
    tails = ([start.tails] if start is not None else TAILS) if problem.robust else [math.inf]
    best: Fit | None = None
    for tail in tails:
        for at in places if best is None else [best.mean]:
            found = climb(problem, at, tail, rows)
            if best is None or found.evidence > best.evidence:
                best = found
    assert best is not None
    return best


def _starts(problem: Problem, rows: BoolArray | None) -> list[FloatArray]:
    nothing = np.zeros(len(problem.precision))
    n = problem.joints
    found = [nothing.copy()]
    if not any(isinstance(table, Table) for table in problem.tables):
        return found  # torques are nearly linear in the stiffness
    for step in (-math.log(2.0), math.log(2.0)):
        found.append(nothing.copy())
        found[-1][: problem.springs] = step
    # A loading's reading is nearly linear in compliances: d y / d c = - k d y / d ln k at the
    # stated values.
    keep = _split(problem, np.ones(problem.rows, bool) if rows is None else rows)
    parts = [
        (-part.slope[kept][..., :n].reshape(-1, n), table.values[kept].ravel())
        for table, part, kept in zip(problem.tables, problem.predict(nothing), keep, strict=True)
        if isinstance(table, Table)
    ]
    matrix = np.concatenate([slope for slope, _ in parts])
    values = np.concatenate([of for _, of in parts])
    size = np.linalg.norm(matrix, axis=0)
    usable = size > 0.0
    if usable.any():
        at = nothing.copy()
        share = nnls(matrix[:, usable] / size[usable], values)[0] / size[usable]
        at[:n][usable] = -np.log(np.clip(share, 0.05, 20.0))
        found.append(at)
    return found


def _split(problem: Fitted, rows: BoolArray) -> list[BoolArray]:
    ends = np.cumsum([len(table) for table in problem.tables])[:-1]
    return np.split(np.asarray(rows), ends)


@dataclass(frozen=True, eq=False)
class _Run:
    """The m rows of tables, one after the other, that have as many readings a row.

    Attributes:
        rows: which of all.
        group: (m, r) of each reading, the number of its noise.
        both: (m, r, p + 1) slopes and, last, the residual.
        own: as of `Predicted`.
    """

    rows: slice
    group: IndexArray
    both: FloatArray
    own: FloatArray | None

    @classmethod
    def all_of(cls, problem: Fitted, parts: Sequence[Predicted]) -> Iterator[_Run]:
        """In the tables' order."""
        begin, number = 0, {group: k for k, group in enumerate(problem.groups)}

        def alike(pair: tuple[Rows, Predicted]) -> tuple[int, int]:
            table, part = pair
            return len(table.groups), 0 if part.own is None else part.own.ndim

        for (_, kind), pairs in groupby(zip(problem.tables, parts, strict=True), alike):
            tables, own = zip(*pairs, strict=True)
            which = np.array([[number[group] for group in table.groups] for table in tables])
            group = np.repeat(which, [len(table) for table in tables], axis=0)
            both = np.concatenate([
                np.concatenate([part.slope, part.residual[..., None]], axis=-1) for part in own
            ])  # fmt: skip
            drawn = np.concatenate([part.own for part in own]) if kind else None
            yield cls(slice(begin, begin + len(group)), group, both, drawn)
            begin += len(group)

    def white(self, noise: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Slopes and residual in standard deviations; (m,) the covariances' logarithms."""
        size = noise[self.group]
        if self.own is None or self.own.ndim == 2:
            each = np.sqrt(size**2 + (0.0 if self.own is None else self.own))
            return self.both / each[..., None], 2.0 * np.log(each).sum(axis=-1)
        lower = np.linalg.cholesky(self.own + size[..., None] ** 2 * np.eye(size.shape[1]))
        logdet = 2.0 * np.log(np.diagonal(lower, axis1=1, axis2=2)).sum(axis=1)
        return np.linalg.solve(lower, self.both), logdet


class _Weighed(NamedTuple):
    """A run's rows under one noise.

    Attributes:
        slope: (m, r, p) in standard deviations.
        square: (m,) of the residual.
        weight: (m,) of a row.
        curve: (m,) what the second derivative makes of it.
        kept: (m,) whether it counts.
    """

    slope: FloatArray
    square: FloatArray
    weight: FloatArray
    curve: FloatArray
    kept: BoolArray

    def product(self, weight: FloatArray) -> FloatArray:
        """(p, p) of the slopes, each row so many times."""
        root = np.sqrt(weight * self.kept)
        flat = (self.slope * root[:, None, None]).reshape(-1, self.slope.shape[-1])
        return np.asarray(flat.T @ flat)


class _State:
    """The score at one place, for given noise and tails."""

    def __init__(self, problem: Fitted, at: FloatArray, tail: float, keep: BoolArray,
                 near: _State | None = None, slopes: bool = True) -> None:  # fmt: skip
        self.problem, self.at, self.tail, self.keep = problem, at, tail, keep
        known = None if near is None else near.parts
        self.parts: list[Predicted] = problem.predict(at, known, slopes)
        self.slopes, self.runs = slopes, tuple(_Run.all_of(problem, self.parts))

    def weigh(self, noise: FloatArray) -> float:
        """Fill in weights and, with slopes, the gradient; the negative log posterior."""
        precise, v = self.problem.precision @ self.at, self.tail
        score = 0.5 * float(self.at @ precise)
        self.gradient, self.weighed = precise, list[_Weighed]()
        for run in self.runs:
            white, logdet = run.white(noise)
            toward, kept, r = white[..., -1], self.keep[run.rows], white.shape[1]
            square = (toward**2).sum(axis=1)
            if math.isinf(v):
                weight, curve = np.ones(len(square)), np.ones(len(square))
                own = 0.5 * square + 0.5 * r * math.log(2.0 * math.pi)
            else:
                weight = (v + r) / (v + square)
                # The second derivative of the t density, its directions averaged.
                curve = np.maximum(weight - 2.0 * weight**2 * square / ((v + r) * r), 0.0)
                own = 0.5 * (v + r) * np.log1p(square / v) + (
                    gammaln(0.5 * v) - gammaln(0.5 * (v + r)) + 0.5 * r * math.log(v * math.pi)
                )
            score += float(((own + 0.5 * logdet) * kept).sum())
            self.weighed.append(_Weighed(white[..., :-1], square, weight, curve, kept))
            if self.slopes:
                pull = (weight * kept)[:, None] * toward
                self.gradient = self.gradient - np.tensordot(pull, white[..., :-1], 2)
        return score

    @property
    def step_matrix(self) -> FloatArray:
        """(p, p) what a step divides the gradient by."""
        return sum((one.product(one.weight) for one in self.weighed), self.problem.precision)

    @property
    def information(self) -> FloatArray:
        """(p, p) of the readings."""
        nothing = np.zeros_like(self.problem.precision)
        return sum((one.product(one.curve) for one in self.weighed), nothing)


def climb(
    problem: Fitted,
    at: FloatArray,
    tail: float = math.inf,
    rows: BoolArray | None = None,
) -> Fit:
    """The most probable numbers near a place, with the noise of the highest evidence.

    Args:
        problem: what is fitted.
        at: (p,) where to begin.
        tail: degrees of freedom of the rows' errors; infinite: normal.
        rows: (rows,) which of them count; all if None.

    Returns:
        the fit.
    """
    keep = np.ones(problem.rows, bool) if rows is None else np.asarray(rows)
    stated = np.log([max(problem.noise[group], _LEAST_NOISE) for group in problem.groups])
    noise = stated.copy()
    state = _State(problem, at.copy(), tail, keep)
    # The first noise is what the residual shows: no row is an outlier of a fit not yet made.
    for k in range(len(noise)):
        inside = np.concatenate(
            [run.both[..., -1][(run.group == k) & keep[run.rows, None]] for run in state.runs]
        )
        if inside.size:
            noise[k] = max(noise[k], math.log(1.5 * float(np.median(np.abs(inside))) + 1e-300))

    def whole(state: _State, noise: FloatArray) -> float:
        score = state.weigh(np.exp(noise))
        logdet = np.linalg.slogdet(state.information + problem.precision)[1]
        return score + 0.5 * logdet + 0.5 * float((((noise - stated) / _NOISE_STD) ** 2).sum())

    last = math.inf
    for _ in range(_ROUNDS):
        state = _State(problem, state.at, tail, keep)
        state = _newton(problem, state, tail, keep, noise)
        for k in range(len(noise)):

            def off(x: float, k: int = k, state: _State = state) -> float:
                return whole(state, np.where(np.arange(len(noise)) == k, x, noise))

            window = (noise[k] - 3.0, noise[k] + 3.0)
            noise[k] = minimize_scalar(off, bounds=window, method="bounded",
                                       options={"xatol": 1e-2}).x  # fmt: skip
        now = whole(state, noise)
        if abs(last - now) < 1e-2:
            break
        last = now
    return _made(problem, state, tail, noise, keep, whole(state, noise))


def score(problem: Fitted, at: FloatArray, like: Fit) -> float:
    """The negative log posterior of some numbers, but for a constant.

    Args:
        problem: what is fitted.
        at: (p,) the numbers.
        like: whose noise and tails count.
    """
    noise = np.array([like.noise[group] for group in problem.groups])
    every = np.ones(problem.rows, bool)
    return _State(problem, at, like.tails, every, slopes=False).weigh(noise)


def _newton(
    problem: Fitted,
    state: _State,
    tail: float,
    keep: BoolArray,
    noise: FloatArray,
) -> _State:
    size = np.exp(noise)
    score = state.weigh(size)
    for _ in range(_STEPS):
        step = -np.linalg.solve(state.step_matrix, state.gradient)
        gain = -float(step @ state.gradient)
        if gain < 1e-6:
            break
        # No spring changes by more than a factor of e at once.
        share = min(1.0, 1.0 / max(float(np.abs(step[: problem.springs]).max()), 1e-300))
        while share > 1e-4:
            tried = math.inf
            with suppress(np.linalg.LinAlgError):  # masses that no arm has: too long a step
                other = _State(problem, state.at + share * step, tail, keep, state)
                tried = other.weigh(size)
            if tried < score - 1e-4 * share * gain:
                break
            share *= 0.4
        else:
            break
        state, score = other, tried
    return state


def _made(
    problem: Fitted, state: _State, tail: float, noise: FloatArray, keep: BoolArray, score: float
) -> Fit:
    information, weighed = state.information, state.weighed
    precise = information + problem.precision
    covariance = np.linalg.inv(precise)
    covariance = 0.5 * (covariance + covariance.T)
    prior = 0.5 * np.linalg.slogdet(problem.precision)[1]  # the 2 pi of prior and volume cancel
    readings = np.concatenate([np.full(len(one.square), one.slope.shape[1]) for one in weighed])
    by_row = [(one.slope[..., : problem.springs] ** 2).sum(axis=1)
              * (one.curve * one.kept)[:, None] for one in weighed]  # fmt: skip
    told = float(np.trace(covariance @ information))
    return Fit(
        problem, state.at, covariance, prior - score,
        dict(zip(problem.groups, np.exp(noise).tolist(), strict=True)), tail,
        np.concatenate([one.square for one in weighed]),
        np.concatenate([one.weight for one in weighed]), readings.astype(float),
        float(readings[keep].sum()) - told, np.concatenate(by_row), information,
    )  # fmt: skip
