"""Tables of fatigue tests as people write them: what is taken for what, and what is refused."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pylife.materialdata.woehler as pylife
import pytest

from picchio.core.errors import InputError, PicchioWarning
from picchio.fatigue.sn.fit import fit_sn
from picchio.fatigue.sn.test_table import read_sn_tests

# The same two tests in every table: an amplitude of 300 MPa broke at 1e5 cycles, one of 200 MPa
# was alive at 1e7. Stress as it stands there, for either row.
R01 = 2.0 / 0.9  # max of an amplitude of 1 at R = 0.1
KSI = 6.894757293168361  # MPa, NIST SP 811


def written(folder: Path, header: str, rows: list[tuple[object, ...]], sep: str = ",") -> Path:
    path = folder / "tests.csv"
    lines = [header, *(sep.join(map(str, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


STRESSES = [
    ("Stress amplitude [MPa]", 1.0),
    ("Stress range [MPa]", 2.0),
    ("Δσ [MPa]", 2.0),
    ("Delta S (N/mm²)", 2.0),
    ("StressRange_MPa", 2.0),
    ("double amplitude [MPa]", 2.0),
    ("Nominal stress range / MPa", 2.0),
    ("σ_a [N/mm^2]", 1.0),
    ("Sa (ksi)", 1.0 / KSI),
    ("S_a_MPa", 1.0),
    ("alternating stress (psi)", 1e3 / KSI),
    ("Stress Amp. [Pa]", 1e6),
    ("shear stress amplitude [GPa]", 1e-3),
    ("Stress (amplitude) [MPa]", 1.0),
    ("Stress [MPa] (range)", 2.0),
    ("tau_a [MPa]", 1.0),
    ("load [MPa]", 1.0),  # pyLife
    ("S [MPa]", 1.0),
    ("Stress S [Mpa]", 1.0),
]


@pytest.mark.parametrize(("name", "factor"), STRESSES)
def test_what_a_stress_is(tmp_path: Path, name: str, factor: float) -> None:
    rows = [(300 * factor, 1e5, "Failure"), (200 * factor, 1e7, "RunOut")]
    tests = read_sn_tests(written(tmp_path, f"{name},Cycles,Outcome", rows))
    np.testing.assert_allclose(tests.amplitude, [300e6, 200e6], rtol=1e-9)
    assert name in tests.assumptions[0]


MEANS = [
    ("Max stress [MPa],R", (R01, 0.1), (R01, 0.1)),
    ("Smax [MPa],Stress ratio", (R01, 0.1), (1.0, -1.0)),
    ("σ_max [MPa],R [-]", (2.0, 0.0), (2.0, 0.0)),
    ("maximum stress [ksi],R-ratio", (R01 / KSI, 0.1), (1 / KSI, -1.0)),
    ("Smax [MPa],Smin [MPa]", (2.0, 0.0), (1.0, -1.0)),
    ("upper stress [MPa],lower stress [MPa]", (3.0, 1.0), (3.0, 1.0)),
    ("Max stress [MPa],mean stress [MPa]", (3.0, 2.0), (1.0, 0.0)),
    ("Mean stress [MPa],R", (11 / 9, 0.1), (3.0, 0.5)),
    ("Stress amplitude [MPa],R", (1.0, 0.1), (1.0, -1.0)),
    ("Max stress [MPa],R", (-0.2 / 0.9, 10.0), (-0.2 / 0.9, 10.0)),  # pressed only
]


@pytest.mark.filterwarnings("ignore:.*several mean stresses")
@pytest.mark.parametrize(("names", "first", "second"), MEANS)
def test_an_amplitude_follows(tmp_path: Path, names: str, first: tuple[float, float],
                              second: tuple[float, float]) -> None:  # fmt: skip
    ratio = names.split(",")[1] in {"R", "R [-]", "Stress ratio", "R-ratio"}
    rows = [
        (300 * first[0], first[1] * (1 if ratio else 300), 1e5, "Failure"),
        (200 * second[0], second[1] * (1 if ratio else 200), 1e7, "RunOut"),
    ]
    tests = read_sn_tests(written(tmp_path, f"{names},Cycles,Outcome", rows))
    np.testing.assert_allclose(tests.amplitude, [300e6, 200e6], rtol=1e-9)


CYCLES = [
    ("Cycles", 1.0),
    ("Cycles [x1000]", 1e3),
    ("Cycles [10^3]", 1e3),
    ("Cycles x 10³", 1e3),
    ("Cycles (thousands)", 1e3),
    ("Cycles in thousands", 1e3),
    ("Cycles/1000", 1e3),
    ("N [1e3]", 1e3),
    ("N × 10^6", 1e6),
    ("Cycles [1,000,000]", 1e6),
    ("kilocycles", 1e3),
    ("Kilocycles to failure", 1e3),
    ("Life [kcycles]", 1e3),
    ("Life (Mcycles)", 1e6),
    ("Million cycles", 1e6),
    ("N_f", 1.0),
    ("Nf [-]", 1.0),
    ("Cycles N [-]", 1.0),
    ("Number of cycles", 1.0),
    ("No. of cycles to failure", 1.0),
    ("fatigue life (cycles)", 1.0),
    ("2Nf", 0.5),
    ("Reversals to failure", 0.5),
    ("log10 cycles", "log"),
    ("log(N)", "log"),
    ("logN", "log"),
    ("Log10(Nf) [-]", "log"),
    ("lg N", "log"),
    ("Cycles [log10]", "log"),
    ("ln N", "ln"),
]


@pytest.mark.parametrize(("name", "factor"), CYCLES)
def test_in_what_the_cycles_are(tmp_path: Path, name: str, factor: float | str) -> None:
    cycles = np.array([1e5, 1e7])
    made = {"log": np.log10, "ln": np.log}.get(str(factor), lambda n: n / float(factor))(cycles)
    header = f'Stress amplitude [MPa],"{name}",Outcome'
    rows = [(300, float(made[0]), "Failure"), (200, float(made[1]), "RunOut")]
    tests = read_sn_tests(written(tmp_path, header, rows))
    np.testing.assert_allclose(tests.cycles, cycles, rtol=1e-9)
    assert any(name in note for note in tests.assumptions)


OUTCOMES = [
    ("fracture", "True", "False"),
    ("Failure", "1", "0"),
    ("Failed?", "yes", "no"),
    ("broken", "x", ""),
    ("Runout", "no", "yes"),
    ("run out", "False", "True"),
    ("Run-out", "0", "1"),
    ("RunOut", "", "x"),
    ("censored", "FALSE", "TRUE"),
    ("Survived", "n", "y"),
    ("Suspended", "0", "1"),
    ("Outcome", "Failure", "RunOut"),
    ("Result", "fracture", "run-out"),
    ("status", "F", "suspended"),
    ("Comment", "failed", "Run out"),
    ("Status (1 = failed)", "1", "0"),
    ("Status (1 = runout)", "0", "1"),
    ("Failure [0 = failed]", "0", "1"),
]


@pytest.mark.parametrize(("name", "broke", "lives"), OUTCOMES)
def test_what_failed(tmp_path: Path, name: str, broke: str, lives: str) -> None:
    rows = [(300, 1e5, broke), (250, 1e6, broke), (200, 1e7, lives), (210, 5e6, lives)]
    tests = read_sn_tests(written(tmp_path, f"S [MPa],N,{name}", rows))
    assert tests.failed.tolist() == [True, True, False, False]
    assert any(name in note for note in tests.assumptions)


def test_the_column_that_is_meant(tmp_path: Path) -> None:
    """Other cycles, loads and strengths stand beside; what is not used is told."""
    header = (
        "Specimen,Block cycles,Max load [kN],Yield stress [MPa],Stress amplitude [MPa],"
        "Strain amplitude [%],Cycles to failure,Test frequency [Hz],Failure mode,Failure"
    )
    rows = [("A1", 100, 9.1, 500, 300, 0.2, 1e5, 20, "root", "yes"),
            ("A2", 100, 7.2, 500, 200, 0.1, 1e7, 20, "none", "no")]  # fmt: skip
    tests = read_sn_tests(written(tmp_path, header, rows))
    assert tests.amplitude.tolist() == [300e6, 200e6]
    assert tests.cycles.tolist() == [1e5, 1e7]
    assert tests.failed.tolist() == [True, False]
    assert "not used: Specimen, Block cycles, Max load [kN]" in tests.assumptions[-1]


@pytest.mark.parametrize(
    ("encoding", "sep", "decimal"),
    [("cp1252", ";", ","), ("utf-16", "\t", ","), ("utf-8-sig", ";", "."), ("utf-8", ",", ".")],
)
def test_tables_from_a_spreadsheet(tmp_path: Path, encoding: str, sep: str, decimal: str) -> None:
    lines = [["Stress range [N/mm²]", "Cycles", "Failure"], ["600,5", "100000", "yes"],
             ["400,25", "10000000", "no"]]  # fmt: skip
    text = "\r\n".join(sep.join(c.replace(",", decimal) for c in line) for line in lines) + "\r\n"
    (tmp_path / "tests.csv").write_text(text, encoding=encoding, newline="")
    tests = read_sn_tests(tmp_path / "tests.csv")
    np.testing.assert_allclose(tests.amplitude, [300.25e6, 200.125e6], rtol=1e-12)
    assert tests.failed.tolist() == [True, False]


def test_without_outcomes(tmp_path: Path) -> None:
    path = tmp_path / "tests.csv"
    path.write_text("Stress [ksi]\tCycles\n40\t1e5\n30\t1e7\n29\t1e7\n")
    with pytest.warns(PicchioWarning, match="1e\\+07 cycles are run-outs"):
        tests = read_sn_tests(path)
    assert tests.failed.tolist() == [True, False, False]
    assert tests.amplitude[0] == pytest.approx(40e6 * KSI, rel=1e-6)
    assert read_sn_tests(path, run_out_cycles=2e7).failed.all()


DECIDED = [
    ("Stress [MPa],N,R\n500,1e5,0.1\n400,1e6,0.1\n", "--stress range", {"stress": "max"}, 225e6),
    ("Stress [MPa],N,R\n500,1e5,0.1\n400,1e6,0.1\n", "--stress", {"stress": "range"}, 250e6),
    ("Stress [MPa],N,R\n500,1e5,0.1\n400,1e6,0.1\n", "--stress", {"stress": "amplitude"}, 500e6),
    ("Max stress [MPa],N\n500,1e5\n400,1e6\n", "--ratio", {"ratio": 0.1}, 225e6),
    ("Max stress [MPa],N\n500,1e5\n400,1e6\n", "--stress", {"stress": "amplitude"}, 500e6),
    ("load,cycles\n500,1e5\n400,1e6\n", "--stress-unit", {"stress_unit": "ksi"}, 500e6 * KSI),
    ("Local stress amplitude [MPa],Nominal stress amplitude [MPa],N\n500,300,1e5\n400,200,1e6\n",
     "--stress-column", {"stress_column": "Nominal stress amplitude [MPa]"}, 300e6),
    ("Stress amplitude [MPa],Stress range [MPa],N\n500,700,1e5\n400,500,1e6\n",
     "--stress-column", {"stress_column": "Stress range [MPa]"}, 350e6),
    ("S [MPa],Cycles to failure,Cycles to fracture\n500,1e5,2e5\n400,1e6,2e6\n", "--cycles",
     {"cycles": "Cycles to failure"}, 500e6),
    ("S [MPa],N,Failure,Runout\n500,1e5,1,1\n400,1e6,0,0\n", "--outcome", {"outcome": "Failure"},
     500e6),
]  # fmt: skip


@pytest.mark.parametrize(("text", "option", "decides", "first"), DECIDED)
def test_what_is_not_sure_is_refused_with_the_option_that_decides(
    tmp_path: Path, text: str, option: str, decides: dict[str, object], first: float
) -> None:
    path = tmp_path / "tests.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=option):
        read_sn_tests(path)
    assert read_sn_tests(path, **decides).amplitude[0] == pytest.approx(first, rel=1e-9)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("Stress [MPa],Cycles\n", "no line of numbers"),
        ("Strain [-],Cycles\n1,2\n", "column named like 'stress'.*--stress-column"),
        ("Stress [MPa],Block time\n1,2\n", "column named like 'cycles'.*--cycles"),
        ("Stress,Cycles\n1,2\n", "unit"),
        ("Stress [furlong],Cycles\n1,2\n", "furlong.*valid: Pa"),
        ("Load [kgf],Cycles\n300,1e5\n", "kgf"),
        ("Stress [MPa],Cycles\n300,1e5\n280,many\n290,2e5\n", "line 3.*Cycles"),
        ("Stress [MPa],Cycles\n300,1e5\n-5,1e5\n", "line 3.*positive"),
        ("Stress [MPa],Cycles,Outcome\n300,1e5,maybe\n", "line 2.*maybe.*RunOut"),
        ("Stress [MPa],Cycles,Failure\n300,1e5,2\n", "line 2.*'2'"),
        ("Stress [MPa],Cycles,Outcome\n300,1e5,Failure\n290,1e6,\n", "line 3.*empty"),
        ("Stress [MPa],Cycles,Status\n300,1e5,0\n290,1e7,1\n280,1e7,1\n", "seems to be a run-out"),
        ("Stress [MPa],Cycles\n300,5.1\n290,6.2\n", "longest life.*log10"),
        ("Stress [MPa],Life [h]\n300,500\n290,600\n", "time.*'h'"),
        ("Stress amplitude [MPa],Stress range [MPa],N\n300,600,1e5\n200,300,1e6\n", "line 3.*150"),
        ("300,1e5\n290,1e6\n", "header"),
    ],
)
def test_a_bad_table_names_its_line(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "tests.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message) as caught:
        read_sn_tests(path)
    assert "\n" not in str(caught.value)


def test_a_line_that_is_left_out_is_told(tmp_path: Path) -> None:
    path = tmp_path / "tests.csv"
    path.write_text("S [MPa],N,Failure\n300,1e5,1\n290,2e5,1\nS [MPa],N,Failure\n200,1e7,0\n"
                    "9,9\n210,8e6,0\n")  # fmt: skip
    tests = read_sn_tests(path)
    assert tests.cycles.tolist() == [1e5, 2e5, 1e7, 8e6]
    told = " ".join(tests.assumptions)
    assert re.search(r"line 4\b.*header", told)
    assert re.search(r"line 6\b.*not 3 cells", told)


def test_a_mean_stress_is_told(tmp_path: Path) -> None:
    path = written(tmp_path, "Smax [MPa],R,N", [(500, 0.1, 1e5), (400, 0.1, 1e6)])
    assert any("1.22 times the amplitude" in note for note in read_sn_tests(path).assumptions)
    path = written(tmp_path, "Smax [MPa],R,N", [(500, 0.1, 1e5), (400, -1, 1e6)])
    with pytest.warns(PicchioWarning, match="several mean stresses"):
        read_sn_tests(path)


HABITS = [
    ("load [MPa],cycles,fracture", 1.0, 1.0, ("True", "False")),
    ("Stress range [MPa],Cycles [x1000],Runout", 2.0, 1e-3, ("no", "yes")),
    ("Smax (ksi),log N,R,censored", 2.0 / KSI, 0.0, ("0", "1")),
]


@pytest.mark.parametrize(("header", "stress", "times", "words"), HABITS)
def test_against_pylife(measured_data: Path, tmp_path: Path, header: str, stress: float,
                        times: float, words: tuple[str, str]) -> None:  # fmt: skip
    """Of one real set of tests in three habits: pyLife's slope and limit, from its own columns."""
    real = pd.read_csv(measured_data / "sn-tests" / "fatigue-data-fractures.csv")
    real.columns = ["load", "cycles", "outcome"]
    real["fracture"] = real["outcome"] == "Failure"
    shown = np.log10(real["cycles"]) if times == 0.0 else real["cycles"] * times
    parts = [(real["load"] * stress).tolist(), shown.tolist()]
    if ",R," in header:
        parts.append([0.0] * len(real))  # from zero: the maximum is the range
    outcomes = [words[0] if broke else words[1] for broke in real["fracture"]]
    rows = list(zip(*parts, outcomes, strict=True))
    found = fit_sn(written(tmp_path, header, rows))
    data = real[["load", "cycles", "fracture"]].fatigue_data
    theirs = pylife.MaxLikeInf(data).analyze()
    assert (found.failures, found.run_outs) == (22, 8)
    assert found.slope.low < theirs["k_1"] < found.slope.high
    assert found.endurance_limit.value == pytest.approx(1e6 * theirs["SD"], rel=0.03)
