"""All equations of a set of motion records, stacked: what was measured, what is predicted."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.model.effects.effect import Effect
from picchio.model.motion import RIPPLE, TORQUE, WINDUP
from picchio.prediction.motion.filters import Band, choose_cutoff
from picchio.prediction.motion.log import MotionLog
from picchio.prediction.motion.readings import Around, Predictor, Readings
from picchio.robot.flexible_robot import FlexibleRobot

Group = tuple[str, str]  # (kind, joint)
BLOCKS = 12


@dataclass(frozen=True, eq=False)
class Segment:
    """The samples of one group in one record.

    Attributes:
        record: which, by number.
        group: kind and joint.
        samples: which samples of the record.
        rows: which rows of the system.
        measured: at those samples; of a windup, less its mean.
    """

    record: int
    group: Group
    samples: np.ndarray
    rows: slice
    measured: FloatArray


class System:
    """The equations of some records.

    Three kinds: "torque" in the band, "ripple" above it, and "windup", link side less motor
    side. A joint that stands tells nothing (friction holds it at any torque within its limit):
    only samples at which it moves count in the first two. A windup's mean is a nuisance of the
    record and taken off both sides.

    Args:
        robot: the nominal robot.
        logs: the records.
        cutoff: Hz, of the band in which torques are compared; from the encoders' noise if None.
    """

    def __init__(
        self, robot: FlexibleRobot, logs: Sequence[MotionLog], cutoff: float | None = None
    ) -> None:
        if cutoff is None:
            cutoff = choose_cutoff([(log.angle[j], log.rate) for log in logs for j in log.moving])
        self.robot, self.logs, self.cutoff = robot, list(logs), cutoff
        # Joints without an angle, and those whose load depends on where they stand.
        self.unknown = tuple(dict.fromkeys(j for log in self.logs for j in log.unknown))
        self.unposed = tuple(robot.resting_on(self.unknown))
        self.predictors = [Predictor(robot, log, Band(cutoff, log.rate)) for log in logs]
        self.segments: list[Segment] = []
        first = 0
        for record, (log, predictor) in enumerate(zip(self.logs, self.predictors, strict=True)):
            for group, samples in _choose(log, predictor):
                measured = _measured(log, predictor.band, group)[samples]
                if group[0] == WINDUP:
                    measured = measured - measured.mean()
                rows = slice(first, first + samples.size)
                first = rows.stop
                self.segments.append(Segment(record, group, samples, rows, measured))
        self.size = first
        self.groups = tuple(dict.fromkeys(s.group for s in self.segments))
        self.measured = np.concatenate([s.measured for s in self.segments]) if first else (
            np.zeros(0)
        )  # fmt: skip
        self.block = self._blocks()
        self._reported: tuple[tuple[tuple[str, float], ...], ...] = ()
        self._begun: dict[tuple[Hashable, ...], FloatArray | None] = {}

    def _blocks(self) -> np.ndarray:
        """(rows,) in which stretch of which record a row lies."""
        found = np.empty(self.size, dtype=np.intp)
        for s in self.segments:
            part = s.samples * BLOCKS // self.logs[s.record].samples
            found[s.rows] = s.record * BLOCKS + np.minimum(part, BLOCKS - 1)
        return found

    def of(self, group: Group) -> list[Segment]:
        """The segments of a group.

        Args:
            group: kind and joint.

        Returns:
            record by record.
        """
        return [s for s in self.segments if s.group == group]

    def predict(
        self,
        effects: Sequence[Effect],
        scales: Mapping[str, float],
        only: Effect | None = None,
        base: FloatArray | None = None,
    ) -> FloatArray:
        """(rows,) prediction.

        Args:
            effects: all that act.
            scales: joint -> factor on the rigid-body torque.
            only: where only this effect differs from `base`, records that it can't concern are
                copied from there.
            base: an earlier prediction.
        """
        out = np.zeros(self.size) if base is None else base.copy()
        readings: dict[int, Readings] = {}
        joint = only.target if only is not None and only.target_kind == "joint" else None
        for s in self.segments:
            if base is not None and joint not in (None, s.group[1]):
                continue
            if s.record not in readings:
                readings[s.record] = self.predictors[s.record].predict(effects, scales, joint)
            out[s.rows] = _at(s, readings[s.record])
        return out

    def around(self, effects: Sequence[Effect]) -> list[Around]:
        """What all effects together do to each one's term.

        Args:
            effects: all that act.

        Returns:
            record by record.
        """
        return [predictor.around(effects) for predictor in self.predictors]

    def bodies(self, effects: Sequence[Effect], fewer: Sequence[Effect]) -> list[FloatArray]:
        """What the bodies of some effects take more than those of fewer.

        Args:
            effects: the ones.
            fewer: the others.

        Returns:
            (rows,) N m or N, joint by joint.
        """
        parts = []
        for more, less in zip(self.around(effects), self.around(fewer), strict=True):
            parts.append({j: x - less.body[j] for j, x in more.body.items()})
        joints = dict.fromkeys(joint for kind, joint in self.groups if kind == TORQUE)
        return [
            self._rows(j, [{TORQUE: {j: each[j]}, RIPPLE: {}, WINDUP: {}} for each in parts])
            for j in joints if all(j in each for each in parts)
        ]  # fmt: skip

    def by_scale(self, around: Sequence[Around], joint: str) -> FloatArray:
        """Derivative by the factor on a joint's rigid-body torque.

        Args:
            around: of `System.around`.
            joint: its name.

        Returns:
            (rows,) N m or N.
        """
        return self._rows(
            joint, [p.by_scale(a, joint) for p, a in zip(self.predictors, around, strict=True)]
        )

    def by_parameter(
        self, around: Sequence[Around], effect: Effect, other: Effect, name: str, step: float
    ) -> FloatArray | None:
        """Derivative by an effect's parameter, as `Predictor.by_parameter` has it.

        Those of bodies from nothing are kept, as a search asks for them again and again.

        Args:
            around: of `System.around`.
            effect: as it is.
            other: the same with that parameter moved.
            name: the parameter.
            step: by which it was moved.

        Returns:
            (rows,); None where the whole prediction has to be made twice.
        """
        reported = tuple((*a.gains.items(), *a.delays.items()) for a in around)
        starts = not effect.linear and effect == type(effect)(effect.target)
        if not starts or any(a.loaded for a in around):
            return self._derivative(around, effect, other, name, step)
        if reported != self._reported:
            self._reported, self._begun = reported, {}
        key = (effect.key, other.key, step)
        if key not in self._begun:
            self._begun[key] = self._derivative(around, effect, other, name, step)
        return self._begun[key]

    def _derivative(
        self, around: Sequence[Around], effect: Effect, other: Effect, name: str, step: float
    ) -> FloatArray | None:
        found: list[Readings] = []
        for predictor, each in zip(self.predictors, around, strict=True):
            readings = predictor.by_parameter(each, effect, other, name, step)
            if readings is None:
                return None
            found.append(readings)
        return self._rows(effect.target if effect.target_kind == "joint" else None, found)

    def _rows(self, joint: str | None, readings: Sequence[Readings]) -> FloatArray:
        """(rows,) what one joint's readings are there, or all joints', record by record."""
        out = np.zeros(self.size)
        for s in self.segments:
            if joint in (None, s.group[1]) and s.group[1] in readings[s.record][s.group[0]]:
                out[s.rows] = _at(s, readings[s.record])
        return out


def _at(s: Segment, readings: Readings) -> FloatArray:
    """A segment's part of its record's readings; of a windup, less its mean."""
    kind, joint = s.group
    values = readings[kind][joint][s.samples]
    return values - values.mean() if kind == WINDUP else values


def _choose(log: MotionLog, predictor: Predictor) -> list[tuple[Group, np.ndarray]]:
    band, nominal = predictor.band, predictor.nominal
    edge = band.edges(log.samples)
    inner = np.arange(edge, log.samples - edge)
    # What is above the band feels the ends for a shorter time.
    short = int(np.ceil(log.rate / band.cutoff))
    ripple_inner = np.arange(min(short, edge), log.samples - min(short, edge))
    found: list[tuple[Group, np.ndarray]] = []
    moving = set(log.moving)
    for joint in log.torque:
        if joint not in moving:
            continue
        moves = np.abs(nominal.velocity[joint][inner]) > nominal.still[joint]
        every = inner[moves]
        thinned = every[every % band.step == 0]
        if thinned.size >= 2 * BLOCKS:
            found.append(((TORQUE, joint), thinned))
            if band.step > 1:
                speed = np.abs(nominal.velocity[joint][ripple_inner])
                found.append(((RIPPLE, joint), ripple_inner[speed > nominal.still[joint]]))
    found += [((WINDUP, joint), inner) for joint in log.link if joint in moving]
    return found


def _measured(log: MotionLog, band: Band, group: Group) -> FloatArray:
    kind, joint = group
    if kind == WINDUP:
        return log.link[joint] - log.angle[joint]
    slow = band.low_pass(log.torque[joint])
    return slow if kind == TORQUE else log.torque[joint] - slow
