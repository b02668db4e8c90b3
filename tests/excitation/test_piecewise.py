"""Force histories: values, repetition, and Fourier coefficients against quadrature."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from picchio.core.errors import InputError
from picchio.excitation.measured import MeasuredForce
from picchio.excitation.pulse_train import HalfSineTrain, PulseTrain
from picchio.model.blows import Blows

MEASURED = MeasuredForce(
    np.array([0.0, 0.001, 0.003, 0.004, 0.02]), np.array([0.0, 310.0, 80.0, -20.0, 0.0]), 0.04
)
TRAINS = [PulseTrain(300, 0.04, 0.004), HalfSineTrain(300, 0.04, 0.004), MEASURED]


def test_a_pulse_has_its_value_just_after_a_jump():
    force = PulseTrain(300.0, 0.04, 0.004).one_period()
    assert force([0.0, 0.0039, 0.004, 0.03]).tolist() == [300.0, 300.0, 0.0, 0.0]
    assert force([-0.001, 0.04]).tolist() == [0.0, 0.0]


def test_a_blow_that_rises_keeps_its_impulse_and_its_middle():
    force = PulseTrain(1.0, 0.04, 0.004).unit_blows[0].ramped(0.001)
    t = np.linspace(0.0, 0.00499, 500)
    expected = np.interp(t, [0.0, 0.001, 0.004, 0.005], [0.0, 1.0, 1.0, 0.0])
    np.testing.assert_allclose(force(t), expected, atol=1e-12)
    assert force.mean() * force.end == pytest.approx(0.004)


@pytest.mark.parametrize("step", [1.3e-4, 1e-3])
def test_stairs_in_place_of_a_ramp_push_alike_up_to_the_third_moment(step):
    force = PulseTrain(1.0, 0.04, 0.004).unit_blows[0].ramped(7e-4).scaled(300.0)
    stairs = force.stepped(step)
    assert not stairs.slope.any() and stairs.start.size > force.start.size
    for power in range(3):  # of the force; of its jumps one more
        one, other = (
            sum(quad(lambda t, f=f, power=power: f(t) * t**power, a, b)[0] for a, b in
                zip(f.start, [*f.start[1:], f.end], strict=True))
            for f in (force, stairs)
        )  # fmt: skip
        assert other == pytest.approx(one, rel=1e-9)
    assert force.stepped(5e-5) is force
    measured = MEASURED.one_period()
    assert measured.stepped(0.01) is measured


def test_a_half_sine_is_a_half_sine():
    force = HalfSineTrain(300.0, 0.04, 0.004).one_period()
    t = np.linspace(0, 0.0039, 40)
    np.testing.assert_allclose(force(t), 300 * np.sin(np.pi * t / 0.004), atol=1e-10)
    assert force(0.01) == 0.0


def test_a_measured_blow_is_interpolated_and_then_silent():
    t = np.linspace(0, 0.0399, 500)
    expected = np.interp(t, MEASURED.time, MEASURED.samples)
    np.testing.assert_allclose(MEASURED.one_period()(t), expected, atol=1e-10)


@pytest.mark.parametrize("train", TRAINS, ids=["pulse", "half-sine", "measured"])
def test_fourier_coefficients_against_quadrature(train):
    force = train.one_period()
    edges = [*force.start, force.end]
    exact = force.fourier_coefficients(40)
    w = 2 * np.pi / train.period
    for k in (0, 1, 2, 7, 40):
        parts = [
            quad(lambda t, f=f, k=k: float(force(t)) * f(k * w * t), a, b, limit=200, epsabs=1e-12)
            for a, b in zip(edges[:-1], edges[1:], strict=True)
            for f in (np.cos, np.sin)
        ]
        values = [p[0] for p in parts]
        expected = (sum(values[::2]) - 1j * sum(values[1::2])) / train.period
        assert abs(exact[k] - expected) < 1e-9


def test_the_pulse_train_has_the_papers_coefficients():
    f0, period, width = 300.0, 0.04, 0.004
    c = PulseTrain(f0, period, width).one_period().fourier_coefficients(50)
    j = np.arange(1, 51)
    assert c[0].real == pytest.approx(f0 * width / period, rel=1e-14)  # eq. 12, a_0
    a = f0 / (j * np.pi) * np.sin(2 * j * np.pi * width / period)
    b = f0 / (j * np.pi) * (1 - np.cos(2 * j * np.pi * width / period))
    np.testing.assert_allclose(2 * c[1:].real, a, atol=1e-10)
    np.testing.assert_allclose(-2 * c[1:].imag, b, atol=1e-10)


@given(hits=st.integers(1, 30), fraction=st.floats(0.01, 0.99))
def test_a_burst_is_the_period_h_times_and_then_nothing(hits, fraction):
    train = HalfSineTrain(100.0, 0.05, 0.05 * fraction)
    burst = train.burst(hits)
    t = np.linspace(0, (hits + 2) * 0.05, 777)
    phase = np.mod(t, 0.05)
    inside = t < hits * 0.05
    away = np.minimum(phase, 0.05 - phase) > 1e-9
    expected = np.where(inside, train.one_period()(phase), 0.0)
    np.testing.assert_allclose(burst(t)[away], expected[away], atol=1e-6)
    assert burst.end == np.inf


def test_mean_force_of_each_train():
    assert PulseTrain(300, 0.04, 0.004).one_period().mean() == pytest.approx(30.0)
    half_sine = HalfSineTrain(300, 0.04, 0.004).one_period().mean()
    assert half_sine == pytest.approx(300 * 2 / np.pi * 0.1)


@pytest.mark.parametrize("train", [PulseTrain, HalfSineTrain])
@pytest.mark.parametrize(
    ("arguments", "key"),
    [
        ((300, 0.04, 0.04), "width"),
        ((300, 0.04, 0.05), "width"),
        ((300, 0.04, 0.0), "width"),
        ((300, -1.0, 0.004), "period"),
        ((np.nan, 0.04, 0.004), "force"),
        ((300, np.inf, 0.004), "period"),
        ((300, 0.04, 0.004, np.nan), "preload"),
    ],
)
def test_impossible_trains_are_refused_by_key(train, arguments, key):
    with pytest.raises(InputError, match=key):
        train(*arguments)


def test_reading_a_measured_force(tmp_path):
    path = tmp_path / "force.csv"
    path.write_text("force [N],time [s]\n0,1.0\n300,1.001\n0,1.004\n")
    force = MeasuredForce.from_csv(path, period=0.04)
    assert force.peak_force == 300.0
    assert force.period == 0.04
    assert force.time[0] == 0.0
    alone = MeasuredForce.from_csv(path)
    assert alone.period == pytest.approx(0.004)
    assert force.describe() == "measured blows (force.csv, peak 300 N), every 40 ms"
    # Of no file: recorded together with a response, and not repeated.
    whole = MeasuredForce.from_start(force.time, force.samples)
    assert whole.describe() == "measured force (peak 300 N, 4 ms)"


@pytest.mark.parametrize("first", [-0.0005, 0.0, 0.00025])
def test_a_recorded_force_keeps_its_time(first):
    """t = 0 need not be at a sample; where there is none before it, the first one holds."""
    time = first + 0.0005 * np.arange(9)
    samples = 1000.0 + 4e5 * time
    force = MeasuredForce.from_start(time, samples)
    assert force.time[0] == 0.0 and force.period == pytest.approx(time[-1])
    later = np.linspace(max(first, 0.0), time[-2], 7)
    blow = force.blow()
    assert [float(blow(np.array([t]))[0]) for t in later] == pytest.approx(1000.0 + 4e5 * later)
    assert force.samples[0] == pytest.approx(1000.0 + 4e5 * max(first, 0.0))


def test_how_well_eight_samples_tell_the_impulse_of_a_half_sine():
    """docs/how_to/diagnose.md: 1.3 % too little to 0.6 % too much, by where they fall."""
    width, step = 0.004, 0.0005
    errors = []
    for late in np.linspace(0.0, step, 50, endpoint=False):
        time = step * np.arange(-10, 30) - late
        inside = (time >= 0.0) & (time <= width)
        pulse = np.where(inside, 300.0 * np.sin(np.pi * time / width), 0.0)
        force = MeasuredForce(time, pulse)
        impulse = np.trapezoid(force.samples, force.time)
        errors.append(impulse / (300.0 * 2.0 * width / np.pi) - 1.0)
    assert -0.0135 < min(errors) < -0.0125
    assert 0.006 < max(errors) < 0.007


def test_the_noise_of_a_force_sensor_is_no_force():
    """It would shake the model on and on: what does not rise out of the quiet time's noise is 0."""
    rng, time = np.random.default_rng(3), 5e-4 * np.arange(-200, 1000)
    pulse = np.where(
        (time >= 0.1) & (time < 0.104), 300.0 * np.sin(np.pi * (time - 0.1) / 4e-3), 0.0
    )
    read = 2.0 + pulse + 0.3 * rng.standard_normal(time.size)  # its zero is off, too
    force = MeasuredForce.from_start(time, read)
    acts = (force.time >= 0.0995) & (force.time <= 0.1045)
    assert not force.samples[~acts].any()
    there = np.interp(force.time, time, pulse)
    assert np.abs(force.samples - there)[acts].max() < 1.5
    # A blow that begins early, before t = 0, is no noise.
    early = MeasuredForce.from_start(time - 0.1005, read)
    assert early.samples.max() > 250.0
    assert np.count_nonzero(early.samples) >= 7
    # Without a quiet time nothing is known of its noise.
    alone = MeasuredForce.from_start(time[time >= 0.0], read[time >= 0.0])
    np.testing.assert_array_equal(alone.samples, read[time >= 0.0])


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("", "is empty"),
        ("time [s],force [kg]\n0,1\n1,2\n", "force [kg]"),
        ("time [s],force [N]\n0,1\n", "two or more samples"),
        ("time [s],force [N]\n0,1\n1,x\n", "line 3"),
        ("time [s],force [N]\n0,1\n1,nan\n", "line 3"),
        ("time [s],force [N]\n0,1\n0,2\n", "does not ascend"),
        ("time [s],force [N]\n0,1\n1,2\n2\n3,4\n", "line 4"),
    ],
)
def test_bad_measured_forces_are_refused(tmp_path, text, part):
    path = tmp_path / "force.csv"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        MeasuredForce.from_csv(path)
    assert part in str(caught.value)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("text", "encoding"),
    [
        ("time [ms],force [kN]\n0,0.001\n2.5,0.3\n5,0\n", "utf-8"),
        ("force [N];time [µs]\n1,0;0\n300,0;2500\n0,0;5000\n", "cp1252"),
        ("n\ttime [s]\tforce [kgf]\n1\t0\t0,101971621298\n2\t0,0025\t30,5914863893\n"
         "3\t0,005\t0\n", "utf-16"),
    ],
)  # fmt: skip
def test_a_measured_force_in_other_units_and_habits(tmp_path, text, encoding):
    (tmp_path / "force.csv").write_text(text, encoding=encoding)
    force = MeasuredForce.from_csv(tmp_path / "force.csv")
    np.testing.assert_allclose(force.time, [0.0, 2.5e-3, 5e-3], rtol=1e-12)
    np.testing.assert_allclose(force.samples, [1.0, 300.0, 0.0], rtol=1e-9)


def test_a_period_shorter_than_the_record_is_refused():
    with pytest.raises(InputError, match="period"):
        MeasuredForce(np.array([0.0, 1.0]), np.array([1.0, 2.0]), 0.5)


def test_a_force_leaves_zero_where_its_blows_begin():
    direction = np.array([0.0, 0.0, 1.0])
    time = 5e-4 * np.arange(-100, 400)
    read = np.zeros(time.size)
    for begins in (0.01, 0.05, 0.0915):
        inside = (time > begins) & (time < begins + 0.004)
        read[inside] = 300.0 * np.sin(np.pi * (time[inside] - begins) / 0.004)
    force = MeasuredForce.from_start(time, read)
    blows = Blows.of(force, 1, direction, recorded=True)
    np.testing.assert_allclose(blows.onsets, (0.01, 0.05, 0.0915), atol=5e-4)
    assert blows.interval == pytest.approx(0.04075, abs=5e-4)
    stated = Blows.of(PulseTrain(300.0, 0.04, 0.004), 3, direction)
    np.testing.assert_allclose(stated.onsets, (0.0, 0.04, 0.08))
