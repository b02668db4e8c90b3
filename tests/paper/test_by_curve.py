"""Table 2 without an arm: the method finds which curve made a table, if any did."""

import numpy as np
import pytest

from picchio.paper.printed import printed
from picchio.paper.table2.by_curve import curve_of_table, rounding_of


def table(cycles):
    """The paper with other lives in Table 2, rounded to three digits as it has them."""
    paper = printed()
    rows = [
        row.model_copy(update={"cycles": tuple(float(f"{n:.2e}") for n in values)})
        for row, values in zip(paper.table2, cycles, strict=True)
    ]
    return paper.model_copy(update={"table2": tuple(rows)})


@pytest.mark.parametrize(
    ("factor", "name"),
    [(1.0, "the curve as printed"), (12.0, "as printed, rivets for hits"),
     (5.0, "as printed, times a factor")],
)  # fmt: skip
def test_a_table_by_the_printed_curve_is_told(factor, name):
    paper = printed()
    found = curve_of_table(table(paper.sn_curve.cycles(paper.stress) / factor))
    assert found.fits[0].name == name
    assert found.fits[0].set_aside is None
    assert np.abs(found.fits[0].residuals).max() < 0.01


@pytest.mark.parametrize("out", [None, 0, 5])
def test_a_table_by_another_curve_and_its_misprint_are_told(out):
    paper = printed()
    with np.errstate(divide="ignore"):
        cycles = (5.0e4 / paper.stress) ** 2.3
    if out is not None:
        row, joint = [(r, j) for r in range(3) for j in range(3) if paper.stress[r, j] > 0][out]
        cycles[row, joint] *= 1.8
    found = curve_of_table(table(cycles)).fits[0]
    assert found.name == "another curve S = a N^b"
    assert found.set_aside == out
    assert found.values["exponent"] == pytest.approx(2.3, rel=1e-3)
    assert found.values["a"] == pytest.approx(5.0e4, rel=1e-2)


def test_a_table_of_noise_belongs_to_no_curve():
    paper = printed()
    rng = np.random.default_rng(5)
    cycles = np.where(paper.stress > 0, 10 ** rng.uniform(5, 8, (3, 3)), np.inf)
    found = curve_of_table(table(cycles)).fits[0]
    assert found.left_out_median > 0.3


def test_the_papers_own_table():
    found = curve_of_table(printed())
    assert found.over_printed.min() == pytest.approx(12.2, abs=0.05)
    assert found.over_printed.max() == pytest.approx(115.9, abs=0.1)
    best = found.fits[0]
    assert found.labels[best.set_aside] == "left, joint 3"
    kept = np.delete(np.arange(8), best.set_aside)
    # By numpy alone: a line through the logarithms of the other seven.
    slope, start = np.polyfit(np.log(found.stress[kept]), np.log(found.cycles[kept]), 1)
    assert best.values["exponent"] == pytest.approx(-slope)
    assert best.values["a"] == pytest.approx(np.exp(-start / slope))
    # Within what rounding can do.
    assert (np.abs(best.residuals[kept]) <= found.rounding[kept]).all()
    rivals = [f for f in found.fits if f.name != best.name]
    assert min(f.bic for f in rivals) - best.bic > 20


def test_rounding_covers_what_rounding_does():
    rng = np.random.default_rng(0)
    exact_n, exact_s = 10 ** rng.uniform(5, 8, 500), rng.uniform(5, 60, 500)
    n = np.array([float(f"{v:.2e}") for v in exact_n])
    s = np.round(exact_s, 2)
    off = np.abs(np.log(n / exact_n) + 2.8 * np.log(s / exact_s))
    bound = rounding_of(s, n, 2.8)
    assert (off <= bound * 1.01).all()
    assert off.max() > 0.5 * bound[off.argmax()]
