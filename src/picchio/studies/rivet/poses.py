"""What blows do to the joints at many poses: the one way from a model to many responses.

Compiled code where it can take the model (see `ManyPoses`), else pose by pose as `ModelAtPose`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from picchio.core.arrays import FloatArray
from picchio.core.processes import on_threads
from picchio.excitation.excitation import Excitation
from picchio.excitation.piecewise import PiecewiseForce
from picchio.fatigue.shaft_stress import stress_per_torque
from picchio.fatigue.sn.curve import SNCurve
from picchio.model.many_poses import ManyPoses
from picchio.model.model import Model
from picchio.studies.rivet.life_rules import RainflowRule
from picchio.studies.rivet.pose import ModelAtPose, Rivet
from picchio.studies.tasks import Operation
from picchio.vibration.batch.peaks import BatchPeaks, batch_peaks
from picchio.vibration.closed_form.response import unit_vector


@dataclass(frozen=True, eq=False)
class BatchDamage:
    """One rivet from rest, ring-down included, at p poses of n joints.

    Attributes:
        natural_frequencies: (p, n) Hz; NaN where the mass matrix is not positive definite.
        lowest: (p, n) rad, smallest deflection.
        highest: (p, n) rad, largest deflection.
        stiffness: (p, n) N m/rad, of the joints there.
        damage: (p, n) Miner's sum; NaN for a joint without a curve.
        many: the model at the poses.
    """

    natural_frequencies: FloatArray
    lowest: FloatArray
    highest: FloatArray
    stiffness: FloatArray
    damage: FloatArray
    many: ManyPoses

    @property
    def amplitude(self) -> FloatArray:
        """(p, n) N m, half of the torque's largest range: rainflow's largest amplitude."""
        return 0.5 * self.stiffness * (self.highest - self.lowest)


def damage_at(
    model: Model,
    poses: FloatArray,
    direction: ArrayLike,
    excitation: Excitation,
    hits: int,
    curves: Sequence[SNCurve | None],
    *,
    compiled: bool = True,
) -> BatchDamage:
    """What one rivet does at many poses: the default method of `assess` without its report.

    Args:
        model: the robot and its effects.
        poses: (p, nv) rad or m, taken unchecked.
        direction: (3,) or (p, 3) unit vectors of the force, world.
        excitation: the blows.
        hits: of a rivet.
        curves: of the n joints; None without a shaft.
        compiled: False takes the path of `assess` throughout: the oracle.

    Raises:
        InputError: no hits, or a mode without damping.
    """
    force = model.force(excitation, hits)
    along = np.require(np.broadcast_to(direction, (len(poses), 3)), float, ("C", "W"))
    many = ManyPoses(model, poses)
    shape = many.stiffness.shape
    found = BatchDamage(
        np.full(shape, np.nan), np.full(shape, np.nan), np.full(shape, np.nan), many.stiffness,
        np.zeros(shape), many,
    )  # fmt: skip
    left = np.ones(len(poses), dtype=bool)
    if compiled and many.compiled:
        from picchio.studies.rivet.damage_kernel import SPAN, damages
        from picchio.vibration.batch.turning_kernel import FINE

        factor = stress_per_torque(model.robot.flexible_joints, 0.0)
        mass, jacobian = many.mass_and_jacobian()
        factors = np.tile(factor, (len(poses), 1))
        if any(curve is not None and curve.kind == "torque" for curve in curves):
            steady = factor * many.static_torque(excitation.preload, along)
            factors = factors * raised(curves, steady)
        here = np.arange(len(poses))
        on_threads(
            damages, len(poses), SPAN,
            *stacked([force]), mass, jacobian, np.zeros_like(here), here, many.stiffness,
            np.tile(many.damping_ratio, (len(poses), 1)), along, factors,
            *curve_tables(curves), found.natural_frequencies, found.lowest, found.highest,
            found.damage, FINE,
        )  # fmt: skip
        left = np.isnan(found.lowest[:, 0]) & ~np.isnan(found.natural_frequencies[:, 0])
    for s in np.flatnonzero(left):
        operation = Operation("", along[s], excitation, hits, poses[s : s + 1])
        _exactly(Rivet(model, operation, poses[s]), curves, found, int(s))
    found.damage[:, [curve is None for curve in curves]] = np.nan
    return found


def _exactly(rivet: Rivet, curves: Sequence[SNCurve | None], found: BatchDamage, s: int) -> None:
    """One pose by the path that takes every model."""
    found.natural_frequencies[s] = rivet.natural_frequencies
    found.stiffness[s] = rivet.stiffness
    joints = rivet.model.robot.flexible_joints
    hits = rivet.operation.hits_per_rivet
    for j, (joint, load) in enumerate(zip(joints, rivet.loads("rest", both=False), strict=True)):
        assert load.rest is not None
        found.lowest[s, j], found.highest[s, j] = load.rest.min(), load.rest.max()
        curve = curves[j]
        if curve is not None:
            found.damage[s, j] = RainflowRule()(joint, load, hits, curve).damage


def raised(curves: Sequence[SNCurve | None], steady: FloatArray) -> FloatArray:
    """What steady loads make of the amplitudes beside them: see `SNCurve.raised_by`.

    Args:
        curves: of the n joints.
        steady: (..., n) Pa of a shaft, share of its torque of a drive.
    """
    found = np.ones_like(steady)
    for j, curve in enumerate(curves):
        if curve is not None:
            found[..., j] = curve.raised_by(steady[..., j])
    return found


def stacked(
    forces: Sequence[PiecewiseForce],
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Bursts as the compiled code takes them: (b, m) each; empty pieces make them equally many.

    Args:
        forces: b of them.

    Returns:
        duration, constant, slope, amplitude and angular frequency, as of `PiecewiseForce`.
    """
    most = max(len(force.start) for force in forces)

    def column(name: str) -> FloatArray:
        rows = [getattr(force, name) for force in forces]
        blank = [np.zeros(most - len(row), row.dtype) for row in rows]
        return np.array(
            [np.concatenate([r[:-1], b, r[-1:]]) for r, b in zip(rows, blank, strict=True)]
        )

    return (
        column("duration"), column("constant"), column("slope"), column("amplitude"),
        column("angular_frequency"),
    )  # fmt: skip


def peaks_at(
    model: Model,
    poses: FloatArray,
    excitation: Excitation,
    *,
    hits: int | None = None,
    direction: ArrayLike | None = None,
) -> tuple[BatchPeaks, FloatArray]:
    """Largest deflection of every joint at many poses, exact in time and in direction.

    Args:
        model: the robot and its effects.
        poses: (p, nv) rad or m, taken unchecked.
        excitation: the blows.
        hits: of a burst from rest; None for the steady state.
        direction: (3,) or (p, 3) of the programmed force; None for the worst of all directions.

    Returns:
        the peaks; (p, n) N m/rad, the joints' stiffness.

    Raises:
        InputError: the worst direction of a nonlinear model, a resonance without damping, an
            effect that has no steady state.
    """
    many = ManyPoses(model, poses)
    if many.compiled:
        mass, jacobian = many.mass_and_jacobian()
        found = batch_peaks(
            mass, jacobian, many.stiffness, many.damping_ratio, model.force(excitation, hits),
            direction=direction,
        )  # fmt: skip
        return found, many.stiffness
    n = many.stiffness.shape[1]
    found = BatchPeaks(
        np.empty((len(poses), n)), np.empty((len(poses), n)), np.empty((len(poses), n, 3))
    )
    along = None if direction is None else np.broadcast_to(direction, (len(poses), 3))
    for s, pose in enumerate(poses):
        at = ModelAtPose(model, pose)
        found.natural_frequencies[s] = at.natural_frequencies
        many.stiffness[s] = at.stiffness
        if along is None:
            for j, worst in enumerate(at.response(excitation, hits).worst_directions()):
                found.peak_deflection[s, j], found.direction[s, j] = worst.value, worst.direction
        else:
            unit = unit_vector(along[s])
            turns = at.turning_points(excitation, hits, unit)
            found.direction[s] = unit
            found.peak_deflection[s] = [np.abs(values).max() for values in turns]
    return found, many.stiffness


def curve_tables(
    curves: Sequence[SNCurve | None],
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """The curves as the compiled code takes them: `enough`, `knots`, `lines`, `known`."""
    most = max((len(c.knees) for c in curves if c is not None), default=0)
    enough = np.full(len(curves), np.inf)
    knots = np.zeros((len(curves), most))
    lines = np.ones((len(curves), most + 1, 3))
    known = np.full(len(curves), -1)
    for j, curve in enumerate(curves):
        if curve is None:
            continue
        anchors, amplitudes, slopes = curve.lines()
        count = len(curve.knees)
        known[j], knots[j, :count] = count, amplitudes[:count]
        lines[j, : count + 1] = np.stack([anchors, amplitudes, slopes], axis=1)
        enough[j] = amplitudes[-1] if np.isinf(slopes[-1]) else -1.0
    return enough, knots, lines, known
