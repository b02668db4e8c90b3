"""What the shipped drive priors were fitted with: `benchmarks/drive_priors.py --refit`.

The model is that of `picchio.robot.drives.hierarchy`. Priors: normal ones, wide against what is
seen, for m, C, a, b; of given spread for g; half-t scales (Gelman, Bayesian Analysis 1, 2006,
515-533), how large in general is learned from all quantities. Draws are Gibbs's. The facts are in
`src/picchio/robot/drives/stiffness/measured.toml`.
"""

from __future__ import annotations

import hashlib
import json
import math
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from picchio.robot.drives import facts
from picchio.robot.drives.facts import (
    CLASSES,
    TARGETS,
    Fitted,
    catalogue_stiffness,
    effort_beside,
    group_of,
    stiffness_beside,
)
from picchio.robot.drives.hierarchy import Draws, Group
from picchio.robot.drives.predictors import (
    OF_STIFFNESS,
    QUANTITIES,
    Predictors,
    places,
    predictors,
)
from picchio.robot.drives.reducer import all_reducers
from picchio.robot.flexible_robot import FlexibleRobot

Array = NDArray[np.float64]
FOLDER = Path(facts.__file__).parent / "stiffness"

_WIDE, _SLOPE = 10.0, 2.0  # standard deviations of the priors of m, and of C, a, b; ln units
_FREEDOM = 4.0  # of the half-t prior of the standard deviations
_VAGUE = 0.1  # shape and rate of the gamma prior of its scale's inverse square
# Of the sampler: with fewer sweeps, scores of robots left out differ from seed to seed by as much
# as the predictors differ among themselves.
_DRAWS, _SWEEPS = 200, 6000
_DIGITS = 3


@dataclass(frozen=True, eq=False)
class MeasuredRobot:
    """A robot of the data.

    Attributes:
        name: of the robot.
        group: (n, 8) logarithms: stiffness in N m/rad of an arm's joints and of a wrist's, then
            the predictors; NaN where not known.
        evidence: how its stiffness was found; "" if it was not.
        source: of what is known of it.
        reducer_share: stiffness of a joint over its reducer's, the joints' geometric mean; None
            where no reducer is known.
    """

    name: str
    group: Group
    evidence: str
    source: str
    reducer_share: float | None

    @property
    def truth(self) -> Array:
        """(n,) ln of the stiffness measured, N m/rad; NaN where it was not."""
        return self.group.values[np.arange(len(self.group.asked)), self.group.asked]


def measured_robots(load: Callable[[str], FlexibleRobot]) -> list[MeasuredRobot]:
    """The robots of `measured.toml`.

    Args:
        load: loads a shipped robot by its name, rigid or not.
    """
    return [_measured(entry, load) for entry in _facts()["robot"]]


def fit_stiffness(
    robots: Sequence[MeasuredRobot], names: Sequence[str] = OF_STIFFNESS, seed: int = 0
) -> Draws:
    """The distribution of stiffness beside the predictors'.

    Args:
        robots: of the data, or some of them.
        names: of the predictors.
        seed: of the chain.
    """
    groups = [stiffness_beside(robot.group, names) for robot in robots]
    return fit(groups, classes=len(CLASSES), class_spread=class_spread(), draws=_DRAWS,
               sweeps=_SWEEPS, seed=seed)  # fmt: skip


def refit(robots: Sequence[MeasuredRobot]) -> Fitted:
    """Fit anew.

    Args:
        robots: of the data.

    Returns:
        the distributions, rounded as the file has them.
    """
    return Fitted(
        _rounded(fit_stiffness(robots)),
        _rounded(fit([effort_beside(one.group) for one in robots], draws=_DRAWS, sweeps=_SWEEPS)),
        _rounded(fit(damping_groups(), draws=_DRAWS, sweeps=_SWEEPS)),
        tuple(robot.reducer_share for robot in robots if robot.reducer_share is not None),
        {place: _rings(robots, place) for place in ("first", "arm")},
    )


def damping_groups() -> list[Group]:
    """The robots of which damping ratios were measured: ln of the ratios, (n, 1)."""
    return [
        Group(np.log(np.array(entry["ratio"]))[:, None], np.zeros((len(entry["ratio"]), 0)),
              np.zeros(len(entry["ratio"]), dtype=np.intp))
        for entry in _facts()["damping"]
    ]  # fmt: skip


def class_spread() -> float:
    """How far classes of reducers differ: the standard deviation of ln stiffness at equal torque.

    The offsets of a line through the catalogues' stiffness against rated torque, one a class.
    """
    rows = [
        (reducer.kind, reducer.rated_torque, own)
        for reducer in all_reducers().values()
        if (own := catalogue_stiffness(reducer)) is not None
    ]
    rows += [("planetary", *row) for row in _facts()["planetary"]["catalogue"]]
    kinds = sorted({row[0] for row in rows})
    design = np.array([[*(float(row[0] == kind) for kind in kinds), math.log(row[1])]
                       for row in rows])  # fmt: skip
    found = np.linalg.lstsq(design, np.log([row[2] for row in rows]), rcond=None)[0]
    return float(np.std(found[:-1], ddof=1))


def to_json(found: Fitted) -> str:
    """The file `fitted.json`.

    Args:
        found: by `refit`.
    """
    plain = json.loads(json.dumps(asdict(found), default=lambda part: part.tolist()))
    text = json.dumps({"facts": facts_hash(), **plain}, separators=(",", ":"))
    return text.replace('],"', '],\n"') + "\n"


def facts_hash() -> str:
    """The SHA-256 of the facts that a fit rests on."""
    return hashlib.sha256((FOLDER / "measured.toml").read_bytes()).hexdigest()


@cache
def _facts() -> dict[str, Any]:
    return tomllib.loads((FOLDER / "measured.toml").read_text(encoding="utf-8"))


def _measured(entry: Mapping[str, Any], load: Callable[[str], FlexibleRobot]) -> MeasuredRobot:
    payload = entry.get("payload")
    if "urdf" in entry:
        found = predictors(load(entry["urdf"]), payload)
    else:
        count = entry["joints"]
        known = {**entry, "payload": [payload or math.nan] + [math.nan] * (count - 1)}
        columns = [known.get(name, [math.nan] * count) for name in QUANTITIES]
        found = Predictors(("",) * count, np.log(np.array(columns)).T, places(count))
    stiffness = np.full(len(found.place), np.nan)
    for k, values in enumerate(entry.get("stiffness", ())):
        stiffness[k] = np.log(values).mean() if values else np.nan
    reducer = np.log(entry["reducer_stiffness"]) if "reducer_stiffness" in entry else None
    drives = entry.get("drive_class")
    return MeasuredRobot(
        entry["name"],
        group_of(found, stiffness, CLASSES.index(drives) if drives else None),
        entry.get("evidence", ""),
        entry["source"],
        None if reducer is None else float(np.exp(np.nanmean(stiffness - reducer))),
    )


def _rings(robots: Sequence[MeasuredRobot], place: str) -> tuple[float, float, int]:
    inertia = TARGETS + QUANTITIES.index("inertia")
    found = []
    for robot in robots:
        first = robot.group.place[:, 0] > 0.0
        rows = first if place == "first" else ~first
        ratio = (robot.truth - robot.group.values[:, inertia])[rows]
        hertz = np.exp(0.5 * ratio[np.isfinite(ratio)]) / (2.0 * np.pi)
        found += [hertz] if len(hertz) else []
    every = np.concatenate(found) if found else np.full(1, np.nan)
    return float(f"{every.min():.3g}"), float(f"{every.max():.3g}"), len(found)


def _rounded(draws: Draws) -> Draws:
    short = np.vectorize(lambda value: float(f"{value:.{_DIGITS}g}"), otypes=[float])
    own = dict(vars(draws))
    return Draws(own.pop("targets"), **{key: short(value) for key, value in own.items()})


def fit(
    groups: Sequence[Group],
    *,
    classes: int = 1,
    class_spread: float = 0.0,
    draws: int = 100,
    sweeps: int = 2000,
    seed: int = 0,
) -> Draws:
    """Draws from the posterior, given robots.

    Args:
        groups: the robots.
        classes: c, of drives.
        class_spread: standard deviation of the classes' shifts.
        draws: how many are kept, evenly from the last two thirds.
        sweeps: of the sampler.
        seed: of its random numbers.

    Returns:
        the draws.
    """
    rng = np.random.default_rng(seed)
    y = np.concatenate([group.values for group in groups])
    x = np.concatenate([group.place for group in groups])
    owner = np.repeat(np.arange(len(groups)), [len(group.values) for group in groups])
    (count, p), q, robots = y.shape, x.shape[1], len(groups)
    seen = ~np.isnan(y)
    y = np.where(seen, y, 0.0)
    rows = [np.flatnonzero(seen[:, i]) for i in range(p)]
    counts = np.bincount(owner, minlength=robots)
    number = np.zeros((robots, p))  # of joints of which it is known
    np.add.at(number, owner, seen.astype(float))
    known = number > 0.0
    centre = y.sum(axis=0) / np.maximum(seen.sum(axis=0), 1)
    # Of one quantity alone, size and scatter are the same thing.
    slope = _SLOPE if p > 1 else 1e-6
    free = np.array([group.kind is None for group in groups])
    s = np.array([rng.integers(classes) if g.kind is None else g.kind for g in groups])
    m, c = centre.copy(), np.zeros((p, q))
    a, b = np.full(p, slope), np.full(p, slope)
    shift, share = np.zeros(classes), np.full(classes, 1.0 / classes)
    first = (np.arange(p) <= max(int(g.asked.max()) for g in groups)).astype(float)
    targets = int(first.sum())
    v, w, v_scale, w_scale = (np.ones(p) for _ in range(4))
    v_rate = w_rate = 1.0
    robot: Array = rng.standard_normal((robots,))
    joint: Array = rng.standard_normal((count,))
    wanted = set(np.linspace(sweeps // 3, sweeps - 1, draws).astype(int).tolist())
    kept: list[tuple[Any, ...]] = []
    for sweep in range(sweeps):
        # A robot's own level of each quantity.
        left = np.zeros((robots, p))
        np.add.at(left, owner, seen * (y - x @ c.T - np.outer(joint, b)))
        precision = number / w + 1.0 / v
        moved = np.outer(shift[s], first)
        level = (left / w + (m + moved + np.outer(robot, a)) / v) / precision
        level += rng.standard_normal((robots, p)) / np.sqrt(precision)
        # Sizes.
        away = seen * (y - level[owner] - x @ c.T)
        precision = 1.0 + seen @ (b**2 / w)
        joint = away @ (b / w) / precision + rng.standard_normal(count) / np.sqrt(precision)
        away = known * (level - m - moved)
        precision = 1.0 + known @ (a**2 / v)
        robot = away @ (a / v) / precision + rng.standard_normal(robots) / np.sqrt(precision)
        # Moves that leave what is seen as it is: Gibbs's sampler alone is slow along them.
        away = known * (level - m - moved - np.outer(robot, a))
        precision = counts + known @ (b**2 / v)
        total = away @ (b / v) - np.bincount(owner, joint, minlength=robots)
        step = total / precision + rng.standard_normal(robots) / np.sqrt(precision)
        joint = joint + step[owner]
        level = level - np.outer(step, b)
        tight = robots + float(a @ a) / _WIDE**2
        pull = float(a @ (m - centre)) / _WIDE**2 - float(robot.sum())
        by = pull / tight + rng.standard_normal() / tight**0.5
        robot, m = robot + by, m - by * a
        robot, a = _rescaled(rng, robot, a, slope)
        joint, b = _rescaled(rng, joint, b, slope)
        # Classes: which, how many, and their shifts.
        rest = (level - m - np.outer(robot, a))[:, :targets]
        weight = known[:, :targets] / v[:targets]
        odds = np.log(share) - 0.5 * np.einsum(
            "ri,ric->rc", weight, (rest[:, :, None] - shift) ** 2
        )
        # The largest of sums with Gumbel noise is a draw with these odds.
        s = np.where(free, np.argmax(odds + rng.gumbel(size=odds.shape), axis=1), s)
        share = rng.dirichlet(1.0 + np.bincount(s, minlength=classes))
        if class_spread > 0.0:
            total = np.bincount(s, (weight * rest).sum(axis=1), minlength=classes)
            precision = np.bincount(s, weight.sum(axis=1), minlength=classes) + class_spread**-2.0
            shift = total / precision + rng.standard_normal(classes) / np.sqrt(precision)
        moved = np.outer(shift[s], first)
        # What each quantity makes of them.
        design = np.stack([np.ones(robots), robot], axis=1)
        for i in range(p):
            here, there = rows[i], np.flatnonzero(known[:, i])
            lower = np.column_stack([x[here], joint[here]])
            rest = y[here, i] - level[owner[here], i]
            found = _regress(rng, rest, lower, w[i], np.array([_SLOPE] * q + [slope]))
            c[i], b[i] = found[:q], found[q]
            w[i], w_scale[i] = _variance(rng, rest - lower @ found, w[i], w_rate)
            rest, upper = (level - moved)[there, i] - centre[i], design[there]
            found = _regress(rng, rest, upper, v[i], np.array([_WIDE, slope]))
            m[i], a[i] = found[0] + centre[i], found[1]
            v[i], v_scale[i] = _variance(rng, rest - upper @ found, v[i], v_rate)
        # How far quantities scatter in general.
        v_rate, w_rate = (
            rng.gamma(_VAGUE + 0.5 * p) / (_VAGUE + (1.0 / scale).sum())
            for scale in (v_scale, w_scale)
        )
        if sweep in wanted:
            kept.append(tuple(np.copy(part) for part in (m, shift, a, v, c, b, w, share)))
    return Draws(targets, *(np.array(column) for column in zip(*kept, strict=True)))


def _rescaled(
    rng: np.random.Generator, sizes: Array, slopes: Array, prior: float
) -> tuple[Array, Array]:
    """Sizes times a factor and slopes over it: a Metropolis step on its logarithm."""
    step = 0.3 * rng.standard_normal()
    factor = np.exp(step)
    gain = -0.5 * float(sizes @ sizes) * (factor**2 - 1.0)
    gain -= 0.5 * float(slopes @ slopes) / prior**2 * (factor**-2.0 - 1.0)
    gain += (len(sizes) - len(slopes)) * step
    if np.log(rng.random()) < gain:
        return sizes * factor, slopes / factor
    return sizes, slopes


def _regress(rng: np.random.Generator, y: Array, x: Array, variance: float, prior: Array) -> Array:
    """A draw of the coefficients of y = x c + noise of this variance."""
    half = np.linalg.cholesky(x.T @ x / variance + np.diag(prior**-2.0))
    mean = np.linalg.solve(half, x.T @ y / variance) + rng.standard_normal(len(prior))
    drawn: Array = np.linalg.solve(half.T, mean)
    return drawn


def _variance(
    rng: np.random.Generator, residual: Array, now: float, rate: float
) -> tuple[float, float]:
    """A draw of a variance and of its scale's own (half-t as a mixture of inverse gammas)."""
    scale = (_FREEDOM / now + rate) / rng.gamma(0.5 * (_FREEDOM + 1.0))
    total = 0.5 * float(residual @ residual) + _FREEDOM / scale
    return total / float(rng.gamma(0.5 * (_FREEDOM + len(residual)))), scale
