from __future__ import annotations

from pathlib import Path

import pytest

from picchio.core.errors import InputError, PicchioWarning
from picchio.fatigue.sn.test_table import read_sn_tests


def test_reading_a_table(tmp_path: Path) -> None:
    path = tmp_path / "tests.csv"
    path.write_text("Stress S [Mpa],Cycles N [-],Comment\n300,1e5,Failure\n280,1e7,RunOut\n")
    tests = read_sn_tests(path)
    assert tests.amplitude.tolist() == [300e6, 280e6]
    assert tests.failed.tolist() == [True, False]
    path.write_text("Stress [ksi]\tCycles\n40\t1e5\n30\t1e7\n29\t1e7\n")
    with pytest.warns(PicchioWarning, match="1e\\+07 cycles are run-outs"):
        tests = read_sn_tests(path)
    assert tests.failed.tolist() == [True, False, False]
    assert tests.amplitude[0] == pytest.approx(40 * 6.894757e6, rel=1e-6)
    assert read_sn_tests(path, run_out_cycles=2e7).failed.all()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("Stress [MPa],Cycles\n", "no tests"),
        ("Strain [-],Cycles\n1,2\n", "column named like 'stress'"),
        ("Stress,Cycles\n1,2\n", "unit"),
        ("Stress [furlong],Cycles\n1,2\n", "furlong"),
        ("Stress [MPa],Cycles\n300,many\n", "row 2.*many"),
        ("Stress [MPa],Cycles\n300,1e5\n-5,1e5\n", "row 3"),
        ("Stress [MPa],Cycles,Outcome\n300,1e5,maybe\n", "row 2.*maybe"),
    ],
)
def test_a_bad_table_names_its_row(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "tests.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read_sn_tests(path)
