"""The motion from rest: classical Runge-Kutta, with dry friction's sticking and slipping found.

Steps end at every edge of the force and at every instant that a sensor reads; a step sees the blows
that are on throughout it. What is written: the motion just after, in the middle and just before the
end of every interval between such instants, so that a sensor's own dynamics can be worked out.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .arm import workspace
from .equations import COULOMB, OUTPUTS, rates

# Raise it when `equations` or `arm` change: numba's cache looks at this file alone.
_REVISION = 2

_SLACK = 1e-9  # of the friction torque, before what sticks lets go
_EVENTS = 64  # at most so many in a step


@njit(cache=True)
def _move(x, h, rate, out):
    for i in range(x.size):
        out[i] = x[i] + h * rate[i]


@njit(cache=True)
def _finish(x, h, r1, r2, r3, r4, out):
    for i in range(x.size):
        out[i] = x[i] + h / 6.0 * (r1[i] + 2.0 * (r2[i] + r3[i]) + r4[i])


@njit(cache=True)
def _step(t, h, start, end, first, on, mode, system, work, past, held, room, spare):
    """One step from the state `start` to `end`; `first` are the rates at its start."""
    x, v, z = start
    a1, d1 = first
    x2, z2, v2, v3, v4, a2, a3, a4, d2, d3, d4 = room
    no = h < 0.0
    _move(x, 0.5 * h, v, x2)
    _move(v, 0.5 * h, a1, v2)
    _move(z, 0.5 * h, d1, z2)
    half = t + 0.5 * h
    rates(half, x2, v2, z2, on, mode, system, work, past, a2, d2, held, spare, no)
    _move(x, 0.5 * h, v2, x2)
    _move(v, 0.5 * h, a2, v3)
    _move(z, 0.5 * h, d2, z2)
    rates(half, x2, v3, z2, on, mode, system, work, past, a3, d3, held, spare, no)
    _move(x, h, v3, x2)
    _move(v, h, a3, v4)
    _move(z, h, d3, z2)
    rates(t + h, x2, v4, z2, on, mode, system, work, past, a4, d4, held, spare, no)
    _finish(x, h, v, v2, v3, v4, end[0])
    _finish(v, h, a1, a2, a3, a4, end[1])
    _finish(z, h, d1, d2, d3, d4, end[2])


@njit(cache=True)
def _apart(row, v):
    """Speed of the two sides of an element against each other."""
    b = int(row[2])
    return v[int(row[1])] - (v[b] if b >= 0 else 0.0)


@njit(cache=True)
def _let_go(elements, mode, held):
    """Elements that stick and are pulled too hard begin to slide; whether there were any."""
    found = False
    for i in range(elements.shape[0]):
        sticks = int(elements[i, 0]) == COULOMB and mode[i] == 0.0
        if sticks and abs(held[i]) > elements[i, 3] * (1.0 + _SLACK):
            mode[i] = np.sign(held[i])
            found = True
    return found


@njit(cache=True)
def _turned(elements, mode, v):
    """Whether an element that slides has come to turn."""
    for i in range(elements.shape[0]):
        if int(elements[i, 0]) == COULOMB and mode[i] * _apart(elements[i], v) < 0.0:
            return True
    return False


@njit(cache=True)
def _rubbing(t, h, state, other, first, on, mode, system, work, past, held, room, spare):
    """One step with dry friction, from event to event; `state` is moved."""
    elements = system[9]
    x, v, z = state
    left, no = h, h < 0.0
    for _ in range(_EVENTS):
        rates(t, x, v, z, on, mode, system, work, past, first[0], first[1], held, spare, no)
        if _let_go(elements, mode, held):
            rates(t, x, v, z, on, mode, system, work, past, first[0], first[1], held, spare, no)
        _step(t, left, state, other, first, on, mode, system, work, past, held, room, spare)
        size = left
        if _turned(elements, mode, other[1]):
            low, high = 0.0, left
            while high - low > 1e-12 + 1e-9 * h:
                size = 0.5 * (low + high)
                _step(t, size, state, other, first, on, mode, system, work, past, held, room, spare)
                if _turned(elements, mode, other[1]):
                    high = size
                else:
                    low = size
            size = high
            _step(t, size, state, other, first, on, mode, system, work, past, held, room, spare)
        for k in range(3):
            for i in range(state[k].size):
                state[k][i] = other[k][i]
        for i in range(elements.shape[0]):
            if int(elements[i, 0]) == COULOMB:
                speed = _apart(elements[i], v)
                if mode[i] * speed < 0.0:
                    v[int(elements[i, 1])] -= speed
                    mode[i] = 0.0
        t += size
        left -= size
        if left <= 1e-13:
            return


@njit(cache=True)
def simulate(system, stops, longest, inner, delayed):
    """Motion from rest.

    Args:
        system: the tuple that `equations.rates` takes.
        stops: (m,) s, ascending; every edge of a blow is among them, and every corner of its rise.
        longest: s, no step is longer.
        inner: how many inner states there are.
        delayed: the coordinate whose past is kept, or -1.

    Returns:
        (m - 1, 3, 13 + joints): what `rates` writes just after a stop, half-way to the next, and
        just before it; the accelerometer and the displacement are not yet less their rest values.
    """
    hold, joints, elements, blows = system[5], system[8], system[9], system[11]
    n = hold.size
    work = workspace(system[0][0].size)
    out = np.empty((stops.size - 1, 3, OUTPUTS + joints.shape[0]))
    state = (np.zeros(n), np.zeros(n), np.zeros(inner))
    other = (np.zeros(n), np.zeros(n), np.zeros(inner))
    first = (np.zeros(n), np.zeros(inner))
    room = (
        np.zeros(n), np.zeros(inner), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n),
        np.zeros(n), np.zeros(n), np.zeros(inner), np.zeros(inner), np.zeros(inner),
    )  # fmt: skip
    x, v, z = state
    a1, d1 = first
    on = np.zeros(blows.shape[0], np.bool_)
    mode, held = np.zeros(elements.shape[0]), np.zeros(elements.shape[0])
    rough = False
    for i in range(elements.shape[0]):
        rough = rough or int(elements[i, 0]) == COULOMB
    spare = np.empty(OUTPUTS + joints.shape[0])
    kept = 1
    if delayed >= 0:
        kept = int((stops[-1] - stops[0]) / longest) + 8 * stops.size
    past = (np.empty(kept), np.empty(kept), np.zeros(1, np.int64))
    yes = n > 0  # no literals: each would compile `rates` once more
    for s in range(stops.size - 1):
        start, end = stops[s], stops[s + 1]
        centre = 0.5 * (start + end)
        for i in range(blows.shape[0]):
            on[i] = blows[i, 0] < centre < blows[i, 0] + blows[i, 1]
        steps = max(1, int(np.ceil(0.5 * (end - start) / longest - 1e-9)))
        h = 0.5 * (end - start) / steps
        for k in range(2 * steps):
            t = start + k * h
            if delayed >= 0 and past[2][0] < kept:
                past[0][past[2][0]], past[1][past[2][0]] = t, x[delayed]
                past[2][0] += 1
            write = k == 0 or k == steps
            row = out[s, 0] if k == 0 else out[s, 1] if k == steps else spare
            rates(t, x, v, z, on, mode, system, work, past, a1, d1, held, row, write)
            if rough:
                if write and _let_go(elements, mode, held):
                    rates(t, x, v, z, on, mode, system, work, past, a1, d1, held, row, write)
                _rubbing(t, h, state, other, first, on, mode, system, work, past, held, room, spare)
                continue
            _step(t, h, state, other, first, on, mode, system, work, past, held, room, spare)
            for i in range(n):
                x[i], v[i] = other[0][i], other[1][i]
            for i in range(inner):
                z[i] = other[2][i]
        rates(end, x, v, z, on, mode, system, work, past, a1, d1, held, out[s, 2], yes)
    return out
