"""The figures' numbers, where they can be had by hand, and that each can be drawn."""

import json

import numpy as np
import pytest

from picchio.core.results import plain
from picchio.paper.figures import FIGURES, paper_figure
from picchio.paper.run import conflicts
from picchio.paper.study import Study
from picchio.paper.world import Assumptions


@pytest.fixture(scope="module")
def figures(study):
    """All but those that need the hypotheses with the arm."""
    names = FIGURES.keys() - {"hypotheses", "fig-13-15"}
    return {name: paper_figure(study, name) for name in names}


@pytest.mark.slow
def test_each_can_be_drawn_and_told(figures):
    for figure in figures.values():
        assert figure._repr_png_().startswith(b"\x89PNG")
        assert len(figure.caption) > 40
        assert len(figure.alt) > 20
        json.dumps(plain(figure.to_dict()), allow_nan=False)
    assert len(figures) >= 20


@pytest.mark.slow
def test_every_conflict_has_its_number_and_its_figure(study, figures):
    found = conflicts(figures)
    assert len({conflict.name for conflict in found}) == len(found) >= 9
    for conflict in found:
        assert conflict.figure in figures
        assert np.isfinite(conflict.number)


def test_the_bend_that_the_path_needs_by_hand(study):
    # At z = 1.5 the arm reaches x = sqrt(1.6^2 - 1.1^2) at the most; there z = 0.6 is nearest.
    x = np.sqrt(1.6**2 - 1.1**2)
    distance = np.hypot(x, 0.2)
    by_hand = np.degrees(2.0 * np.arccos(distance / 1.6))
    data = paper_figure(study, "range").data
    assert data["least_bend_deg"] == pytest.approx(by_hand, abs=0.5)
    assert data["at_x"] == pytest.approx(x, abs=0.01)
    assert data["limit_deg"] == pytest.approx(70.0)


def test_rings_and_axes(study):
    assert paper_figure(study, "rings").data["spread"] < 1e-9
    along_x, along_z = (paper_figure(study, f"{axis}-force") for axis in "xz")
    forces = along_x.data["joint_1"]
    assert max(forces["x"]) < 1e-12 < max(forces["y"])
    straight_up = along_z.data["joint_2"]
    assert straight_up["z"][-1] < 1e-12 < straight_up["x"][-1]
    assert straight_up["x"][-1] == pytest.approx(max(straight_up["x"]))


def test_the_largest_envelopes_are_the_exact_ones(study):
    from picchio.studies.envelopes import envelope as envelope_of

    ours = paper_figure(study, "fig-9").data["peak_mrad"]
    for k, pose in enumerate(study.base.path_poses):
        exact = envelope_of(study.base.model, pose, study.base.blows)
        np.testing.assert_allclose(ours[k], 1e3 * exact.peak_deflection, rtol=1e-5)


def test_influences_that_are_known_by_hand(study):
    rows = {row.name: row for row in study.influences}
    exponent = study.printed.sn_curve.exponent
    # Life goes with stress to minus m, and stress with G r / l.
    assert rows["stress_per_twist"].factor == pytest.approx(8.0**exponent, rel=1e-6)
    for nothing in ("harmonics", "shear_modulus", "path_x"):
        assert rows[nothing].factor == pytest.approx(1.0)
    assert rows["period"].factor > 10


def test_the_sequence_is_looked_for_in_the_same_worlds_again(study):
    found = study.sequences
    assert (found.agree == 4).sum() == found.counts[4] > 0
    assert found.example is not None
    joints = found.example.path_peaks.peak_deflection.argmax(axis=1) + 1
    assert tuple(joints) == study.printed.task.dominant_joints


def test_a_study_of_one_world_is_allowed():
    assert len(Study(Assumptions(), count=0).worlds) == 1
