"""Records that repeat each other: of the same pose, direction and blows."""

from __future__ import annotations

from collections import Counter

import numpy as np

from picchio.campaign.campaign import Campaign
from picchio.campaign.record import Record
from picchio.measurement.noise.window import Window

# Samples kept of a record until it is repeated, and numbers kept of all such records: 24 MiB.
_SAMPLES = 16384
_BUDGET = 3 << 20


def repeat_key(record: Record) -> tuple[object, ...] | None:
    """What repeats of a record have in common; None for records that cannot be compared."""
    if record.kind == "motion" or record.pose is None or record.direction is None:
        return None
    pose = record.pose
    where = tuple(sorted(pose.items())) if isinstance(pose, dict) else tuple(pose)
    blows = record.excitation.model_dump(exclude_none=True)
    return (where, tuple(np.round(record.direction, 9)), tuple(sorted(blows.items())))


def overlap(one: Window, other: Window) -> tuple[slice, slice]:
    """Which samples of two windows of one sample rate were taken at the same times."""
    shift = round((other.time[0] - one.time[0]) * one.rate)
    a, b = (shift, 0) if shift >= 0 else (0, -shift)
    count = max(0, min(one.time.size - a, other.time.size - b))
    return slice(a, a + count), slice(b, b + count)


class Repeats:
    """Finds to each record the one before it that it repeats.

    Args:
        campaign: whose records will come, in its order.
    """

    def __init__(self, campaign: Campaign) -> None:
        self._left = Counter(repeat_key(record) for record in campaign)
        self._before: dict[tuple[object, ...], Window] = {}
        self._kept = 0

    def before(self, window: Window) -> Window | None:
        """The first samples of the record that this one repeats, where their rates are the same."""
        key = repeat_key(window.record)
        if key is None:
            return None
        self._left[key] -= 1
        before = self._before.pop(key, None)
        if before is not None:
            self._kept -= _numbers(before)
        if self._left[key] > 0 and self._kept < _BUDGET:
            arrays = {name: values[:_SAMPLES].copy() for name, values in window.arrays.items()}
            kept = Window(window.record, window.time[:_SAMPLES].copy(), arrays, False, window.rate)
            self._before[key] = kept
            self._kept += _numbers(kept)
        if before is None or abs(before.rate / window.rate - 1.0) > 1e-6:
            return None
        return before


def _numbers(window: Window) -> int:
    return window.time.size * (len(window.arrays) + 1)
