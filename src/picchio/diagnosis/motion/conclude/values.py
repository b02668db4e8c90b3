"""Fitted numbers in the units that people expect: causes, and nuisances."""

from __future__ import annotations

import math

import numpy as np

from picchio.diagnosis.motion.data.system import System
from picchio.diagnosis.motion.fit.least_squares import Fit
from picchio.diagnosis.motion.fit.state import with_coordinate
from picchio.diagnosis.result import Correlation, Value, unit_of
from picchio.model.effects.effect import Effect
from picchio.robot.units import SLIDING

_POSES = 50


def parameters(system: System, current: Fit, effect: Effect) -> dict[str, Value]:
    """The parameters of an effect that were fitted, and what follows from them."""
    robot, number = system.robot, current.state.every.index(effect)
    std = {
        c.name: float(s)
        for c, s in zip(current.coordinates, current.std, strict=True) if c.index == number
    }  # fmt: skip
    found: dict[str, Value] = {}
    for p in effect.parameters:
        if p.name not in std and p.name != "order":
            continue
        # An order that is locked to the motor's turn has no spread.
        value, spread = effect.values[p.name], std.get(p.name, 0.0)
        if p.name in effect.inverse:
            spread *= value**2
        found[p.name] = Value(float(value), spread, unit_of(robot, effect.target, p.unit))
    index = [i for i, c in enumerate(current.coordinates) if c.index == number]
    block, here = current.covariance[np.ix_(index, index)], effect.follows(robot)
    slopes = dict.fromkeys(here, np.zeros(0))
    for c in (current.coordinates[i] for i in index):
        moved = with_coordinate(effect, c.name, c.value + c.step).follows(robot)
        for name, (value, _) in here.items():
            slopes[name] = np.append(slopes[name], (moved[name][0] - value) / c.step)
    for name, (value, unit) in here.items():
        spread = math.sqrt(max(float(slopes[name] @ block @ slopes[name]), 0.0))
        found[name] = Value(value, spread, unit)
    if "scale" in effect.inverse and "scale" in found:
        stated = dict(zip(robot.flexible_names, robot.stiffness, strict=True))
        documented = float(stated[effect.target])
        unit = unit_of(robot, effect.target, "N*m/rad")
        scale = found["scale"]
        found["stiffness"] = Value(scale.value * documented, scale.std * documented, unit)
    joint = robot.tree.joints.get(effect.target)
    if effect.periodic and joint is not None and joint.units is SLIDING:
        # A slide does not turn: what repeats, repeats along its way.
        order, ratio = found["order"], system.predictors[0].nominal.gear_ratio[effect.target]
        length = 2.0 * math.pi / (order.value * ratio)
        found["period"] = Value(length, length * order.std / order.value, "m")
    if effect.periodic and {"cosine", "sine"} <= found.keys():
        cosine, sine = found["cosine"], found["sine"]
        size = math.hypot(cosine.value, sine.value)
        spread = math.hypot(cosine.value * cosine.std, sine.value * sine.std) / max(size, 1e-300)
        found["amplitude"] = Value(size, spread, cosine.unit)
    return found


def correlation(current: Fit) -> Correlation:
    """How the parameters of a fit's effects hang together, stated frictions included.

    Args:
        current: the fit.

    Returns:
        correlation coefficients by effect, target and parameter.
    """
    kept = [k for k, c in enumerate(current.coordinates) if c.index >= 0]
    acting = [(current.state.every[c.index], c.name) for c in current.coordinates if c.index >= 0]
    sign = np.array([-1.0 if name in effect.inverse else 1.0 for effect, name in acting])
    names = [(effect.name, effect.target, name) for effect, name in acting]
    return Correlation.of(names, current.covariance[np.ix_(kept, kept)] * np.outer(sign, sign))


def nuisances(system: System, current: Fit) -> dict[str, Value]:
    """Inertias and stated frictions as fitted."""
    found: dict[str, Value] = {}
    inertia = mean_inertia(system)
    for c, std in zip(current.coordinates, current.std, strict=True):
        if c.index < 0:
            size = inertia[c.name]
            unit = unit_of(system.robot, c.name, "kg*m^2")
            found[f"inertia.{c.name}"] = Value(c.value * size, float(std) * size, unit)
        elif c.index < len(current.state.nuisances):
            effect = current.state.nuisances[c.index]
            unit = next(p.unit for p in effect.parameters if p.name == c.name)
            found[f"{effect.name}.{effect.target}"] = Value(
                c.value, float(std), unit_of(system.robot, effect.target, unit)
            )
    return found


def mean_inertia(system: System) -> dict[str, float]:
    """Joint -> the mass matrix's diagonal, mean over the poses of the records."""
    robot, total = system.robot, []
    for predictor in system.predictors:
        angle = predictor.nominal.angle
        step = max(1, predictor.log.samples // _POSES)
        poses = np.column_stack(
            [
                angle[j]
                if j in angle
                else np.full(predictor.log.samples, predictor.log.standing.get(j, 0.0))
                for j in robot.joint_names
            ]
        )[::step]
        total.append(np.mean([np.diag(robot.rigid.mass_matrix(q.copy())) for q in poses], axis=0))
    return dict(zip(robot.joint_names, np.mean(total, axis=0).tolist(), strict=True))
