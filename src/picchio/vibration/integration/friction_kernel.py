"""Dry friction within a step, compiled: a joint is held still where the friction can hold it."""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import numpy as np
from numba import njit

COULOMB = 3
_FRICTION_SWEEPS = 4
_LOOKS = 80
_APART = 1e-8
_IDEAL = 2e-5  # rad/s, below which friction is taken as ideal


@njit(cache=True, nogil=True)
def _way(x, push, brake):
    """A primitive: over push^2 - brake^2 the time it takes x, where x' = push - brake tanh x."""
    near = push - brake if x > 0.0 else push + brake
    other = push + brake if x > 0.0 else push - brake
    return push * x + brake * (abs(x) + np.log(abs(near + other * np.exp(-2.0 * abs(x)))))


@njit(cache=True, nogil=True)
def _smooth_friction(before, free, gain, limit, smooth):
    """The mean over a step of limit tanh(rate / smooth), everything else pushing evenly.

    x = rate / smooth then follows x' = push - brake tanh x, whose time from one x to another is
    known; where it is after one step is found by Newton's method between two bounds.
    """
    change, brake = free - before, gain * limit
    if not brake > 0.0:
        return 0.0
    push = change
    if abs(abs(push) - brake) < _APART * brake:  # there the closed form is 0 / 0
        push *= 1.0 + 2.0 * _APART
    near = before / smooth
    rate = push - brake * np.tanh(near)
    x = near + rate / smooth
    if abs(push) < brake:
        far = np.arctanh(push / brake)  # where it would stay
        if abs(x - near) > 0.5 * abs(far - near):
            x = 0.5 * (near + far)
    else:
        far = near + (push + (brake if push > 0.0 else -brake)) / smooth
    start, across = _way(near, push, brake), push * push - brake * brake
    for _ in range(_LOOKS):
        late = (_way(x, push, brake) - start) / across - 1.0 / smooth
        if late > 0.0:
            far = x
        else:
            near = x
        new = x - late * (push - brake * np.tanh(x))
        if not min(near, far) < new < max(near, far):
            new = 0.5 * (near + far)
        moved = abs(new - x)
        x = new
        if moved <= 1e-11 * (1.0 + abs(x)):
            break
    mean = (change - (x * smooth - before)) / gain
    return min(max(mean, -limit), limit)


@njit(cache=True, nogil=True)
def _ideal_friction(before, free, gain, limit):
    """Mean and last value of ideal friction in a step, from the rate before and after it.

    A joint that slides towards rest comes to it within the step at `part`; from there it is held
    where friction can, or slides the other way. Without this the friction of a step in which the
    joint turns round would have the last part's sign all through, an impulse wrong by as much as
    the step is long. The rate is a straight line in each part.
    """
    change = free - before
    side = 1.0 if before > 0.0 else -1.0
    slope = change - side * gain * limit
    if before != 0.0 and (before + slope) * side > 0.0:
        return side * limit, side * limit  # it slides all through
    part = min(max(-before / slope, 0.0), 1.0) if before != 0.0 else 0.0
    if abs(change) <= gain * limit:
        mean = min(max(free / gain, -limit), limit)
        held = mean
        if part < 1.0:
            held = min(max((mean - side * limit * part) / (1.0 - part), -limit), limit)
        return mean, held
    last = limit if change > 0.0 else -limit
    return last * (1.0 - part) + side * limit * part, last


@njit(cache=True, nogil=True)
def stick(old, new, kinds, parameters, rows, kick, friction, last):
    """Dry friction of a step: it holds a joint still where it can, else it has its limit.

    `old` and `new` are the states before and after, (2N,), and `kick` (elements, 2N) what a unit
    of each element's friction all through the step adds; the mean over the step goes to
    `friction`, the value at its end to `last`, and `new` is moved by it.
    """
    n = rows.shape[1]
    friction[:] = 0.0
    for _ in range(_FRICTION_SWEEPS):
        for e in range(kinds.size):
            if kinds[e] != COULOMB:
                continue
            rate = 0.0
            gain = 0.0
            before = 0.0
            for j in range(n):
                before += rows[e, j] * old[n + j]
                rate += rows[e, j] * new[n + j]
                gain += rows[e, j] * kick[e, n + j]
            free = rate + gain * friction[e]  # the rate without this friction
            limit, smooth = parameters[e, 0], parameters[e, 1]
            if smooth <= _IDEAL:
                wanted, last[e] = _ideal_friction(before, free, gain, limit)
            else:
                wanted = _smooth_friction(before, free, gain, limit, smooth)
                last[e] = limit * np.tanh((free - gain * wanted) / smooth)
            change = wanted - friction[e]
            friction[e] = wanted
            for i in range(2 * n):
                new[i] -= change * kick[e, i]
