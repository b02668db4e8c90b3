"""Causes must hold on records that were not fitted to, in their own channels."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from picchio.diagnosis.motion.criteria.score import contribution
from picchio.diagnosis.motion.data.system import Group, System
from picchio.diagnosis.motion.fit.least_squares import (
    Fit,
    difference,
    fit,
    row_weights,
    stable_solve,
)
from picchio.diagnosis.motion.fit.state import State
from picchio.model.effects.effect import Effect
from picchio.model.effects.registry import effect_class
from picchio.model.motion import RIPPLE

# File and channel -> what is left without and with an effect, in power; rows.
Powers = dict[tuple[str, str], tuple[float, float, int]]

_TINY = 1e-300
_LITTLE = 0.05
_WORSE = 1.01  # error after over error before: less is no loss worth a cause


def validate(
    train: System, held_out: System, current: Fit, before: State
) -> tuple[Fit, list[tuple[Effect, dict[str, float]]]]:
    """The fit without causes that lose on records held out, and those causes.

    What tells another cause with more numbers gives way to that one unless it predicts better.
    Where two or more records are held out, a cause has to gain on each; a short one is heard as
    far as it is long. In any case one that is everywhere or nowhere has to gain in each of its
    channels, and no cause stays that loses in a channel that is predicted worse than without any
    cause.

    Args:
        train: the equations fitted to.
        held_out: those of the records held out.
        current: the fit.
        before: the nominal model's state.
    """
    current, dropped = _coarser(train, held_out, current)

    def fails(effect: Effect, found: Powers) -> bool:
        by_record = len(held_out.logs) > 1 and _fails(found, effect.periodic)
        by_channel = _gains(found, _channel).values() if effect.everywhere else ()
        return by_record or min(by_channel, default=0.0) < 0.0

    while current.state.effects:
        powers = _powers(train, held_out, current)
        gains = [_gains(each, _file) for each in powers]
        failing = [i for i, e in enumerate(current.state.effects) if fails(e, powers[i])]
        if not failing:
            break
        # Ripples hardly touch each other and go together; others one by one, first what is of least
        # use on the whole: beside it others may lose a little that they gain without it.
        gone = [i for i in failing if current.state.effects[i].periodic]
        others = [i for i in failing if i not in gone]
        if others:
            gone.append(min(others, key=lambda i: _mean(powers[i])))
        state = current.state
        for i in sorted(gone, reverse=True):
            dropped.append((state.effects[i], gains[i]))
            state = state.without(i)
        current = fit(train, state, rounds=3)
    while current.state.effects:
        worse = _withdrawn(train, held_out, current, before)
        if not worse:
            break
        state = current.state
        for i, gain in sorted(worse.items(), reverse=True):
            dropped.append((state.effects[i], gain))
            state = state.without(i)
        current = fit(train, state, rounds=3)
    return current, dropped


def _coarser(
    train: System, held_out: System, current: Fit
) -> tuple[Fit, list[tuple[Effect, dict[str, float]]]]:
    """The fit with the simpler form of each effect whose finer one does not predict better."""
    dropped: list[tuple[Effect, dict[str, float]]] = []
    for index, effect in enumerate(current.state.effects):
        kind = effect_class(effect.refines) if effect.refines else None
        if kind is None or not kind.shows(motion=True):
            continue
        shared = {p.name: effect.values[p.name] for p in kind.parameters}
        other = fit(train, current.state.replaced(index, kind(effect.target, **shared)))
        powers = _compared(held_out, other.state, current)
        if _mean(powers) <= 0.0:
            dropped.append((effect, _gains(powers, _file)))
            current = other
    return current, dropped


def _withdrawn(
    train: System, held_out: System, current: Fit, before: State
) -> dict[int, dict[str, float]]:
    """The worst effect of each channel that is worse off: number -> its gains by channel."""
    groups = [g for g in worse_off(held_out, before, current.state) if g[0] != RIPPLE]
    effects = current.state.effects
    gone: dict[int, dict[str, float]] = {}
    powers = _powers(train, held_out, current) if groups else []
    gains = [_gains(each, _channel) for each in powers]
    for kind, joint in groups:
        channel = f"{kind}.{joint}"
        own = [i for i, e in enumerate(effects) if e.target == joint and e.target_kind == "joint"]
        if not own:
            # What acts in several joints loses in this one, and on the whole.
            own = [
                i for i, found in enumerate(gains)
                if found.get(channel, 0.0) < 0.0 and _mean(powers[i]) <= 0.0
            ]  # fmt: skip
        if own:
            worst = min(own, key=lambda i: gains[i].get(channel, 0.0))
            gone[worst] = gains[worst]
    return gone


def worse_off(system: System, before: State, after: State) -> list[Group]:
    """The groups of a system that `after` predicts worse than `before` does.

    Args:
        system: the equations of records held out.
        before: the nominal model's state.
        after: with causes.
    """
    power = [
        {g: sum(float(left[s.rows] @ left[s.rows]) for s in system.of(g)) for g in system.groups}
        for left in (
            system.measured - system.predict(state.every, state.scales) for state in (before, after)
        )
    ]
    return [g for g in system.groups if power[1][g] > _WORSE**2 * power[0][g]]


def _fails(powers: Powers, ripple: bool) -> bool:
    """A cause must gain on every record; a narrow line may lose a little on one of them.

    What a short record tells of the gain is little: it is pooled with what all say, by its part
    of a mean record's length.
    """
    if not powers:
        return False
    gains, rows, mean = _gains(powers, _file), _rows(powers), _mean(powers)
    full = sum(rows.values()) / len(rows)
    weight = {file: min(1.0, n / full) for file, n in rows.items()}
    worst = min(weight[file] * x + (1.0 - weight[file]) * mean for file, x in gains.items())
    return mean <= 0.0 or worst <= (-_LITTLE if ripple else 0.0)


def _rows(powers: Powers) -> dict[str, int]:
    rows: dict[str, int] = {}
    for (file, _), (*_, count) in powers.items():
        rows[file] = rows.get(file, 0) + count
    return rows


def _mean(powers: Powers) -> float:
    """The gain on a record, on the mean; each counts by its rows."""
    gains, rows = _gains(powers, _file), _rows(powers)
    return sum(rows[file] * x for file, x in gains.items()) / max(sum(rows.values()), 1)


def _file(file: str, channel: str) -> str:
    return file


def _channel(file: str, channel: str) -> str:
    return channel


def _gains(powers: Powers, key: Callable[[str, str], str]) -> dict[str, float]:
    """File or channel, as `key` has it -> part of the power that an effect takes away there."""
    sums: dict[str, list[float]] = {}
    for place, (without, beside, _) in powers.items():
        total = sums.setdefault(key(*place), [0.0, 0.0])
        total[0] += without
        total[1] += beside
    return {name: (a - b) / max(a, _TINY) for name, (a, b) in sums.items()}


def _powers(train: System, held_out: System, current: Fit) -> list[Powers]:
    """Of every effect, in its equations: what is left without it and with it, linearised.

    Without the effect everything else is fitted anew to the training records.

    Args:
        train: the equations fitted to.
        held_out: those of the records held out.
        current: the fit.
    """
    weight = row_weights(train, current.level)
    left = current.columns * weight[:, None]
    normal, right = left.T @ left, left.T @ (current.residual * weight)
    state = current.state
    predicted = held_out.predict(state.every, state.scales)
    slopes = [difference(held_out, state, c, predicted) for c in current.coordinates]
    columns = np.column_stack(slopes) if slopes else np.zeros((held_out.size, 0))
    residual = held_out.measured - predicted
    scale = row_weights(held_out, {g: current.level.get(g, 1.0) for g in held_out.groups})
    prior = np.array([c.precision for c in current.coordinates])
    powers: list[Powers] = []
    for index in range(len(state.effects)):
        own, part = contribution(current, index)
        rest = [i for i in range(len(current.coordinates)) if i not in own]
        target = right[rest] + normal[np.ix_(rest, own)] @ part
        step = stable_solve(normal[np.ix_(rest, rest)] + np.diag(prior[rest]), target)
        change = np.zeros(len(current.coordinates))
        change[own], change[rest] = part, -step
        found: Powers = {}
        for s in held_out.segments:
            if not np.any(columns[s.rows][:, own]):
                continue
            without = residual[s.rows] + columns[s.rows] @ change
            found[held_out.logs[s.record].file, ".".join(s.group)] = (
                float(np.sum((without * scale[s.rows]) ** 2)),
                float(np.sum((residual[s.rows] * scale[s.rows]) ** 2)),
                s.samples.size,
            )
        powers.append(found)
    return powers


def _compared(held_out: System, fewer: State, current: Fit) -> Powers:
    """What a state and a fit leave of the records held out."""
    scale = row_weights(held_out, {g: current.level.get(g, 1.0) for g in held_out.groups})
    states = (fewer, current.state)
    left = [held_out.measured - held_out.predict(x.every, x.scales) for x in states]
    found: Powers = {}
    for s in held_out.segments:
        without, beside = (float(np.sum((x[s.rows] * scale[s.rows]) ** 2)) for x in left)
        place = held_out.logs[s.record].file, ".".join(s.group)
        found[place] = without, beside, s.samples.size
    return found
