"""Does a sensor run into its limit? Flat tops, exact or under noise."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator

import numpy as np

from picchio.core.arrays import FloatArray, IndexArray
from picchio.excitation.table import excitation_class
from picchio.measurement.noise.window import Window
from picchio.measurement.quality.check import Check, Context, Finding
from picchio.measurement.quality.scan import ChannelScan, RecordScan

_KEPT = 4000
# Widths below the largest value, and above zero, that may count.
_DEPTH, _CLEAR = 5.4, 7.8
_ADVICE = "set a larger range and repeat; until then leave these samples out"


class ClippingCheck(Check):
    """Values that pile up at the largest one, as only a limit makes them."""

    name = "clipping"
    what = "sensors that reach their limit (flat tops)"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._tops: dict[str, list[tuple[str, str, FloatArray, FloatArray]]] = defaultdict(list)

    def record(self, scan: RecordScan) -> Iterator[Finding]:
        """Flat tops that are exact; what may be one under noise is kept until the end."""
        for name, seen in scan.channels.items():
            channel = scan.window.channels[name]
            if seen.constant or channel.kind.condition:
                continue
            motion = scan.record.kind == "motion"
            if motion and channel.kind.smooth:
                continue  # a machine may stand still where its range ends
            if channel.kind.of_force and excitation_class(scan.record.excitation.kind).flat:
                continue
            values = scan.window.arrays[name]
            flat = _exact(values, seen)
            if flat:
                limit, samples = flat
                self.told.add(channel.group)
                yield self.found(
                    "warning",
                    f"reaches its limit of {limit:.4g} {channel.unit}: {samples} samples lie "
                    "exactly there",
                    _ADVICE, record=scan.file, channel=name, value=limit, unit=channel.unit,
                )  # fmt: skip
            elif not motion:
                keep = self._near_top(scan.window, name)
                if keep.size:
                    self._tops[channel.group].append((scan.file, name, keep, values[keep]))

    def _near_top(self, window: Window, name: str) -> IndexArray:
        """The samples that `_piled` may count, in order: memory must not grow with the records."""
        size = np.abs(window.arrays[name])
        group = [channel.name for channel in window.groups[window.channels[name].group]]
        low = max(size.max() - _DEPTH * self._width(group), _CLEAR * self._width([name]))
        near = np.flatnonzero(size >= low)
        return np.sort(near[np.argsort(size[near])[-_KEPT:]])

    def _width(self, names: Iterable[str]) -> float:
        """How far the noise spreads what lies at one level."""
        std, hum = (max(map(of, names)) for of in (self.context.std, self.context.hum))
        return 2.5 * std + hum

    def finish(self) -> Iterator[Finding]:
        """Groups whose largest values pile up within the noise of one level."""
        for group, tops in self._tops.items():
            if group in self.told:
                continue
            # Channel by channel: one limit may be reached by a small one of the group alone.
            found = [
                finding
                for name in dict.fromkeys(name for _, name, _, _ in tops)
                for finding in self._piled(name, [top for top in tops if top[1] == name])
            ]
            yield from found or self._piled(group, tops)

    def _piled(
        self, group: str, tops: list[tuple[str, str, FloatArray, FloatArray]]
    ) -> Iterator[Finding]:
        names = {name for _, name, _, _ in tops}
        if max(map(self.context.std, names)) <= 0.0:
            return
        most = max(float(np.abs(v).max()) for _, _, _, v in tops)
        # The noise comes after the limit: the level is below the largest reading.
        width = self._width(names)
        limit = most - 1.2 * width
        if limit < 12.0 * width:  # `_CLEAR` and `_DEPTH` follow from these numbers
            return
        at, below, runs, both = 0, 0, 0, set()
        files = []
        for file, _, index, values in tops:
            size = np.abs(values)
            inside = np.abs(size - limit) <= 1.2 * width
            at += int(inside.sum())
            below += int((np.abs(size - (limit - 3.0 * width)) <= 1.2 * width).sum())
            places = index[inside]
            groups = np.split(places, np.flatnonzero(np.diff(places) > 2) + 1)
            longer = [g for g in groups if g.size >= 3]
            if longer:
                runs += len(longer)
                files.append(file)
            both.update(np.sign(values[inside]).tolist())
        enough = len(set(files)) >= 2 or (len(both) == 2 and runs >= 4)
        if at >= 15 and at > 4.0 * max(below, 1) and runs >= 3 and enough:
            yield self.found(
                "warning",
                f"seems to reach a limit of about {limit:.4g}: {at} samples of "
                f"{len(set(files))} records pile up there, {below} as far below it",
                _ADVICE,
                record=files[0] if len(set(files)) == 1 else None, channel=group, value=limit,
            )  # fmt: skip


def _exact(values: FloatArray, seen: ChannelScan) -> tuple[float, int] | None:
    """(limit, samples) where samples in a row lie exactly at an extreme, and pile up there."""
    for limit in (seen.most, seen.least):
        at = values == limit
        count = int(at.sum())
        if count < 4:
            continue
        longest = _longest(at)
        steps = np.unique(values)
        resolution = float(np.diff(steps).min()) if steps.size > 1 else 0.0
        sign = 1.0 if limit == seen.most else -1.0
        # On a coarse grid tops are flat anyway, but not fuller than the next levels together.
        span = max(3.0 * resolution, 0.01 * (seen.most - seen.least))
        near = int(((sign * (limit - values) > 0.0) & (sign * (limit - values) <= span)).sum())
        silent = abs(limit) <= 0.02 * max(abs(seen.most), abs(seen.least))
        if longest >= 3 and count > 2.0 * near and not silent:
            return limit, count
    return None


def _longest(mask: FloatArray) -> int:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    return int((edges[1::2] - edges[::2]).max()) if edges.size else 0
