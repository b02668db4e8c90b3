"""Samples that stand so near a jump of the force that either side of it may be meant."""

from __future__ import annotations

from functools import partial

import numpy as np

from picchio.core.arrays import BoolArray
from picchio.excitation import PiecewiseForce
from picchio.model import Model
from picchio.prediction.percussion import PercussionSetup
from picchio.vibration.integrate import Samples

# A sample this near a jump of the force, but not on it, holds neither side for sure: a sensor of
# finite bandwidth smears a jump, and what keeps it from aliasing by about half a sample.
_NEAR_EDGE = 1.8e-4
# s, more: two samples that stand alike on either side of an edge are to be both in or both out,
# whatever a fit does to the clock; else it gains by moving one of them out.
_MARGIN = 2e-5
_SMEARED = 0.5
_ON_EDGE = 1e-7
_SMALL_JUMP = 0.05


def near_edges(setup: PercussionSetup, model: Model) -> dict[str, BoolArray] | None:
    """Which samples of each group stand so near a jump that either side may be meant."""
    force = setup.struck(model).unit
    sensors, clock = model.sensors(setup.conditions), setup.samples
    found = {}
    for group in setup.groups:
        timing = sensors.get(group).timing
        near = setup.in_common.edges.get(
            (force, clock, timing), partial(_marked, force, clock, *timing)
        )
        if near is None:
            return None
        found[group] = near
    return found


def _marked(force: PiecewiseForce, clock: Samples, delay: float, rate: float) -> BoolArray | None:
    """(count,) which samples of a sensor; None where nothing jumps."""
    from picchio.diagnosis.percussion._residual_kernel import near_edges as mark

    edges = force.start
    if edges.size > 400:  # a measured history has no jumps
        return None
    jump = np.abs(force(edges + _ON_EDGE) - force(edges - _ON_EDGE))
    edges = edges[jump > _SMALL_JUMP * max(float(jump.max()), 1e-300)]
    if not edges.size:
        return None
    if np.isfinite(force.end):
        edges = (edges + force.end * np.arange(int(clock.last / force.end) + 2)[:, None]).ravel()
    near = max(_NEAR_EDGE, _SMEARED * clock.step) + _MARGIN
    out = np.empty(clock.count, dtype=bool)
    mark(clock.start, clock.step, rate, delay, edges, near, out)
    return out
