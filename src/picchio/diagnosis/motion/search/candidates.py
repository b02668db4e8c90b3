"""What might be wrong: every effect of the catalogue at every place where it can act."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.diagnosis.motion.data.system import System
from picchio.diagnosis.motion.fit.least_squares import Fit, clean, jacobian
from picchio.diagnosis.motion.fit.orders import find_orders
from picchio.diagnosis.motion.fit.state import Coordinate, with_coordinate
from picchio.model.effects.effect import Effect
from picchio.model.effects.evidence import Evidence
from picchio.model.effects.registry import catalogue, effect_class
from picchio.model.motion import TORQUE, WINDUP
from picchio.prediction.motion.readings import Around
from picchio.robot.units import SLIDING

# Over less of a turn than this, sine, cosine and angle are nearly a straight line.
_SWEPT = 1.0  # rad


@dataclass(frozen=True, eq=False)
class Candidate:
    """An effect to be tried: it starts as nothing, with what is searched for set.

    Attributes:
        effect: at its neutral values, its nonlinear ones set.
        columns: (rows, c) what the data would change by.
        coordinates: those of the columns.
        neutral: (c,) where nothing changes.
        searched: how many parameters were searched for.
        noise: power of a sample's noise as a line sees it; None of what is no line.
    """

    effect: Effect
    columns: FloatArray
    coordinates: list[Coordinate]
    neutral: FloatArray
    searched: int = 0
    noise: float | None = None

    @property
    def label(self) -> tuple[str, str]:
        """Effect and target."""
        return self.effect.name, self.effect.target

    def started(self, values: tuple[float, ...]) -> Effect:
        """The effect at values of its coordinates."""
        effect = self.effect
        for c, value in zip(self.coordinates, values, strict=True):
            effect = with_coordinate(effect, c.name, float(np.clip(value, c.lower, c.upper)))
        return effect


def motion_effects(without: Collection[str] = ()) -> dict[str, type[Effect]]:
    """Those of the catalogue that change a motion record, less some by name."""
    return {
        name: kind for name, kind in catalogue().items()
        if kind.shows(motion=True) and name not in without
    }  # fmt: skip


def evidence_of(system: System) -> Evidence:
    """What motion records can show."""
    groups = {group for log in system.logs for group in log.group.values()}
    groups |= {"position" for log in system.logs if log.link}
    groups |= {TORQUE for log in system.logs if log.torque}
    return Evidence(
        robot=system.robot,
        motion=True,
        groups=tuple(sorted(groups)),
        driven=tuple(joint for kind, joint in system.groups if kind == TORQUE),
        unposed=tuple(j for kind, j in system.groups if kind == TORQUE and j in system.unposed),
        wound=tuple(joint for kind, joint in system.groups if kind == WINDUP),
        swept=tuple(
            dict.fromkeys(
                joint
                for log in system.logs
                for joint in log.moving
                if np.ptp(log.angle[joint]) > _SWEPT
                and system.robot.tree.joints[joint].units is not SLIDING
            )
        ),
    )


def candidates(
    system: System, base: Fit, kinds: dict[str, type[Effect]], near: str | None = None
) -> list[Candidate]:
    """Everything that may be added to a fit.

    Args:
        system: the training equations.
        base: the fit.
        kinds: the catalogue.
        near: only what acts at this target, or on more than a joint.
    """
    held = base.state.held
    taken = {(e.name, e.target) for i, e in enumerate(base.state.every) if i not in held}
    predicted = system.measured - base.residual
    around = system.around(base.state.every)
    found: list[Candidate] = []
    evidence = evidence_of(system)
    for name in sorted(kinds, key=usual):
        kind = kinds[name]
        for target in kind.applies(evidence):
            if near not in (None, target) and kind.target_kind == "joint":
                continue
            if kind.periodic:
                for order, noise in find_orders(system, base.residual, target, base.state):
                    effect = kind(target, order=order)
                    made = _make(system, base, predicted, effect, {"order"}, around)
                    found += [replace(each, noise=noise) for each in made]
            elif (name, target) not in taken and (not kind.needs or (kind.needs, target) in taken):
                for effect, set_ in _starts(system, base, kind, target):
                    found += _make(system, base, predicted, effect, set_, around)
    return found


def usual(name: str) -> tuple[int, str]:
    """Where an effect stands among those that explain the same."""
    return (effect_class(name).usual, name)


def _starts(
    system: System, base: Fit, kind: type[Effect], target: str
) -> list[tuple[Effect, set[str]]]:
    """Where an effect is tried from, and which of its parameters are set there.

    One that refines another stands in its place, at the values that they share: those are in the
    base, and are not scored again.
    """
    if kind.refines and effect_class(kind.refines).shows(motion=True):
        coarse = [e for e in base.state.effects if (e.name, e.target) == (kind.refines, target)]
        return [(kind(target, **e.values), set(e.values)) for e in coarse]
    return [(kind(target, **trial), set(trial)) for trial in _trials(system, kind, target)]


def _trials(system: System, kind: type[Effect], target: str) -> list[dict[str, float]]:
    if kind.target_kind != "joint":
        return kind(target).motion_trials(system.predictors[0].nominal)
    moving = [p for p in system.predictors if target in p.log.moving]
    if not moving:
        return []
    fastest = max(moving, key=lambda p: float(np.abs(p.nominal.velocity[target]).max()))
    return kind(target).motion_trials(fastest.nominal)


def _make(system: System, base: Fit, predicted: FloatArray, effect: Effect,
          searched: set[str], around: list[Around]) -> list[Candidate]:  # fmt: skip
    """Derivatives at nothing, by what is not searched for."""
    state = base.state.with_effect(effect)
    coordinates = state.numbers(system, state.every.index(effect))
    if effect.inverse:
        # Nothing is an infinite stiffness; the column is what the nominal one does.
        changed = system.predict(state.every, state.scales, effect, predicted)
        columns = clean(system, changed - predicted)[:, None]
        kept = [c for c in coordinates if c.name in effect.inverse]
        return [Candidate(effect, columns, kept, np.zeros(1))] if np.any(columns) else []
    varied = [c for c in coordinates if c.name not in searched]
    kept, columns = jacobian(system, state, predicted, varied, around)
    if not kept:
        return []
    tried = 0 if effect.refines else len(searched)
    return [Candidate(effect, columns, kept, np.array([c.value for c in kept]), tried)]
