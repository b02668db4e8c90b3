"""Which effects could be at work in these records, and of what size they would matter."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import partial

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.workers import worker_count
from picchio.diagnosis.attempt import attempt
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.model.effects.effect import Effect
from picchio.model.effects.evidence import Evidence
from picchio.model.effects.registry import catalogue
from picchio.model.effects.scales import Scales

_MOMENT = 0.06  # s


def evidence_of(problem: Problem) -> Evidence:
    """What a campaign's percussion records can show."""
    channels = {c.group: c.kind for r in problem.records for c in r.setup.channels}
    blows = [r.setup.blows for r in problem.records]
    return Evidence(
        robot=problem.robot,
        groups=tuple(g for g in problem.groups if not channels[g].of_force),
        vectors=frozenset(g for g, kind in channels.items() if kind.axes),
        accelerations=frozenset(g for g, kind in channels.items() if kind.derivative == 2),
        forces=tuple(g for g in problem.groups if channels[g].of_force),
        bursts=any(b.start.size > 1 and b.period is None for b in blows),
        recorded=problem.recorded,
        reshaped=any(b.other is not None for b in blows),
        days=_spread(problem, "days"),
        kelvin=_spread(problem, "temperature"),
    )


def _spread(problem: Problem, name: str) -> float:
    values = [getattr(r.setup.conditions, name) for r in problem.records]
    known = [v for v in values if v is not None]
    return float(np.ptp(known)) if len(known) == len(values) else 0.0


def all_candidates(problem: Problem, without: Iterable[str] = ()) -> list[tuple[type[Effect], str]]:
    """Every (effect, target) that could be at work.

    Args:
        problem: robot and records.
        without: names of effects to leave out.
    """
    left_out, evidence = set(without), evidence_of(problem)
    return [
        (effect, target)
        for name, effect in catalogue().items()
        if name not in left_out and not effect.refines
        for target in effect.applies(evidence)
    ]


def finer_candidates(
    problem: Problem, without: Iterable[str] = ()
) -> list[tuple[type[Effect], str]]:
    """Every (effect, target) that tells another one with more numbers (`Effect.refines`).

    Such an effect is not screened; it is tried in the place of the other one where that is found.

    Args:
        problem: robot and records.
        without: names of effects to leave out.
    """
    left_out, evidence = set(without), evidence_of(problem)
    return [
        (effect, target)
        for name, effect in catalogue().items()
        if effect.refines and name not in left_out and effect.shows(motion=False)
        for target in effect.targets(evidence)
    ]


def not_looked_for(problem: Problem) -> dict[str, str]:
    """Effects that these records cannot show, and why.

    Args:
        problem: robot and records.

    Returns:
        name -> one clause.
    """
    evidence = evidence_of(problem)
    return {
        name: why
        for name, effect in catalogue().items()
        if effect.shows(motion=False) and not effect.refines and (why := effect.why_not(evidence))
    }


def measure_scales(
    problem: Problem, effects: Sequence[Effect], predictions: Sequence[Mapping[str, FloatArray]]
) -> Scales:
    """Sizes of deflections, torques and readings under the baseline."""
    robot, records = problem.robot, problem.records
    model = problem.model.with_effects(effects)
    names = robot.flexible_names
    peak, rate = np.zeros(len(names)), np.zeros(len(names))
    inertia, gravity, stiffness = np.zeros(len(names)), np.full(len(names), np.inf), None
    compliance, travel, force = [], 0.0, 0.0
    links: dict[str, list[float]] = {}
    for record in records:
        setup = record.setup
        geometry = setup.geometry
        stiffness = geometry.stiffness
        system, motion = setup._motion(model, setup.samples)
        deflection = system.deflections @ motion.position.T
        peak = np.maximum(peak, np.abs(deflection).max(axis=1))
        rate = np.maximum(rate, np.abs(system.deflections @ motion.velocity.T).max(axis=1))
        inertia += system.mass.diagonal()[: len(names)] / len(records)
        gravity = np.minimum(gravity, np.abs(geometry.gravity_torque))
        inverse = np.linalg.inv(system.stiffness)
        compliance.append(float(system.force @ inverse @ system.force))
        travel = max(travel, float(np.abs(motion.position @ system.force).max()))
        force = max(force, float(np.abs(setup.blows.height).max()))
        for name in names:
            joint = robot.tree.joints.get(name)
            if joint is None:
                continue
            jacobian = geometry.motion(joint.child).jacobian[:3][:, list(system.taken)]
            soft = np.linalg.eigvalsh(jacobian @ inverse @ jacobian.T).max()
            links.setdefault(joint.child, []).append(float(soft))
    reading: dict[str, tuple[float, float]] = {}
    for group in problem.groups:
        rows = [
            p[c.name]
            for p, r in zip(predictions, records, strict=True)
            for c in r.setup.channels
            if c.group == group
        ]
        squares = float(np.sqrt(np.mean([np.mean(row**2) for row in rows])))
        reading[group] = (squares, float(max(np.abs(row).max() for row in rows)))
    blows = records[0].setup.blows
    return Scales(
        stiffness=dict(zip(names, stiffness if stiffness is not None else [], strict=True)),
        inertia=dict(zip(names, inertia, strict=True)),
        deflection=dict(zip(names, np.maximum(peak, 1e-9), strict=True)),
        rate=dict(zip(names, rate, strict=True)),
        gravity=dict(zip(names, gravity, strict=True)),
        mass=robot.rigid.total_mass(),
        compliance=float(np.mean(compliance)),
        travel=max(travel, 1e-9),
        force=force,
        period=blows.interval,
        width=blows.width or 0.1 * blows.interval,
        days=_spread(problem, "days"),
        kelvin=_spread(problem, "temperature"),
        reading=reading,
        step=records[0].setup.samples.step,
        link_stiffness={
            link: float(1.0 / np.mean(values))
            for link, values in links.items()
            if np.mean(values) > 0.0
        },
    )


def warm_up(problem: Problem, candidates: Sequence[tuple[type[Effect], str]]) -> None:
    """Predict a moment of one record with every effect once, where there will be processes.

    Compiled kernels and libraries come with it. Processes are forked anew for every round of a
    search: what this one has not loaded each of them would load again.

    Args:
        problem: data and noise.
        candidates: effects and targets.
    """
    if worker_count(problem.workers) < 2:
        return
    nominal = Hypothesis.nominal(problem)
    scales = measure_scales(problem, nominal.effects, problem.predictions(nominal.effects))
    first = dict(reversed(candidates))
    for kind, target in first.items():
        effect = next(iter(kind(target).tried_at(scales)), kind(target))
        attempt(effect.label, partial(_predict_a_moment, problem, nominal, effect))


def _predict_a_moment(problem: Problem, nominal: Hypothesis, effect: Effect) -> None:
    problem.own_residuals(nominal.plus(effect).effects, problem.records[:1], _MOMENT)
