"""Ripple as a clock: its phase tells by how much torques and angles are stamped apart.

A ripple of some hundred cycles a turn shifts its phase by a radian within a few milliseconds of
delay, more at higher speed. Where several speeds were driven, one delay makes all of them agree.
"""

from __future__ import annotations

import numpy as np

from picchio.diagnosis.motion.data.system import System
from picchio.diagnosis.motion.fit.least_squares import Fit, fit, len_of
from picchio.diagnosis.motion.fit.state import State
from picchio.model.effects.effect import Effect
from picchio.model.motion import RIPPLE, TORQUE

_FINEST = 0.25  # of the shortest period of a ripple
_LONGEST = 0.02  # s
_LEAST = 5.0  # log-likelihood


def time_by_ripple(system: System, current: Fit, delay: type[Effect]) -> Fit:
    """The fit with a delay of torques or angles, where that makes ripples agree.

    Args:
        system: the training equations.
        current: a fit with ripples in it.
        delay: the effect's class.
    """
    state = current.state
    rippling = {e.target for e in state.effects if e.periodic}
    # Above the band where there is such; a band up to the highest frequencies has it all.
    groups = [(RIPPLE, joint) for joint in rippling if (RIPPLE, joint) in system.groups]
    groups += [
        (TORQUE, joint) for joint in rippling
        if (RIPPLE, joint) not in system.groups and (TORQUE, joint) in system.groups
    ]  # fmt: skip
    if not groups or any(e.name == delay.name for e in state.every):
        return current
    angles = {log.group[joint] for log in system.logs for _, joint in groups if joint in log.group}
    if len(angles) != 1:
        return current
    period = _shortest_period(system, state)
    steps = int(_LONGEST / (_FINEST * period))
    best: tuple[float, State] | None = None
    pieces = _pieces(system, state, groups)
    before = _left(pieces, 0.0)
    for number in range(-steps, steps + 1):
        late = number * _FINEST * period
        after = _left(pieces, late)
        cost = _gain(system, current, before, after, groups)
        if number and (best is None or cost > best[0]):
            target = TORQUE if late > 0.0 else next(iter(angles))
            best = (cost, state.with_effect(delay(target, delay=abs(late))))
    if best is None or best[0] < _LEAST:
        return current
    return fit(system, best[1])


def _shortest_period(system: System, state: State) -> float:
    fastest = 1.0
    for effect in (e for e in state.effects if e.periodic):
        for nominal in (p.nominal for p in system.predictors if effect.target in p.log.moving):
            speed = float(np.abs(nominal.velocity[effect.target]).max())
            turns = effect.values["order"] * nominal.gear_ratio[effect.target]
            fastest = max(fastest, speed * turns / (2.0 * np.pi))
    return 1.0 / fastest


def _pieces(system: System, state: State, groups: list) -> list:
    """Of each joint: its ripples' orders, and angle, velocity and measured ripple of records."""
    found = []
    others = tuple(e for e in state.every if not e.periodic)
    target = system.measured - system.predict(others, state.scales)
    for group in groups:
        joint = group[1]
        orders = [
            e.values["order"] * system.predictors[0].nominal.gear_ratio[joint]
            for e in state.effects if e.periodic and e.target == joint
        ]  # fmt: skip
        parts = []
        for s in system.of(group):
            nominal = system.predictors[s.record].nominal
            parts.append((nominal.angle[joint][s.samples], nominal.velocity[joint][s.samples],
                          target[s.rows]))  # fmt: skip
        found.append((group, orders, parts))
    return found


def _left(pieces: list, late: float) -> dict:
    """Group -> power that its ripples leave, with torques late by `late` s."""
    left = {}
    for group, orders, parts in pieces:
        columns, values = [], []
        for angle, velocity, measured in parts:
            phase = np.outer(angle - late * velocity, orders)
            columns.append(np.hstack([np.cos(phase), np.sin(phase)]))
            values.append(measured)
        x, y = np.vstack(columns), np.concatenate(values)
        solution = np.linalg.lstsq(x.T @ x, x.T @ y, rcond=1e-10)[0]
        left[group] = float(y @ y - solution @ (x.T @ y))
    return left


def _gain(system: System, current: Fit, before: dict, after: dict, groups: list) -> float:
    return sum(
        0.5 * len_of(system, g) / current.correlation[g] * np.log(before[g] / after[g])
        for g in groups
    )  # fmt: skip
