"""Do the blows have the programmed timing, number and force?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.excitation.excitation import Excitation
from picchio.measurement.noise.window import Window
from picchio.measurement.quality.check import Check, Finding
from picchio.measurement.quality.scan import RecordScan

_SIGMAS = 7.0
_FACTORS = {1e3: "N or kN?", 1e-3: "N or kN?", 4.448: "N or lbf?", 1 / 4.448: "N or lbf?",
            9.81: "N or kgf?", 1 / 9.81: "N or kgf?"}  # fmt: skip


class BlowsCheck(Check):
    """The measured force against the programmed one; t = 0 against the first movement."""

    name = "blows"
    what = "t = 0 at the first blow; measured blows as programmed"
    of = "percussion"

    def record(self, scan: RecordScan) -> Iterator[Finding]:
        """One percussion record."""
        window = scan.window
        for name, channel in window.channels.items():
            if channel.kind.of_force and window.blows is not None:
                yield from self._force(scan, name, window.blows)
        yield from self._onset(scan)
        if scan.file in self.context.periods:
            programmed, found = self.context.periods[scan.file]
            if abs(found / programmed - 1.0) > 2e-3:
                yield self.found(
                    "warning",
                    f"repeats every {1e3 * found:.4g} ms, not every {1e3 * programmed:.4g} ms as "
                    "programmed",
                    "correct the period, or the clock", record=scan.file,
                    value=found, unit="s",
                )  # fmt: skip

    def _force(self, scan: RecordScan, channel: str, blows: Excitation) -> Iterator[Finding]:
        window = scan.window
        force = window.arrays[channel] - blows.preload
        programmed = blows.peak_force
        if not force.any() or programmed <= 0.0:
            return
        name = {"record": scan.file, "channel": channel}
        if -force.min() > 2.0 * force.max():
            yield self.found("warning", "the blows are negative: the force is flipped",
                             "it must be the tool's force on the robot along `direction`",
                             value=float(force.min()), unit="N", **name)  # fmt: skip
            force = -force
        peak = float(np.median(force[force > 0.6 * force.max()]))
        if not blows.flat:
            peak = float(force.max())
        ratio = peak / programmed
        if not 1.0 / 3.0 < ratio < 3.0:
            close = [w for f, w in _FACTORS.items() if abs(np.log(ratio / f)) < 0.25]
            yield self.found("warning", f"the blows are {peak:.4g} N high, programmed are "
                             f"{programmed:.4g} N", close[0] if close else "which one is right?",
                             value=ratio, **name)  # fmt: skip
        elif abs(ratio - 1.0) > max(0.03, 2.5 * self.context.campaign.tolerance.force):
            yield self.found("warning", f"the blows are {peak:.4g} N high, programmed are "
                             f"{programmed:.4g} N: {100 * (ratio - 1):+.0f} %",
                             "state the measured force, or check the cell's calibration",
                             value=ratio, **name)  # fmt: skip
        yield from self._timing(window, blows, force, peak, name)

    def _timing(self, window: Window, blows: Excitation, force: FloatArray, peak: float,
                name: dict[str, str]) -> Iterator[Finding]:  # fmt: skip
        hits = window.record.hits
        above = force > 0.5 * peak
        rising = np.flatnonzero(above[1:] & ~above[:-1]) + 1
        # Noise at the threshold is not another blow.
        times = window.time[rising]
        width = blows.width or 0.1 * blows.period
        times = times[np.insert(np.diff(times) > max(0.25 * blows.period, 0.5 * width), 0, True)]
        if not times.size:
            return
        slack = max(1.6 * window.step, 0.25 * width)
        if hits is not None and abs(times[0]) > slack:
            text = f"the first blow begins at {1e3 * times[0]:.3g} ms, not at t = 0"
            yield self.found("warning", text, "shift the time", value=float(times[0]),
                             unit="s", **name)  # fmt: skip
        if hits is not None and window.complete and times.size != hits:
            yield self.found("warning", f"{times.size} blows are seen, {hits} are programmed",
                             "correct `hits`, or note the misses", value=float(times.size),
                             unit="blows", **name)  # fmt: skip
        if times.size >= 3 and (hits is None or times.size == hits):
            period = (times[-1] - times[0]) / (times.size - 1)
            slip = 2.0 * window.step / (times[-1] - times[0])
            if abs(period / blows.period - 1.0) > 2e-3 + slip:
                yield self.found("warning", f"a blow comes every {1e3 * period:.4g} ms, programmed "
                                 f"are {1e3 * blows.period:.4g} ms",
                                 "correct the period, or the clock", value=float(period),
                                 unit="s", **name)  # fmt: skip

    def _onset(self, scan: RecordScan) -> Iterator[Finding]:
        window = scan.window
        quiet = window.quiet()
        if quiet.stop < 20:
            return
        onsets = {}
        for name, values in window.arrays.items():
            std = self.context.std(name)
            if window.channels[name].kind.of_force or std == 0.0:
                continue
            x = values - np.median(values[: max(10, quiet.stop // 2)])
            moved = np.abs(x) > _SIGMAS * std + 1.5 * self.context.hum(name)
            steady = moved[:-2] & moved[1:-1] & moved[2:]
            if steady.any():
                onsets[name] = float(window.time[int(steady.argmax())])
        if not onsets:
            return
        name = min(onsets, key=lambda key: onsets[key])
        first = onsets[name]
        blows = window.blows
        late = 2.0 * ((blows.width if blows is not None else None) or 0.0) + 5e-3
        if first < -2.0 * window.step:
            yield self.found("warning", f"moves {-1e3 * first:.3g} ms before the first blow",
                             "t = 0 must be the first blow's first edge: shift the time",
                             record=scan.file, channel=name, value=first, unit="s")  # fmt: skip
        elif first > max(late, 8.0 * window.step):
            yield self.found("warning", f"nothing moves until {1e3 * first:.3g} ms after the first "
                             "blow", "t = 0 must be the first blow's first edge: shift the time",
                             record=scan.file, channel=name, value=first, unit="s")  # fmt: skip
