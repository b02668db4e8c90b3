"""The data file holds what the paper prints, and every sentence in it is tried."""

import re
from pkgutil import resolve_name

import numpy as np
import pytest

from picchio.paper.claims import OF_STUDY, OF_WORLD
from picchio.paper.equations import GAPS
from picchio.paper.figures import FIGURES
from picchio.paper.printed import printed, trials
from picchio.paper.world import Assumptions, parse_assumptions


def test_every_sentence_is_tried_and_every_test_has_its_sentence():
    claims = trials().claims
    assert set(claims) == set(printed().claims)
    assert len(claims) >= 20
    assert (OF_WORLD | OF_STUDY).keys() >= {k for k, claim in claims.items() if not claim.unknown}
    assert not OF_WORLD.keys() & OF_STUDY.keys()
    assert claims.keys() >= OF_WORLD.keys() | OF_STUDY.keys()
    for sentence in printed().claims.values():
        assert 292 <= sentence.page <= 301


def test_what_is_tried_names_what_exists():
    told = trials()
    assert told.figures.keys() == FIGURES.keys()
    assert {entry["figure"] for entry in told.conflicts.values()} <= FIGURES.keys()
    figures = {claim.figure for claim in told.claims.values()}
    assert figures <= FIGURES.keys() | {"", "table-2", "equations"}
    assert {entry["gap"] for entry in told.equations.values()} == GAPS.keys()
    for entry in told.equations.values():
        assert callable(resolve_name(entry["function"]))
    for claim in told.claims.values():
        assert set(claim.among) <= told.inputs.keys()


def test_the_equations_are_all_there():
    assert list(printed().equations) == [str(k) for k in range(1, 23)]


def test_every_input_has_a_base_value_within_its_range():
    base = Assumptions()
    assert trials().inputs.keys() == vars(base).keys()
    for name, entry in trials().inputs.items():
        value = getattr(base, name)
        if entry.choices:
            assert value in entry.choices
        else:
            assert entry.low <= value <= entry.high


@pytest.mark.parametrize(
    ("word", "part"),
    [
        ("perod=1", "period"),
        ("period", "NAME=VALUE"),
        ("period=-1", "positive"),
        ("period=nan", "finite"),
        ("duty=1.5", "below 1"),
        ("elbow=left", "down"),
        ("rows=2.5", "whole"),
    ],
)
def test_a_wrong_assumption_is_told(word, part):
    with pytest.raises(Exception, match=part):
        parse_assumptions([word])


def test_assumptions_are_read():
    given = parse_assumptions(["period=0.1", "elbow=up", "rows=5"])
    assert (given.period, given.elbow, given.rows) == (0.1, "up", 5)
    assert isinstance(given.rows, int)


def plain(text):
    for old, new in (("−", "-"), ("–", "-"), ("’", "'"), ("\n", " "), ("¼", "=")):
        text = text.replace(old, new)
    return re.sub(r"[^a-z0-9.+-]+", " ", text.lower())


def test_the_file_against_the_papers_text(measured_data):
    path = measured_data.parent / "paper.txt"
    if not path.is_file():
        pytest.skip("no measured data here: the paper's text is missing")
    # The text has two columns; a sentence may break over lines and hyphens.
    text = plain(path.read_text("utf-8").replace("-\n", ""))
    paper = printed()
    for row in paper.table2:
        for value in row.stress:
            assert f"{value:g}" in text
    for cycles in paper.cycles[np.isfinite(paper.cycles)]:
        mantissa, exponent = f"{cycles:.2e}".split("e+")
        assert re.search(rf"{mantissa}e *{exponent}", text), cycles
    assert "18930" in text
    assert "0.3548" in text
    missing = []
    for name, sentence in paper.claims.items():
        words = re.findall(r"[a-z]{4,}", plain(sentence.quote))
        share = np.mean([word in text for word in words]) if words else 1.0
        if share < 0.85:
            missing.append((name, share))
    assert not missing
