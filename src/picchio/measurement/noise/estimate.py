"""The noise of every channel of a campaign: level, spectrum, hum, and a filter that whitens it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from picchio.campaign.campaign import Campaign
from picchio.core.arrays import FloatArray
from picchio.core.processes import one_thread
from picchio.measurement.noise.autoregression import (
    AutoRegression,
    fit_autoregression,
    relative_error,
)
from picchio.measurement.noise.hum import Line, take_out_hum
from picchio.measurement.noise.level import Noise, NoiseSource
from picchio.measurement.noise.pieces import (
    METHODS,
    Piece,
    fast_pieces,
    quiet_pieces,
    repeat_pieces,
    ring_down_pieces,
    steady_period,
    steady_pieces,
)
from picchio.measurement.noise.repeats import Repeats
from picchio.measurement.noise.window import Window, read_window

# Enough for 0.6 %: more is not kept.
_ENOUGH = 1 << 14
# With fewer samples than this from surer sources, the ring-down is used too.
_TOO_FEW = 1500
# A source may exceed a surer one by this factor and still be used.
_SLACK = 1.08


class NoiseCollector:
    """Takes windows one by one, keeps the stretches of noise, and makes one estimate per channel.

    Args:
        campaign: whose records will come, in its order.
    """

    def __init__(self, campaign: Campaign) -> None:
        self.units: dict[str, str] = {}
        self.periods: dict[str, tuple[float, float]] = {}
        self._pieces: dict[tuple[str, float], dict[str, list[Piece]]] = defaultdict(
            lambda: defaultdict(list)
        )
        self._rates: list[float] = []
        self._resolution: dict[str, float] = {}
        self._repeats = Repeats(campaign)

    def add(self, window: Window) -> None:
        """Take the next record's window."""
        rate = self._rate(window.rate)
        for name, values in window.arrays.items():
            self.units[name] = window.channels[name].unit
            self._note_resolution(name, values)
        self._put(rate, quiet_pieces(window))
        found = steady_period(window)
        if found is not None:
            self.periods[window.record.file] = found
            self._put(rate, steady_pieces(window, found[1]))
        before = self._repeats.before(window)
        if before is not None:
            self._put(rate, repeat_pieces(before, window))
        if window.record.kind == "motion":
            self._put(rate, fast_pieces(window))
        elif not window.steady and self._poor(window, rate):
            self._put(rate, ring_down_pieces(window))

    def _rate(self, rate: float) -> float:
        """The first rate that was as good as the same."""
        self._rates.append(rate)
        return next(known for known in self._rates if abs(known / rate - 1.0) < 1e-3)

    def _note_resolution(self, name: str, values: FloatArray) -> None:
        steps = np.abs(np.diff(values))
        steps = steps[steps > 0.0]
        if not steps.size:
            return
        least = float(steps.min())
        # A grid: every step is a whole number of the smallest.
        multiples = steps / least
        on_grid = np.abs(multiples - np.round(multiples)) < 1e-3 * np.maximum(multiples, 1.0)
        if not on_grid.all() or steps.size < 32 or float(multiples.max()) > 1e6:
            least = 0.0
        self._resolution[name] = min(self._resolution.get(name, np.inf), least)

    def _put(self, rate: float, pieces: Iterable[tuple[str, Piece]]) -> None:
        for name, piece in pieces:
            kept = self._pieces[name, rate][piece.method]
            if sum(p.samples for p in kept) < _ENOUGH:
                m = min(piece.values.size, _ENOUGH)
                share = m / piece.values.size
                time, values = piece.time[:m].copy(), piece.values[:m].copy()
                kept.append(replace(piece, time=time, values=values, samples=piece.samples * share))

    def _poor(self, window: Window, rate: float) -> bool:
        """Whether some channel of this record still has too little noise for an estimate."""
        return any(
            sum(p.samples for pieces in self._pieces[name, rate].values() for p in pieces)
            < _TOO_FEW
            for name in window.arrays
        )

    def finish(self) -> dict[str, Noise]:
        """The estimates."""
        found: dict[str, list[Noise]] = defaultdict(list)
        for (name, rate), by_method in self._pieces.items():
            noise = self._estimate(name, rate, by_method)
            if noise is not None:
                found[name].append(noise)
        ranked = {name: sorted(found[name], key=lambda n: n.error) for name in self.units}
        return {
            name: replace(best[0], others={n.rate: n for n in best[1:]})
            for name, best in ranked.items()
            if best
        }

    def _estimate(self, name: str, rate: float, by_method: dict[str, list[Piece]]) -> Noise | None:
        sources: list[NoiseSource] = []
        chosen: list[Piece] = []
        lines: tuple[Line, ...] = ()
        resolution = self._resolution.get(name, 0.0)
        for method in METHODS:
            if not by_method.get(method):
                continue
            # In repeats the blows' own harmonics differ, and may lie at the mains' frequency.
            seek = method != "fast changes" and (method != "repeats" or not chosen)
            pieces = by_method[method]
            if seek:
                pieces, hum = take_out_hum(pieces, rate)
                lines = lines or hum
            self._weigh(method, pieces, _model(pieces), sources, chosen)
        if not chosen:
            return None
        used = [source for source in sources if source.used]
        rough = all(source.method == "fast changes" for source in used)
        model = _model(chosen)
        floor = resolution / np.sqrt(12.0)
        if model.variance < floor**2:
            model = AutoRegression(np.zeros(0), floor**2)
        error = relative_error(model, sum(p.samples for p in chosen))
        return Noise(name, self.units[name], rate, float(np.sqrt(model.variance)), error, model,
                     lines, resolution, tuple(sources), rough)  # fmt: skip

    @staticmethod
    def _weigh(method: str, pieces: list[Piece], model: AutoRegression,
               sources: list[NoiseSource], chosen: list[Piece]) -> None:  # fmt: skip
        """Use a source unless it is clearly noisier, or quieter, than a surer one."""
        std = float(np.sqrt(model.variance))
        error = relative_error(model, sum(p.samples for p in pieces))
        surer = [s for s in sources if s.used]
        used = True
        if surer:
            known = min(surer, key=lambda s: s.error)
            # A short stretch of slow noise looks whiter than it is, and its error smaller.
            least = relative_error(model, sum(p.samples for p in chosen))
            doubt = 4.0 * np.hypot(max(known.error, least), error)
            less, more = std < known.std / (_SLACK + doubt), std > known.std * (_SLACK + doubt)
            if method == "fast changes":
                used = False
            elif more or known.std == 0.0:
                used = known.std == 0.0 and std == 0.0
            elif less:
                # The surer one is not as quiet as it should be: something moved there.
                sources[:] = [replace(s, used=False) for s in sources]
                chosen.clear()
        sources.append(NoiseSource(method, std, error, len({p.record for p in pieces}), used))
        if used:
            chosen.extend(pieces)


def _model(pieces: list[Piece]) -> AutoRegression:
    """The autoregression of pieces, with the variance that their means took given back."""
    return fit_autoregression(
        [p.values for p in pieces], mean_removed=[p.mean_removed for p in pieces]
    )


@one_thread()
def noise_levels(campaign: Campaign) -> dict[str, Noise]:
    """The noise of every channel, estimated from the records themselves.

    Sources: the quiet time before the first blow and after the robot has rung down, what is not
    periodic in steady records, the difference of repeats and, where these give too little, what
    fitted damped sines leave of the ring-down. Motion records have repeats at best, otherwise only
    a rough floor. Only the first part of a long record is read.

    Args:
        campaign: read record by record.

    Returns:
        {channel: noise}; a channel with nothing to estimate it from is missing.

    Raises:
        InputError: a sample that cannot be read.
    """
    collector = NoiseCollector(campaign)
    for record in campaign:
        collector.add(read_window(record))
    return collector.finish()
