"""What a diagnosis of motion records looked at, channel by channel: measured, before and after."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from picchio.campaign.channels import Channel, parse_channel
from picchio.core.arrays import FloatArray
from picchio.diagnosis.motion.conclude.holdout import residual_of
from picchio.diagnosis.motion.data.system import Group, Segment, System
from picchio.diagnosis.motion.residual import rms
from picchio.diagnosis.result import Diagnosis
from picchio.model.motion import TORQUE, WINDUP

_BINS = 20
_FEWEST = 8  # samples of a bin
_WORDS = {TORQUE: "torque", WINDUP: "link angle less motor angle"}


@dataclass(frozen=True, eq=False)
class View:
    """One channel of one record.

    Attributes:
        system: the record's equations.
        segment: the channel's.
        before: (m,) what the baseline leaves, SI.
        after: (m,) what the extended model leaves.
        noise: standard deviation of the noise, SI.
    """

    system: System
    segment: Segment
    before: FloatArray
    after: FloatArray
    noise: float

    @property
    def group(self) -> Group:
        """Kind and joint."""
        return self.segment.group

    @property
    def file(self) -> str:
        """The record's."""
        return self.system.logs[self.segment.record].file

    @property
    def time(self) -> FloatArray:
        """(m,) s."""
        found: FloatArray = self.segment.samples / self.system.logs[self.segment.record].rate
        return found

    @property
    def measured(self) -> FloatArray:
        """(m,) SI."""
        return self.segment.measured

    @property
    def prismatic(self) -> bool:
        """Whether the joint slides."""
        joint = self.system.robot.tree.joints.get(self.group[1])
        return joint is not None and joint.type == "prismatic"

    @property
    def words(self) -> str:
        """For people."""
        kind = "force" if self.prismatic and self.group[0] == TORQUE else _WORDS[self.group[0]]
        return f"{kind} of {self.group[1]}"

    @property
    def channel(self) -> Channel:
        """With a short name, to label axes with."""
        kind, joint = self.group
        length = "m" if self.prismatic else "rad"
        unit = {TORQUE: "N" if self.prismatic else "N*m"}.get(kind, length)
        name = f"{'torque' if kind == TORQUE else 'position'}.{joint}"
        short = f"link - motor, {joint}" if kind == WINDUP else f"{self.words.split()[0]}, {joint}"
        return replace(parse_channel(name, unit)[0], name=short)

    def motion(self, name: str) -> FloatArray:
        """(m,) a series of the nominal motion: angle, velocity, acceleration, body."""
        nominal = self.system.predictors[self.segment.record].nominal
        found: FloatArray = getattr(nominal, name)[self.group[1]][self.segment.samples]
        return found


def views(diagnosis: Diagnosis, which: str) -> list[View]:
    """All torques in the band and twists of some records.

    Args:
        diagnosis: of motion records.
        which: "train" or "held_out".
    """
    details = diagnosis.details
    system: System = details["systems"][which]
    before, after = (residual_of(system, details[key]) for key in ("baseline", "extended"))
    noise = {(row["record"], row["channel"]): row["noise"] for row in details[which]}
    return [
        View(system, s, before[s.rows], after[s.rows],
             noise[system.logs[s.record].file, ".".join(s.group)])
        for s in system.segments if s.group[0] in _WORDS
    ]  # fmt: skip


def worst(found: Sequence[View], kind: str, explained: Collection[str] = ()) -> View | None:
    """The view of a kind that the baseline leaves most of, over its noise.

    Args:
        found: all views.
        kind: "torque" or "windup".
        explained: joints to look at first, if there are any: those with a cause.
    """
    of = [v for v in found if v.group[0] == kind]
    chosen = [v for v in of if v.group[1] in explained] or of
    return max(chosen, key=lambda v: rms(v.before) / v.noise, default=None)


def telling(found: Sequence[View], view: View) -> tuple[str, FloatArray, list[View]]:
    """What of the motion the residual goes with most, in all records of a channel.

    Angle, velocity, acceleration and the torque that the gear carries are each cut into bins of
    as many samples; the one whose bins' means take most of the residual's power is told.

    Returns:
        its name, its values, and the views whose samples those are.
    """
    same = [v for v in found if v.group == view.group]
    left = np.concatenate([v.before for v in same])
    names = ["angle", "velocity", "acceleration", "body"]
    series = {name: np.concatenate([v.motion(name) for v in same]) for name in names}
    best = max(names, key=lambda name: _share(series[name], left))
    return best, series[best], same


def _share(x: FloatArray, y: FloatArray) -> float:
    """Part of y's power that goes with x."""
    edges = np.quantile(x, np.linspace(0.0, 1.0, _BINS + 1))
    place = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, _BINS - 1)
    taken = [y[place == k] for k in range(_BINS)]
    return float(sum(part.size * part.mean() ** 2 for part in taken if part.size >= _FEWEST))
