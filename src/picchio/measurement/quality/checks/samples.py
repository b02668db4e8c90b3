"""Samples that are no readings: sensors that are dead, fall silent or clip, samples far off."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from picchio.core.arrays import FloatArray, IndexArray
from picchio.excitation.table import excitation_class
from picchio.measurement.noise.window import Window
from picchio.measurement.quality.check import Check, Finding
from picchio.measurement.quality.scan import ChannelScan, RecordScan, Run

_FEWEST = 5
_SIGMAS = 20.0
_ALONE = 2.5
# Of a motion's range: less is the encoder's own error.
_SMALL = 1e-4
# Of a flat top under noise: samples that are kept; widths below the largest value, and above zero,
# that may count.
_KEPT = 4000
_DEPTH, _CLEAR = 5.4, 7.8


class DropoutsCheck(Check):
    """Dead channels, and runs of equal samples longer than noise and resolution allow."""

    name = "dropouts"

    def record(self, scan: RecordScan) -> Iterator[Finding]:
        """Every channel of one record."""
        motion = scan.record.kind == "motion"
        for name, seen in scan.channels.items():
            kind = scan.window.channels[name].kind
            if seen.constant:
                if motion and (kind.smooth or kind.condition):
                    continue  # a machine at rest
                yield self.found("dead", scan.file, name, seen.least)
                continue
            if motion and (kind.motion == "reference" or kind.condition):
                continue
            bad = [run for run in seen.runs if self._is_dropout(scan, name, seen, run)]
            if bad:
                longest = bad[0]
                held = "is exactly 0" if longest.value == 0.0 else f"stays at {longest.value:.6g}"
                more = f", and at {len(bad) - 1} more places" if len(bad) > 1 else ""
                place = scan.place(longest.start)
                yield self.found("silent", scan.file, name, longest.length, held=held,
                                 place=place, more=more)  # fmt: skip

    def _is_dropout(self, scan: RecordScan, name: str, seen: ChannelScan, run: Run) -> bool:
        kind = scan.window.channels[name].kind
        if run.length < _FEWEST or run.value in (seen.least, seen.most):
            return False  # flat tops are clipping's business
        share = (seen.equal - (run.length - 1)) / max(seen.samples - run.length, 1)
        if share > 0.0:
            expected = np.log(seen.samples) / -np.log(min(share, 0.999))
            if run.length < 2.0 * expected + 4.0:
                return False
        if scan.record.kind == "motion":
            # A joint comes to rest smoothly; a lost signal jumps.
            return run.jump > 8.0 * seen.step and kind.derivative != 1
        noise = self.context.noise.get(name)
        if noise is None or noise.std == 0.0:
            # Without noise a channel stands still before the blow, and a force between blows.
            return kind.smooth and run.start > 0 and scan.when(run.start) > 0.0
        return True


class SpikesCheck(Check):
    """Isolated samples that no motion reaches and leaves again."""

    name = "spikes"

    def record(self, scan: RecordScan) -> Iterator[Finding]:
        """Smooth channels everywhere; those that jump with the blows only while none falls."""
        window = scan.window
        motion = window.record.kind == "motion"
        for name, values in window.arrays.items():
            kind = window.channels[name].kind
            if values.size < 64 or kind.condition:
                continue
            if motion and kind.motion not in ("link", "motor"):
                continue  # drives switch, velocities are differences: spikes are their nature
            whole = slice(0, values.size)
            for part in [whole] if kind.smooth else [window.quiet(), window.after()]:
                least = _SMALL * float(np.ptp(values)) if motion else 0.0
                spikes = _spikes(values[part], max(self.context.std(name), least / 8.0))
                if 0 < spikes.size <= max(3, values.size // 200):
                    at = part.start + int(spikes[0])
                    height = abs(values[at] - 0.5 * (values[at - 1] + values[at + 1]))
                    more = f", and {spikes.size - 1} more" if spikes.size > 1 else ""
                    yield self.found("alone", scan.file, name, height, place=scan.place(at),
                                     more=more, of=window.channels[name].unit)  # fmt: skip


def _spikes(values: FloatArray, std: float) -> FloatArray:
    """Indices of samples far from both neighbours, which agree with each other."""
    if values.size < 64:
        return np.zeros(0, dtype=np.intp)
    off = values[1:-1] - 0.5 * (values[:-2] + values[2:])
    spread = 1.4826 * float(np.median(np.abs(off)))
    if spread == 0.0:
        spread = float(np.mean(np.abs(off)))
    limit = max(_SIGMAS * spread, 8.0 * std)
    size, across = np.abs(off), np.abs(values[2:] - values[:-2])
    found = np.flatnonzero((size > limit) & (across < 0.25 * size))
    # They stand alone: a mode that rings near half the sample rate looks like many of them.
    rest = size.copy()
    for shift in (-1, 0, 1):
        rest[np.clip(found + shift, 0, rest.size - 1)] = 0.0
    return found[size[found] > _ALONE * rest.max()] + 1


class ClippingCheck(Check):
    """Values that pile up at the largest one, as only a limit makes them."""

    name = "clipping"

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
                yield self.found("exact", scan.file, name, limit, of=channel.unit, samples=samples)
            elif not motion:
                keep = self._near_top(scan.window, name)
                if keep.size:
                    self.kept[channel.group].append((scan.file, name, keep, values[keep]))

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
        for group, tops in self.kept.items():
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
            records = len(set(files))
            yield self.found("piled", files[0] if records == 1 else None, group, limit, at=at,
                             records=records, below=below)  # fmt: skip


def _exact(values: FloatArray, seen: ChannelScan) -> tuple[float, int] | None:
    """(limit, samples) where samples in a row lie exactly at an extreme, and pile up there."""
    for limit in (seen.most, seen.least):
        at = values == limit
        count = int(at.sum())
        if count < 4:
            continue
        edges = np.flatnonzero(np.diff(at, prepend=False, append=False))
        longest = int((edges[1::2] - edges[::2]).max())
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
