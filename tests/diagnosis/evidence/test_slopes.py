"""Slopes of percussion records by every number, on a world that is a little wrong."""

import numpy as np
import pytest

import picchio
from picchio.diagnosis.evidence.numbers import Numbers
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.likelihood.percussion import Data, Percussion
from worlds import campaign as worlds

ARM = "fanuc_like_3dof"
pytestmark = pytest.mark.slow


def test_slopes_are_those_of_differences():
    campaign, _ = worlds.make(
        robot=ARM, seed=5, causes=[], sensors=("accelerometer.tool", "deflection"), records=3,
        snr_db=40.0, mismatch=1.0,
    )  # fmt: skip
    likelihood = Percussion(Data.of(Problem(picchio.load_robot(ARM), campaign)))
    at = likelihood.start()
    rng = np.random.default_rng(0)
    at = Numbers(  # where every number is a little off
        at.shared + 0.3 * likelihood.prior.std.shared * np.abs(rng.standard_normal(at.shared.size)),
        tuple(0.3 * rng.standard_normal(own.size) for own in at.groups),
        tuple(0.3 * rng.standard_normal(own.size) for own in at.records),
    )
    slopes = likelihood.linearised(at).records[0]
    own, group = at.records[0].size, at.groups[0].size
    compared = 0
    for number in range(own + group + at.shared.size):
        step = np.zeros(own + group + at.shared.size)
        step[number] = 1e-2 * (1.0 if number < own + group
                               else likelihood.prior.std.shared[number - own - group])  # fmt: skip
        both = []
        for sign in (-1.0, 1.0):
            moved = Numbers(
                at.shared + sign * step[own + group :],
                (at.groups[0] + sign * step[own : own + group], *at.groups[1:]),
                (at.records[0] + sign * step[:own], *at.records[1:]),
            )
            both.append(likelihood.residuals(moved)[0])
        difference = (both[0] - both[1]) / (2.0 * step[number])
        size = np.linalg.norm(difference) * step[number] / 1e-2
        if size < 1.0:  # less than the noise: what is of second order would be compared
            continue
        error = np.linalg.norm(slopes.column(number) - difference) * step[number] / 1e-2
        assert error < 0.05 * size, number
        compared += 1
    assert compared > 20
