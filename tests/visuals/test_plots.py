"""Every plot shows the numbers it claims to show."""

from __future__ import annotations

from types import SimpleNamespace

import matplotlib.pyplot as plt
import numpy as np
import pytest
import scipy.linalg
from matplotlib.figure import Figure

import picchio
from picchio.excitation.pulse_train import HalfSineTrain, PulseTrain
from picchio.fatigue.counting.counter import rainflow
from picchio.fatigue.sn.fit import fit_sn
from picchio.fatigue.sn.test_table import SNTests
from picchio.studies.envelopes import envelope as envelope_of
from picchio.visuals.plots.force import plot_force_spectrum, plot_force_train
from picchio.visuals.plots.frequency import plot_frequency_response, plot_mode_shapes
from picchio.visuals.plots.life import plot_damage, plot_life_spread, plot_utilisation
from picchio.visuals.plots.polar import cut_directions, plot_polar_envelope
from picchio.visuals.plots.response import plot_response
from picchio.visuals.plots.sn import plot_sn_curve, plot_sn_fit
from picchio.visuals.plots.stress import plot_counted_cycles, plot_stress_history
from picchio.visuals.plots.workspace import plot_workspace_map

BLOWS = PulseTrain(300.0, 0.040, 0.004, preload=20.0)


@pytest.fixture(autouse=True)
def _close_figures():
    yield
    plt.close("all")


def line(ax, label: str):
    """x and y of the line with this label."""
    return next(found.get_xydata().T for found in ax.get_lines() if found.get_label() == label)


def markers(ax):
    """x and y of every single marked point."""
    return np.array([found.get_xydata()[0] for found in ax.get_lines()
                     if found.get_marker() == "o" and len(found.get_xydata()) == 1])  # fmt: skip


def drawn(ax) -> None:
    """Draw it all, as a file would; check the labels' units."""
    ax.figure.canvas.draw()
    if ax.name == "polar":
        assert "[" in ax.get_title(loc="left")
        return
    assert "[" in ax.get_xlabel() or ax.get_xticklabels()[0].get_text().startswith("mode")
    categories = {text.get_text() for text in ax.get_yticklabels()} - {""}
    named = any(text[:1].isalpha() for text in categories)
    assert "[" in ax.get_ylabel() or named


@pytest.mark.parametrize("kind", [PulseTrain, HalfSineTrain])
def test_force_train_has_the_height_and_the_impulse_of_the_blows(kind) -> None:
    ax = plot_force_train(kind(300.0, 0.040, 0.004), hits=3)
    time, force = line(ax, "blows")
    impulse = {PulseTrain: 1.0, HalfSineTrain: 2.0 / np.pi}[kind] * 300.0 * 0.004
    # 24 chords of a half-sine keep all but 0.2 % of its area.
    assert np.trapezoid(force, time) / 1e3 == pytest.approx(3 * impulse, rel=2e-3)
    assert force.max() == pytest.approx(300.0, rel=3e-3)
    assert time[-1] == pytest.approx(120.0)
    drawn(ax)


def test_spectrum_is_the_papers_fourier_series() -> None:
    ax = plot_force_spectrum(BLOWS, natural_frequencies=np.array([5.0, 9.0]))
    frequency, amplitude = line(ax, "harmonics")
    j = np.arange(1, len(frequency))
    np.testing.assert_allclose(frequency, np.arange(len(frequency)) * 25.0)
    # Nie et al. 2016, eq. 12: sqrt(a_j^2 + b_j^2), a_0 = F0 Td / T.
    a = 300.0 / (j * np.pi) * np.sin(2 * np.pi * j * 0.1)
    b = 300.0 / (j * np.pi) * (1.0 - np.cos(2 * np.pi * j * 0.1))
    np.testing.assert_allclose(amplitude[1:], np.hypot(a, b), atol=1e-9)
    assert amplitude[0] == pytest.approx(30.0)
    np.testing.assert_allclose(line(ax, "the robot's modes")[0], [5.0, 9.0])
    drawn(ax)


def test_modes_are_those_of_the_eigenproblem(arm: SimpleNamespace) -> None:
    system = picchio.Model(arm.robot).linear_system(arm.worst.pose)
    _, shapes = scipy.linalg.eigh(np.diag(arm.robot.stiffness), system.mass_matrix)
    ax = plot_mode_shapes(arm.worst.modes)
    heights = np.array([[bar.get_height() for bar in group] for group in ax.containers])
    expected = shapes / shapes[np.abs(shapes).argmax(axis=0), range(3)]
    np.testing.assert_allclose(heights, expected, atol=1e-9)
    drawn(ax)


def test_frequency_response_solves_the_equations_of_motion(arm: SimpleNamespace) -> None:
    system = picchio.Model(arm.robot).linear_system(arm.worst.pose)
    n = np.array([0.0, 0.6, 0.8])
    ax = plot_frequency_response(arm.worst.modes, n, excitation=BLOWS)
    for j, name in enumerate(arm.robot.flexible_names):
        frequency, gain = line(ax, name)
        for k in range(0, len(frequency), 97):
            w = 2 * np.pi * frequency[k]
            dynamic = (system.stiffness_matrix - w**2 * system.mass_matrix
                       + 1j * w * system.damping_matrix)  # fmt: skip
            x = np.linalg.solve(dynamic, system.input_matrix @ n)
            assert gain[k] == pytest.approx(1e6 * abs(x[j]), rel=1e-6)
    drawn(ax)


@pytest.mark.parametrize("which", ["rest", "steady"])
def test_response_line_and_peaks(arm: SimpleNamespace, which: str) -> None:
    response = getattr(arm.worst, which)
    n = np.array([0.6, 0.0, 0.8])
    ax = plot_response(response, n)
    peaks = response.peaks(n)
    for j, name in enumerate(arm.robot.flexible_names):
        time, value = line(ax, name)
        np.testing.assert_allclose(value, 1e3 * response.deflection(time, n)[j], atol=1e-12)
    marks = markers(ax)
    assert len(marks) >= 2
    wanted = np.array([[p.time, 1e3 * p.value] for p in peaks])
    for mark in marks:
        assert np.abs(wanted - mark).sum(axis=1).min() < 1e-9
    assert abs(marks[:, 1]).max() == pytest.approx(1e3 * max(abs(p.value) for p in peaks))
    drawn(ax)


def test_steady_band_is_the_steady_states_range(arm: SimpleNamespace) -> None:
    n = arm.worst.operation.direction
    ax = plot_response(arm.worst.rest, n, joints=["joint_2"], steady=arm.worst.steady)
    low, high = sorted(patch.get_y() + k * patch.get_height()
                       for patch in ax.patches if "steady" in patch.get_label()
                       for k in (0, 1))  # fmt: skip
    x = 1e3 * arm.worst.steady.deflection(np.linspace(0, 0.04, 4001), n)[1]
    assert (low, high) == (pytest.approx(x.min(), rel=1e-4), pytest.approx(x.max(), rel=1e-4))


def test_response_refuses_an_unknown_joint(arm: SimpleNamespace) -> None:
    with pytest.raises(picchio.InputError, match=r"joint_9.*joint_1"):
        plot_response(arm.worst.rest, [0, 0, 1], joints=["joint_9"])


def test_stress_and_cycles(arm: SimpleNamespace) -> None:
    time, stress = arm.worst.stress_turning_points()
    assert np.abs(stress).max() == pytest.approx(
        arm.assessment.joint(arm.worst.joint.name).peak_shear_stress
    )
    ax = plot_stress_history(time, stress, turning_points=(time, stress), joint="a$b")
    np.testing.assert_allclose(line(ax, "stress of the vibration")[1], stress / 1e6)
    np.testing.assert_allclose(line(ax, "turning points")[1], stress / 1e6)
    drawn(ax)
    cycles = rainflow(stress)
    ax = plot_counted_cycles(cycles, allowable=260e6)
    values, edges, _ = next(patch.get_data() for patch in ax.patches if hasattr(patch, "get_data"))
    assert edges[-1] == pytest.approx(cycles.total)
    np.testing.assert_allclose(
        (np.diff(edges) * values).sum(), (cycles.count * cycles.amplitude).sum() / 1e6
    )
    assert (np.diff(values) <= 0).all()
    drawn(ax)
    drawn(plot_counted_cycles(rainflow(np.zeros(3))))


def test_points_lie_on_the_sn_curve_or_at_its_right_edge() -> None:
    curve = picchio.load_sn_curve("42CrMo4-QT-shaft")
    above, below = 1.3 * curve.allowable, 0.4 * curve.allowable
    ax = plot_sn_curve(curve, amplitudes={"joint": [above, below, np.nan]})
    life, amplitude = line(ax, "joint")
    np.testing.assert_allclose(amplitude, np.array([above, below]) / 1e6)
    assert curve.amplitude(life[0]) == pytest.approx(above)
    assert life[1] > curve.knees[-1]
    assert life[1] < ax.get_xlim()[1]
    n, s = line(ax, curve.name)
    np.testing.assert_allclose(s, curve.amplitude(n) / 1e6)
    drawn(ax)


def test_utilisation_and_damage_are_the_assessments(arm: SimpleNamespace) -> None:
    ax = plot_utilisation(arm.assessment)
    for bars, operation in zip(ax.containers, arm.assessment.operations, strict=True):
        widths = [bar.get_width() for bar in bars]
        np.testing.assert_allclose(widths, 100 * operation.utilisation.max(axis=0))
    drawn(ax)
    told = [text.get_text() for text in plot_damage(arm.assessment).texts]
    assert any("no damage" in text for text in told)
    paper = picchio.assess(arm.robot, arm.task, method="paper")
    ax = plot_damage(paper)
    total = np.sum([[bar.get_width() for bar in bars] for bars in ax.containers], axis=0)
    np.testing.assert_allclose(total, [joint.damage_per_rivet for joint in paper.joints])
    drawn(ax)


def test_without_shafts_torques_are_shown_and_damage_says_why(ur10: SimpleNamespace) -> None:
    ax = plot_utilisation(ur10.assessment)
    assert "torque" in ax.get_xlabel()
    widths = [bar.get_width() for bar in ax.containers[0]]
    np.testing.assert_allclose(widths, [joint.peak_torque for joint in ur10.assessment.joints])
    drawn(ax)
    told = [text.get_text() for text in plot_damage(ur10.assessment).texts]
    assert any("no joint has a shaft" in text for text in told)


@pytest.mark.parametrize("plane", ["xy", "xz", "yz"])
def test_polar_cut_is_the_support_function(arm: SimpleNamespace, plane) -> None:
    envelope = envelope_of(picchio.Model(arm.robot), arm.worst.pose, BLOWS)
    ax = plot_polar_envelope(envelope, plane, count=24)
    angle, directions = cut_directions(plane, 24)
    time = np.linspace(0.0, 0.04, 4001)
    g = envelope.response.unit_deflection(time)
    for j, name in enumerate(envelope.joint_names):
        turn, radius = line(ax, name)
        np.testing.assert_allclose(turn[:24], angle)
        brute = 1e3 * np.abs(directions @ g[j]).max(axis=1)
        np.testing.assert_allclose(radius[:24], brute, rtol=1e-5, atol=1e-9)
        np.testing.assert_allclose(radius[24:48], radius[:24])
    drawn(ax)


def test_polar_refuses_an_unknown_plane(arm: SimpleNamespace) -> None:
    envelope = envelope_of(picchio.Model(arm.robot), arm.worst.pose, BLOWS)
    with pytest.raises(picchio.InputError, match=r"plane.*xy, xz, yz"):
        plot_polar_envelope(envelope, "ab")


def test_axes_given_are_axes_returned(arm: SimpleNamespace) -> None:
    ax = Figure().add_subplot()
    before = plt.get_fignums()
    assert plot_force_train(BLOWS, ax) is ax
    assert plot_utilisation(arm.assessment, Figure().add_subplot()) is not ax
    assert plt.get_fignums() == before


@pytest.fixture(scope="module")
def workspace():
    """Four places, one of them reached by two poses and one by none."""
    import xarray

    position = np.array([[0.0, 0, 0], [0.1, 0, 0], [0.1, 0, 0], [0.0, 0, 0.1], [0.1, 0, 0.1]])
    peak = np.array([[1e-3, 5e-3], [4e-3, 2e-3], [3e-3, 9e-3], [2e-3, np.nan], [np.nan, np.nan]])
    return xarray.Dataset(
        {"position": (("point", "xyz"), position), "peak_deflection": (("point", "joint"), peak)},
        coords={"joint": ["a", "b"]},
        attrs={"hits": 0},
    )


def test_map_shows_every_place_once_at_its_best(workspace) -> None:
    ax = plot_workspace_map(workspace, "a")
    dots = ax.collections[0]
    shown = {tuple(np.round(p, 9)): v for p, v in
             zip(dots.get_offsets().tolist(), dots.get_array().tolist(), strict=True)}  # fmt: skip
    assert shown == {(0.0, 0.0): pytest.approx(1.0), (0.1, 0.0): pytest.approx(3.0),
                     (0.0, 0.1): pytest.approx(2.0)}  # fmt: skip
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x [m]", "z [m]")
    assert "steady state" in ax.get_title(loc="left")
    burst = plot_workspace_map(workspace.assign_attrs(hits=12), "a")
    assert "12 hits from rest" in burst.get_title(loc="left")
    drawn(ax)
    with pytest.raises(picchio.InputError, match=r"'c'.*a, b"):
        plot_workspace_map(workspace, "c")


def test_life_spread_draws_the_percentiles() -> None:
    sure = SimpleNamespace(p10=1e5, p50=1e6, p90=1e7, endless=0.0)
    open_ended = SimpleNamespace(p10=2e5, p50=3e6, p90=np.inf, endless=0.3)
    ax = plot_life_spread(SimpleNamespace(joints={"a": sure}, robot=open_ended))
    bars = [found.get_xdata() for found in ax.get_lines() if found.get_linewidth() == 5]
    np.testing.assert_allclose(bars[0], [1e5, 1e7])
    assert bars[1][0] == 2e5
    assert bars[1][1] == ax.get_xlim()[1]
    dots = [float(found.get_xdata()[0]) for found in ax.get_lines() if found.get_marker() == "o"]
    assert dots == [1e6, 3e6]
    assert any("30 % infinite" in text.get_text() for text in ax.texts)
    drawn(ax)
    endless = SimpleNamespace(p10=np.inf, p50=np.inf, p90=np.inf, endless=1.0)
    ax = plot_life_spread(SimpleNamespace(joints={"a": endless}, robot=endless))
    assert any("infinite life" in text.get_text() for text in ax.texts)


def test_sn_fit_shows_tests_lines_band_and_knee() -> None:
    rng = np.random.default_rng(11)
    stress = np.repeat([280e6, 300e6, 320e6, 360e6, 420e6], 6)
    strength = 300e6 * 10 ** (0.03 * rng.standard_normal(30))
    broken = stress > strength
    life = np.where(broken, 1e6 * (stress / strength) ** -8.0, 1e7)
    tests = SNTests(stress, life * 10 ** (0.1 * rng.standard_normal(30) * broken), broken)
    fit = fit_sn(tests)
    ax = plot_sn_fit(fit)
    assert len(line(ax, "failure")[0]) == tests.failed.sum()
    np.testing.assert_allclose(sorted(line(ax, "run-out")[1]), sorted(stress[~tests.failed] / 1e6))
    arrows = [text for text in ax.texts if text.arrow_patch is not None]
    assert len(arrows) == len(set(stress[~tests.failed]))
    cycles, median = line(ax, "median")
    expected = np.maximum(cycles / fit.reference_cycles, 0.0) ** (-1.0 / fit.slope.value)
    limit = fit.endurance_limit.value / 1e6
    np.testing.assert_allclose(median, limit * np.maximum(expected, 1.0), rtol=1e-9)
    spread = 10.0 ** (1.2815516 * fit.scatter.value)
    np.testing.assert_allclose(line(ax, "P10 and P90")[1], median / spread, rtol=1e-6)
    np.testing.assert_allclose(line(ax, "_P90")[1], median * spread, rtol=1e-6)
    assert fit.knee is not None
    np.testing.assert_allclose(
        line(ax, "knee, 90 % interval")[0],
        np.clip([fit.knee.low, fit.knee.high], *ax.get_xlim()),
    )
    edge = ax.collections[0].get_paths()[0].vertices
    last = edge[np.isclose(edge[:, 0], cycles[-1], rtol=1e-6), 1]
    known = np.array([fit.endurance_limit.low, fit.endurance_limit.high]) / 1e6
    np.testing.assert_allclose([last.min(), last.max()], known, rtol=0.02)
    drawn(ax)


def test_sn_fit_shows_a_knee_that_the_tests_do_not_bound() -> None:
    rng = np.random.default_rng(11)
    stress = np.repeat([280e6, 300e6, 320e6, 360e6, 420e6], 6)
    life = 1e6 * (stress / (300e6 * 10 ** (0.03 * rng.standard_normal(30)))) ** -8.0
    tests = SNTests(stress, np.minimum(life, 2e6), life < 2e6)
    fit = fit_sn(tests)
    assert fit.knee is not None
    assert fit.knee.high > 1e9
    ax = plot_sn_fit(fit)
    left, right = ax.get_xlim()
    assert left > 1e3
    assert right < 1e9
    ends = line(ax, "knee, 90 % interval")[0]
    np.testing.assert_allclose(ends, np.clip([fit.knee.low, fit.knee.high], left, right))
    drawn(ax)
