"""What a bare log of an accelerometer shows: level, spectrum, blows, how the structure rings.

Nothing of the robot is known here. The blows are those that `picchio count` would find, the
frequencies are the poles of the silence after them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from picchio.campaign.importing.importer import Detection, detection
from picchio.campaign.importing.named import Accelerometer, accelerometers
from picchio.core import spoken
from picchio.core.arrays import FloatArray, IndexArray
from picchio.core.errors import InputError
from picchio.core.processes import one_thread
from picchio.core.results import TableResult
from picchio.core.units import conversion
from picchio.ledger.blows import runs
from picchio.ledger.finding import SHARE
from picchio.ledger.jolts import averaged, jolts
from picchio.ledger.samples import STEPS
from picchio.ledger.store import Kept, Stream
from picchio.ledger.watch.ringing import TOLD, decaying, silences
from picchio.measurement.noise.ringdown import fit_ring_down
from picchio.studies.tasks import ASSUMED_BLOWS

_SAMPLES = 1000  # of a ring-down: modes up to 150 Hz, where it lasts 2 s
_MOST = 8  # ring-downs that are looked at, evenly over the log: 0.3 s each
_WINDOW = 4.0  # s, of a spectrum: lines are told to 0.25 Hz
_LINES = 5  # of a spectrum that are named
_ROUNDS = 3  # in which the time between blows is found
G = conversion("g", ("m/s^2",))[1].scale
"""m/s^2."""


@dataclass(frozen=True)
class Ringing:
    """A frequency at which the structure rings.

    Attributes:
        frequency: Hz, undamped, the median over ring-downs.
        low, high: Hz, the least and the largest of them.
        damping_ratio: 1, the median.
        seen: in how many ring-downs.
    """

    frequency: float
    low: float
    high: float
    damping_ratio: float
    seen: int


@dataclass(frozen=True, eq=False)
class Vibration:
    """What an accelerometer reads.

    Attributes:
        sensor: its series and unit.
        time: (m,) s.
        values: (m, k) less their median; m/s^2, or the file's unit where none is told.
        rest: (k,) the median, likewise.
        threshold: what a blow exceeds, likewise.
        onsets: (b,) s, of the blows, ascending.
        peaks: (b,) the largest reading of each, likewise.
        period: s from one blow of a burst to the next; None with fewer than two.
        driven: whether it moves all the time without blows that stand out.
        rung: ring-downs that were looked at.
        ringing: by frequency: what most of them share.
        frequency, density: of the spectrum, Hz and (m/s^2)^2/Hz, all axes together.
        lines: Hz, its strongest lines.
    """

    sensor: Accelerometer
    time: FloatArray
    values: FloatArray
    rest: FloatArray
    threshold: float
    onsets: FloatArray
    peaks: FloatArray
    period: float | None
    driven: bool
    rung: int
    ringing: tuple[Ringing, ...]
    frequency: FloatArray
    density: FloatArray
    lines: tuple[float, ...]

    @property
    def unit(self) -> str:
        """Of what is told to people."""
        return "g" if self.sensor.convert else "of the file's unit"

    @property
    def scale(self) -> float:
        """From that to what `values` are in."""
        return G if self.sensor.convert else 1.0

    @property
    def bursts(self) -> int:
        """Groups of blows that follow one another at the period."""
        if self.period is None:
            return len(self.onsets)
        return 1 + int((np.diff(self.onsets) > 2.0 * self.period).sum())

    def level(self) -> list[dict[str, Any]]:
        """A row an axis: what it reads at rest, the rms and the peak of the rest."""
        rms, peak = np.sqrt((self.values**2).mean(axis=0)), np.abs(self.values).max(axis=0)
        table = zip(self.sensor.series.items(), self.rest, rms, peak, strict=True)
        return [
            {"axis": axis, "series": name, "rest": float(a), "rms": float(b), "peak": float(c)}
            for (axis, name), a, b, c in table
        ]

    def sentences(self) -> list[str]:
        """What matters, a sentence each."""
        sensor, scale = self.sensor, self.scale
        level = self.level()
        rms = math.sqrt(sum(row["rms"] ** 2 for row in level)) / scale
        worst = max(level, key=lambda row: row["peak"])
        rest = ", ".join(f"{round(row['rest'] / scale, 2) + 0.0:.2f}" for row in level)
        told = [
            f"Accelerometer: {', '.join(sensor.series.values())}; {sensor.why}.",
            f"Level: {spoken.number(rms)} {self.unit} rms, all axes together; largest reading "
            f"{spoken.number(worst['peak'] / scale)} in {worst['series']}; at rest {rest}.",
            self._of_blows(),
        ]
        if self.lines:
            lines = ", ".join(f"{spoken.number(hz)}" for hz in self.lines)
            told.append(f"Spectrum: strongest at {lines} Hz{self._harmonic()}.")
        of = f"{self.rung} ring-down{'s' * (self.rung > 1)}"
        rings = [
            f"{spoken.between([r.low, r.high])} Hz (damping ratio "
            f"{spoken.per_cent(r.damping_ratio)} %)" for r in self.ringing
        ]  # fmt: skip
        if not self.rung:
            told.append("Ring-down: no silence of 0.4 s after a blow, so no frequencies are told.")
        elif rings:
            told.append(f"Rings after the blows ({of}) at {', '.join(rings)}.")
        else:
            told.append(f"Rings after the blows ({of}) at no frequency that most of them share.")
        return told

    def _of_blows(self) -> str:
        if self.driven:
            return "Blows: none stand out; it moves evenly, as at rest or with a tool that turns."
        if not self.onsets.size:
            return "Blows: none."
        peaks = np.quantile(self.peaks, [0.1, 0.5, 0.9]) / self.scale
        count = len(self.onsets)
        rate = f", {1.0 / self.period:.3g} a second" if self.period else ""
        each = f" in {self.bursts} bursts" if 1 < self.bursts < count else ""
        return (
            f"Blows: {count}{each}{rate}, the first after {self.onsets[0]:.4g} s; median reading "
            f"{spoken.number(peaks[1])} {self.unit}, 80 % of them "
            f"{spoken.between(peaks[[0, 2]].tolist())}."
        )

    def _harmonic(self) -> str:
        """Whether the blows themselves make the strongest line."""
        if self.period is None or not self.lines:
            return ""
        order = self.lines[0] * self.period
        if abs(order - round(order)) > 2.0 * self.period / _WINDOW:
            return ""
        times = f"{round(order)} times " if order > 1.5 else ""
        return f" (the first is {times}the rate of the blows)"

    def to_dict(self) -> dict[str, Any]:
        """For JSON: SI where the unit is known."""
        peaks = np.quantile(self.peaks, [0.1, 0.5, 0.9]).tolist() if self.peaks.size else [None] * 3
        return {
            "series": self.sensor.series, "unit": self.sensor.unit or None, "why": self.sensor.why,
            "level": self.level(),
            "blows": {"count": len(self.onsets), "bursts": self.bursts,
                      "rate": None if self.period is None else 1.0 / self.period,
                      "peak": dict(zip(("p10", "p50", "p90"), peaks, strict=True)),
                      "threshold": self.threshold, "times": self.onsets, "driven": self.driven},
            "ring_downs": self.rung, "ringing": self.ringing, "lines": self.lines,
        }  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class FirstLook(TableResult):
    """What a file seems to be, and what its accelerometer shows.

    Attributes:
        detection: layout, clock, series.
        vibration: None where no series is an accelerometer's.
        others: further accelerometers, which were not looked at.
    """

    PAGE: ClassVar[str] = "visuals.report.first_look:first_look_page"
    LACKS: ClassVar = {"plot": "`picchio.report` draws it", "show": "no robot is named yet"}
    INDEX = ""

    detection: Detection
    vibration: Vibration | None
    others: tuple[Accelerometer, ...] = ()

    @property
    def told(self) -> tuple[str, ...]:
        """A sentence a line: what the accelerometer shows, what the file is."""
        seen = self.vibration.sentences() if self.vibration else []
        left = [", ".join(one.series.values()) for one in self.others]
        if left:
            seen.append(f"Not looked at: {'; '.join(left)} ({self.others[0].why}).")
        return (*seen, *self.detection.told)

    def _headline(self) -> str:
        seen = self.vibration
        if seen is None:
            return self.detection._headline()
        rings = ", ".join(f"{spoken.number(r.frequency)} Hz" for r in seen.ringing)
        count = len(seen.onsets)
        blows = "no blows" if not count else f"{count} blow{'s' * (count > 1)}"
        found = f"{blows}{', ringing at ' * bool(rings)}{rings}"
        return f"{found}: {self.detection.raw.path.name}"

    def _content(self) -> dict[str, Any]:
        return {**self.detection._content(), "vibration": self.vibration}

    def _rows(self) -> list[dict[str, Any]]:
        return [vars(ring) for ring in (self.vibration.ringing if self.vibration else ())]

    def _repr_html_(self) -> str:
        from picchio.core.html import sheet

        found = self.vibration.ringing if self.vibration else ()
        heads = ("Frequency [Hz]", "least", "largest", "damping ratio [%]", "ring-downs")
        rows = [(r.frequency, r.low, r.high, 100.0 * r.damping_ratio, r.seen) for r in found]
        return sheet(type(self).__name__, None, heads if rows else (), rows, head=self._headline())


def first_look(path: str | Path) -> FirstLook:
    """What a measured file shows before any robot is named.

    Its layout, series, clock and gaps; of an accelerometer the level, the spectrum, the blows, and
    the frequencies and damping ratios of the ring-downs after them.

    Args:
        path: a file that `picchio import` reads.

    Raises:
        InputError: the file can't be read.
    """
    found = detection(path)
    sensors = accelerometers(found.raw)
    seen = None
    for first in sensors[:1]:
        channels = [found.raw.channel(name) for name in first.series.values()]
        time = channels[0].time
        whole = all(channel.values.size == channels[0].values.size for channel in channels)
        if time is not None and time.size > 1 and whole:
            values = np.column_stack([channel.values for channel in channels])
            good = np.isfinite(values).all(axis=1)
            values = first.convert(values) if first.convert else values
            seen = vibration(first, time[good], values[good])
    return FirstLook(found, seen, tuple(sensors[1:]))


@one_thread()
def vibration(sensor: Accelerometer, time: FloatArray, values: FloatArray) -> Vibration:
    """What an accelerometer reads.

    Args:
        sensor: which.
        time: (m,) s, ascending.
        values: (m, k) m/s^2, gravity included.

    Raises:
        InputError: fewer than two samples.
    """
    if time.size < 2:
        raise InputError("holds fewer than two samples", key=", ".join(sensor.series.values()))
    from scipy.signal import find_peaks, welch

    rest = np.median(values, axis=0)
    values = values - rest
    stamps = np.rint((time - time[0]) * 1e9).astype(np.int64)
    step = float(np.median(np.diff(stamps))) * 1e-9
    threshold = SHARE * float(np.linalg.norm(values, axis=1).max())
    onsets, peaks, period, driven = _blows(stamps, values, threshold)
    width = ASSUMED_BLOWS.width or 0.0
    struck = stamps[0] + np.rint(1e9 * (onsets + width)).astype(np.int64)
    stretches = list(silences(struck, int(stamps[-1])))
    stretches = stretches[:: -(-len(stretches) // _MOST) or 1]
    rung = [_poles(stamps, values, begin, end, step) for begin, end in stretches]
    frequency, density = welch(
        values, 1.0 / step, nperseg=min(len(values), round(_WINDOW / step)), axis=0
    )
    density = density.sum(axis=1)
    size = np.log10(np.maximum(density, 1e-12 * density.max() + 1e-300))
    tops = find_peaks(size, prominence=1.0)[0]
    tops = tops[np.argsort(-size[tops])][:_LINES]
    return Vibration(
        sensor, time, values, rest, threshold, time[0] + onsets, peaks, period, driven, len(rung),
        _together(rung), frequency, density, tuple(frequency[tops].tolist()),
    )  # fmt: skip


def _blows(
    stamps: IndexArray, values: FloatArray, threshold: float
) -> tuple[FloatArray, FloatArray, float | None, bool]:
    """S of the blows, how large each reads, the time from one to the next, whether none stands out.

    As `picchio count` finds them; the time between them, which a task would tell, is found anew
    from what was found with that of the blows that are assumed where nobody says.
    """
    usual = float(np.median(np.diff(stamps)))
    expected, width = ASSUMED_BLOWS.period or 0.0, ASSUMED_BLOWS.width or 0.0
    found: list[tuple[float, float]] = []
    period, driven = None, False
    for _ in range(_ROUNDS):
        hold = {"hold": round(2e9 * expected)}
        stream = Stream("acceleration", int(STEPS * usual), values.shape[1], threshold, 0.0, hold)
        found, driven = [], False
        for run in runs(Kept(stream, stamps, values, stamps[:1], np.zeros((1, 0)))):
            blows = jolts((run.stamps - run.stamps[0]) * 1e-9, run.values, threshold, width,
                          expected)  # fmt: skip
            driven |= blows is None
            found += [(run.onset * 1e-9 + begin, float(np.linalg.norm(peak)))
                      for begin, peak, _ in blows or ()]  # fmt: skip
        steps = np.diff([at for at, _ in found])
        near = steps[steps < 10.0 * expected]
        period = float(np.median(near)) if near.size else None
        if period is None or abs(period / expected - 1.0) < 0.1:
            break
        expected = period
    table = np.array(found).reshape(-1, 2)
    return table[:, 0], table[:, 1], period, driven and not found


def _poles(
    stamps: IndexArray, values: FloatArray, begin: int, end: int, step: float
) -> list[tuple[float, float]]:
    """Frequencies, Hz, and damping ratios of one ring-down, those that are told."""
    own = (stamps >= begin) & (stamps < end)
    time = (stamps[own] - begin) * 1e-9
    step = max(step, float(time[-1]) / _SAMPLES)
    series = averaged(time, values[own], step).T
    fitted = fit_ring_down(series, 1.0 / step)
    poles = fitted.poles if fitted is not None else np.zeros(0)
    poles = poles[poles.real < 0.0]
    if not poles.size:
        return []
    size = np.abs(poles)
    made = decaying(step * np.arange(series.shape[1]), series, size / (2.0 * math.pi),
                    -poles.real / size)  # fmt: skip
    if made is None:
        return []
    return [(float(f), float(z)) for f, e, z in zip(*made, strict=True) if e < TOLD]


def _together(rung: Sequence[list[tuple[float, float]]]) -> tuple[Ringing, ...]:
    """What most of the ring-downs share: frequencies whose peaks, 2 zeta wide, overlap."""
    every = sorted((f, z, k) for k, found in enumerate(rung) for f, z in found)
    groups: list[list[tuple[float, float, int]]] = []
    for f, z, k in every:
        before = groups[-1][-1] if groups else (-math.inf, 0.0, 0)
        if f * (1.0 - z) < before[0] * (1.0 + before[1]):
            groups[-1].append((f, z, k))
        else:
            groups.append([(f, z, k)])
    told = []
    for group in groups:
        seen = len({k for _, _, k in group})
        if 2 * seen > len(rung):
            f, z = np.array([(f, z) for f, z, _ in group]).T
            mid, low, high, ratio = map(float, (np.median(f), f.min(), f.max(), np.median(z)))
            told.append(Ringing(mid, low, high, ratio, seen))
    return tuple(told)
