"""What a bare accelerometer's log shows, against structures that scipy simulates."""

import contextlib
import io
import itertools
import sys

import numpy as np
import pytest
from scipy import signal

from picchio.campaign.importing.mapping import read_mapping
from picchio.cli.main import run
from picchio.ledger.first_look import G, first_look

FINE = 10


def struck(modes, bursts, hits, period, *, rate=1000.0, length=12.0, width=0.004, seed=0):
    """Times, s, accelerations, m/s^2, and onsets, s, of modes struck by half sines of 300 m/s^2."""
    rng = np.random.default_rng(seed)
    step = 1.0 / rate / FINE
    force = np.zeros(round(length / step))
    onsets = [burst + k * period for burst, k in itertools.product(bursts, range(hits))]
    blow = 300.0 * np.sin(np.pi * np.arange(round(width / step)) * step / width)
    for onset in onsets:
        at = round(onset / step)
        force[at : at + blow.size] += blow
    out = np.zeros((force.size, 3))
    for hz, ratio in modes:
        omega = 2.0 * np.pi * hz
        system = ([1.0, 0.0, 0.0], [1.0, 2.0 * ratio * omega, omega**2])
        top, bottom, _ = signal.cont2discrete(system, step, method="foh")
        along = rng.standard_normal(3)
        out += signal.lfilter(top.ravel(), bottom, force)[:, None] * along / np.linalg.norm(along)
    out = out[::FINE] + 0.1 * rng.standard_normal((len(out[::FINE]), 3))
    return np.arange(len(out)) / rate, out, np.array(onsets)


def written(path, header, time, values):
    table = np.column_stack([time, values])
    np.savetxt(path, table, delimiter=",", header=header, comments="", fmt="%.6f")
    return path


TWO = ((6.3, 0.03), (17.0, 0.02))
CASES = [
    ("time,x,y,z", G, (0.0, 0.0, -1.0), TWO, (1.0, 4.0, 7.0), 12, 0.040, {}),
    ("time [s],x [g],y [g],z [g]", G, (0.0, 0.0, 0.0), ((4.7, 0.04), (28.0, 0.02)),
     (1.0, 5.0), 10, 0.031, {"width": 0.003}),
    ("t,ax,ay,az", 1.0, (0.6 * G, 0.0, -0.8 * G), ((9.4, 0.015), (23.0, 0.03)),
     (1.0, 4.5, 8.0), 1, 1.0, {}),
    ("t [ms];Acc X (mg);Acc Y (mg);Acc Z (mg)", 1e-3 * G, (0.0, 1e3, 0.0),
     ((11.0, 0.02), (36.0, 0.01), (80.0, 0.01)), (0.5, 3.5, 7.0), 8, 0.050, {"rate": 2000.0}),
]  # fmt: skip


@pytest.mark.parametrize(
    ("header", "unit", "rest", "modes", "bursts", "hits", "period", "how"), CASES
)
def test_blows_and_ring_downs_are_those_of_the_structure(
    tmp_path, header, unit, rest, modes, bursts, hits, period, how
):
    time, values, onsets = struck(modes, bursts, hits, period, **how)
    scale = 1e3 if "[ms]" in header else 1.0
    path = written(tmp_path / "log.csv", header, scale * time, values / unit + rest)
    if ";" in header:
        path.write_text(path.read_text().replace(",", ";"))
    seen = first_look(path).vibration
    assert seen.scale == pytest.approx(G)
    assert seen.rest * (1.0 / unit) == pytest.approx(rest, abs=0.05 / unit)
    assert len(seen.onsets) == len(onsets)
    assert seen.onsets == pytest.approx(onsets, abs=2.5e-3)
    if hits > 1:
        assert seen.period == pytest.approx(period, rel=0.02)
        assert seen.bursts == len(bursts)
    true = np.linalg.norm(values, axis=1)
    tops = [true[(time >= t) & (time < t + 0.005)].max() for t in onsets[::hits]]
    assert seen.peaks[::hits] == pytest.approx(tops, rel=0.2)
    assert [r.frequency for r in seen.ringing] == pytest.approx([f for f, _ in modes], rel=2e-3)
    assert [r.damping_ratio for r in seen.ringing] == pytest.approx([z for _, z in modes], rel=0.03)
    level = np.sqrt(((values - np.median(values, axis=0)) ** 2).mean(axis=0))
    assert [row["rms"] for row in seen.level()] == pytest.approx(level, rel=1e-3)


@pytest.mark.parametrize(
    ("signal_of", "word"),
    [
        (lambda t, rng: 0.3 * rng.standard_normal((t.size, 3)), "evenly"),
        (lambda t, rng: 20.0 * np.sin(2 * np.pi * 37.0 * t)[:, None] * [1.0, 0.5, 0.0], "evenly"),
        (lambda t, rng: np.zeros((t.size, 3)), "none"),
    ],
)
def test_what_no_blow_makes_is_none(tmp_path, signal_of, word):
    time = np.arange(8000) / 1000.0
    values = signal_of(time, np.random.default_rng(1)) / G + [0.0, 0.0, 1.0]
    found = first_look(written(tmp_path / "a.csv", "time,x,y,z", time, values))
    assert not found.vibration.onsets.size
    assert any("Blows: none" in line and word in line for line in found.told)


@pytest.mark.parametrize(
    ("header", "why"),
    [
        ("time,q1,q2,q3", "joint angles"),
        ("time,gx,gy,gz", "a gyroscope"),
        ("time,x [mm],y [mm],z [mm]", "positions"),
        ("time,Acc1,Acc2,Acc3", "an array over joints"),
    ],
)
def test_other_series_are_no_accelerometer(tmp_path, header, why):
    time = np.arange(500) / 1000.0
    values = np.random.default_rng(2).standard_normal((500, 3))
    found = first_look(written(tmp_path / "a.csv", header, time, values))
    assert found.vibration is None, why
    assert found.to_dict()["vibration"] is None


class Terminal(io.StringIO):
    """A person who types."""

    def isatty(self):
        return True


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    time, values, _ = struck(TWO, (1.0, 4.0), 12, 0.040, length=7.0)
    path = tmp_path_factory.mktemp("log") / "shift.csv"
    return written(path, "time,x,y,z", time, values / G + [0.0, 0.0, 1.0])


def test_at_a_terminal_the_rest_is_asked_and_the_mapping_counts(log, tmp_path, monkeypatch, capsys):
    answers = ["no_robot", "fanuc_like_3dof", "elbow", "", "0.1, 0.5", "0.1, 0.5, -0.8",
               "2026-03-01 08:00", "m.toml"]  # fmt: skip
    monkeypatch.setattr(sys, "stdin", Terminal("\n".join(answers) + "\n"))
    with contextlib.chdir(tmp_path):
        assert run(["import", str(log)]) == 0
        said = capsys.readouterr()
        assert "no such robot" in said.err
        assert "a number for each joint" in said.err
        rules = read_mapping("m.toml")
        assert [entry.to for entry in rules.channel] == [f"accelerometer.tool.{a}" for a in "xyz"]
        assert {entry.unit for entry in rules.channel} == {"g"}
        assert rules.blows.pose == [0.1, 0.5, -0.8]
        monkeypatch.setattr(sys, "stdin", io.StringIO())
        command = ["count", "fanuc_like_3dof", "--log", str(log), "--mapping", "m.toml"]
        assert run([*command, "--ledger", "l"]) == 0
    assert "24 blows in 1 log" in capsys.readouterr().out


def test_without_a_terminal_nothing_is_asked(log, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "stdin", io.StringIO("fanuc_like_3dof\n"))
    with contextlib.chdir(tmp_path):
        assert run(["import", str(log), "--report", "page.html"]) == 0
        assert [p.name for p in tmp_path.iterdir()] == ["page.html"]
    out = capsys.readouterr().out
    assert "24 in 2 bursts, 25 a second" in out
    assert "Robot" not in out
    page = (tmp_path / "page.html").read_text()
    assert page.count("<svg") == 2
    assert "24 in 2 bursts, 25 a second" in page
