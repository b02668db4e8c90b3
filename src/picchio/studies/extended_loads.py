"""One rivet's loads by a model with effects: other springs, other blows, nonlinear joints."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.excitation import PiecewiseForce
from picchio.model import Model
from picchio.model.blows import Blows
from picchio.model.elements import ElementKind
from picchio.model.geometry import Geometry
from picchio.model.system import VibratingSystem
from picchio.vibration import modal_analysis, response_from_rest, steady_state
from picchio.vibration.integrate import Samples, integrate
from picchio.vibration.response import RING_DOWN_LEVEL

if TYPE_CHECKING:
    from picchio.studies.task import Operation

# Samples of a nonlinear response, a period of the fastest mode that matters.
_PER_CYCLE = 40
_FINEST = 5e-5
_LONGEST_RING = 20.0


class ExtendedRivet:
    """A rivet of an operation at a pose, by a model whose effects change the motion.

    Args:
        model: with its effects.
        operation: blows, direction, hits.
        pose: (nv,) rad or m.

    Attributes:
        stiffness: (n,) N m/rad, of the joints' springs.
        natural_frequencies: Hz, of the linear part; effects that let something else move add some.
    """

    def __init__(self, model: Model, operation: Operation, pose: FloatArray) -> None:
        self._model, self._operation = model, operation
        self._geometry = Geometry.of(model.robot, pose)
        self._rotation = self._geometry.motion(model.robot.tool_frame).rotation
        plant = model.plant(self._geometry)
        self.stiffness = np.array(list(plant.springs.values()))
        force, direction = self._force(operation.hits_per_rivet)
        self._system = plant.build(direction)
        self._burst, self._direction = force, direction
        self._modes = modal_analysis(self._system.linear())
        self.natural_frequencies = self._modes.natural_frequencies

    def _force(self, hits: int | None) -> tuple[PiecewiseForce, FloatArray]:
        operation = self._operation
        blows = Blows.of(operation.excitation, hits, operation.direction)
        blows = self._model.blows(blows.change(tool_rotation=self._rotation))
        return blows.force(), blows.direction

    def turning_points(self, *, steady: bool = False) -> list[FloatArray]:
        """Every joint's turning points, rad, as its spring's torque over its stiffness.

        Where the spring is not linear (backlash, hardening) this is the deflection of a linear
        spring under the same torque: what shaft and gear feel.

        Args:
            steady: of the steady state, else of the burst from rest.

        Raises:
            InputError: a mode without damping, a motion that does not become periodic.
        """
        force = self._force(None)[0] if steady else self._burst
        if not self._system.elements:
            if steady:
                response = steady_state(self._modes, force)
            else:
                response = response_from_rest(self._modes, force)
            return [value for _, value in response.turning_points(self._direction)]
        samples = self._samples(force)
        motion = integrate(self._system, force, samples)
        history = spring_torque(self._system, motion.position, self.stiffness)
        return [_turning(row / k) for row, k in zip(history, self.stiffness, strict=True)]

    def _samples(self, force: PiecewiseForce) -> Samples:
        fastest = float(self._modes.natural_frequencies[: len(self.stiffness)].max())
        step = max(1.0 / (_PER_CYCLE * fastest), _FINEST)
        if np.isfinite(force.end):
            count = max(int(np.ceil(force.end / step)), 64)
            return Samples(0.0, force.end / count, count + 1)
        slowest = -float(self._modes.poles.real.max())
        if slowest <= 0.0:
            raise InputError(
                "a mode has no damping: after the blows it rings for ever, and a rivet has no end",
                key="damping_ratio",
                value=0.0,
                hint="give the joints a damping ratio above 0",
            )
        ring = min(-float(np.log(RING_DOWN_LEVEL)) / slowest, _LONGEST_RING)
        return Samples(0.0, step, int((float(force.start[-1]) + ring) / step) + 1)


def spring_torque(
    system: VibratingSystem, position: FloatArray, stiffness: FloatArray
) -> FloatArray:
    """Torque of every joint's spring beyond what it carries at rest, N m.

    Args:
        system: gives the joints' deflections and nonlinear springs.
        position: (k, N) rad.
        stiffness: (n,) N m/rad.

    Returns:
        (n, k).
    """
    deflection = system.deflections @ position.T
    torque = stiffness[:, None] * deflection
    for element, row in zip(system.elements, system.rows, strict=True):
        joint = int(np.abs(system.deflections @ row).argmax())
        d, p = deflection[joint], element.parameters
        if element.kind == ElementKind.BACKLASH:
            total = d + p[2]
            beyond = total - np.clip(total, -0.5 * p[1], 0.5 * p[1])
            torque[joint] = torque[joint] - p[0] * d + p[0] * beyond - p[3]
        elif element.kind == ElementKind.CUBIC:
            torque[joint] = torque[joint] + p[0] * d**3
    return torque


def _turning(values: FloatArray) -> FloatArray:
    """First, last and every turning point between."""
    slope = np.sign(np.diff(values))
    moving = np.flatnonzero(slope)
    if not moving.size:
        return values[[0, -1]]
    turns = moving[1:][slope[moving[1:]] != slope[moving[:-1]]]
    return values[np.concatenate([[0], turns, [values.size - 1]])]
