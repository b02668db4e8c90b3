"""Something changed: readings of each shift against the robot's own first shifts.

What is nominal cancels: a reading is compared with what it was when the robot was new to the
ledger. The false-alarm rate is set for a whole history, looked at after every shift, and held by
simulating histories in which nothing happens.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import cache
from typing import Any

import numpy as np

from picchio.core.arrays import FloatArray, IndexArray
from picchio.ledger.blows import Burst
from picchio.ledger.store import DAY, SHIFT
from picchio.model.many_poses import ManyPoses
from picchio.model.model import Model

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
_OF_BLOWS = {"force": ("force of the blows", "force_drift"),
             "width": ("width of the blows", "pulse_width"),
             "gap": ("time between blows", "pulse_rate")}  # fmt: skip
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
        days = (when[-1] - when[self.onset]) / DAY
        moved = "rose" if self.value > 0.0 else "fell"
        between = f" ({dates[1]} to {dates[2]})" if dates[1] < dates[2] else ""
        words = (
            f"{self.reading.name} {moved} by {100 * abs(self.value):.3g} % "
            f"({100 * self.low:+.3g} to {100 * self.high:+.3g} %) in the {days:.0f} days since "
            f"{dates[0]}{between}, {'gradually' if self.ramp else 'at once'}"
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


def _covariates(reading: Reading) -> FloatArray:
    """(t, c) a constant, and the covariates that vary."""
    table = np.vstack([np.ones(reading.values.size), reading.covariates]).T
    varies = np.ptp(table[:FIRST], axis=0) > 0.0
    varies[0] = True
    return np.asarray(table[:, varies])


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


class Shown:
    """What a shift shows: means of what its blows and drives tell, and how the arm rang.

    Args:
        model: the robot and its effects: where frequencies are compared with.
    """

    def __init__(self, model: Model) -> None:
        self._model = model
        self._sums: dict[str, FloatArray] = {}
        self._rung: dict[str, Any] | None = None

    def _more(self, name: str, values: FloatArray) -> None:
        if values.size:
            self._sums[name] = self._sums.get(name, 0.0) + np.array([values.sum(), values.size])

    def add(self, bursts: Iterable[Burst]) -> None:
        """Further bursts: force, width and rate of the blows that a force shows.

        Args:
            bursts: by time.
        """
        for burst in bursts:
            seen = [blow for blow in burst.blows if blow.kind == "force" and not blow.cut]
            peak = np.array([blow.peak for blow in seen])
            width = np.array([blow.impulse for blow in seen]) / np.maximum(peak, 1e-300)
            self._more("force", np.log(peak))
            self._more("width", np.log(np.maximum(np.abs(width), 1e-9)))
            gap = np.diff([blow.onset for blow in seen]) * 1e-9
            near = (gap > 0.0) & (gap < 3.0 * np.median(gap)) if gap.size else gap > 0.0
            self._more("gap", np.log(gap[near]))

    def read(self, features: Iterable[tuple[str, int, float]]) -> None:
        """What the ledger holds of ring-downs, temperatures and drives.

        Args:
            features: of the shift, by time: see `ring_downs` and `drives`.
        """
        table: dict[int, dict[str, float]] = {}
        numbers: dict[str, list[float]] = {}
        for name, stamp, value in features:
            if name == "temperature" or "." in name:
                numbers.setdefault(name, []).append(value)
            else:
                table.setdefault(stamp, {})[name] = value
        self._rung = _rung(self._model, [told for told in table.values() if "q0" in told])
        for name, values in numbers.items():
            plain = name.partition(".")[0] in ("temperature", "offset")
            self._more(name, np.array(values) if plain else np.log(values))

    @property
    def told(self) -> dict[str, Any]:
        """The means by name, and "rung" where anything did."""
        means = {name: float(row[0] / row[1]) for name, row in self._sums.items()}
        return means | ({"rung": self._rung} if self._rung else {})


def readings_of(names: Sequence[str], shown: Mapping[int, Mapping[str, Any]]) -> list[Reading]:
    """What the shifts show: force, width and rate of the blows, the joints' stiffness and drives.

    Args:
        names: of the flexible joints.
        shown: by shift, see `Shown`.
    """
    when: dict[str, list[int]] = {}
    for shift in sorted(shown):
        for name in shown[shift]:
            when.setdefault(name, []).append(shift)
    told = {name: [shown[shift][name] for shift in own] for name, own in when.items()}
    found = [
        _reading(words, effect, "tool", when[name], told[name])
        for name, (words, effect) in _OF_BLOWS.items()
        if name in told
    ]
    if "rung" in told:
        found += _ringing(names, when["rung"], told["rung"])
    for name in sorted(told):
        kind, _, joint = name.partition(".")
        if joint:
            words, effect = _DRIVEN[kind]
            found.append(_reading(f"{words} {joint}", effect, joint, when[name], told[name]))
    warmth = dict(zip(when.get("temperature", ()), told.get("temperature", ()), strict=True))
    return [_warmed(reading, warmth) for reading in found]


def _reading(
    name: str, effect: str, target: str, shifts: Sequence[int], values: Sequence[float] | FloatArray
) -> Reading:
    """Without covariates."""
    when = np.array(shifts, np.int64) * SHIFT + SHIFT // 2
    return Reading(name, effect, target, when, np.array(values), np.empty((0, when.size)))


def _warmed(reading: Reading, warmth: Mapping[int, float]) -> Reading:
    """The reading with the temperature of its shifts, where each has one."""
    shifts = (reading.when // SHIFT).tolist()
    if not warmth.keys() >= set(shifts):
        return reading
    return replace(reading, covariates=np.array([[warmth[shift] for shift in shifts]]))


def _rung(model: Model, rows: Sequence[dict[str, float]]) -> dict[str, Any] | None:
    """Each joint's stiffness, and the damping, from the frequencies of a shift's ring-downs.

    ln f_i moves by half the sum of s_ij d ln k_j, s_ij the share of joint j in the strain energy
    of mode i.

    Returns:
        ln of each joint's stiffness over the model's, its error, and by mode: the weight of its
        ring-downs, the sum of their ln z, the middle one; None where the modes do not tell.
    """
    nv = len(model.robot.joint_names)
    poses = np.array([[told[f"q{k}"] for k in range(nv)] for told in rows])
    many = ManyPoses(model, poses) if rows else None
    if many is None or not many.compiled:
        return None
    omega, shapes = many.modes()
    share = many.stiffness[:, :, None] * (shapes / omega[:, None, :]) ** 2
    frequency, n = omega / (2.0 * np.pi), omega.shape[1]
    found = [(k, i, told) for k, told in enumerate(rows) for i in range(n) if f"f{i}" in told]
    pose, mode = (np.array([each[part] for each in found], int) for part in (0, 1))
    off = np.array([told[f"f{i}"] for _, i, told in found]) / frequency[pose, mode]
    weight = 1.0 / np.maximum(np.array([told[f"e{i}"] for _, i, told in found]), 1e-4)
    ratio = np.log([told[f"z{i}"] for _, i, told in found])
    left = 0.5 * share[pose, :, mode] * weight[:, None]
    # Of a joint that no mode shows nothing is told: the smallest change that fits.
    size, *_, values = np.linalg.lstsq(left, np.log(off) * weight, rcond=1e-3)
    if values.size < n or values[-1] < 1e-3 * values[0]:
        return None
    return {
        "stiffness": size.tolist(),
        "error": np.sqrt(np.diag(np.linalg.inv(left.T @ left))).tolist(),
        "damping": [
            np.bincount(mode, weight**2, n).tolist(),
            np.bincount(mode, weight**2 * ratio, n).tolist(),
            [float(np.median(ratio[mode == i])) if (mode == i).any() else None for i in range(n)],
        ],
    }


def _ringing(
    names: Sequence[str], shifts: Sequence[int], rung: Sequence[Mapping[str, Any]]
) -> list[Reading]:
    """A reading a joint, and that of the damping."""
    stiffness, errors = (np.array([told[key] for told in rung]).T for key in ("stiffness", "error"))
    found = []
    for name, column, error in zip(names, stiffness, errors, strict=True):
        # A shift that hardly shows the joint would be taken for one in which it changed.
        good = error < _DIM * np.median(error)
        own = np.array(shifts)[good].tolist()
        found.append(_reading(f"stiffness of {name}", "stiffness_drift", name, own, column[good]))
    # Modes differ in damping, and a mode that hardly rings tells little of it: what each
    # usually has is taken out, and their mean put back, by which robots differ.
    table = np.array([told["damping"] for told in rung], float)
    weight, ratio, middle = table.transpose(1, 0, 2)
    usual = np.nanmedian(middle, axis=0)
    damping = (ratio - weight * np.nan_to_num(usual)).sum(axis=1) / weight.sum(axis=1)
    damping += np.nanmean(usual)
    return [*found, _reading("damping", "modal_damping", "robot", shifts, damping)]
