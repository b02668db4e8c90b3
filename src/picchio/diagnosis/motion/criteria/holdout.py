"""Causes must hold on records that were not fitted to, in their own channels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

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

Powers = dict[tuple[str, str], tuple[float, float]]  # file and channel -> without, with

_TINY = 1e-300
_LITTLE = 0.05
_WORSE = 1.01  # error after over error before: less is no loss worth a cause


def validate(
    train: System, held_out: System, current: Fit, before: State
) -> tuple[Fit, list[tuple[Effect, dict[str, float]]]]:
    """The fit without causes that lose on records held out, and those causes.

    What tells another cause with more numbers gives way to that one unless it predicts better.
    Where two or more records are held out, a cause has to gain on each. In any case one that is
    everywhere or nowhere has to gain in each of its channels, and no cause stays that loses in a
    channel that is predicted worse than without any cause.

    Args:
        train: the equations fitted to.
        held_out: those of the records held out.
        current: the fit.
        before: the nominal model's state.
    """
    current, dropped = _coarser(train, held_out, current)
    while current.state.effects:
        powers = _powers(train, held_out, current)
        gains = [_gains(each, lambda file, channel: file) for each in powers]
        failing = [
            i for i, (effect, found) in enumerate(zip(current.state.effects, gains, strict=True))
            if (len(held_out.logs) > 1 and _fails(found, effect.periodic))
            or (effect.everywhere and min(_gains(powers[i], _channel).values(), default=0.0) < 0.0)
        ]  # fmt: skip
        if not failing:
            break
        # Ripples hardly touch each other and go together; others one by one, first what is of least
        # use on the whole: beside it others may lose a little that they gain without it.
        gone = [i for i in failing if current.state.effects[i].periodic]
        others = [i for i in failing if i not in gone]
        if others:
            gone.append(min(others, key=lambda i: sum(gains[i].values())))
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
    scale = row_weights(held_out, {g: current.level.get(g, 1.0) for g in held_out.groups})
    for index, effect in enumerate(current.state.effects):
        kind = effect_class(effect.refines) if effect.refines else None
        if kind is None or not kind.shows(motion=True):
            continue
        shared = {p.name: effect.values[p.name] for p in kind.parameters}
        effects = list(current.state.effects)
        effects[index] = kind(effect.target, **shared)
        other = fit(train, replace(current.state, effects=tuple(effects)))
        powers: Powers = {}
        left = [
            (held_out.measured - held_out.predict(state.every, state.scales)) * scale
            for state in (other.state, current.state)
        ]
        for s in held_out.segments:
            without, beside = (float(each[s.rows] @ each[s.rows]) for each in left)
            powers[held_out.logs[s.record].file, ".".join(s.group)] = without, beside
        gains = _gains(powers, lambda file, channel: file)
        if sum(gains.values()) <= 0.0:
            dropped.append((effect, gains))
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
                i for i, found in enumerate(gains) if found.get(channel, 0.0) < 0.0
                and sum(_gains(powers[i], lambda file, channel: file).values()) <= 0.0
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


def _fails(gains: dict[str, float], ripple: bool) -> bool:
    """A cause must gain on every record; a narrow line may lose a little on one of them."""
    if not gains:
        return False
    worst, mean = min(gains.values()), sum(gains.values()) / len(gains)
    return mean <= 0.0 or worst <= (-_LITTLE if ripple else 0.0)


def _channel(file: str, channel: str) -> str:
    return channel


def _gains(powers: Powers, key: Callable[[str, str], str]) -> dict[str, float]:
    """File or channel, as `key` has it -> part of the power that an effect takes away there."""
    sums: dict[str, list[float]] = {}
    for place, (without, beside) in powers.items():
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
            )
        powers.append(found)
    return powers
