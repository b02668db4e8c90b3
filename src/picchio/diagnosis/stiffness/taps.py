"""Taps in time: records of one blow as functions along a line in the Laplace plane.

An exponential window w = exp(-a t) on force and reading makes them decay within the record; their
Fourier transforms are then the Laplace transforms at s = a + i w, and their ratio is the transfer
function there, with no damping to be corrected afterwards (Bucher, J. Vib. Acoust. 120 (1998) 588,
has the window as a shift of the poles). Without a measured force the ratio to a unit impulse is
taken, and how hard, when and how long the blow was are numbers of their own.

A sum over samples is not the integral: where the force bends between two samples, where a blow
begins and ends, it is off by T^2/2 times the bend times B_2 of where between them (Euler and
Maclaurin), which is half a per cent of a blow of eight samples. The sum of the acceleration is off
by as much times J_s M^-1 J_f, by which it follows the force at once: where the arm hardly answers
that is more than what it answers. Both are numbers of their own, each of a blow.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from picchio.campaign.channels import AXES, Channel
from picchio.campaign.record import Record
from picchio.core.arrays import BoolArray, ComplexArray, FloatArray
from picchio.diagnosis.stiffness.prior import prior_of
from picchio.robot.flexible_robot import FlexibleRobot

SAMPLING = ("blow_begins", "blow_ends")
"""Where a sum over samples is off."""
UNKNOWN_BLOW = (("impulse", 2.3), ("blow_delay", 1e-3), ("blow_variance", 3e-7))
"""Numbers of a blow that is not measured, and their standard deviations: ln of N s, s, s^2."""
_IMPULSE, _DELAY, _VARIANCE = 1.0, 1.5e-3, 4e-7  # N s, s, s^2: a hammer's, about
_USUAL = 4e-3, 0.5 * math.pi**2  # s, a blow; how much its force bends there, over impulse / s^2
_BENDS = 1.0 / math.sqrt(720.0)  # of T^2 times the bend: B_2 / 2 of what may lie anywhere
_DECAY = 6.0  # of the window, over the record's length
SAMPLED = 0.4
"""Highest line, over the sample rate."""
_BLOCK = 4096  # samples
_SHAKEN, _STRUCK = 0.3, 0.1  # least force over the largest, of a line and of a sample
_MOST_UNKNOWN = 120.0  # Hz, to which a blow of unknown shape is nearly an impulse
_MOST_LINES = 240
_MODEL = 0.005  # of a line: nothing is measured better than that
_WIDTH = 3.0  # samples that a measured blow must last
_QUIET = 20  # samples, at least, that tell a channel's noise
_LIKELY = 1.645  # standard deviations of what is known of a joint
_REACH = 250.0  # Hz, to which a hammer's blow of 4 ms shakes an arm
POWER = {"accelerometer": 2, "acceleration": 2, "velocity": 1, "displacement": 0, "deflection": 0}
"""Of s, from a motion to what a kind of channel reads."""
_READ = [name for name in POWER if name != "deflection"]  # of a tap


class Seen(NamedTuple):
    """How a function was taken.

    Attributes:
        way: (3,) unit, world, of the force.
        along: (3,) unit, world, in which the sensor reads.
        power: of s, from a motion to the reading.
        tilts: whether the sensor also reads that it turns in gravity.
        force_frame, force_point: where the force acts; see `RecordTable`.
        response_frame, response_point: where the sensor is.
        joint: number of the joint whose turn is read; None of a sensor in space.
    """

    way: FloatArray
    along: FloatArray
    power: int
    tilts: bool
    force_frame: str | None = None
    force_point: tuple[float, float, float] | None = None
    response_frame: str | None = None
    response_point: tuple[float, float, float] | None = None
    joint: int | None = None

    @classmethod
    def by(cls, channel: Channel, way: FloatArray, robot: FlexibleRobot, pose: FloatArray) -> Seen:
        """What a channel of a record in time reads.

        Args:
            channel: of a kind in `POWER`.
            way: (3,) unit, world, of the force.
            robot: flexible.
            pose: (nv,) rad or m.
        """
        power, subject = POWER[channel.kind.name], channel.subject or ""
        if channel.kind.name == "deflection":
            joint = robot.flexible_names.index(subject)
            return cls(way, np.zeros(3), power, False, joint=joint)
        axis, turns = np.eye(3)[AXES.index(channel.axis or "x")], False
        if channel.kind.name == "accelerometer":
            axis, turns = robot.frame_placement(pose, subject)[1] @ axis, True
        return cls(way, axis, power, turns, response_frame=channel.subject)


class Spectrum(NamedTuple):
    """One channel of a tap.

    Attributes:
        seen: what it is.
        omega: (m,) rad/s, of the lines.
        shift: 1/s, likewise.
        measured: (m,) SI per newton.
        scale: (m,) its standard deviation.
        known: whether the force was measured.
        bends: (2, m) a standard deviation of where the sum over samples is off, over the force.
    """

    seen: Seen
    omega: FloatArray
    shift: float
    measured: ComplexArray
    scale: FloatArray
    known: bool
    bends: ComplexArray


def lines(length: float, highest: float) -> ComplexArray:
    """Where a record of blows is looked at in the Laplace plane, (m,) rad/s.

    Args:
        length: s, over which the window decays.
        highest: Hz.
    """
    spacing = max(2.0 / length, highest / _MOST_LINES)
    return _DECAY / length + 2j * np.pi * np.arange(spacing, highest, spacing)


def transform(line: ComplexArray, time: FloatArray, values: FloatArray) -> ComplexArray:
    """The sum of exp(-s t) times values over samples, block by block.

    Args:
        line: (m,) s, rad/s.
        time: (count,) s.
        values: (count,) or (count, k).

    Returns:
        (m,) or (m, k).
    """
    found = np.zeros((len(line), *values.shape[1:]), dtype=complex)
    for first in range(0, len(time), _BLOCK):
        part = slice(first, first + _BLOCK)
        found += np.exp(-np.outer(line, time[part])) @ values[part]
    return found


@dataclass(frozen=True, eq=False)
class Window:
    """An exponential window on what a record reads, over the blow.

    Attributes:
        time: (count,) s, the blow from 0 on.
        line: (m,) rad/s, in the Laplace plane, on a line parallel to the imaginary axis.
        blow: (m,) N s there.
        end: s, how far the record is looked at.
    """

    time: FloatArray
    line: ComplexArray
    blow: ComplexArray
    end: float = math.inf

    def over_blow(
        self, values: FloatArray, noise: FloatArray, kept: BoolArray
    ) -> tuple[ComplexArray, FloatArray]:
        """The functions of channels and their standard deviations, both SI per newton.

        Args:
            values: (count, k) SI; before the blow their means are nothing.
            noise: (k,) their standard deviations.
            kept: (m,) lines.

        Returns:
            (k, kept) each.
        """
        within = (self.time >= 0.0) & (self.time <= self.end)
        step, before = float(np.median(np.diff(self.time))), values[self.time < 0.0]
        rest = before.mean(axis=0) if len(before) >= _QUIET else 0.0
        time, blow = self.time[within], self.blow[kept]
        value = step * transform(self.line[kept], time, values[within] - rest).T / blow
        weight = np.sqrt(np.sum(np.exp(-2.0 * self.line[0].real * time)))
        size = np.abs(value)
        floor = _MODEL * np.hypot(size, 0.01 * size.max(axis=1, keepdims=True))
        return value, np.hypot(noise[:, None] * step * weight / np.abs(blow), floor)


def spectra(robot: FlexibleRobot, record: Record, pose: FloatArray) -> list[Spectrum]:
    """What every channel of a tap says.

    Args:
        robot: flexible.
        record: a percussion record of one blow.
        pose: (nv,) rad or m.

    Returns:
        one for each channel of an accelerometer and the like.

    Raises:
        InputError: no such channel; a record that does not begin before the blow's end, is too
            short, or is sampled too slowly for its blow or for the robot's modes.
    """
    columns = record.read()
    time = columns.pop("time")
    step = float(np.median(np.diff(time)))
    after = time >= 0.0
    length = float(time[-1])
    if after.sum() < 64 or length <= 0.0:
        raise record.source.error("a tap needs 64 samples or more from t = 0 on", channel="time")
    force = columns.pop("force", None)
    used = [name for name in columns if record.channel(name).kind.name in _READ]
    if not used:
        raise record.source.error("no channel of this tap tells the stiffness",
                                  choices=[f"{name}.<frame>.x" for name in _READ])  # fmt: skip
    highest = SAMPLED / step
    _sampled_well(robot, record, pose, step)
    if force is not None:
        struck = np.abs(force) > _STRUCK * np.abs(force).max()
        if not np.abs(force).max() > 0.0:
            raise record.source.error("is zero throughout", channel="force")
        if struck.sum() < _WIDTH:
            raise record.source.error(
                f"the blow lasts {struck.sum()} samples at {1.0 / step:.0f} Hz: its force is not "
                "known so", channel="force",
                hint="sample faster, or leave the force out: the ring-down is used then",
            )  # fmt: skip
    else:
        highest = min(highest, _MOST_UNKNOWN)
    line = lines(length, highest)
    if force is not None:
        blow = step * transform(line, time[after], force[after])
        kept = np.abs(blow) > _SHAKEN * np.abs(blow).max()
        kept &= np.cumprod(kept).astype(bool)  # beyond the first gap nothing
        ends = time[np.flatnonzero(struck)[[0, -1]]] + np.array([-0.5, 0.5]) * step
        bend = float(np.abs(np.diff(force)).max()) / step
    else:
        blow = _IMPULSE * np.exp(-line * _DELAY + 0.5 * line**2 * _VARIANCE)
        kept = np.ones(len(line), bool)
        ends = np.array([0.0, _USUAL[0]])
        bend = _USUAL[1] * _IMPULSE / _USUAL[0] ** 2
    bends = _BENDS * step**2 * bend * np.exp(-np.outer(ends, line)) / blow
    window = Window(time, line, blow)
    every = np.stack([columns[name] for name in used], axis=1)
    quiet = every[~after] if (~after).sum() >= _QUIET else every[-max(len(every) // 10, 2) :]
    both = window.over_blow(every, quiet.std(axis=0), kept)
    found = []
    for name, value, size in zip(used, *both, strict=True):
        assert record.direction is not None
        seen = Seen.by(record.channel(name), record.direction, robot, pose)
        found.append(Spectrum(seen, line.imag[kept], line[0].real, value, size,
                              force is not None, bends[:, kept]))  # fmt: skip
    return found


def _sampled_well(robot: FlexibleRobot, record: Record, pose: FloatArray, step: float) -> None:
    """Refuse what may fold, with each joint as stiff as what is known of it allows.

    No filter is known of, and a mode beyond half the sample rate, folded, looks like a low one.
    """
    state, prior = robot.state(pose), prior_of(robot)
    inverse = np.linalg.inv(np.linalg.cholesky(state.mass_matrix))
    raised = np.exp(_LIKELY * np.diag(prior.std))
    for joint, factors in zip(("", *robot.flexible_names), (np.ones(len(raised)), *raised),
                              strict=True):  # fmt: skip
        squared = np.linalg.eigvalsh(inverse @ np.diag(factors * state.stiffness) @ inverse.T)
        modes = np.sqrt(squared) / (2.0 * np.pi)
        folds = modes[(modes > 0.5 / step) & (modes < _REACH)]
        if not len(folds):
            continue
        when = f"if {joint} is as stiff as it may be, " if joint else ""
        known = ", or tell the stiffness by loads first" if joint else ", as no phone does"
        raise record.source.error(
            f"is sampled at {1.0 / step:.0f} Hz: {when}a mode near {folds[0]:.0f} Hz, if nothing "
            "filters it, folds into what is read", channel="time",
            hint=f"sample at {2.5 * folds[-1]:.0f} Hz or more{known}",
        )  # fmt: skip
