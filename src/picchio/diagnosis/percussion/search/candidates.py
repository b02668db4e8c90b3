"""Which effects could be at work in these records, and of what size they would matter."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.model.effects.effect import Effect
from picchio.model.effects.registry import catalogue
from picchio.model.effects.scales import Scales
from picchio.model.expansion import BASE_AXES

# What a group of channels must be for a sensor effect to make sense there.
_AXES_ONLY = ("sensor_axes", "sensor_misalignment")
_VECTOR = ("acceleration", "accelerometer", "velocity", "displacement")
_MOUNTED = ("accelerometer", "acceleration")


def candidate_targets(problem: Problem, effect: type[Effect]) -> list[str]:
    """The targets that an effect can have on this robot, in these records."""
    robot = problem.robot
    kind = effect.target_kind
    if effect.where == "motion":
        return []
    if effect.name == "stiffness_drift" and _spread(problem, "days") <= 0.0:
        return []
    if effect.name == "thermal_stiffness" and _spread(problem, "temperature") <= 0.0:
        return []
    if effect.name in ("force_drift", "pulse_jitter", "missed_hits") and not _bursts(problem):
        return []
    if kind in ("joint", "joint or link"):
        names = list(robot.flexible_names)
        if effect.name == "transverse_compliance":
            names = [j.name for j in robot.flexible_joints if j.kind == "revolute"]
        return names
    if kind == "link":
        links = [
            robot.tree.joints[name].child for name in robot.joint_names if name in robot.tree.joints
        ]
        if effect.name == "link_mass":
            return [link for link in links if robot.tree.links.get(link) is not None]
        return links
    if kind == "axis":
        return list(BASE_AXES)
    if kind == "channel group":
        groups = [g for g in problem.groups if g != "force"]
        if effect.name in _AXES_ONLY:
            groups = [g for g in groups if g.split(".")[0] in _VECTOR]
        if effect.name == "mount_resonance":
            groups = [g for g in groups if g.split(".")[0] in _MOUNTED]
        if effect.name in ("sensor_gain", "sensor_delay") and "force" in problem.groups:
            groups.append("force")
        return groups
    return ["robot"] if kind == "robot" else ["tool"]


def _spread(problem: Problem, name: str) -> float:
    values = [getattr(r.setup.conditions, name) for r in problem.records]
    known = [v for v in values if v is not None]
    return float(np.ptp(known)) if len(known) == len(values) else 0.0


def _bursts(problem: Problem) -> bool:
    return any(r.setup.blows.start.size > 1 and not r.setup.steady for r in problem.records)


def all_candidates(problem: Problem, without: Iterable[str] = ()) -> list[tuple[type[Effect], str]]:
    """Every (effect, target) that could be at work.

    Args:
        problem: robot and records.
        without: names of effects to leave out.
    """
    left_out = set(without)
    return [
        (effect, target)
        for name, effect in catalogue().items()
        if name not in left_out
        for target in candidate_targets(problem, effect)
    ]


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
