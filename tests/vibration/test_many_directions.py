"""Peaks in many directions at once against one direction at a time, and against dense samples."""

from __future__ import annotations

import numpy as np
import pytest

import picchio
from picchio.excitation.pulse_train import HalfSineTrain, PulseTrain
from picchio.vibration.closed_form.response import peak_deflections


def unit_vectors(rng: np.random.Generator, count: int) -> np.ndarray:
    found = rng.normal(size=(count, 3))
    return found / np.linalg.norm(found, axis=1)[:, None]


@pytest.mark.parametrize("name", ["fanuc_like_3dof", "ur10", "panda"])
@pytest.mark.parametrize("hits", [None, 1, 12])
def test_as_exact_as_one_by_one(name: str, hits: int | None) -> None:
    robot = picchio.load_robot(name)
    rng = np.random.default_rng(5)
    for kind in (PulseTrain, HalfSineTrain):
        pose = rng.uniform(-1.5, 1.5, len(robot.joint_names))
        period = 10.0 ** rng.uniform(-2.0, -0.7)
        blows = kind(100.0, period, period * rng.uniform(0.02, 0.5))
        modes = picchio.modal_analysis(picchio.Model(robot).linear_system(robot.pose(pose)))
        found = (picchio.steady_state(modes, blows) if hits is None
                 else picchio.response_from_rest(modes, blows, hits))  # fmt: skip
        directions = unit_vectors(rng, 8)
        exact = np.array([[abs(p.value) for p in found.peaks(n)] for n in directions]).T
        np.testing.assert_allclose(
            peak_deflections(found, directions), exact, rtol=1e-10, atol=1e-9 * exact.max()
        )


def test_no_sample_lies_above_and_the_densest_comes_close() -> None:
    robot = picchio.load_robot("fanuc_like_3dof")
    modes = picchio.modal_analysis(picchio.Model(robot).linear_system(robot.pose([0.3, 1.1, -1.0])))
    rivet = picchio.response_from_rest(modes, PulseTrain(300.0, 0.040, 0.004), 3)
    directions = unit_vectors(np.random.default_rng(0), 50)
    time = np.linspace(0.0, 1.0, 20_001)
    sampled = np.abs(np.einsum("mdk,bd->mbk", rivet.unit_deflection(time), directions)).max(axis=2)
    peaks = peak_deflections(rivet, directions)
    assert (peaks >= sampled * (1 - 1e-12)).all()
    np.testing.assert_allclose(sampled, peaks, rtol=1e-4)


def test_directions_by_blocks_are_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = picchio.load_robot("fanuc_like_3dof")
    modes = picchio.modal_analysis(picchio.Model(robot).linear_system(robot.pose([0.3, 1.1, -1.0])))
    steady = picchio.steady_state(modes, PulseTrain(300.0, 0.040, 0.004))
    directions = unit_vectors(np.random.default_rng(0), 7)
    whole = peak_deflections(steady, directions)
    monkeypatch.setattr("picchio.vibration.closed_form.response._CELLS", 1)
    np.testing.assert_allclose(peak_deflections(steady, directions), whole, rtol=1e-12)
