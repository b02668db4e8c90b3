"""Quantities of robots' joints as signs of one size, a robot's and a joint's, with gaps.

The logarithm y of quantity i of a joint is

    y_i = V_i + C_i x + b_i d + e_i,        e_i ~ N(0, w_i), d ~ N(0, 1)      (a joint)
    V_i = m_i + a_i D + u_i,                u_i ~ N(0, v_i), D ~ N(0, 1)      (its robot)

with x the joint's place in the chain; V of what is asked for (the first quantities) has g added,
the shift of the robot's class of drives. So each quantity tells of the sizes D and d as well as its
scatter lets it, on each level; together they predict what is asked for, and errors of one robot
correlated through D and u. It is factor analysis on two levels. A quantity that is not known is
not there: nothing is filled in. A class that is not known is drawn, too, with probabilities that
the robots teach. Priors: normal ones, wide against what is seen, for m, C, a, b; of given spread
for g; half-t scales (Gelman, Bayesian Analysis 1, 2006, 515-533), how large in general is learned
from all quantities. Draws are Gibbs's; what is predicted is a mixture over them, so its tails are
as wide as few robots make them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_WIDE, _SLOPE = 10.0, 2.0  # standard deviations of the priors of m, and of C, a, b; ln units
_FREEDOM = 4.0  # of the half-t prior of the standard deviations
_VAGUE = 0.1  # shape and rate of the gamma prior of its scale's inverse square


@dataclass(frozen=True, eq=False)
class Group:
    """A robot's table.

    Attributes:
        values: (n, p) logarithms, NaN where not known.
        place: (n, q) covariates of its joints.
        asked: (n,) which quantity is asked for of each joint, one of the first.
        kind: which class of drives; None if not known.
    """

    values: Array
    place: Array
    asked: NDArray[np.intp]
    kind: int | None = None


@dataclass(frozen=True, eq=False)
class Draws:
    """d draws from the posterior, named as in the module's text.

    Attributes:
        targets: how many quantities can be asked for.
        mean: (d, p) m.
        shift: (d, c) g, of each class.
        size: (d, p) a.
        scatter: (d, p) v, variances.
        contrast: (d, p, q) C.
        joint_size: (d, p) b.
        joint_scatter: (d, p) w, variances.
        share: (d, c) of robots of each class.
    """

    targets: int
    mean: Array
    shift: Array
    size: Array
    scatter: Array
    contrast: Array
    joint_size: Array
    joint_scatter: Array
    share: Array


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


def predict(draws: Draws, group: Group, *, given: bool = False) -> tuple[Array, Array, Array]:
    """What is asked for of a robot's joints, given what is known of the rest, as a mixture.

    Args:
        draws: of the posterior.
        group: the robot.
        given: read also the quantities that can be asked for: those of a joint that are known
            stand as they are, and tell of the others. Else they are not read.

    Returns:
        weights (k,), means (k, n) and covariances (k, n, n) of the parts.
    """
    n = len(group.values)
    joint, asked = np.arange(n), group.asked
    there = ~np.isnan(group.values)
    there[:, : draws.targets] &= given
    rows, columns = np.nonzero(there)
    data = group.values[rows, columns]
    same, own_row = rows[:, None] == rows, joint[:, None] == rows
    means, covs = [], []
    for k in range(len(draws.mean)):
        a, b = draws.size[k], draws.joint_size[k]
        between = np.outer(a, a) + np.diag(draws.scatter[k])
        within = np.outer(b, b) + np.diag(draws.joint_scatter[k])
        centre = draws.mean[k] + group.place @ draws.contrast[k].T
        cov = between[np.ix_(columns, columns)] + same * within[np.ix_(columns, columns)]
        cross = between[np.ix_(asked, columns)] + own_row * within[np.ix_(asked, columns)]
        gain = np.linalg.solve(cov, cross.T).T
        means.append(centre[joint, asked] + gain @ (data - centre[rows, columns]))
        own = between[np.ix_(asked, asked)] + np.eye(n) * within[np.ix_(asked, asked)]
        covs.append(own - gain @ cross.T)
    kinds = range(draws.share.shape[1]) if group.kind is None else [group.kind]
    weight = draws.share[:, kinds] / draws.share[:, kinds].sum(axis=1, keepdims=True)
    moved = np.array(means)[:, None] + draws.shift[:, kinds, None]
    return (
        (weight / len(weight)).ravel(),
        moved.reshape(-1, n),
        np.repeat(np.array(covs), len(kinds), axis=0),
    )


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
