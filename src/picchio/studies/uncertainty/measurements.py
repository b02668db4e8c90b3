"""What a measurement would do to the interval of a life: the value of information.

The drawn worlds tell it without another run. In each part that bears, the logarithm of the
utilisation is regressed on the uncertain values: it is linear in most of them and curved in the
stiffnesses, while the robot's, the largest of the parts', is not smooth. A measurement reads some
of the values with an error; given a reading the rest is conditioned on it, drawn, and put through
the regression with its residuals. How wide the interval then is, averaged over what might be read,
is what is to be expected after it (value of sample information by a regression in place of the
model: Strong, Oakley and Brennan, Medical Decision Making 34 (2014) 311-326).
`python benchmarks/estimated_robots.py ranking` compares the ranking with fresh runs of the model.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from shlex import quote

import numpy as np
from numpy.typing import NDArray

from picchio.core.arrays import FloatArray
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.joint import is_drive
from picchio.robot.loading.find import typed_name
from picchio.studies.uncertainty.drawn import Drawn
from picchio.studies.uncertainty.inputs import Input

# Of a stiffness, a damping ratio and a force, relative, one standard deviation.
_STIFFNESS, _DAMPING, _FORCE = 0.10, 0.20, 0.02
# What narrows by less, in decades, is not worth a measurement.
_WORTH = 0.02
# Readings of a measurement, and worlds that are drawn given each.
_READINGS, _WORLDS = 32, 512
_ROWS_A_TERM = 4  # drawn worlds, at least, for each number of a regression
_SEED = 7


@dataclass(frozen=True)
class Measurement:
    """What a measurement is expected to leave of a life's interval.

    Attributes:
        what: it would tell, such as "stiffness.joint_2", "stiffness", "reducer.joint_1", "force".
        words: the same in words, with its accuracy.
        command: that uses it, or None.
        interval_decades: width of the 80 % interval of the life, in decades, now and then; NaN
            where it has no upper end.
        kept: width then over width now, of the logarithm of the life (of the utilisation, where
            the life has no upper end).
    """

    what: str
    words: str
    command: str | None
    interval_decades: tuple[float, float]
    kept: float


def measure_first(
    robot: FlexibleRobot,
    inputs: Sequence[Input],
    moved: FloatArray,
    drawn: Drawn,
    covariance: FloatArray,
) -> tuple[Measurement, ...]:
    """Every measurement that would narrow the life's interval, the best first.

    Args:
        robot: whose life it is.
        inputs: what varies.
        moved: (m, inputs) its normal scores in the drawn worlds, correlated.
        drawn: what these worlds do.
        covariance: (inputs, inputs) of the scores.

    Returns:
        those that narrow it by more than the draws blur.
    """
    lives = drawn.robots_life
    endless = bool(np.isinf(np.quantile(lives, 0.9, method="inverted_cdf")))
    if not endless:  # few enough to lie beyond the interval, wherever they are
        lives = np.minimum(lives, lives[np.isfinite(lives)].max())
    now = _width(np.log10(drawn.robots_use if endless else lives))
    if not now > _WORTH:
        return ()
    worlds = FittedWorlds.of(moved, drawn, endless)
    before = worlds.expected_width(covariance, [], np.zeros(0))
    found = []
    for what, words, command, columns, error in _candidates(robot, inputs):
        size = np.array([inputs[i].uncertain.spread for i in columns])
        kept = worlds.expected_width(covariance, columns, error / size) / before
        if kept * now < now - _WORTH:
            decades = (math.nan, math.nan) if endless else (now, kept * now)
            found.append(Measurement(what, words, command, decades, kept))
    return tuple(sorted(found, key=lambda one: one.kept))


@dataclass(frozen=True, eq=False)
class FittedWorlds:
    """Regressions in place of a model's runs: the utilisation of k parts by n uncertain values.

    Attributes:
        terms: (t, 2) which two values each term is the product of; -1 stands for 1.
        numbers: (t, k) of the terms, for log10 of the utilisation.
        left: (m, k) residuals of the drawn worlds, each row one world's.
        life: of every part, its log10 utilisations in rising order and log10 lives beside them;
            empty where the outcome is the utilisation.
    """

    terms: NDArray[np.intp]
    numbers: FloatArray
    left: FloatArray
    life: tuple[tuple[FloatArray, FloatArray], ...]

    @classmethod
    def of(cls, moved: FloatArray, drawn: Drawn, endless: bool) -> FittedWorlds:
        """Fit them to drawn worlds.

        Args:
            moved: (m, n) scores.
            drawn: what the worlds do.
            endless: whether the outcome is the utilisation, since lives have no upper end.

        Returns:
            the regressions, with products of two values as far as the draws can bear them.
        """
        m, n = moved.shape
        parts = drawn.used
        if not len(parts):
            parts = drawn.geared[~np.isnan(drawn.geared).any(axis=1)]
        used = np.log10(np.maximum(parts, 1e-12 * parts.max())).T
        rows = [(-1, -1), *((-1, i) for i in range(n)), *((i, i) for i in range(n))]
        pairs = [(i, j) for i in range(n) for j in range(i)]
        # Of the products those that tell most beyond the rest, as many as the draws can bear.
        spare = m // _ROWS_A_TERM - len(rows)
        design = _design(moved, np.array(rows))
        left = used - design @ np.linalg.lstsq(design, used, rcond=None)[0]
        if spare > 0 and pairs:
            products = _design(moved, np.array(pairs))
            products -= products.mean(axis=0)
            told = (np.square(products.T @ left) / np.square(products).sum(axis=0)[:, None]).max(
                axis=1
            )
            rows += [pairs[i] for i in np.argsort(-told)[: min(spare, 2 * n)]]
            design = _design(moved, np.array(rows))
        terms = np.array(rows)
        numbers = np.linalg.lstsq(design, used, rcond=None)[0]
        # The fitted numbers take up as many degrees of freedom.
        left = (used - design @ numbers) * math.sqrt(m / max(m - len(terms), 1))
        life: list[tuple[FloatArray, FloatArray]] = []
        if not endless:
            finite = drawn.lives[np.isfinite(drawn.lives)].max()
            for k in range(used.shape[1]):
                order = np.argsort(used[:, k], kind="stable")
                lasting = np.log10(np.minimum(drawn.lives[k][order], finite))
                life.append((used[order, k], np.minimum.accumulate(lasting)))
        return cls(terms, numbers, left, tuple(life))

    def expected_width(
        self, covariance: FloatArray, columns: Sequence[int], error: FloatArray
    ) -> float:
        """The width from P10 to P90 of the robot's outcome, in decades, once values are read.

        Args:
            covariance: (n, n) of the scores.
            columns: which values are read; none of them is how it is now.
            error: of each reading, standard deviations of the score.

        Returns:
            its mean over what might be read.
        """
        rng = np.random.default_rng(_SEED)
        n, size = len(covariance), _READINGS * _WORLDS
        base, draws = rng.standard_normal((_READINGS, n)), rng.standard_normal((size, n))
        which = rng.integers(len(self.left), size=size)
        columns = list(columns)
        rest, middle = covariance, np.zeros((_READINGS, n))
        if columns:
            read = covariance[np.ix_(columns, columns)] + np.diag(np.maximum(error, 1e-6) ** 2)
            gain = np.linalg.solve(read, covariance[columns]).T
            rest = covariance - gain @ covariance[columns]
            middle = base[:, columns] @ np.linalg.cholesky(read).T @ gain.T
        sizes, vectors = np.linalg.eigh(0.5 * (rest + rest.T))
        half = (vectors * np.sqrt(np.clip(sizes, 0.0, None))) @ vectors.T
        moved = np.repeat(middle, _WORLDS, axis=0) + draws @ half
        used = _design(moved, self.terms) @ self.numbers + self.left[which]
        if self.life:
            lives = [np.interp(used[:, k], *one) for k, one in enumerate(self.life)]
            outcome = np.min(lives, axis=0)
        else:
            outcome = used.max(axis=1)
        if not columns:
            return _width(outcome)
        return float(np.mean([_width(part) for part in outcome.reshape(_READINGS, _WORLDS)]))


def _design(moved: FloatArray, terms: NDArray[np.intp]) -> FloatArray:
    """(m, t): the terms' values."""
    values = np.vstack([moved.T, np.ones(len(moved))])  # a value a row: gathered at once
    return np.asarray((values[terms[:, 0]] * values[terms[:, 1]]).T)


def _width(values: FloatArray) -> float:
    low, high = np.quantile(values, [0.1, 0.9], method="median_unbiased")
    return float(high - low)


Candidate = tuple[str, str, str | None, list[int], float]


def _candidates(robot: FlexibleRobot, inputs: Sequence[Input]) -> list[Candidate]:
    """What can be measured: name, words, command, inputs that it reads, error of the logarithm."""
    drives = [(j, joint) for j, joint in enumerate(robot.flexible_joints) if is_drive(joint.name)]
    where = quote(typed_name(robot.name, robot.source))
    identify = f"picchio identify {where} --data CAMPAIGN --out flex.toml"

    def of(key: str, j: int | None = None) -> list[int]:
        return [i for i, each in enumerate(inputs) if each.key == key and each.spread is None
                and (j is None or each.joints == (j,)) and each.uncertain.shape == "lognormal"
                and each.uncertain.spread > 0.0]  # fmt: skip

    def named(joints: list[str]) -> str:
        told = " ".join(f"--reducer {quote(f'{name}=NAME')}" for name in joints)
        return f"picchio start {where} {told}"

    found: list[Candidate] = []
    springs, bears = (
        [(joint.name, columns) for j, joint in drives if (columns := of(key, j))]
        for key in ("stiffness", "bears")
    )
    for name, columns in springs:
        words = f"the stiffness of {name} to 10 % (a known load, or a hammer)"
        found.append((f"stiffness.{name}", words, identify, columns, _STIFFNESS))
    if len(springs) > 1 or (not springs and of("stiffness")):
        words = "the stiffness of every joint to 10 %"
        found.append(("stiffness", words, identify, of("stiffness"), _STIFFNESS))
    slides = {joint.name for _, joint in drives if joint.kind == "prismatic"}
    for name, columns in bears:
        if name in slides:  # a screw, a rack or a belt: no catalogue of them is known here
            words = f"what the drive of {name} bears, from its maker (strength in a sidecar)"
            found.append((f"strength.{name}", words, None, columns, 1e-6))
            continue
        words = f"the name of the reducer of {name}"
        found.append((f"reducer.{name}", words, named([name]), columns, 1e-6))
    geared = {name: columns for name, columns in bears if name not in slides}
    if len(geared) > 1:
        words = "the names of all reducers"
        every = [i for columns in geared.values() for i in columns]
        found.append(("reducer", words, named(list(geared)), every, 1e-6))
    for key, words, command, error in (
        ("damping_ratio", "the damping to 20 % (one hammer blow)", identify, _DAMPING),
        ("force", "the force of the blows to 2 % (a load cell under the tool)",
         f"picchio assess {where} --task TASK.toml", _FORCE),
    ):  # fmt: skip
        if columns := of(key):
            found.append((key, words, command, columns, error))
    # Only what is known less well than the measurement would tell it.
    return [one for one in found if any(inputs[i].uncertain.spread > one[4] for i in one[3])]
