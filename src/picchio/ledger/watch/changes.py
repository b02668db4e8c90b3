"""Something changed: readings of each shift against the robot's own first shifts.

What is nominal cancels: a reading is compared with what it was when the robot was new to the
ledger. The false-alarm rate is set for a whole history, looked at after every shift, and held by
simulating histories in which nothing happens.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from typing import Any

import numpy as np

from picchio.core.arrays import FloatArray, IndexArray
from picchio.ledger.blows import Blow
from picchio.model.many_poses import ManyPoses
from picchio.model.model import Model

SHIFT = 8 * 3600 * 10**9
"""ns: blows of the same eight hours (UTC) are one shift."""
FIRST = 30
"""Shifts that a robot is compared with."""
ALARMS = 0.02
"""Share of histories of `_HORIZON` shifts without a change in which anything is told."""
_HORIZON = 200
_HISTORIES = 4000
_DIM = 2.0  # times the usual standard error
SMALLEST = 2e-3
"""Relative: smaller changes are not told, nor are those that may be: no life depends on them."""
_LENGTHS = (1, 4, 8, 16, 32, 64, 128)  # shifts that a change may take
_DRIVEN = {"friction": ("friction of", "coulomb_friction"),
           "offset": ("torque offset, of gravity's torque, of", "torque_offset"),
           "lost_motion": ("lost motion of", "backlash")}  # fmt: skip
_LEAST = 5  # shifts after the first ones before anything can be told


@dataclass(frozen=True, eq=False)
class Reading:
    """One number a shift.

    Attributes:
        name: for people, such as "stiffness of joint_2".
        effect: as a diagnosis names the cause.
        target: joint, or "tool".
        when: (t,) ns, the middle of each shift, ascending.
        values: (t,) natural logarithms, so that differences are relative changes.
        covariates: (c, t) what else may move it, such as the temperature.
    """

    name: str
    effect: str
    target: str
    when: IndexArray
    values: FloatArray
    covariates: FloatArray


@dataclass(frozen=True)
class Change:
    """A reading that is no longer what it was.

    Attributes:
        reading: which.
        ramp: whether it moves on, rather than having moved once.
        onset: index of the shift where it began.
        onset_low: lower end of its 90 % interval.
        onset_high: upper end.
        value: relative change until now.
        low: lower end of its 90 % interval.
        high: upper end.
    """

    reading: Reading
    ramp: bool
    onset: int
    onset_low: int
    onset_high: int
    value: float
    low: float
    high: float

    def to_dict(self) -> dict[str, Any]:
        """As the JSON of a count has it."""
        when = self.reading.when
        dates = [date_of(int(when[k])) for k in (self.onset, self.onset_low, self.onset_high)]
        days = (when[-1] - when[self.onset]) / 8.64e13
        moved = "rose" if self.value > 0.0 else "fell"
        words = (
            f"{self.reading.name} {moved} by {100 * abs(self.value):.3g} % "
            f"({100 * self.low:+.3g} to {100 * self.high:+.3g} %) in the {days:.0f} days since "
            f"{dates[0]} ({dates[1]} to {dates[2]}), {'gradually' if self.ramp else 'at once'}"
        )
        return {
            "effect": self.reading.effect, "target": self.reading.target, "since": dates[0],
            "since_low": dates[1], "since_high": dates[2], "value": self.value, "low": self.low,
            "high": self.high, "reading": self.reading.name, "words": words,
        }  # fmt: skip


def date_of(ns: int) -> str:
    """The day, UTC, as text.

    Args:
        ns: from 1970.
    """
    return datetime.fromtimestamp(ns / 1e9, UTC).date().isoformat()


@cache
def threshold(level: float) -> float:
    """What the largest of all comparisons in a history without a change exceeds so rarely.

    Args:
        level: share of histories.
    """
    return _exceeded(np.ones((_HORIZON, 1)).tobytes(), _HORIZON, level)


@cache
def _exceeded(covariates: bytes, length: int, level: float) -> float:
    """The same of histories as long as a table of covariates, which are taken out as in `find`."""
    table = np.frombuffer(covariates).reshape(length, -1)
    rng = np.random.default_rng(29)
    part = 200
    top = [
        _scores(rng.standard_normal((part, len(table))), table) for _ in range(_HISTORIES // part)
    ]
    return float(np.quantile(np.concatenate([_largest(scores) for scores in top]), 1.0 - level))


def _scores(values: FloatArray, table: FloatArray) -> FloatArray:
    """Histories (h, t) less what covariates (t, c) explain, by the spread and mean of the first."""
    basis = np.linalg.qr(table)[0]
    left = values - (values @ basis) @ basis.T
    own = left[:, :FIRST] - left[:, :FIRST].mean(axis=1, keepdims=True)
    spread = np.sqrt((own**2).sum(axis=1) / (FIRST - table.shape[1]))[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        scores = (left - left[:, :FIRST].mean(axis=1, keepdims=True)) / spread
    return np.where(spread > 0.0, scores, 0.0)


def _largest(scores: FloatArray) -> FloatArray:
    """The largest comparison of any stretch after the first shifts with them: (h,) of (h, t)."""
    sums = np.concatenate(
        [np.zeros((len(scores), 1)), np.cumsum(scores[:, FIRST:], axis=1)], axis=1
    )
    best = np.zeros(len(scores))
    for length in range(1, sums.shape[1]):
        mean = np.abs(sums[:, length:] - sums[:, :-length]) / length
        best = np.maximum(best, mean.max(axis=1) / np.sqrt(1.0 / length + 1.0 / FIRST))
    return best


def find(readings: Sequence[Reading], alarms: float = ALARMS) -> list[Change]:
    """The readings that have changed.

    Args:
        readings: those of one robot; the rate of alarms is that of all together.
        alarms: share of histories without a change in which anything is told.

    Returns:
        the changes, the largest against its interval first.
    """
    told = [r for r in readings if r.values.size >= FIRST + _LEAST]
    found = []
    for reading in told:
        table = _covariates(reading)
        level = alarms / len(told)
        limit = threshold(level)
        if table.shape[1] > 1:
            limit = max(limit, _exceeded(table.tobytes(), len(table), level))
        if _largest(_scores(reading.values[None], table))[0] > limit:
            change = _told(reading, table)
            if change.low * change.high > 0.0 and min(abs(change.low), abs(change.high)) > SMALLEST:
                found.append(change)
    return sorted(found, key=lambda c: -abs(c.value) / max(c.high - c.low, 1e-12))


def scores(reading: Reading) -> FloatArray:
    """(t,) a reading less what its covariates explain, by the mean and spread of the first shifts.

    Args:
        reading: of more than `FIRST` shifts.
    """
    return _scores(reading.values[None], _covariates(reading))[0]


def _covariates(reading: Reading) -> FloatArray:
    """(t, c) a constant, and the covariates that vary."""
    table = np.vstack([np.ones(reading.values.size), reading.covariates]).T
    return np.asarray(table[:, _useful(table[:FIRST])])


def _useful(table: FloatArray) -> IndexArray:
    """The columns that vary, after the constant."""
    return np.array([0, *(k for k in range(1, table.shape[1]) if np.ptp(table[:, k]) > 0.0)])


def _told(reading: Reading, table: FloatArray) -> Change:
    """Onset and size: every onset, at once or over so many shifts, weighed by how well it fits.

    Flat priors on the sizes, 1/sigma on the noise: the marginal likelihood of a regression.
    """
    y, count = reading.values, reading.values.size
    index, onsets = np.arange(count), np.arange(2, count - 2)
    lengths = [n for n in _LENGTHS if n < count] + [count]
    shapes = [
        np.clip((index - onset + 1) / min(length, count - int(onset)), 0.0, 1.0)
        for length in lengths
        for onset in onsets
    ]
    # What the covariates explain is taken out of both.
    basis = np.linalg.qr(table)[0]
    left_y = y - basis @ (basis.T @ y)
    left = np.array(shapes)
    left -= (left @ basis) @ basis.T
    power, product = (left**2).sum(axis=1), left @ left_y
    size = product / power
    rest = np.maximum((left_y**2).sum() - size * product, 1e-300)
    free = count - table.shape[1] - 1
    error = np.sqrt(rest / free / power)
    log = -0.5 * free * np.log(rest) - 0.5 * np.log(power)
    weight = np.exp(log - log.max())
    weight /= weight.sum()
    of_onset = weight.reshape(len(lengths), -1).sum(axis=0)
    low_at, high_at = np.searchsorted(np.cumsum(of_onset), [0.05, 0.95])
    best = int(np.argmax(weight))
    mean = float(weight @ size)
    reach = 1.645 * float(np.sqrt(weight @ (error**2 + (size - mean) ** 2)))
    value, low, high = (float(np.expm1(x)) for x in (mean, mean - reach, mean + reach))
    return Change(
        reading, best >= len(onsets), int(onsets[int(np.argmax(of_onset))]),
        int(onsets[low_at]), int(onsets[min(high_at, len(onsets) - 1)]), value, low, high,
    )  # fmt: skip


def readings_of(
    model: Model, blows: Sequence[Blow], features: Sequence[tuple[str, int, float]]
) -> list[Reading]:
    """What each shift shows: force, width and rate of the blows, the joints' stiffness and drives.

    Args:
        model: the robot and its effects: where frequencies are compared with.
        blows: by time.
        features: what the ledger holds of ring-downs, temperatures and drives: see `ring_downs` and
            `drives`.
    """
    found = []
    seen = [blow for blow in blows if blow.kind == "force" and not blow.cut]
    if seen:
        onset = np.array([blow.onset for blow in seen])
        peak = np.array([blow.peak for blow in seen])
        width = np.array([blow.impulse for blow in seen]) / np.maximum(peak, 1e-300)
        found.append(_shifts("force of the blows", "force_drift", "tool", onset, np.log(peak)))
        found.append(_shifts("width of the blows", "pulse_width", "tool", onset,
                             np.log(np.maximum(np.abs(width), 1e-9))))  # fmt: skip
        gap = np.diff(onset) * 1e-9
        near = (gap > 0.0) & (gap < 3.0 * np.median(gap)) if gap.size else np.zeros(0, bool)
        if near.any():
            found.append(_shifts("time between blows", "pulse_rate", "tool", onset[1:][near],
                                 np.log(gap[near])))  # fmt: skip
    table: dict[int, dict[str, float]] = {}
    warmth: list[tuple[int, float]] = []
    driven: dict[str, list[tuple[int, float]]] = {}
    for name, stamp, value in features:
        if name == "temperature":
            warmth.append((stamp, value))
        elif "." in name:
            driven.setdefault(name, []).append((stamp, value))
        else:
            table.setdefault(stamp, {})[name] = value
    found += _stiffness(model, table)
    for name, told in sorted(driven.items()):
        kind, _, joint = name.partition(".")
        words, effect = _DRIVEN[kind]
        when, size = np.array([t for t, _ in told]), np.array([x for _, x in told])
        values = size if kind == "offset" else np.log(size)
        found.append(_shifts(f"{words} {joint}", effect, joint, when, values))
    return [_warmed(reading, warmth) for reading in found]


def _shifts(name: str, effect: str, target: str, when: IndexArray, values: FloatArray) -> Reading:
    """The mean of each shift."""
    shift = when // SHIFT
    which, at = np.unique(shift, return_inverse=True)
    mean = np.bincount(at, values) / np.bincount(at)
    return Reading(
        name, effect, target, which * SHIFT + SHIFT // 2, mean, np.empty((0, which.size))
    )


def _warmed(reading: Reading, warmth: Sequence[tuple[int, float]]) -> Reading:
    """The reading with the temperature of its shifts, where each has one."""
    if not warmth:
        return reading
    mean = _shifts("", "", "", np.array([w[0] for w in warmth]), np.array([w[1] for w in warmth]))
    known = dict(zip(mean.when.tolist(), mean.values.tolist(), strict=True))
    if not all(int(when) in known for when in reading.when):
        return reading
    values = np.array([[known[int(when)] for when in reading.when]])
    return Reading(
        reading.name, reading.effect, reading.target, reading.when, reading.values, values
    )


def _stiffness(model: Model, table: dict[int, dict[str, float]]) -> list[Reading]:
    """Each joint's stiffness, and the damping, of each shift, from the frequencies of ring-downs.

    ln f_i moves by half the sum of s_ij d ln k_j, s_ij the share of joint j in the strain energy
    of mode i.
    """
    rows = [(stamp, told) for stamp, told in sorted(table.items()) if "q0" in told]
    if not rows:
        return []
    nv, n = len(model.robot.joint_names), len(model.robot.flexible_joints)
    poses = np.array([[told[f"q{k}"] for k in range(nv)] for _, told in rows])
    many = ManyPoses(model, poses)
    if not many.compiled:
        return []
    mass, _ = many.mass_and_jacobian()
    root = np.linalg.inv(np.linalg.cholesky(mass))
    squared, vectors = np.linalg.eigh(np.einsum("pij,pj,pkj->pik", root, many.stiffness, root))
    shapes = np.einsum("pji,pjk->pik", root, vectors)
    share = many.stiffness[:, :, None] * shapes**2 / squared[:, None, :]
    frequency = np.sqrt(squared) / (2.0 * np.pi)
    by_shift: dict[int, list[tuple[FloatArray, float, float, float]]] = {}
    # Modes differ in damping, and a mode that hardly rings tells little of it.
    usual = [
        float(np.median(own)) if (own := [np.log(t[f"z{i}"]) for _, t in rows if f"z{i}" in t])
        else 0.0 for i in range(n)
    ]  # fmt: skip
    for k, (stamp, told) in enumerate(rows):
        for i in range(n):
            if f"f{i}" in told:
                off = float(np.log(told[f"f{i}"] / frequency[k, i]))
                damped = float(np.log(told[f"z{i}"])) - usual[i]
                entry = (0.5 * share[k, :, i], off, told[f"e{i}"], damped)
                by_shift.setdefault(stamp // SHIFT, []).append(entry)
    when: list[int] = []
    damping: list[float] = []
    stiffness: list[FloatArray] = []
    errors: list[FloatArray] = []
    for shift, entries in sorted(by_shift.items()):
        weight = 1.0 / np.maximum(np.array([e[2] for e in entries]), 1e-4)
        left = np.array([e[0] for e in entries]) * weight[:, None]
        # Of a joint that no mode shows nothing is told: the smallest change that fits.
        size, *_, values = np.linalg.lstsq(
            left, np.array([e[1] for e in entries]) * weight, rcond=1e-3
        )
        if values.size < n or values[-1] < 1e-3 * values[0]:
            continue
        when.append(shift * SHIFT + SHIFT // 2)
        stiffness.append(size)
        errors.append(np.sqrt(np.diag(np.linalg.inv(left.T @ left))))
        damping.append(float(np.average([e[3] for e in entries], weights=weight**2)))
    if not when:
        return []
    clock, nothing = np.array(when), np.empty((0, len(when)))
    found = []
    for name, column, error in zip(
        model.robot.flexible_names, np.array(stiffness).T, np.array(errors).T, strict=True
    ):
        # A shift that hardly shows the joint would be taken for one in which it changed.
        good = error < _DIM * np.median(error)
        found.append(Reading(f"stiffness of {name}", "stiffness_drift", name, clock[good],
                             column[good], np.empty((0, int(good.sum())))))  # fmt: skip
    return [*found, Reading("damping", "modal_damping", "robot", clock, np.array(damping), nothing)]
