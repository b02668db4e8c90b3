"""The exact response to a force in pieces: steady, or from rest.

A `Response` has the deflection at any time, the turning points, and the worst direction.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from picchio.core.arrays import ComplexArray, FloatArray, IndexArray
from picchio.core.errors import InputError
from picchio.core.shown import Shown
from picchio.excitation.excitation import Excitation
from picchio.excitation.piecewise import PiecewiseForce
from picchio.excitation.pulse_train import USUAL_BLOWS, USUAL_HITS
from picchio.vibration.closed_form.extrema import Grid, golden_maximum, refine_roots
from picchio.vibration.closed_form.modes import Modes

# A ring-down is followed until its envelope has fallen to this share of its start.
RING_DOWN_LEVEL = 1e-4
# |1 - exp(pole T)| below this: the blows are in resonance with an undamped mode.
_RESONANCE = 1e-10
# Numbers that are evaluated together: 16 MB.
_CELLS = 2_000_000


class Peak(NamedTuple):
    """Largest absolute deflection of one joint: value (rad, with its sign) and time (s)."""

    value: float
    time: float


class WorstDirection(NamedTuple):
    """Over all directions: value (rad), direction (3,) unit vector, time (s)."""

    value: float
    direction: FloatArray
    time: float


@dataclass(frozen=True, eq=False)
class Response(Shown):
    """The deflection of every joint, in closed form, for a force in any direction.

    Attributes:
        modes: the system.
        force: the history that acts; of a periodic response, one period.
        states: (p, m) complex, N s, modal states at the start of every piece of the force.
        periodic: whether the response repeats with the force's period.
    """

    PLOTS: ClassVar = {"deflection": "visuals.plots.response:plot_response"}
    LACKS: ClassVar = {
        "show": "show the robot's envelope",
        "to_frame": "choose times: `deflection`",
    }

    modes: Modes
    force: PiecewiseForce
    states: ComplexArray
    periodic: bool

    def __repr__(self) -> str:
        what = "steady state" if self.periodic else "from rest"
        return f"Response({', '.join(self.modes.output_names)}; {what})"

    @property
    def horizon(self) -> float:
        """Until when there is anything to see, s: the period, or the ring-down's end.

        Raises:
            InputError: an undamped mode rings for ever.
        """
        if np.isfinite(self.force.end):
            return float(self.force.end)
        return float(self.force.start[-1]) + ring_down(self.modes)

    def _locate(self, time: ArrayLike) -> tuple[IndexArray, FloatArray]:
        t = np.asarray(time, dtype=float)
        if self.periodic:
            t = np.mod(t, self.force.end)
        elif (t < 0.0).any() or (t > self.force.end).any():
            raise InputError("time must lie within the force history", key="time")
        index = np.searchsorted(self.force.start, t, side="right") - 1
        return index, t - self.force.start[index]

    def _modal(self, index: IndexArray, u: FloatArray) -> ComplexArray:
        """Modal states (p, k) at `u` seconds after the start of piece `index`."""
        poles = self.modes.poles
        free = np.exp(poles[:, None] * u) * self.states[:, index]
        return free + self.force.convolve(poles, index, u)

    def unit_deflection(self, time: ArrayLike) -> FloatArray:
        """g_j(t): deflection of joint j for the force along x, y and z.

        Args:
            time: (k,) s.

        Returns:
            (m, 3, k) rad; the deflection for direction n is the sum over axis 1 with n.
        """
        modal = self._modal(*self._locate(np.atleast_1d(time)))
        return np.einsum("mpd,pk->mdk", self.modes.residues, modal).real

    def deflection(self, time: ArrayLike, direction: ArrayLike) -> FloatArray:
        """Deflection of every joint for one force direction.

        Args:
            time: (k,) s.
            direction: (3,) unit vector, world.

        Returns:
            (m, k) rad.
        """
        modal = self._modal(*self._locate(np.atleast_1d(time)))
        return (self._along(direction) @ modal).real

    def velocity(self, time: ArrayLike, direction: ArrayLike) -> FloatArray:
        """The rate (m, k) of every joint's deflection, rad/s.

        Args:
            time: (k,) s.
            direction: (3,) of the force.
        """
        modal = self._modal(*self._locate(np.atleast_1d(time)))
        return ((self._along(direction) * self.modes.poles) @ modal).real

    def acceleration(self, time: ArrayLike, direction: ArrayLike) -> FloatArray:
        """The second derivative (m, k) of every joint's deflection, rad/s^2; jumps with the force.

        Args:
            time: (k,) s.
            direction: (3,) of the force.
        """
        index, u = self._locate(np.atleast_1d(time))
        weighted = self._along(direction) * self.modes.poles
        rate = self.modes.poles[:, None] * self._modal(index, u)
        return (weighted @ (rate + self.force.in_piece(index, u))).real

    def _along(self, direction: ArrayLike) -> ComplexArray:
        return self.modes.residues @ unit_vector(direction)

    def turning_points(self, direction: ArrayLike) -> list[tuple[FloatArray, FloatArray]]:
        """Every extremum of every joint's deflection, found from the closed form.

        A response from rest starts at time 0 with deflection 0 and, after a ring-down, ends at
        rest. A periodic one starts and ends at the same turning point, one period later.

        Args:
            direction: (3,) unit vector.

        Returns:
            for each output, (time (k,) s, deflection (k,) rad).
        """
        along = self._along(direction)
        m, pieces = len(along), self.force.start.size
        weighted = along * self.modes.poles
        curved = weighted * self.modes.poles
        jump = weighted.sum(axis=1).real

        def slope(index: IndexArray, u: FloatArray) -> tuple[FloatArray, FloatArray]:
            """First and second derivative; `index` counts the pieces output by output."""
            row, piece = np.divmod(index, pieces)
            modal = self._modal(piece, u)
            # Not by BLAS: its threads cost more than these few rows.
            first = np.einsum("kp,pk->k", weighted[row], modal).real
            second = np.einsum("kp,pk->k", curved[row], modal).real
            return first, second + jump[row] * self.force.in_piece(piece, u)

        times: list[list[FloatArray]] = [[] for _ in along]
        values: list[list[FloatArray]] = [[] for _ in along]
        for grid in self._grids(m):
            modal = self._modal(grid.index, grid.local)
            force = self.force.in_piece(grid.index, grid.local)
            first = np.einsum("mp,pk->mk", weighted, modal).real
            second = np.einsum("mp,pk->mk", curved, modal).real + jump[:, None] * force
            # All outputs at once, each on pieces of its own.
            own = (pieces * np.arange(m)[:, None] + grid.index).ravel()
            every = Grid(own, np.tile(grid.local, m))
            index, u = refine_roots(every, (first.ravel(), second.ravel()), slope)
            row, piece = np.divmod(index, pieces)
            found = np.einsum("kp,pk->k", along[row], self._modal(piece, u)).real
            ends = np.searchsorted(row, np.arange(1, m))
            time = self.force.start[piece] + u
            for j, part in enumerate(zip(np.split(time, ends), np.split(found, ends), strict=True)):
                times[j].append(part[0])
                values[j].append(part[1])
        return [
            self._close(np.concatenate(time), np.concatenate(value), row)
            for time, value, row in zip(times, values, along, strict=True)
        ]

    def _grids(self, outputs: int, density: int = 1) -> Iterator[Grid]:
        """The samples in blocks that keep what `outputs` of them need within the memory."""
        poles = self.modes.poles
        most = max(_CELLS // (poles.size * (1 + outputs // 8) + outputs), 64)
        return Grid.blocks(poles, self.force, self.horizon, density=density, most=most)

    def _close(
        self, time: FloatArray, value: FloatArray, row: ComplexArray
    ) -> tuple[FloatArray, FloatArray]:
        if self.periodic:
            if not time.size:  # a constant
                start = (row @ self.states[:, :1]).real
                return np.zeros(1), start
            return np.append(time, time[0] + self.force.end), np.append(value, value[0])
        end = self.horizon
        last = 0.0
        if np.isfinite(self.force.end):
            here, u = self._locate(np.array([end]))
            last = float((row @ self._modal(here, u)).real[0])
        return np.concatenate([[0.0], time, [end]]), np.concatenate([[0.0], value, [last]])

    def peaks(self, direction: ArrayLike) -> list[Peak]:
        """The largest absolute deflection of every joint for one direction, exact in time.

        Args:
            direction: (3,) of the force.
        """
        result = []
        for time, value in self.turning_points(direction):
            k = int(np.abs(value).argmax())
            result.append(Peak(float(value[k]), float(time[k])))
        return result

    def worst_directions(self) -> list[WorstDirection]:
        """The largest deflection of every joint over all force directions, no direction sampled.

        The deflection for direction n is g(t) . n, so its maximum over unit n and time is
        max |g(t)|, reached along g. Where g vanishes the direction is +z.

        Returns:
            one for each output; either sign of the direction gives the same deflection.
        """
        poles, residues = self.modes.poles, self.modes.residues
        up = np.array([0.0, 0.0, 1.0])
        result = [WorstDirection(0.0, up, 0.0)] * len(residues)
        for grid in self._grids(3 * len(residues), density=2):
            modal = self._modal(grid.index, grid.local)
            norms = np.linalg.norm(_real(residues, modal), axis=1)
            rises = _rise(grid, np.linalg.norm(_real(residues * poles[:, None], modal), axis=1))
            for j, (residue, norm, rise) in enumerate(zip(residues, norms, rises, strict=True)):
                # The grid itself as well: a monotonic response has its maximum at an end.
                top = int(norm.argmax())
                index, u = grid.index[top : top + 1], grid.local[top : top + 1]
                ends, pieces = _hopeful(grid, norm, rise, max(norm[top], result[j].value))
                if pieces.size:
                    slope = partial(self._norm_slope, residue, pieces)
                    which, root = refine_roots(ends, slope(ends.index, ends.local), slope)
                    index, u = np.append(index, pieces[which]), np.append(u, root)
                g = np.einsum("pd,pk->dk", residue, self._modal(index, u)).real
                size = np.sqrt((g * g).sum(axis=0))
                k = int(size.argmax())
                if size[k] > result[j].value or not np.isfinite(size[k]):
                    time = float(self.force.start[index[k]] + u[k])
                    result[j] = WorstDirection(float(size[k]), g[:, k] / size[k], time)
        return result

    def worst_combination(self, rows: FloatArray) -> tuple[float, FloatArray]:
        """Largest length of a vector output over time and all force directions.

        The output rows @ x(t) is G(t) n with G (r, 3), so its largest length over unit n is G's
        largest singular value, along its right singular vector.

        Args:
            rows: (r, m), such as the tool's Jacobian for its displacement.

        Returns:
            the value (per unit of the rows) and the direction (3,).
        """
        residues = np.einsum("rm,mpd->rpd", rows, self.modes.residues)
        rates = residues * self.modes.poles[:, None]
        best, along = 0.0, np.array([0.0, 0.0, 1.0])

        def length(index: IndexArray, u: FloatArray) -> FloatArray:
            return _largest(_real(residues, self._modal(index, u)))

        for grid in self._grids(3 * len(residues), density=2):
            modal = self._modal(grid.index, grid.local)
            size = _largest(_real(residues, modal))
            top = int(size.argmax())
            rise = _rise(grid, _largest(_real(rates, modal)))
            ends, pieces = _hopeful(grid, size, rise, max(size[top], best))
            index, u = grid.index[top : top + 1], grid.local[top : top + 1]
            if pieces.size:
                low, high = ends.local[0::2], ends.local[1::2]
                found = golden_maximum(low, high, partial(length, pieces))
                index, u = np.append(index, pieces), np.append(u, found)
            g = _real(residues, self._modal(index, u))
            final = _largest(g)
            k = int(final.argmax())
            if final[k] > best or not np.isfinite(final[k]):
                best, along = float(final[k]), np.linalg.svd(g[:, :, k])[2][0]
        return best, along

    def _norm_slope(
        self, residue: ComplexArray, pieces: IndexArray, which: IndexArray, u: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """First and second derivative of |g|^2 / 2 at `u` in the pieces `pieces[which]`."""
        index = pieces[which]
        modal = self._modal(index, u)
        poles = self.modes.poles[:, None]
        g = (residue.T @ modal).real
        v = ((residue * poles).T @ modal).real
        a = ((residue * poles**2).T @ modal).real
        a += (residue * poles).sum(axis=0).real[:, None] * self.force.in_piece(index, u)
        return (g * v).sum(axis=0), (v * v).sum(axis=0) + (g * a).sum(axis=0)


def _real(residues: ComplexArray, modal: ComplexArray) -> FloatArray:
    """(m, 3, k): residues (m, p, 3) on modal states (p, k)."""
    m, p, _ = residues.shape
    return (residues.swapaxes(1, 2).reshape(3 * m, p) @ modal).real.reshape(m, 3, -1)


def _largest(g: FloatArray) -> FloatArray:
    """(k,) the largest singular value of every matrix of (r, 3, k)."""
    return np.asarray(np.linalg.svd(np.moveaxis(g, -1, 0), compute_uv=False)[:, 0])


def _rise(grid: Grid, speed: FloatArray) -> FloatArray:
    """(..., k - 1): how far a peak may stand out between samples whose speeds are (..., k)."""
    step = np.diff(grid.local)
    # Neighbours in time that belong to different pieces of the force span no interval.
    step[grid.index[1:] != grid.index[:-1]] = -np.inf
    with np.errstate(invalid="ignore"):  # no interval, and no speed
        return np.asarray(step * np.maximum(speed[..., 1:], speed[..., :-1]))


def _hopeful(
    grid: Grid, size: FloatArray, rise: FloatArray, best: float
) -> tuple[Grid, IndexArray]:
    """The intervals in which a peak may exceed `best`, as pieces of their own with two ends.

    Args:
        grid: the samples.
        size: (k,) there.
        rise: (k - 1,) see `_rise`.
        best: known so far.

    Returns:
        the two ends of each interval, numbered by it; (c,) the piece of the force of each.
    """
    at = np.flatnonzero(np.maximum(size[1:], size[:-1]) + rise > best)
    local = grid.local[np.stack([at, at + 1], axis=1)].ravel()
    return Grid(np.repeat(np.arange(at.size), 2), local), grid.index[at]


def ring_down(modes: Modes) -> float:
    """How long the slowest mode takes to fall to `RING_DOWN_LEVEL`.

    Args:
        modes: of the system.

    Returns:
        s.

    Raises:
        InputError: an undamped mode rings for ever.
    """
    slowest = -float(modes.poles.real.max())
    if slowest <= 0.0:
        raise InputError(
            "a mode has no damping: after the blows it rings for ever",
            key="damping_ratio",
            value=0.0,
            hint="give the joints a damping ratio above 0",
        )
    return -float(np.log(RING_DOWN_LEVEL)) / slowest


def unit_vector(direction: ArrayLike) -> FloatArray:
    """The direction with length 1.

    Raises:
        InputError: not three finite numbers, or all zero.
    """
    n = np.asarray(direction, dtype=float)
    if n.shape != (3,) or not np.isfinite(n).all():
        raise InputError("must be three finite numbers", key="direction", value=direction)
    length = float(np.linalg.norm(n))
    if length == 0.0:
        raise InputError("has zero length", key="direction", value=[float(c) for c in n])
    return n / length


def described(hits: int | None) -> str:
    """Which response a result is of, for people.

    Args:
        hits: of a burst from rest; None for the steady state.
    """
    return "steady state" if hits is None else f"{hits} hit{'s' * (hits > 1)} from rest"


def steady_state(modes: Modes, excitation: Excitation | PiecewiseForce = USUAL_BLOWS) -> Response:
    """The exact periodic response, no Fourier sum: paper eq. 13 without truncation.

    Between the jumps of the force each mode is a free decay about a particular solution; the
    state that repeats after one period follows from one division.

    Args:
        modes: the system.
        excitation: the blows, if not given 300 N, 4 ms wide, one every 40 ms; of a
            `PiecewiseForce`, one period.

    Returns:
        the response over one period.

    Raises:
        InputError: an undamped mode in resonance with the blows: no steady state exists.
    """
    force = excitation.one_period() if isinstance(excitation, Excitation) else excitation
    if not np.isfinite(force.end):
        raise InputError("a steady state needs a force with a finite period")
    zero = np.zeros(modes.poles.size, dtype=complex)
    after_one_period = _propagate(modes.poles, force, zero)[:, -1]
    remaining = -np.expm1(modes.poles * force.end)  # 1 - exp(pole T)
    undamped = modes.poles.real >= 0.0
    stuck = undamped & (np.abs(remaining) < _RESONANCE)
    if stuck.any():
        frequency = float(np.abs(modes.poles[stuck][0].imag)) / (2.0 * np.pi)
        raise InputError(
            f"the mode at {frequency:.6g} Hz has no damping and is in resonance with blows every "
            f"{force.end:g} s: its vibration grows without bound",
            key="damping_ratio",
            value=0.0,
            hint="give the joints a damping ratio above 0, or another period",
        )
    states = _propagate(modes.poles, force, after_one_period / remaining)
    return Response(modes, force, states[:, :-1], periodic=True)


def response_from_rest(
    modes: Modes,
    excitation: Excitation | PiecewiseForce = USUAL_BLOWS,
    hits: int | None = None,
) -> Response:
    """The exact response to a burst from rest, ring-down included.

    Args:
        modes: the system.
        excitation: the blows, as in `steady_state`, or a force history (whose last piece may be
            endless).
        hits: how many blows, for an `Excitation`; 12, as of a rivet, where no blows are given.

    Returns:
        the response from the first blow on.

    Raises:
        InputError: hits below 1, or none given for an excitation.
    """
    if isinstance(excitation, Excitation):
        if hits is None and excitation is USUAL_BLOWS:
            hits = USUAL_HITS
        if hits is None:
            raise InputError("give the number of hits of the burst", key="hits")
        force = excitation.burst(hits)
    else:
        force = excitation
    rest = np.zeros(modes.poles.size, dtype=complex)
    return Response(modes, force, _propagate(modes.poles, force, rest)[:, :-1], periodic=False)


def truncated_fourier_response(
    modes: Modes,
    excitation: Excitation | PiecewiseForce,
    direction: ArrayLike,
    time: ArrayLike,
    harmonics: int,
) -> FloatArray:
    """The steady state as a Fourier sum of `harmonics` terms: paper eqs. 12 and 13, to compare.

    Eq. 13 is written here in complex form, where amplitude and phase are those of
    H(i j w) (a_j - i b_j); its arctangent thereby takes the right quadrant, which the plain
    tan^-1 of the paper does not above resonance.

    Args:
        modes: the system.
        excitation: the blows; of a `PiecewiseForce`, one period.
        direction: (3,) the force's direction, taken as it is.
        time: (k,) s.
        harmonics: number of terms after the mean.

    Returns:
        (m, k) deflection, rad.
    """
    force = excitation.one_period() if isinstance(excitation, Excitation) else excitation
    coefficients = force.fourier_coefficients(harmonics)
    omega = 2.0 * np.pi / force.end * np.arange(harmonics + 1)
    transfer = np.einsum(
        "mdk,d->mk", modes.frequency_response(omega), np.asarray(direction, dtype=float)
    )
    spectrum = transfer * coefficients
    spectrum[:, 1:] *= 2.0  # the negative frequencies
    t = np.asarray(time, dtype=float)
    total = np.zeros((spectrum.shape[0], t.size))
    for first in range(0, harmonics + 1, 2048):  # bounded memory for long sums
        part = slice(first, first + 2048)
        total += (spectrum[:, part] @ np.exp(1j * np.outer(omega[part], t))).real
    return total


def peak_deflections(response: Response, directions: ArrayLike) -> FloatArray:
    """Largest absolute deflection of every output for each force direction, as exact as one by one.

    All directions share one curve g_j(t). It is sampled once; only where a direction's deflection
    may exceed its own largest sample is its slope solved for zero on the closed form.

    Args:
        response: steady or from rest.
        directions: (d, 3) unit vectors.

    Returns:
        (m, d) rad.
    """
    wanted = np.atleast_2d(np.asarray(directions, dtype=float))
    poles, residues = response.modes.poles, response.modes.residues
    grid = Grid.of(poles, response.force, response.horizon)
    modal = response._modal(grid.index, grid.local)
    value = _real(residues, modal)
    rise = _rise(grid, np.linalg.norm(_real(residues * poles[:, None], modal), axis=1))
    result = np.empty((len(residues), len(wanted)))
    block = max(1, _CELLS // grid.local.size)
    for j in range(len(residues)):
        for first in range(0, len(wanted), block):
            part = slice(first, first + block)
            size = np.abs(wanted[part] @ value[j])
            best = size.max(axis=1)
            hopeful = np.maximum(size[:, 1:], size[:, :-1]) + rise[j] > best[:, None]
            row, interval = np.nonzero(hopeful)
            along = wanted[part] @ residues[j].T
            np.maximum.at(best, *_peaks_within(response, grid, along, row, interval))
            result[j, part] = best
    return result


def _peaks_within(
    response: Response, grid: Grid, along: np.ndarray, row: IndexArray, interval: IndexArray
) -> tuple[IndexArray, FloatArray]:
    """Rows and absolute values of the peaks inside some intervals between samples.

    Args:
        response: whose.
        grid: the samples.
        along: (b, p) complex, residues along each direction.
        row: (c,) which direction.
        interval: (c,) from which sample to the next.
    """
    poles, piece = response.modes.poles, grid.index[interval]

    def slope(which: IndexArray, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        weighted = (along[row[which]] * poles).T
        modal = response._modal(piece[which], u)
        second = (weighted * poles[:, None] * modal).sum(axis=0).real
        jump = weighted.sum(axis=0).real * response.force.in_piece(piece[which], u)
        return (weighted * modal).sum(axis=0).real, second + jump

    # Each interval as a piece of its own, with its two ends.
    ends = Grid(np.repeat(np.arange(len(row)), 2),
                grid.local[np.stack([interval, interval + 1], axis=1)].ravel())  # fmt: skip
    which, u = refine_roots(ends, slope(ends.index, ends.local), slope)
    value = (along[row[which]].T * response._modal(piece[which], u)).sum(axis=0).real
    return row[which], np.abs(value)


def _propagate(poles: ComplexArray, force: PiecewiseForce, state: ComplexArray) -> ComplexArray:
    """Modal states at every piece's start and at the end: (p, m + 1)."""
    duration = np.where(np.isfinite(force.duration), force.duration, 0.0)
    index = np.arange(duration.size)
    gained = force.convolve(poles, index, duration)
    kept = np.exp(poles[:, None] * duration)
    states = np.empty((poles.size, duration.size + 1), dtype=complex)
    states[:, 0] = state
    for i in index:
        states[:, i + 1] = kept[:, i] * states[:, i] + gained[:, i]
    return states
