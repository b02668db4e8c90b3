"""What the nominal simulation leaves of percussion records, and where; no cause is looked for."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from picchio.campaign.campaign import Campaign
from picchio.core.arrays import FloatArray
from picchio.diagnosis.percussion.criteria.whiteness import Evidence, whiteness_test
from picchio.diagnosis.percussion.data.problem import MeasuredRecord, Problem
from picchio.diagnosis.percussion.fit.least_squares import Fit, fit_growing
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.prediction.residual import (
    ChannelResidual,
    Restoring,
    Transfer,
    by_window,
    residual_torque,
    spectrum,
    transfer,
)
from picchio.robot.flexible_robot import FlexibleRobot

_BANDS = 110
_HIGHEST = 6.0
_MOST_WINDOWS = 60
_ALIKE = 0.02  # between the intervals of blows that are shown together
# A joint moves if its deflection is so many times its noise.
_CLEAR = 15.0
# Channels whose transfer function is shown.
_TRANSFERS = 4


def channel_residuals(
    problem: Problem, fit: Fit, predictions: Sequence[dict[str, FloatArray]]
) -> list[ChannelResidual]:
    """Every channel of every record."""
    found = []
    for record, white, predicted in zip(fit.records, fit.residuals, predictions, strict=True):
        source = problem.campaign[record.name]
        for channel, row in zip(record.channels, white, strict=True):
            name, values = channel.name, record.values[channel.name]
            left, signal = values - predicted[name], values
            if record.setup.steady or channel.kind.free_offset:
                left, signal = left - left.mean(), values - values.mean()
            found.append(
                ChannelResidual(
                    record.name,
                    name,
                    channel.group,
                    record.pose,
                    tuple(float(c) for c in record.setup.blows.direction),
                    float(np.abs(record.setup.blows.height).max()),
                    source.taken,
                    source.temperature,
                    float(np.sqrt(np.mean(left**2))),
                    float(np.sqrt(np.mean(signal**2))),
                    record.noise[name].std,
                    float(np.sqrt(np.mean(row**2))),
                )
            )
    return found


@dataclass(frozen=True, eq=False)
class Spectra:
    """Residual power by frequency.

    Attributes:
        edges: (k + 1,) Hz.
        power: group -> (k,), 1 is noise.
        modes: from and to over the poses, Hz, a natural frequency each.
        hit_rate: Hz.
    """

    edges: FloatArray
    power: dict[str, FloatArray]
    modes: list[tuple[float, float]]
    hit_rate: float

    @property
    def worst(self) -> tuple[str, float, float]:
        """Group, Hz and power where most is left."""
        middle = np.sqrt(self.edges[:-1] * self.edges[1:])
        best = ("", 0.0, 0.0)
        for group, power in self.power.items():
            # The lowest lines hold what is left of offsets.
            values = np.where((middle > 3.0 * self.edges[0]) & np.isfinite(power), power, 0.0)
            k = int(np.argmax(values))
            if values[k] > best[2]:
                best = (group, float(middle[k]), float(values[k]))
        return best


def spectra(problem: Problem, fit: Fit) -> Spectra:
    """By frequency, all records together; records of the first one's clock."""
    step = fit.records[0].setup.samples.step
    found = problem.natural_frequencies
    ends = zip(found.min(axis=0), found.max(axis=0), strict=True)
    modes = [(float(low), float(high)) for low, high in ends]
    longest = max(r.setup.samples.count for r in fit.records) * step
    high = min(0.5 / step, _HIGHEST * max(m[1] for m in modes))
    edges = np.geomspace(1.0 / longest, high, _BANDS + 1)
    rows: dict[str, list[FloatArray]] = {}
    for record, white in zip(fit.records, fit.residuals, strict=True):
        if abs(record.setup.samples.step / step - 1.0) > 1e-6:
            continue
        for channel, row in zip(record.channels, white, strict=True):
            rows.setdefault(channel.group, []).append(row)
    power = {group: spectrum(every, step, edges) for group, every in rows.items()}
    return Spectra(edges, power, modes, 1.0 / fit.records[0].setup.blows.interval)


@dataclass(frozen=True, eq=False)
class PercussionResidual:
    """The nominal model fitted within its tolerance to all records, and what that leaves.

    Attributes:
        problem: data and noise.
        fit: stiffness, damping and force within their tolerance.
        evidence: whether noise is left.
        predictions: channel -> (m,) SI, a record each.
        parts: every channel of every record.
        spectra: by frequency.
    """

    problem: Problem
    fit: Fit
    evidence: Evidence
    predictions: list[dict[str, FloatArray]]
    parts: list[ChannelResidual]
    spectra: Spectra


def percussion_residual(
    robot: FlexibleRobot, campaign: Campaign, *, gravity_stiffness: bool = True
) -> PercussionResidual:
    """Fit the nominal model within the campaign's tolerance, and measure what is left.

    Args:
        robot: as its files have it.
        campaign: its percussion records; others are passed over.
        gravity_stiffness: whether gravity's change with the deflection counts.

    Returns:
        the fit, and what it leaves: by channel, frequency and pose.

    Raises:
        InputError: no record that can be predicted for this robot.
    """
    problem = Problem(robot, campaign, gravity_stiffness=gravity_stiffness)
    fit = fit_growing(problem, Hypothesis.nominal(problem))
    predictions = problem.predictions(fit.hypothesis.effects)
    return PercussionResidual(
        problem, fit, whiteness_test(problem, fit), predictions,
        channel_residuals(problem, fit, predictions), spectra(problem, fit),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class OverTime:
    """Residual and signal, window by window.

    Attributes:
        edges: (k + 1,) s.
        residual, signal: group -> (k,) RMS over the noise.
        last_blow: s; None in steady records.
    """

    edges: FloatArray
    residual: dict[str, FloatArray]
    signal: dict[str, FloatArray]
    last_blow: float | None


def over_time(fit: Fit) -> OverTime:
    """By time, a window a hit, records with the same blows together."""
    first = fit.records[0].setup
    like = [
        (r, w)
        for r, w in zip(fit.records, fit.residuals, strict=True)
        if r.setup.blows.start.size == first.blows.start.size
        and math.isclose(r.setup.blows.interval, first.blows.interval, rel_tol=_ALIKE)
    ]
    window = first.blows.interval
    start = min(float(r.setup.samples.times[0]) for r, _ in like)
    end = max(float(r.setup.samples.times[-1]) for r, _ in like)
    while (end - start) / window > _MOST_WINDOWS:
        window *= 2.0
    before = np.ceil(max(-start, 0.0) / window)
    edges = window * np.arange(-before, np.floor(end / window) + 1)
    # Group -> times, residuals and readings, both in units of the noise.
    parts: dict[str, tuple[list[FloatArray], list[FloatArray], list[FloatArray]]] = {}
    for record, white in like:
        for channel, row in zip(record.channels, white, strict=True):
            times, rows, levels = parts.setdefault(channel.group, ([], [], []))
            times.append(record.setup.samples.times)
            rows.append(row)
            levels.append(record.values[channel.name] / record.noise[channel.name].std)
    residual = {g: by_window(times, rows, edges) for g, (times, rows, _) in parts.items()}
    signal = {g: by_window(times, levels, edges) for g, (times, _, levels) in parts.items()}
    last = None if first.steady else float(first.blows.onsets.max())
    return OverTime(edges, residual, signal, last)


def restoring(
    problem: Problem, fit: Fit, predictions: Sequence[dict[str, FloatArray]]
) -> dict[str, tuple[str, Restoring]]:
    """Joint -> the record that shows its missing torque best, and that torque.

    A joint that hardly moves in any record, or a record that lacks a joint's deflection, is
    left out: noise would correlate with itself.
    """
    robot = problem.robot
    names = [f"deflection.{name}" for name in robot.flexible_names]
    best: dict[str, tuple[float, int]] = {}
    for index, (record, white) in enumerate(zip(fit.records, fit.residuals, strict=True)):
        if not all(name in record.values for name in names) or record.setup.samples.count < 64:
            continue
        for joint, name in zip(robot.flexible_names, names, strict=True):
            row = list(record.values).index(name)
            size = float((white[row] ** 2).mean())
            moves = float(record.values[name].std()) > _CLEAR * record.noise[name].std
            if moves and size > best.get(joint, (0.0, 0))[0]:
                best[joint] = (size, index)
    found = {}
    for joint, (_, index) in best.items():
        every = _missing(problem, fit, fit.records[index], predictions[index], names)
        if every is not None:
            found[joint] = (fit.records[index].name, every[robot.flexible_names.index(joint)])
    return {joint: found[joint] for joint in robot.flexible_names if joint in found}


def _missing(
    problem: Problem,
    fit: Fit,
    record: MeasuredRecord,
    predicted: dict[str, FloatArray],
    names: Sequence[str],
) -> list[Restoring] | None:
    setup = record.setup
    plant = problem.model.with_effects(fit.hypothesis.effects).plant(
        setup.geometry, setup.conditions
    )
    system = plant.build(setup.blows.direction)
    if system.mass.shape[0] != len(names):
        return None
    measured = np.stack([record.values[name] for name in names])
    simulated = np.stack([predicted[name] for name in names])
    # What rests before the first blow has no deflection.
    quiet = setup.samples.times < -1e-9
    rest = quiet if quiet.sum() > 8 else np.ones(quiet.size, dtype=bool)
    measured = measured - measured[:, rest].mean(axis=1, keepdims=True)
    simulated = simulated - simulated[:, rest].mean(axis=1, keepdims=True)
    return residual_torque(system.mass, system.damping, system.stiffness, measured, simulated,
                           setup.samples.step)  # fmt: skip


def transfers(
    fit: Fit, predictions: Sequence[dict[str, FloatArray]]
) -> tuple[list[MeasuredRecord], dict[str, Transfer]]:
    """Response over force of the channels that are wrong most, where a force was measured."""
    acting = {r.name: force for r in fit.records if (force := _force_read(r)) is not None}
    chosen = [r for r in fit.records if r.name in acting]
    if not chosen:
        return [], {}
    worst = max(chosen, key=lambda r: float((fit.residuals[fit.records.index(r)] ** 2).mean()))
    like = [
        r for r in chosen
        if r.pose == worst.pose
        and np.allclose(r.setup.blows.direction, worst.setup.blows.direction)
        and r.setup.samples.step == worst.setup.samples.step
    ]  # fmt: skip
    white = fit.residuals[fit.records.index(worst)]
    order = np.argsort(-(white**2).mean(axis=1))
    names = [worst.channels[i].name for i in order if not worst.channels[i].kind.of_force]
    found = {}
    for name in names[:_TRANSFERS]:
        if not all(name in r.values for r in like):
            continue
        simulated = [predictions[fit.records.index(r)][name] for r in like]
        found[name] = transfer([acting[r.name] for r in like], [r.values[name] for r in like],
                               simulated, worst.setup.samples.step)  # fmt: skip
    return like, found


def _force_read(record: MeasuredRecord) -> FloatArray | None:
    """(m,) N, beside stated blows or in place of them; None where no sensor read it."""
    setup = record.setup
    if setup.blows.recorded:
        return setup.blows.force()(setup.samples.times)
    return record.values.get("force")
