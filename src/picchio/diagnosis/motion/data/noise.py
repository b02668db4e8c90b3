"""What noise alone would leave: the encoders' and the drives', through the same filters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.diagnosis.motion.data.system import Group, System
from picchio.model.motion import RIPPLE, TORQUE
from picchio.prediction.motion.log import MotionLog
from picchio.prediction.motion.readings import angle_noise, rigid_motion

_TINY = 1e-12
_SEED = 0


def noise_levels(system: System) -> dict[Group, float]:
    """Group -> standard deviation that noise has in its equations.

    Both noises are read off fourth differences, which no motion reaches. The torque's is taken
    as white and so shared between the band and what is above it; the encoders' is put on the
    measured angles and sent through filter, derivatives and inverse dynamics.
    """
    power: dict[Group, list[float]] = {}
    for record, (log, predictor) in enumerate(zip(system.logs, system.predictors, strict=True)):
        share = 2.0 * predictor.band.cutoff / log.rate
        shaken = _shaken(system, log, record)
        for s in system.segments:
            if s.record != record:
                continue
            kind, joint = s.group
            if kind == TORQUE:
                of_angles = shaken[joint][s.samples]
                found = share * angle_noise(log.torque[joint]) ** 2 + float(np.mean(of_angles**2))
            elif kind == RIPPLE:
                found = (1.0 - share) * angle_noise(log.torque[joint]) ** 2
            else:
                found = angle_noise(log.link[joint] - log.angle[joint]) ** 2
            sums = power.setdefault(s.group, [0.0, 0.0])
            sums[0] += found * s.samples.size
            sums[1] += s.samples.size
    size: dict[Group, float] = {}
    for s in system.segments:
        size[s.group] = max(size.get(s.group, 0.0), float(np.abs(s.measured).max()))
    return {
        g: max(float(np.sqrt(total / count)), _TINY * size[g], 1e-300)
        for g, (total, count) in power.items()
    }  # fmt: skip


def _shaken(system: System, log: MotionLog, record: int) -> dict[str, FloatArray]:
    """Joint -> how the rigid-body torque changes when the angles get their noise once more."""
    rng = np.random.default_rng(_SEED)
    angle = {
        joint: values + angle_noise(values) * rng.normal(size=values.size)
        for joint, values in log.angle.items()
    }
    predictor = system.predictors[record]
    other = rigid_motion(system.robot, replace(log, angle=angle), predictor.band)
    return {joint: other.body[joint] - x for joint, x in predictor.nominal.body.items()}
