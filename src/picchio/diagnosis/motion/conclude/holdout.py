"""How much better the extended model predicts records that it has not seen."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.diagnosis.motion.data.system import Group, System
from picchio.diagnosis.motion.fit.least_squares import Fit
from picchio.diagnosis.motion.fit.state import State
from picchio.diagnosis.result import MOSTLY, Gain, Verdict
from picchio.model.motion import RIPPLE

_THERE = 0.05
NOISE = 1.15  # residual over noise that counts as noise: noise is known to about a tenth


def judged_groups(system: System, fitted: Fit) -> list[Group]:
    """Torques in the band and windups; what is above the band where a claimed ripple is there."""
    state = fitted.state
    found = [g for g in system.groups if g[0] != RIPPLE]
    if not any(e.periodic for e in state.effects):
        return found
    predicted = system.predict(state.every, state.scales)
    for group in system.groups:
        rows = np.concatenate([np.arange(s.rows.start, s.rows.stop) for s in system.of(group)])
        if group[0] == RIPPLE and np.std(predicted[rows]) > _THERE * np.std(system.measured[rows]):
            found.append(group)
    return found


def residual_of(system: System, state: State) -> FloatArray:
    """(rows,) measured less predicted."""
    return system.measured - system.predict(state.every, state.scales)


def judge(
    system: System,
    before: State,
    after: State,
    noise: Mapping[Group, float],
    groups: Collection[Group],
    train: System,
) -> Gain:
    """Gain on a system; held out is nothing where it is the one that was fitted to.

    Every channel's residual over its noise and the square root of its samples, all channels
    together, each as long as its record is, relative to the signal so weighted.
    """
    sums = np.zeros(4)
    parts = (system.measured, residual_of(system, before), residual_of(system, after))
    judged = [s for s in system.segments if s.group in groups]
    seconds = [system.logs[s.record].samples / system.logs[s.record].rate for s in judged]
    for s, length in zip(judged, seconds, strict=True):
        part = length * len(judged) / sum(seconds)
        for i, values in enumerate(parts):
            sums[i] += part * float(np.mean(values[s.rows] ** 2)) / noise[s.group] ** 2
        sums[3] += part
    signal = max(sums[0], 1e-300)
    return Gain(
        train_records=tuple(log.file for log in train.logs),
        held_out_records=() if system is train else tuple(log.file for log in system.logs),
        baseline_nrmse=float(np.sqrt(sums[1] / signal)),
        extended_nrmse=float(np.sqrt(sums[2] / signal)),
        noise_floor_nrmse=float(np.sqrt(sums[3] / signal)),
        channels=len(judged),
    )


def table(
    system: System, before: State, after: State, noise: Mapping[Group, float]
) -> list[dict[str, Any]]:
    """Record by record and channel by channel: RMS measured, left before, left after, noise."""
    left, less = residual_of(system, before), residual_of(system, after)
    rms = lambda x: float(np.sqrt(np.mean(x**2)))  # noqa: E731
    return [
        {
            "record": system.logs[s.record].file,
            "channel": ".".join(s.group),
            "measured": rms(s.measured),
            "baseline": rms(left[s.rows]),
            "extended": rms(less[s.rows]),
            "noise": noise[s.group],
            "samples": s.samples.size,
        }
        for s in system.segments
    ]


def channels(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Channel by channel, all records together: RMS left before and after, noise, verdict.

    Args:
        rows: of `table`.

    Returns:
        rows of "channel", "before", "after", "noise" and "verdict".
    """
    found: dict[str, list[Mapping[str, Any]]] = {}
    for row in rows:
        if not row["channel"].startswith(RIPPLE):
            found.setdefault(row["channel"], []).append(row)
    made = []
    for channel, parts in found.items():
        before, after, noise, signal = (
            math.sqrt(sum(row[key] ** 2 * row["samples"] for row in parts)
                      / sum(row["samples"] for row in parts))
            for key in ("baseline", "extended", "noise", "measured")
        )  # fmt: skip
        made.append({
            "channel": channel, "before": before, "after": after, "noise": noise,
            "verdict": channel_verdict(before, after, noise, signal),
        })  # fmt: skip
    return made


def channel_verdict(before: float, after: float, noise: float, signal: float = math.inf) -> Verdict:
    """What is said of one channel, in the words of a whole diagnosis.

    Args:
        before: RMS that the nominal model leaves.
        after: what the extended model leaves.
        noise: what noise alone leaves.
        signal: RMS measured: where as much is left, nothing is explained.
    """
    if before <= NOISE * noise:
        return "nothing-wrong"
    if after <= NOISE * noise:
        return "named"
    if after >= signal:
        return "unexplained"
    explained = (before**2 - after**2) / max(before**2 - noise**2, 1e-300)
    return "partial" if explained >= MOSTLY else "unexplained"
