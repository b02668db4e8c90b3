"""A force history in pieces: constants, ramps and sines, one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from picchio.core.arrays import ComplexArray, FloatArray, IndexArray
from picchio.core.errors import InputError

# The exponential's phi functions, from which every closed-form response is built.

_SERIES_TERMS = 18
_SERIES_RADIUS = 0.7


def phi1(z: ArrayLike) -> ComplexArray:
    """(exp(z) - 1) / z, equal to 1 at z = 0, without cancellation.

    Args:
        z: complex, any shape.

    Source: Hochbruck and Ostermann, Acta Numerica 19 (2010) 209, eq. 2.10.
    """
    z = np.asarray(z, dtype=np.complex128)
    small = np.abs(z) < 1e-8
    safe = np.where(small, 1.0, z)
    return np.where(small, 1.0 + 0.5 * z, np.expm1(safe) / safe)


def phi2(z: ArrayLike) -> ComplexArray:
    """(exp(z) - 1 - z) / z^2, equal to 1/2 at z = 0, without cancellation."""
    z = np.asarray(z, dtype=np.complex128)
    small = np.abs(z) < _SERIES_RADIUS
    near = np.where(small, z, 0.0)
    series = np.zeros_like(near)
    # Horner on sum z^k / (k + 2)!: 1/2 (1 + z/3 (1 + z/4 (1 + ...)))
    for k in range(_SERIES_TERMS, 2, -1):
        series = (1.0 + series) * near / k
    series = 0.5 * (1.0 + series)
    safe = np.where(small, 1.0, z)
    return np.where(small, series, (phi1(safe) - 1.0) / safe)


# A rivet takes a dozen; more hits than this are a slip, and would fill the memory.
MOST_HITS = 10_000
MOST_PIECES = 2_000_000

# So many steps at most a ramp lasts that stairs are put in its place, and where they stand.
_SHORT_RAMP = 10
_GAUSS = 0.5 / np.sqrt(3.0)

Hits = Annotated[int, Field(gt=0, le=MOST_HITS, strict=True)]
"""Blows of a burst, in a file."""


def check_hits(count: int, key: str = "hits") -> None:
    """Refuse a burst of no blow, or of more than anybody means.

    Args:
        count: blows of the burst.
        key: what gives them, for the message.

    Raises:
        InputError: below 1, or above `MOST_HITS`.
    """
    if count < 1:
        raise InputError("a burst needs at least one hit", key=key, value=count)
    if count > MOST_HITS:
        raise InputError(
            f"a burst has at most {MOST_HITS} hits, as each is computed; a rivet takes a dozen",
            key=key,
            value=count,
            hint="a longer train is a steady state: leave the hits out",
        )


@dataclass(frozen=True, eq=False)
class PiecewiseForce:
    """F(t) on [0, end), in m pieces that follow one another without a gap.

    On piece i, with u = t - start[i],

        F(t) = constant[i] + slope[i] u + Re(amplitude[i] exp(1j angular_frequency[i] u)).

    A pulse is a constant, a half-sine blow a sine, a measured history a chain of ramps.
    At a jump the force takes its value just after.

    Attributes:
        start: (m,) s, ascending, the first is 0.
        end: s, where the last piece ends; infinite after a burst.
        constant: (m,) N.
        slope: (m,) N/s.
        amplitude: (m,) complex, N.
        angular_frequency: (m,) rad/s.
    """

    start: FloatArray
    end: float
    constant: FloatArray
    slope: FloatArray
    amplitude: ComplexArray
    angular_frequency: FloatArray

    def __post_init__(self) -> None:
        arrays = []
        for name in _PER_PIECE:
            array = np.array(getattr(self, name), complex if name == "amplitude" else float)
            array.flags.writeable = False
            object.__setattr__(self, name, array)
            arrays.append(array)
        shape = self.start.shape
        if len(shape) != 1 or not shape[0] or any(array.shape != shape for array in arrays):
            raise InputError("the pieces of a force must be arrays of one common length")
        if not np.isfinite(np.concatenate(arrays)).all():
            raise InputError("a force history holds a value that is not finite")
        if self.start[0] != 0.0 or not (self.duration > 0.0).all():
            raise InputError("the pieces of a force must start at 0 and follow one another")

    @property
    def duration(self) -> FloatArray:
        """(m,) s, length of each piece; the last may be infinite."""
        return np.concatenate((self.start[1:], (self.end,))) - self.start

    def __call__(self, time: ArrayLike) -> FloatArray:
        """The force (N) at times within [0, end); zero outside.

        Args:
            time: any shape, s.
        """
        t = np.asarray(time, dtype=float)
        index = np.clip(np.searchsorted(self.start, t, side="right") - 1, 0, None)
        value = self.in_piece(index, t - self.start[index])
        return np.where((t >= 0.0) & (t < self.end), value, 0.0)

    @property
    def onsets(self) -> FloatArray:
        """(k,) s, where it begins to differ from zero."""
        acts = np.any([getattr(self, name) != 0.0 for name in _FORCES], axis=0)
        return np.asarray(self.start[acts & ~np.concatenate([[False], acts[:-1]])])

    def scaled(self, factor: float) -> PiecewiseForce:
        """So many times as large.

        Args:
            factor: of the force.
        """
        return replace(self, **{name: factor * getattr(self, name) for name in _FORCES})

    def over(self, height: float) -> PiecewiseForce:
        """Divided by a height: a force of that height becomes one of exactly 1.

        Args:
            height: N.

        Returns:
            the force without its unit.
        """
        return replace(self, **{name: getattr(self, name) / height for name in _FORCES})

    def stretched(self, factor: float) -> PiecewiseForce:
        """So many times as long, as high as before.

        Args:
            factor: of time.
        """
        if factor == 1.0:
            return self
        return replace(
            self,
            start=factor * self.start,
            end=factor * self.end,
            slope=self.slope / factor,
            angular_frequency=self.angular_frequency / factor,
        )

    def ramped(self, rise: float) -> PiecewiseForce:
        """A rectangle of height 1 that takes some time to rise, and as long to fall.

        Args:
            rise: s, above 0 and below its length; its impulse stays.
        """
        return PiecewiseForce(
            start=np.array([0.0, rise, self.end]), end=self.end + rise,
            constant=np.array([0.0, 1.0, 1.0]), slope=np.array([1.0, 0.0, -1.0]) / rise,
            amplitude=np.zeros(3), angular_frequency=np.zeros(3),
        )  # fmt: skip

    def delayed(self, by: float) -> PiecewiseForce:
        """The same later; nothing before.

        Args:
            by: s, above 0.

        Returns:
            it, one piece longer.
        """

        def first(values: FloatArray) -> FloatArray:
            return np.concatenate([[0.0], values])

        return replace(
            self,
            start=first(self.start + by),
            end=self.end + by,
            constant=first(self.constant),
            slope=first(self.slope),
            amplitude=first(self.amplitude),
            angular_frequency=first(self.angular_frequency),
        )

    def stepped(self, step: float) -> PiecewiseForce:
        """With stairs in place of every short ramp, which have the same area and moments.

        What takes jumps for what they are, between its samples, need then know of no ramps.

        Args:
            step: s between its samples; ramps of more than ten of them stay, and those that
                follow one another.

        Returns:
            the force, itself where it has no short ramp.
        """
        parts = np.ceil(self.duration / step)
        level = np.concatenate([[True], (self.slope == 0.0) & (self.amplitude == 0.0), [True]])
        ramp = (self.slope != 0.0) & (self.amplitude == 0.0) & (parts <= _SHORT_RAMP)
        ramp &= level[:-2] & level[2:]  # a chain of ramps is a measured history
        if not ramp.any():
            return self
        # Two stairs to each part, at its Gauss points: right up to the third moment.
        stairs = np.where(ramp, 2.0 * np.where(ramp, parts, 0.0), 0.0).astype(int)
        own = np.repeat(np.arange(self.start.size), 1 + stairs)
        place = np.arange(own.size) - (np.cumsum(1 + stairs) - 1 - stairs)[own]
        length = np.where(ramp, self.duration, 0.0)[own]
        at = np.floor(0.5 * (place - 1)) + np.where(place % 2, 0.5 - _GAUSS, 0.5 + _GAUSS)
        share = np.where(place > 0, 1.0 / np.maximum(stairs[own], 1), 0.0)
        pieces = {name: getattr(self, name)[own] for name in _PER_PIECE}
        pieces["start"] = pieces["start"] + np.where(place > 0, 2.0 * at * share, 0.0) * length
        pieces["constant"] = pieces["constant"] + place * share * pieces["slope"] * length
        pieces["slope"] = np.where(ramp[own], 0.0, pieces["slope"])
        return PiecewiseForce(end=self.end, **pieces)

    @cached_property
    def key(self) -> bytes:
        """What tells this history from another."""
        arrays = b"".join(getattr(self, name).tobytes() for name in _PER_PIECE)
        return arrays + float(self.end).hex().encode()

    def padded(self, end: float) -> PiecewiseForce:
        """Followed by silence until `end`, s.

        Args:
            end: s; nothing changes where the history ends later.

        Returns:
            the longer history.
        """
        if end <= self.end:
            return self
        pieces = {name: np.append(getattr(self, name), 0.0) for name in _PER_PIECE}
        pieces["start"][-1] = self.end
        return PiecewiseForce(end=end, **pieces)

    def in_piece(self, index: ArrayLike, u: ArrayLike) -> FloatArray:
        """The force (N) of piece `index` at `u` seconds after that piece's start.

        Args:
            index: of the piece.
            u: s, same shape as `index` or one that broadcasts.
        """
        i = np.asarray(index)
        u = np.asarray(u, dtype=float)
        line = self.constant[i] + self.slope[i] * u
        if not self.amplitude.any():
            return np.asarray(line)
        wave = self.amplitude[i] * np.exp(1j * self.angular_frequency[i] * u)
        return np.asarray(line + wave.real)

    def convolve(self, pole: ComplexArray, index: IndexArray, u: FloatArray) -> ComplexArray:
        """The integral of exp(pole (u - v)) F(v) dv over v from 0 to u, within a piece.

        It solves z' = pole z + F from z = 0: the exact answer of a first-order system.

        Args:
            pole: (p,) complex, 1/s.
            index: (k,) piece of each time.
            u: (k,) s since the start of its piece.

        Returns:
            (p, k) complex, N s.
        """
        lam = pole[:, None]
        index, u = np.asarray(index), np.asarray(u)
        constant = self.constant[index]
        acts = np.flatnonzero(constant)  # most pieces are silence, and phi1 is what costs
        total = np.zeros((pole.size, index.size), dtype=np.complex128)
        total[:, acts] = constant[acts] * (u[acts] * phi1(lam * u[acts]))
        slope = self.slope[index]
        if (ramps := np.flatnonzero(slope)).size:
            v = u[ramps]
            total[:, ramps] += slope[ramps] * (v * v * phi2(lam * v))
        amplitude = self.amplitude[index]
        if amplitude.any():
            for c, mu in (
                (amplitude, 1j * self.angular_frequency[index]),
                (amplitude.conj(), -1j * self.angular_frequency[index]),
            ):
                total = total + 0.5 * c * np.exp(mu * u) * u * phi1((lam - mu) * u)
        return total

    def fourier_coefficients(self, harmonics: int) -> ComplexArray:
        """The exact complex Fourier coefficients of the force repeated with period `end`.

        c_k = (1/T) times the integral of F(t) exp(-1j k w t) over one period, w = 2 pi / T.
        The paper's coefficients (eq. 12) are a_0 = c_0, a_j = 2 Re c_j, b_j = -2 Im c_j.

        Args:
            harmonics: the highest k.

        Returns:
            (harmonics + 1,) complex, N.
        """
        period = self.end
        mu = -2j * np.pi / period * np.arange(harmonics + 1)
        length = self.duration
        total = np.zeros(harmonics + 1, dtype=np.complex128)
        # integral of exp(mu u) F(u) du = exp(mu L) times the convolution with the pole -mu
        for i, span in enumerate(length):
            index, u = np.array([i]), np.array([span])
            piece = np.exp(mu * span) * self.convolve(-mu, index, u)[:, 0]
            total += np.exp(mu * self.start[i]) * piece
        return total / period

    def mean(self) -> float:
        """The mean force over [0, end), N."""
        return float(self.fourier_coefficients(0)[0].real)

    def burst(self, count: int) -> PiecewiseForce:
        """The history `count` times in a row, then silence for ever.

        Args:
            count: at least 1.

        Raises:
            InputError: a count below 1, or more hits or pieces than anybody means.
        """
        check_hits(count)
        if count * self.start.size > MOST_PIECES:
            raise InputError(
                f"a blow of {self.start.size} pieces makes {count * self.start.size} of them, and "
                f"at most {MOST_PIECES} are computed",
                key="hits",
                value=count,
                hint="give fewer hits, or a force measured at a lower rate",
            )
        offset = np.repeat(np.arange(count) * self.end, self.start.size)
        pieces = {name: np.tile(getattr(self, name), count) for name in _PER_PIECE}
        pieces["start"] = pieces["start"] + offset
        return PiecewiseForce(end=count * self.end, **pieces).padded(np.inf)


def superposed(
    start: FloatArray, parts: Sequence[tuple[FloatArray, PiecewiseForce]], end: float = np.inf
) -> PiecewiseForce:
    """Blows that may overlap, added up from t = 0 to `end`.

    Args:
        start: (b,) s, of each blow; it may lie before 0.
        parts: what every blow consists of: (b,) factors, and the force from the blow's start on.
        end: s.

    Returns:
        pieces between all edges, which are rounded to 1e-12 s.

    Raises:
        InputError: two sines of different frequencies at one time, which no piece can hold.
    """
    order = np.argsort(start, kind="stable")
    start = start[order]
    ends = [(start[:, None] + (*force.start, force.end)).ravel() for _, force in parts]
    edges = np.concatenate([(0.0,), *ends])
    edges = np.unique(np.round(edges[(edges >= 0.0) & (edges < end)], 12))
    # At an edge only the blows that began lately enough are felt, however many there are.
    longest = max(force.end for _, force in parts)
    first = np.searchsorted(start, edges - longest - _AFTER)
    felt = np.searchsorted(start, edges + _AFTER, side="right") - first
    blow = first[:, None] + np.arange(int(felt.max(initial=1)))
    known = blow < (first + felt)[:, None]
    blow = np.minimum(blow, start.size - 1)
    since = edges[:, None] - start[blow]
    # Just after an edge it is clear which piece holds, whatever the rounding did.
    late = since + _AFTER
    constant, slope, highest = np.zeros((3, edges.size))
    lowest = np.full(edges.size, np.inf)  # rad/s, as `highest`: of the sines of one moment
    amplitude = np.zeros(edges.size, dtype=np.complex128)
    for factor, force in parts:
        height = np.broadcast_to(factor, start.shape)[order][blow]
        on = np.where(known & (late >= 0.0) & (late < force.end), height, 0.0)
        piece = np.searchsorted(force.start, late, side="right") - 1
        u = since - force.start[piece]
        if force.constant.any():
            constant += (on * force.constant[piece]).sum(axis=1)
        if force.slope.any():
            rate = on * force.slope[piece]
            constant += (rate * u).sum(axis=1)
            slope += rate.sum(axis=1)
        if force.amplitude.any():
            own = force.angular_frequency[piece]
            wave = on * force.amplitude[piece] * np.exp(1j * own * u)
            amplitude += wave.sum(axis=1)
            highest = np.maximum(highest, np.where(wave, own, 0.0).max(axis=1))
            lowest = np.minimum(lowest, np.where(wave, own, np.inf).min(axis=1))
    if np.any(highest - lowest > 1e-9 * highest):
        raise InputError("blows that overlap hold sines of different frequencies")
    return PiecewiseForce(edges, end, constant, slope, amplitude, highest)


_AFTER = 1e-9  # s
_FORCES = ("constant", "slope", "amplitude")
_PER_PIECE = ("start", "constant", "slope", "amplitude", "angular_frequency")
