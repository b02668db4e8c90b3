"""The published tables of the blind trial are those that its rows give."""

import shutil
from pathlib import Path

import pytest
import trial_tables

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGE = DOCS / "blind_trial.md"


@pytest.fixture(scope="module")
def rows():
    return trial_tables.read_rows(DOCS / "blind_trial.jsonl")


def test_the_page_says_what_the_rows_say(rows):
    assert trial_tables.printed(rows) in PAGE.read_text(), (
        "python benchmarks/blind_trial.py --out docs/blind_trial.jsonl --summary "
        "--page docs/blind_trial.md brings the page up to date"
    )


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
