"""The direction envelope: exact worst directions, the double ball, the paper's rings."""

import numpy as np
import pytest

import picchio
from picchio.core.errors import InputError
from picchio.studies.envelopes import envelope as envelope_of
from picchio.studies.envelopes import icosphere

BLOWS = picchio.PulseTrain(300.0, 0.040, 0.004)
POSE = [0.3, 1.1, -1.0]


@pytest.fixture(scope="module")
def model():
    return picchio.Model(picchio.load_robot("fanuc_like_3dof"))


@pytest.mark.parametrize(
    ("pose", "worst"),
    [
        ([0, 0.5, -0.8], [0.23128, 0.46373, 0.49894]),
        ([0.3, 1.1, -1.0], [0.22554, 0.43009, 0.45901]),
        ([0.7, 0, 0], [0.24191, 0.64274, 0.76175]),
    ],
)
def test_reference_figures(model, pose, worst):
    found = envelope_of(model, pose, BLOWS)
    np.testing.assert_allclose(found.peak_deflection * 1e3, worst, atol=5.1e-6)


def test_the_surface_is_the_support_function(model):
    found = envelope_of(model, POSE, BLOWS)
    vertices, faces = found.surface("joint_3", subdivisions=2)
    radius = np.linalg.norm(vertices, axis=1)
    directions = icosphere(2)[0]
    times = np.linspace(0, 0.04, 20_001)
    g = found.response.unit_deflection(times)[2]
    np.testing.assert_allclose(radius, np.abs(directions @ g).max(axis=1), rtol=1e-6, atol=1e-12)
    assert radius.max() <= found.peak_deflection[2] * (1 + 1e-12)
    assert faces.min() == 0
    assert faces.max() == len(vertices) - 1
    # A double ball: along any direction in the plane across the worst one, almost nothing moves
    # when the joint's response keeps to one line; here the waist is narrow.
    across = np.cross(found.worst_direction[2], [0.0, 1.0, 0.0])
    across /= np.linalg.norm(across)
    assert found.support([across])[2, 0] < 0.4 * found.peak_deflection[2]


def test_torque_and_stress_follow_the_deflection(model):
    found = envelope_of(model, POSE, BLOWS, hits=12)
    k = np.array([2.4e5, 1e5, 1e5])
    np.testing.assert_allclose(found.peak("torque"), k * found.peak_deflection)
    r = np.array([0.01765, 0.0132, 0.0132])
    stress = k * found.peak_deflection * 2 / (np.pi * r**3)
    np.testing.assert_allclose(found.peak("stress"), stress, rtol=1e-12)
    with pytest.raises(InputError, match="deflection, torque, stress"):
        found.peak("strain")


def test_the_tools_largest_displacement_against_brute_force(model):
    found = envelope_of(model, POSE, BLOWS)
    state = model.robot.state(POSE)
    times = np.linspace(0, 0.04, 4001)
    moved = np.einsum("rm,mdk->krd", state.jacobian, found.response.unit_deflection(times))
    brute = np.linalg.svd(moved, compute_uv=False)[:, 0].max()
    assert brute <= found.peak_tool_displacement * (1 + 1e-12)
    assert found.peak_tool_displacement == pytest.approx(brute, rel=1e-6)
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    reached = np.linalg.norm(np.einsum("krd,nd->nkr", moved[::10], directions), axis=2).max()
    assert reached <= found.peak_tool_displacement


def test_rings_about_joint_2_that_the_papers_figure_lacks(model):
    """Turning joint 2 (or 1) only turns the force: the worst deflection of joints 2 and 3 hangs
    on the elbow alone."""
    for elbow in (-1.0, -0.3, 0.8):
        peaks = [
            envelope_of(model, [a, b, elbow], BLOWS).peak_deflection[1:]
            for a, b in ((0.0, 0.0), (0.4, 0.9), (-1.0, -1.2), (2.0, 0.3))
        ]
        np.testing.assert_allclose(peaks, np.tile(peaks[0], (4, 1)), rtol=1e-9)


def test_an_icosphere_is_round_and_closed():
    for subdivisions in range(4):
        vertices, faces = icosphere(subdivisions)
        assert len(vertices) == 10 * 4**subdivisions + 2
        assert len(faces) == 20 * 4**subdivisions
        np.testing.assert_allclose(np.linalg.norm(vertices, axis=1), 1.0)
        a, b, c = (vertices[faces[:, k]] for k in range(3))
        volume = (a * np.cross(b, c)).sum() / 6
        assert 2.5 < volume < 4 * np.pi / 3
