"""The published tables of the blind trial are those that its rows give."""

import shutil
from pathlib import Path

import pytest
import trial_tables

DOCS = Path(__file__).resolve().parents[3] / "docs" / "validation"
PAGE = DOCS / "blind_trial.md"


@pytest.fixture(scope="module")
def rows():
    return trial_tables.read_rows(DOCS / "data/exact.jsonl")


def test_the_page_says_what_the_rows_say(rows):
    assert trial_tables.printed(rows) in PAGE.read_text(), (
        "python benchmarks/blind_trial.py --out docs/validation/data/exact.jsonl --summary "
        "--page docs/validation/blind_trial.md brings the page up to date"
    )


def test_the_page_says_what_worlds_that_are_a_little_wrong_say():
    told = trial_tables.read_rows(DOCS / trial_tables.WRONG)
    assert trial_tables.printed_wrong(told) in PAGE.read_text(), (
        "python benchmarks/blind_trial.py --out docs/validation/data/exact.jsonl --summary "
        "--page docs/validation/blind_trial.md brings the page up to date"
    )


def test_rows_are_told_by_their_draws_and_mismatches():
    rows = [{"case": f"arm/null//40/{n}/1 times wrong", "mismatch": 1.0} for n in range(4)]
    rows += [{"case": "arm/null//40/2", "draw": 2}, {**rows[2], "mismatch": 2.0}]
    assert trial_tables.of_draws(rows, range(1, 3), [1.0]) == rows[1:3]
    assert trial_tables.of_draws(rows, range(2, 3)) == [rows[2], rows[5]]
    assert trial_tables.of_draws(rows) == [*rows[:4], rows[5]]


@pytest.mark.parametrize("name", trial_tables.SIMPLER)
def test_the_page_says_how_simpler_ways_did(name, rows):
    assert trial_tables.printed_against(rows, DOCS / name) in PAGE.read_text()


def test_a_page_is_brought_up_to_date(rows, tmp_path):
    page = Path(shutil.copy(PAGE, tmp_path / "page.md"))
    trial_tables.into_page(rows[:50], page)
    assert trial_tables.printed(rows[:50]) in page.read_text()
    trial_tables.into_page(rows, page)
    assert page.read_text() == PAGE.read_text()


def test_no_case_is_counted_twice(rows):
    cases = [row["case"] for row in rows]
    assert len(set(cases)) == len(cases)
    assert len({row["salt"] for row in rows}) == 1


def test_the_curve_counts_the_cases_that_every_way_was_given_at_every_mismatch(tmp_path, capsys):
    def rows(outcomes):
        return [
            {"case": f"arm/single//40/{draw}/{size} times wrong", "kind": "single",
             "verdict": "named", "mismatch": size, "outcome": outcome}
            for (draw, size), outcome in outcomes.items()
        ]  # fmt: skip

    ways = {
        "one": rows({(0, 0): "right", (0, 2): "wrong", (1, 0): "right", (1, 2): "right"}),
        "two": rows({(0, 0): "right", (0, 2): "undecided", (1, 0): "wrong"}),
    }
    table = trial_tables.curve(ways)
    assert table == {
        ("single", 0, "one"): [1, 0, 0], ("single", 0, "two"): [1, 0, 0],
        ("single", 2, "one"): [0, 0, 1], ("single", 2, "two"): [0, 1, 0],
    }  # fmt: skip
    trial_tables.print_curve(ways)
    assert capsys.readouterr().out.splitlines()[3].split() == ["single", "2", "one", "0", "0", "1"]
    trial_tables.draw_curve(ways, tmp_path / "curve.png")
    assert (tmp_path / "curve.png").stat().st_size > 5000


def test_the_page_has_the_curve_that_its_rows_give(capsys):
    files = {"picchio": "wrong", "before": "wrong_before", "plain BIC": "wrong_plain_bic"}
    ways = {
        way: trial_tables.read_rows(DOCS / "data" / f"{name}.jsonl") for way, name in files.items()
    }
    trial_tables.print_curve(ways)
    assert capsys.readouterr().out.rstrip() in PAGE.read_text()
