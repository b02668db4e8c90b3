"""Compiled search for the top of a joint's response |g|.

The response is sampled (`sample`, `joint_norms`); `highest` picks the samples that the top may be
near, and finds it there exactly: by a series in time about the sample (`series_top`), or by Newton
steps between two samples (`refine`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from picchio.core.arrays import ComplexArray, FloatArray, IndexArray
from picchio.vibration.batch.modal_kernel import KERNEL, exponential

# Samples a cycle of the fastest mode. |g|^2 swings twice as fast: a top between two samples is
# at most 10 % above both, unless modes nearly cancel (see `_MISSED`).
_PER_CYCLE = 10.0
# Samples whose marks are read as one number.
_WORD = 8
# Of the largest |g|^2 on the samples: no top beside a sample below this is the largest.
_CANDIDATE = 0.5
# How much higher than a cubic through values and slopes a top can be: of |g|, the modes'
# accelerations times their shares, and the step squared. A cubic misses a 48th of that times
# (omega h)^2, which is 0.4 of the fastest mode; modes that nearly cancel have larger accelerations
# than |g| itself.
_MISSED = 0.025
# Of the series of g, and how far from the sample, in rad of the fastest mode, it serves:
# 0.35^12 / 12! = 7e-15 of that mode's share is left out.
TERMS = 12
_NEAR = 0.35
_SERIES_STEPS = 6
_REFINE_STEPS = 40
# Of the bracket: the last step's own error is its square, and a maximum is off by the square of
# that, once what the step itself gains is added.
_PRECISION = 2e-5


class Samples(NamedTuple):
    """Room for samples of one pose, used again for the next; only the first columns are in use.

    Each array is whole: a slice has a stride that the compiler does not know, and its loops then
    take one sample at a time instead of four.

    Attributes:
        time: (k,) s.
        eta: (n, k) deflections of the modes.
        rate: (n, k) real parts of their states.
        norm: (n, k) |g|^2 of every joint.
        marks: (k,) of one joint: whether a sample is higher than those beside it.
        words: (k / 8,) the same.
        found: (k,) which are.
        scratch: (3, k).
    """

    time: FloatArray
    eta: FloatArray
    rate: FloatArray
    norm: FloatArray
    marks: NDArray[np.uint8]
    words: IndexArray
    found: IndexArray
    scratch: FloatArray


@njit(cache=True)
def room_for(n: int, count: int) -> Samples:
    """Room for `count` samples of n modes and joints.

    Args:
        n: how many modes there are, and joints.
        count: of the samples.
    """
    words = np.zeros((count + _WORD - 1) // _WORD, dtype=np.int64)
    count = len(words) * _WORD
    return Samples(
        np.empty(count), np.empty((n, count)), np.empty((n, count)), np.empty((n, count)),
        words.view(np.uint8), words, np.empty(count, dtype=np.int64), np.empty((3, count)),
    )  # fmt: skip


@njit(**KERNEL)
def steps_of(duration: float, rate: float) -> int:
    """How many samples a piece takes.

    Args:
        duration: s, of the piece.
        rate: rad/s, of the fastest mode or wave.
    """
    return max(1, int(np.ceil(duration * rate * (_PER_CYCLE / (2.0 * np.pi)))))


@njit(**KERNEL)
def samples_of(length: FloatArray, wave: FloatArray, fastest: float) -> tuple[int, float]:
    """How many samples all pieces take, and how long they are, s.

    A function of its own: what begins as a number in the text is a type of its own to Numba, which
    then compiles all that it is handed to once more.

    Args:
        length: (m,) s, of the pieces.
        wave: (m,) rad/s.
        fastest: rad/s, of the modes.
    """
    count, total = 0, 0.0
    for p in range(length.shape[0]):
        count += steps_of(length[p], max(fastest, wave[p]))
        total += length[p]
    return count, total


@njit(**KERNEL)
def _double(factor, real, imag, next_real, next_imag):  # type: ignore[no-untyped-def]
    """The next states of a decay, from as many before them."""
    c, d = factor.real, factor.imag
    for k in range(next_real.shape[0]):
        next_real[k] = real[k] * c - imag[k] * d
        next_imag[k] = real[k] * d + imag[k] * c


@njit(**KERNEL)
def _decay(state: complex, factor: complex, real: FloatArray, imag: FloatArray) -> None:
    """State factor^k, for all k: each pass doubles what is there, side by side."""
    real[0], imag[0] = state.real, state.imag
    done = 1
    while done < real.shape[0]:
        _double(factor, real, imag, real[done : 2 * done], imag[done : 2 * done])
        factor *= factor
        done *= 2


@njit(**KERNEL)
def _add(  # type: ignore[no-untyped-def]
    first, level, rise, scale, real, imag, eta, rate
):
    """A decay and a line in time: the first of a mode, or more of it."""
    for k in range(real.shape[0]):
        x = (imag[k] + (level.imag + rise.imag * k)) * scale
        v = real[k] + (level.real + rise.real * k)
        eta[k] = x if first else eta[k] + x
        rate[k] = v if first else rate[k] + v


@njit(**KERNEL)
def sample(
    poles: ComplexArray,
    rows: ComplexArray,
    duration: FloatArray,
    wave: FloatArray,
    fastest: float,
    room: Samples,
) -> None:
    """Oscillators' deflections at the samples of all pieces, and their `rate`, into `room`.

    A rate is the real part of a state: the speed less Re(pole) times the deflection.
    """
    count, began = 0, 0.0
    for p in range(duration.shape[0]):
        steps = steps_of(duration[p], max(fastest, wave[p]))
        h = duration[p] / steps
        last = count + steps
        real, imag = room.scratch[0, :steps], room.scratch[1, :steps]
        for i in range(poles.shape[0]):
            scale = 1.0 / poles[i].imag
            eta, rate = room.eta[i, count:last], room.rate[i, count:last]
            _decay(rows[i, p, 0], exponential(poles[i], h), real, imag)
            _add(True, rows[i, p, 1], rows[i, p, 2] * h, scale, real, imag, eta, rate)
            if wave[p] != 0.0:
                spin = exponential(complex(0.0, wave[p]), h)
                _decay(rows[i, p, 3], spin, real, imag)
                _add(False, 0.0j, 0.0j, scale, real, imag, eta, rate)
                _decay(rows[i, p, 4], spin.conjugate(), real, imag)
                _add(False, 0.0j, 0.0j, scale, real, imag, eta, rate)
        for k in range(steps):
            room.time[count + k] = began + h * k
        began += duration[p]
        count = last


@njit(**KERNEL)
def _project(count, eta, pull, first, g, norm):  # type: ignore[no-untyped-def]
    """Add three modes' shares to the axes of a joint's g: the fewer ways to memory, the faster."""
    n = pull.shape[0]
    second, third = min(first + 1, n - 1), min(first + 2, n - 1)
    one, two = 1.0 if first + 1 < n else 0.0, 1.0 if first + 2 < n else 0.0
    a0, a1, a2 = pull[first, 0], one * pull[second, 0], two * pull[third, 0]
    b0, b1, b2 = pull[first, 1], one * pull[second, 1], two * pull[third, 1]
    c0, c1, c2 = pull[first, 2], one * pull[second, 2], two * pull[third, 2]
    for k in range(count):
        x, y, z = eta[first, k], eta[second, k], eta[third, k]
        a = a0 * x + a1 * y + a2 * z
        b = b0 * x + b1 * y + b2 * z
        c = c0 * x + c1 * y + c2 * z
        if first > 0:
            a, b, c = a + g[0, k], b + g[1, k], c + g[2, k]
        g[0, k], g[1, k], g[2, k] = a, b, c
        norm[k] = a * a + b * b + c * c


@njit(**KERNEL)
def joint_norms(joint: int, count: int, pull: FloatArray, room: Samples) -> float:
    """The largest |g|^2 of a joint on the samples; all into its row of `norm`.

    Args:
        joint: which row.
        count: of the samples.
        pull: (n, 4), its deflection by each mode's, for each axis of the force; and their length.
        room: the samples.
    """
    norm = room.norm[joint]
    for first in range(0, pull.shape[0], 3):
        _project(count, room.eta, pull, first, room.scratch, norm)
    for k in range(count, min(count + 3, norm.shape[0])):
        norm[k] = 0.0
    a, b, c, d = 0.0, 0.0, 0.0, 0.0
    for k in range(0, count, 4):  # four at a time: each waits for itself alone
        a, b = max(a, norm[k]), max(b, norm[k + 1])
        c, d = max(c, norm[k + 2]), max(d, norm[k + 3])
    return max(max(a, b), max(c, d))


@njit(**KERNEL)
def _beside(k: int, count: int, periodic: bool) -> tuple[int, int]:
    """The samples before and after one: at the ends those at the other end, or itself."""
    before = k - 1 if k > 0 else (count - 1 if periodic else 0)
    return before, k + 1 if k + 1 < count else (0 if periodic else k)


@njit(**KERNEL)
def _tops(count: int, periodic: bool, largest: float, norm: FloatArray, room: Samples) -> int:
    """How many samples the highest top may be beside; they go into `found`, the largest first."""
    marks, found, floor = room.marks, room.found, _CANDIDATE * largest
    for k in range(1, count - 1):
        marks[k] = (norm[k] >= floor) & (norm[k] >= norm[k - 1]) & (norm[k] >= norm[k + 1])
    for k in (0, count - 1):
        before, after = _beside(k, count, periodic)
        marks[k] = (norm[k] >= floor) & (norm[k] >= norm[before]) & (norm[k] >= norm[after])
    many = 0
    for word in range((count + _WORD - 1) // _WORD):
        if room.words[word] == 0:
            continue
        for k in range(word * _WORD, min(count, word * _WORD + _WORD)):
            if marks[k] != 0:
                found[many] = k
                if norm[k] == largest:
                    found[many], found[0] = found[0], k
                many += 1
    return many


@njit(**KERNEL)
def piece_at(time: float, start: FloatArray) -> int:
    """The last piece of the force that has begun at a time.

    Args:
        time: s.
        start: (m,) s, of the pieces.
    """
    p = 0
    while p + 1 < start.shape[0] and start[p + 1] <= time:
        p += 1
    return p


@njit(**KERNEL)
def refine(
    a: float,
    t: float,
    b: float,
    total: float,
    start: FloatArray,
    poles: ComplexArray,
    rows: ComplexArray,
    constant: FloatArray,
    slope: FloatArray,
    amplitude: ComplexArray,
    wave: FloatArray,
    pull: FloatArray,
    g: FloatArray,
) -> float:
    """|g|^2 at the maximum in (a, b), and g (3,) there; Newton on its slope, in the bracket.

    Everything is in scalars: views into arrays cost more than the arithmetic.
    """
    n = poles.shape[0]
    width = b - a
    norm = 0.0
    for _ in range(_REFINE_STEPS):
        inside = t
        if inside < 0.0:
            inside += total
        elif inside >= total:
            inside -= total
        p = piece_at(inside, start)
        u = inside - start[p]
        force = constant[p] + slope[p] * u
        turn, sway = 0.0, 0.0
        if wave[p] != 0.0:
            turn, sway = math.cos(wave[p] * u), math.sin(wave[p] * u)
            force += amplitude[p].real * turn - amplitude[p].imag * sway
        x0, x1, x2 = 0.0, 0.0, 0.0
        v0, v1, v2 = 0.0, 0.0, 0.0
        a0, a1, a2 = 0.0, 0.0, 0.0
        for i in range(n):
            fall, spin = poles[i].real, poles[i].imag
            size, angle = math.exp(fall * u), spin * u
            cosine, sine = size * math.cos(angle), size * math.sin(angle)
            free = rows[i, p, 0]
            real = free.real * cosine - free.imag * sine + rows[i, p, 1].real
            imag = free.real * sine + free.imag * cosine + rows[i, p, 1].imag
            real += rows[i, p, 2].real * u
            imag += rows[i, p, 2].imag * u
            if wave[p] != 0.0:
                plus, minus = rows[i, p, 3], rows[i, p, 4]
                real += (plus.real + minus.real) * turn - (plus.imag - minus.imag) * sway
                imag += (plus.imag + minus.imag) * turn + (plus.real - minus.real) * sway
            x = imag / spin
            v = real + fall * x
            change = force + 2.0 * fall * v - (fall * fall + spin * spin) * x
            q0, q1, q2 = pull[i, 0], pull[i, 1], pull[i, 2]
            x0, x1, x2 = x0 + q0 * x, x1 + q1 * x, x2 + q2 * x
            v0, v1, v2 = v0 + q0 * v, v1 + q1 * v, v2 + q2 * v
            a0, a1, a2 = a0 + q0 * change, a1 + q1 * change, a2 + q2 * change
        norm = x0 * x0 + x1 * x1 + x2 * x2
        first = x0 * v0 + x1 * v1 + x2 * v2
        second = v0 * v0 + v1 * v1 + v2 * v2 + x0 * a0 + x1 * a1 + x2 * a2
        if first > 0.0:
            a = t
        else:
            b = t
        new = t - first / second if second < 0.0 else 0.5 * (a + b)
        newton = second < 0.0 and a <= new <= b
        if not newton:
            new = 0.5 * (a + b)
        step = new - t
        t = new
        g[0], g[1], g[2] = x0, x1, x2
        if abs(step) <= _PRECISION * width:
            if newton:  # what the last, unevaluated step would still have gained
                norm -= first * first / second
                half = 0.5 * step
                g[0] += step * (v0 + half * a0)
                g[1] += step * (v1 + half * a1)
                g[2] += step * (v2 + half * a2)
            break
    return norm


@njit(**KERNEL)
def power_series(poles: ComplexArray, powers: FloatArray) -> None:
    """Taylor coefficients of exp(pole t) / Im(pole).

    Args:
        poles: (n,) 1/s.
        powers: (TERMS, n, 2) out, real and imaginary parts.
    """
    for i in range(poles.shape[0]):
        term = complex(1.0 / poles[i].imag, 0.0)
        for m in range(TERMS):
            powers[m, i, 0], powers[m, i, 1] = term.real, term.imag
            term *= poles[i] * (1.0 / (m + 1.0))


@njit(**KERNEL)
def series_top(
    k: int,
    hint: float,
    low: float,
    high: float,
    p: int,
    poles: ComplexArray,
    rows: ComplexArray,
    powers: FloatArray,
    eta: FloatArray,
    rate: FloatArray,
    pull: FloatArray,
    free: FloatArray,
    terms: FloatArray,
    g: FloatArray,
) -> float:
    """|g|^2 at its top near a sample, and g (3,) there; negative where the top is not near.

    The sample has every mode's state already, so that no exponential is taken.

    Args:
        k: the sample.
        hint: s, from the sample to where the top is thought to be.
        low: s, how far back the sample's piece of the force goes.
        high: s, how far ahead.
        p: that piece, which has no wave.
        poles: (n,) ascending, 1/s.
        rows: see `coefficients`.
        powers: see `power_series`.
        eta: (n, samples) deflections of the modes.
        rate: (n, samples) real parts of their states.
        pull: (n, 4) of the joint: its deflection by each mode's, for each axis of the force.
        free: (n, 2) scratch: what of a state decays.
        terms: (TERMS, 3) scratch: Taylor series of g.
        g: (3,) out.
    """
    n = poles.shape[0]
    most = _NEAR / poles[n - 1].imag
    u0, u1, u2, r0, r1, r2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(n):
        level, rise = rows[i, p, 1] - rows[i, p, 2] * low, rows[i, p, 2]
        free[i, 0] = rate[i, k] - level.real
        free[i, 1] = eta[i, k] * poles[i].imag - level.imag
        still, drift = level.imag / poles[i].imag, rise.imag / poles[i].imag
        u0, u1, u2 = u0 + pull[i, 0] * still, u1 + pull[i, 1] * still, u2 + pull[i, 2] * still
        r0, r1, r2 = r0 + pull[i, 0] * drift, r1 + pull[i, 1] * drift, r2 + pull[i, 2] * drift
    for m in range(TERMS):
        for i in range(n):
            x = powers[m, i, 0] * free[i, 1] + powers[m, i, 1] * free[i, 0]
            u0, u1, u2 = u0 + pull[i, 0] * x, u1 + pull[i, 1] * x, u2 + pull[i, 2] * x
        terms[m, 0], terms[m, 1], terms[m, 2] = u0, u1, u2
        u0, u1, u2 = r0, r1, r2
        r0, r1, r2 = 0.0, 0.0, 0.0
    s = min(max(hint, low), high)
    for _ in range(_SERIES_STEPS):
        # The axes side by side: each chain of products waits for itself alone.
        y0, y1, y2 = terms[TERMS - 1, 0], terms[TERMS - 1, 1], terms[TERMS - 1, 2]
        w0, w1, w2, z0, z1, z2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for m in range(TERMS - 2, -1, -1):
            z0, z1, z2 = z0 * s + w0, z1 * s + w1, z2 * s + w2
            w0, w1, w2 = w0 * s + y0, w1 * s + y1, w2 * s + y2
            y0, y1, y2 = y0 * s + terms[m, 0], y1 * s + terms[m, 1], y2 * s + terms[m, 2]
        norm = y0 * y0 + y1 * y1 + y2 * y2
        first = y0 * w0 + y1 * w1 + y2 * w2
        second = w0 * w0 + w1 * w1 + w2 * w2 + 2.0 * (y0 * z0 + y1 * z1 + y2 * z2)
        if not second < 0.0:
            return -1.0
        step = -first / second
        if not (low <= s + step <= high and abs(s + step) <= most):
            return -1.0
        if abs(step) <= 1e-4 * most:  # 3e-5 rad: what is left is its cube
            g[0] = y0 + step * (w0 + step * z0)
            g[1] = y1 + step * (w1 + step * z1)
            g[2] = y2 + step * (w2 + step * z2)
            return norm - first * first / second
        s += step
    return -1.0


@njit(**KERNEL)
def _moving(
    k: int,
    force: float,
    poles: ComplexArray,
    eta: FloatArray,
    rate: FloatArray,
    pull: FloatArray,
) -> tuple[float, float]:
    """Half the slope of |g|^2 at a sample, and a bound of how fast g's own slope changes."""
    x0, x1, x2, v0, v1, v2, bound = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(poles.shape[0]):
        fall, spin = poles[i].real, poles[i].imag
        x = eta[i, k]
        v = rate[i, k] + fall * x
        change = force + 2.0 * fall * v - (fall * fall + spin * spin) * x
        q0, q1, q2 = pull[i, 0], pull[i, 1], pull[i, 2]
        x0, x1, x2 = x0 + q0 * x, x1 + q1 * x, x2 + q2 * x
        v0, v1, v2 = v0 + q0 * v, v1 + q1 * v, v2 + q2 * v
        bound += pull[i, 3] * abs(change)
    return x0 * v0 + x1 * v1 + x2 * v2, bound


@njit(**KERNEL)
def _cubic_top(
    first: float, last: float, rise: float, fall: float, length: float
) -> tuple[float, float]:
    """Where in [0, length] the cubic of two values and slopes is highest, and how high."""
    # first + rise s + b s^2 + c s^3
    mean = (last - first) / length
    b = (3.0 * mean - 2.0 * rise - fall) / length
    c = (rise + fall - 2.0 * mean) / (length * length)
    at, top = 0.0, first
    if last > first:
        at, top = length, last
    under = b * b - 3.0 * rise * c
    if under >= 0.0:
        # The extremum where the second derivative is negative, without cancellation.
        root = np.sqrt(under)
        s = rise / (root - b) if b <= 0.0 else (-b - root) / (3.0 * c if c != 0.0 else np.inf)
        if 0.0 < s < length:
            value = first + s * (rise + s * (b + s * c))
            if value > top:
                at, top = s, value
    return at, top


@njit(**KERNEL)
def _force(
    p: int,
    u: float,
    constant: FloatArray,
    slope: FloatArray,
    amplitude: ComplexArray,
    wave: FloatArray,
) -> float:
    """The force (N) of a piece, `u` s after it began."""
    force = constant[p] + slope[p] * u
    if wave[p] != 0.0:
        angle = wave[p] * u
        force += amplitude[p].real * np.cos(angle) - amplitude[p].imag * np.sin(angle)
    return float(force)


@njit(**KERNEL)
def highest(
    joint: int,
    count: int,
    periodic: bool,
    total: float,
    largest: float,
    room: Samples,
    start: FloatArray,
    poles: ComplexArray,
    rows: ComplexArray,
    constant: FloatArray,
    slope: FloatArray,
    amplitude: ComplexArray,
    wave: FloatArray,
    powers: FloatArray,
    pull: FloatArray,
    g: FloatArray,
    free: FloatArray,
    terms: FloatArray,
    direction: FloatArray,
) -> float:
    """The largest |g| of a joint, from that of |g|^2 on the samples; its way into `direction`."""
    best = -1.0
    time, norm, eta, rate = room.time, room.norm[joint], room.eta, room.rate
    for candidate in range(_tops(count, periodic, largest, norm, room)):
        k = room.found[candidate]
        before, after = _beside(k, count, periodic)
        a, t, b = time[before], time[k], time[after]
        if a > t:
            a -= total
        if b < t:
            b += total
        p = piece_at(t, start)
        # A parabola's top; of a wave, and where there is a top to compare with, a cubic's.
        here, guess = norm[k], t
        above, below = here - norm[before], here - norm[after]
        if above + below > 0.0:
            side = b - t if above > below else t - a
            guess += 0.5 * side * (above - below) / (above + below)
        if best >= 0.0 or wave[p] != 0.0:
            force = _force(p, t - start[p], constant, slope, amplitude, wave)
            climb, bound = _moving(k, force, poles, eta, rate, pull)
            beside, length = (after, b - t) if climb >= 0.0 else (before, t - a)
            top = here
            if length > 0.0:
                # Where a piece ends the force may jump, but no slope does: any piece's will do.
                descent = _moving(beside, 0.0, poles, eta, rate, pull)[0]
                sign = 1.0 if climb >= 0.0 else -1.0
                move, top = _cubic_top(
                    here, norm[beside], 2.0 * sign * climb, 2.0 * sign * descent, length
                )
                guess = t + sign * move
            if top + _MISSED * np.sqrt(here) * bound * length * length < best:
                continue
        value = -1.0
        if wave[p] == 0.0:
            stop = start[p + 1] if p + 1 < start.shape[0] else total
            value = series_top(
                k, guess - t, start[p] - t, stop - t, p, poles, rows, powers, eta, rate, pull,
                free, terms, g,
            )  # fmt: skip
        if value < 0.0:  # the top is in another piece, or not near
            value = refine(
                a, guess, b, total if periodic else np.inf, start, poles, rows, constant,
                slope, amplitude, wave, pull, g,
            )  # fmt: skip
        if value > best:
            best = value
            size = np.sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2])
            for d in range(3):
                direction[joint, d] = g[d] / size
    return float(np.sqrt(best))
