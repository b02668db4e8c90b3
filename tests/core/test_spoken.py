"""Numbers as people read them, and the words that have only one meaning."""

import math
import re
from pathlib import Path

import pytest

import picchio
from picchio.core import spoken

SOURCE = Path(picchio.__file__).parent


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "-"), (math.nan, "-"), (math.inf, "unlimited"), (0.0, "0"), (3e-12, "about 0"),
        (0.04123, "0.0412"), (-2.4996, "-2.5"), (43.82, "43.8"), (999.6, "1,000"),
        (12345.0, "12,300"), (-240_000.0, "-240,000"), (7.93e10, "7.93e10"), (1e9, "1e9"),
        (1.5e-6, "1.5e-6"),
    ],
)  # fmt: skip
def test_numbers_as_an_engineer_says_them(value, text):
    assert spoken.number(value) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.3, "< 1"), (0.0, "0"), (7.4, "7.4"), (2_838_123, "2,840,000"), (2.8e9, "> 1e9"),
     (math.inf, "unlimited"), (None, "-")],
)  # fmt: skip
def test_counts_end_where_nobody_needs_to_know(value, text):
    assert spoken.count(value) == text


def test_shares_intervals_and_factors():
    assert [spoken.per_cent(x) for x in (7.91e-9, 0.0868, 1.304, math.nan)] == [
        "about 0", "8.68", "130", "-"]  # fmt: skip
    assert [spoken.per_cent(x, 2) for x in (0.16, 1.64, 2.41, 12.6)] == [
        "16",
        "160",
        "240",
        "1,300",
    ]
    assert spoken.between((0.0912, 0.332), spoken.per_cent) == "9.12 to 33.2"
    assert spoken.likely((0.26, 2.41)) == "26 to 240"
    assert spoken.between((7.91e-9, 3.95e-8), spoken.per_cent) == "about 0"
    assert [spoken.allowed(e) for e in ((320.0, None), (None, None), (2.0, 2.0))] == [
        "320 to unlimited", "unlimited", "2"]  # fmt: skip
    assert [spoken.factor(x) for x in (1.97, 1.34)] == ["a factor 93", "a factor 22"]


# What these words wanted to say has a word of its own, see `docs`.
OLD = (
    r"\bno end\b(?! (of|is worse)|, up)", r"\bha(s|ve) an end\b", r"\bis not assessed\b",
    r"the motor side of every joint stands", r"stands still (under|while)", r"\bfrom memory\b",
    r"[Hh]eight of (a|one|the) blow", r"doubt is from", r"of them seen, the others",
    r"what is left is noise", r"(remains|left) of the interval", r"values are uncertain",
    r"decades wide", r"powers of ten (wide|left)", r"reducer\\nused", r"fatigue: used",
    r"used on the task", r"It ends there", r"no reducer is named",
)  # fmt: skip


def test_no_old_word_is_left():
    found = [
        f"{file.relative_to(SOURCE)}: {hit[0]}"
        for file in SOURCE.rglob("*")
        if file.suffix in (".py", ".toml", ".j2", ".js", ".html")
        for hit in re.finditer("|".join(OLD), file.read_text(encoding="utf-8"))
    ]
    assert not found
