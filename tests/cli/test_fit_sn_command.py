"""`picchio fit-sn` on made and on real tests."""

import json

import numpy as np
import pytest

from picchio.fatigue.sn.library import load_sn_curve


@pytest.fixture
def tests_file(tmp_path):
    """Forty tests of a known law: slope 6, scatter 0.03, limit 300 MPa."""
    rng = np.random.default_rng(1)
    rows = ["Stress [MPa],Cycles,Comment"]
    for stress in np.repeat([280, 320, 360, 420, 480], 8):
        strength = 300 * 10 ** (0.03 * rng.normal())
        life = 1e6 * (stress / strength) ** -6.0
        failed = stress > strength and life < 1e7
        cycles, outcome = (life, "Failure") if failed else (1e7, "RunOut")
        rows.append(f"{stress},{cycles:.0f},{outcome}")
    path = tmp_path / "tests.csv"
    path.write_text("\n".join(rows))
    return path


def test_a_curve_that_assess_can_use(picchio, tests_file, tmp_path):
    out = tmp_path / "my-steel.toml"
    done = picchio("fit-sn", tests_file, "--out", out, "--json", "-")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["format"] == "picchio-sn/1"
    assert found["slope"]["low"] < 6.0 < found["slope"]["high"]
    assert found["endurance_limit"]["value"] == pytest.approx(300e6, rel=0.05)
    assert found["scatter"]["value"] > 0.01
    curve = load_sn_curve(out)
    assert curve.survival == 0.975
    assert curve.endurance_limit == pytest.approx(found["design"]["value"], rel=0.01)
    done = picchio("assess", "fanuc_like_3dof", "--sn-curve", out, "-v")
    assert done.returncode == 0, done.stderr
    assert "my-steel" in done.stdout


def test_real_tests_print_a_table(picchio, measured_data):
    done = picchio("fit-sn", measured_data / "sn-tests" / "fatigue-data-fractures.csv")
    assert done.returncode == 0, done.stderr
    for word in ("slope", "endurance limit", "scatter", "interval", "run-outs"):
        assert word in done.stdout


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("", "is empty"),
        ("Stress [MPa],Cycles\n300,x\n", "line 2"),
        ("Load [kgf],Cycles\n300,10\n", "kgf"),
        ("a,b\n1,2\n", "stress"),
    ],
)
def test_bad_tables(picchio, tmp_path, text, part):
    path = tmp_path / "tests.csv"
    path.write_text(text)
    done = picchio("fit-sn", path)
    assert done.returncode == 2
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1
    assert part in done.stderr.lower()


def test_the_options_that_say_what_a_column_is(picchio, tests_file):
    """The same tests as maxima from zero, with a column of outcomes that has no usual name."""
    lines = tests_file.read_text().replace("Comment", "Verdict").splitlines()
    rows = [f"{2 * float(x)},{y}" for x, _, y in (line.partition(",") for line in lines[1:])]
    tests_file.write_text("\n".join([lines[0], *rows]))
    options = ["--stress", "max", "--ratio", "0", "--outcome", "Verdict", "--cycles", "Cycles",
               "--stress-column", "Stress [MPa]", "--stress-unit", "MPa"]  # fmt: skip
    done = picchio("fit-sn", tests_file, *options, "--json", "-")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["endurance_limit"]["value"] == pytest.approx(300e6, rel=0.05)
    assert any("max (1 - R) / 2, of Stress [MPa]" in note for note in found["assumptions"])


def test_a_picture_of_real_tests(picchio, measured_data, tmp_path):
    source = measured_data / "sn-tests" / "fatigue-data-fractures.csv"
    for name, start in (("fit.png", b"\x89PNG"), ("fit.svg", b"<?xml"), ("fit.PDF", b"%PDF")):
        done = picchio("fit-sn", source, "--plot", tmp_path / name)
        assert done.returncode == 0, done.stderr
        assert (tmp_path / name).read_bytes().startswith(start)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["fit.PDF", "fit.png", "fit.svg"]


def test_a_picture_of_no_known_kind(picchio, tests_file, tmp_path):
    done = picchio("fit-sn", tests_file, "--plot", tmp_path / "fit.docx")
    assert done.returncode == 2
    assert "--plot" in done.stderr
    assert ".png" in done.stderr
    assert not (tmp_path / "fit.docx").exists()
