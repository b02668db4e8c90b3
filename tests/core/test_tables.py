"""Tables of text: every habit, and what is left out, against values that were written."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from picchio.core import tables
from picchio.core.dates import MISSING, moments
from picchio.core.errors import InputError
from picchio.core.tables import joined, read_table, table_blocks

HEADS = {  # what stands above the rows "0.5;1234.5": the names that must come of it
    "plain": ("t;F\n", ["t", "F"]),
    "below prose": ("Messung 7\n\nwith 3 sensors\nt;F\n", ["t", "F"]),
    "in a comment": ("# made today\n# t;F\n", ["t", "F"]),
    "in a comment of MATLAB": ("%t;F\n", ["t", "F"]),
    "a line of units and a blank one": ("t;F\n(ms);[kN]\n\n", ["t", "F"]),
    "none": ("", ["1", "2"]),
    "of another width": ("t;F;x;y\n", ["1", "2"]),
    "the same name twice": ("F;F\n", ["F", "F#2"]),
    "quoted": ('"t";"F"\n', ["t", "F"]),
    "a number for a name": ("t;1\n", ["t", "1"]),
}


@pytest.mark.parametrize("head", HEADS)
def test_the_header_wherever_it_stands(tmp_path, head):
    above, names = HEADS[head]
    path = tmp_path / "a.txt"
    path.write_text(above + "".join(f"{0.5 * k};{1234.5 + k}\n" for k in range(30)))
    found = read_table(path)
    assert list(found.columns) == names
    assert found.columns[names[0]].values.tolist() == [0.5 * k for k in range(30)]
    assert found.columns[names[1]].values.tolist() == [1234.5 + k for k in range(30)]
    assert not found.left
    assert ("line 1 has 4 cells and the rows 2" in " ".join(found.told)) == (
        head == "of another width"
    )
    if "units" in head:
        assert [c.unit for c in found.columns.values()] == ["ms", "kN"]


CUT = {  # what stands above the rows "3,4,5" and "6,7,8": names, first column, the lines left out
    "the first row": ("a,b,c\n1,2\n", ["a", "b", "c"], [3, 6], 1),
    "the first two": ("a,b,c\n1,2\n1,\n", ["a", "b", "c"], [3, 6], 2),
    "the second row": ("a,b,c\n0,1,2\n1,2\n", ["a", "b", "c"], [0, 3, 6], 1),
    "a longer one": ("a,b,c\n0,1,2\n1,2,3,4\n", ["a", "b", "c"], [0, 3, 6], 1),
    "below prose": ("Test 7\na,b,c\n1,2\n", ["a", "b", "c"], [3, 6], 1),
    "below units": ("a,b,c\n(s),(N),(N)\n1,2\n", ["a", "b", "c"], [3, 6], 1),
    "without a header": ("0,1,2\n1,2\n", ["1", "2", "3"], [0, 3, 6], 1),
}


@pytest.mark.parametrize("cut", CUT)
def test_a_row_that_is_cut_near_the_header_costs_itself_alone(tmp_path, cut):
    above, names, first, lost = CUT[cut]
    path = tmp_path / "a.csv"
    path.write_text(above + "3,4,5\n6,7,8\n")
    found = read_table(path)
    assert list(found.columns) == names
    assert found.columns[names[0]].values.tolist() == first
    assert sum(one.count for one in found.left) == lost


NUMBERS = {  # cells, separator: 1234.5 and 0.25 in each habit
    "point": (("1234.5", "0.25"), ","),
    "decimal comma": (("1234,5", "0,25"), ";"),
    "quoted decimal comma": (('"1234,5"', '"0,25"'), ","),
    "German thousands": (("1.234,5", "0,25"), ";"),
    "English thousands": (('"1,234.5"', "0.25"), ","),
    "French thousands": (("1 234,5", "0,25"), ";"),
    "Swiss thousands": (("1'234.5", "0.25"), "\t"),
    "exponents": (("1.2345E+03", "2.5e-1"), " "),
    "no leading zero": (("+1234.50", ".25"), "|"),
}


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252", "utf-16"])
@pytest.mark.parametrize("habit", NUMBERS)
def test_numbers_and_letters_of_every_habit(tmp_path, habit, encoding):
    cells, separator = NUMBERS[habit]
    path = tmp_path / "a.csv"
    rows = [separator.join(["Zeit", "Weg_µm"]), *[separator.join(cells)] * 20]
    path.write_bytes("\r\n".join(rows).encode(encoding))
    found = read_table(path).columns
    assert {name: set(c.values.tolist()) for name, c in found.items()} == {
        "Zeit": {1234.5}, "Weg_µm": {0.25},
    }  # fmt: skip


WORDS = ["#N/A", "NULL", "None", "---", "", "nan", "inf", "-∞", "overload", "?", "1.2.3"]


@pytest.mark.parametrize("word", WORDS)
@pytest.mark.parametrize("block", [4, 1000])
def test_a_cell_that_is_no_number_costs_itself_and_is_told(tmp_path, word, block):
    path = tmp_path / "a.csv"
    cells = [str(k / 4) for k in range(20)]
    cells[7] = cells[11] = word
    path.write_text("t,F\n" + "".join(f"{k},{c}\n" for k, c in enumerate(cells)))
    found = joined(list(table_blocks(path, size=block)))
    expected = np.arange(20) / 4
    expected[[7, 11]] = np.nan
    np.testing.assert_array_equal(found.columns["F"].values, expected)
    (left,) = found.left
    assert (left.column, left.cells, left.line, left.text) == ("F", 2, 9, word)
    assert "line 9" in left.told and word in left.told


def test_true_and_false_are_1_and_0_and_text_stays_text(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t,on,ok,mode,who\n0,True,FALSE,run,a\n1,False,TRUE,stop,\n2,True,,run,NULL\n")
    found = read_table(path).columns
    assert found["on"].values.tolist() == [1.0, 0.0, 1.0]
    np.testing.assert_array_equal(found["ok"].values, [0.0, 1.0, np.nan])
    assert found["mode"].values.tolist() == ["run", "stop", "run"]
    assert found["who"].values.tolist() == ["a", "", "NULL"]


LINES = {  # below 6 good rows of t,F: what is told of it
    "cut": ("6,", None),
    "cut in the cell before": ("6", "not 2 cells"),
    "one cell too many": ("6,7,8", "not 2 cells"),
    "the header again": ("t,F", "the header again"),
    "an open quote": ('6,"7', "a quote is not closed"),
}


@pytest.mark.parametrize("line", LINES)
@pytest.mark.parametrize("then", ["", "\n7,7\n"])
def test_a_line_that_is_no_row_costs_itself_and_is_told(tmp_path, line, then):
    text, why = LINES[line]
    path = tmp_path / "a.csv"
    path.write_text("t,F\n" + "".join(f"{k},{k}\n" for k in range(6)) + text + then)
    found = read_table(path)
    assert found.columns["t"].values.tolist() == [*range(6), *([6] * (why is None)),
                                                  *([7] * bool(then))]  # fmt: skip
    (left,) = found.left
    assert left.line == 8
    assert (left.why, left.cells, left.text) == ((why, 2, text) if why else ("no number", 1, ""))
    if then:
        assert found.lines[-1] == 9


STAMPS = {  # 2026-03-01 08:00:00.5 UTC
    "ISO": "2026-03-01T08:00:00.500Z",
    "ISO with a blank": "2026-03-01 08:00:00.5",
    "ISO with a zone": "2026-03-01T09:30:00.500+01:30",
    "ISO basic": "20260301T080000.500Z",
    "UTC": "2026-03-01 08:00:00.500 UTC",
    "German": "01.03.2026 08:00:00,500",
    "American": "3/1/2026 8:00:00.500 AM",
    "slashes": "2026/03/01 08:00:00.5",
    "MATLAB": "01-Mar-2026 08:00:00.5",
    "two digits of a year": "01.03.26 08:00:00,5",
}
BEGIN = 1_772_352_000_500_000_000


@pytest.mark.parametrize("habit", STAMPS)
def test_dates(tmp_path, habit):
    path = tmp_path / "a.csv"
    path.write_text("when;F\n" + f"{STAMPS[habit]};1\n" * 3 + "NULL;1\n")
    column = read_table(path).columns["when"]
    assert (column.kind, column.values.tolist()) == ("date", [BEGIN] * 3 + [MISSING])


def test_days_and_times_of_day_apart(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("Date,Time,Noon\n" + "2026-03-01,08:00:00.5,12:00 PM\n" * 2)
    day, time, noon = read_table(path).columns.values()
    assert (day.kind, time.kind, noon.kind) == ("day", "clock", "clock")
    assert day.values[0] + time.values[0] == BEGIN
    assert noon.values[0] == 12 * 3600 * 10**9


@pytest.mark.parametrize(
    ("cells", "day", "told"),
    [(["13/01/2026 0:00"], 13, False), (["01/13/2026 0:00"], 13, False),
     (["3/5/2026 0:00"], 3, True), (["3/5/2026 1:00 AM"], 5, True), (["31.5.2026 0:00"], 31, False),
     (["3/5/2026 0:00", "3/25/2026 0:00"], 5, False)],
)  # fmt: skip
def test_day_and_month(cells, day, told):
    _, ns, note = moments(cells)
    assert str(ns[:1].astype("datetime64[ns]")[0])[8:10] == f"{day:02d}"
    assert bool(note) == told


def test_a_file_of_no_numbers_is_refused(tmp_path):
    path = tmp_path / "a.csv"
    for text, why in (("", "is empty"), ("\n\n", "is empty"), ("a,b\nc,d\n", "no line of numbers"),
                      ("\0" * 300, "no line of numbers")):  # fmt: skip
        path.write_text(text)
        with pytest.raises(InputError, match=why):
            read_table(path)


CELL = st.one_of(
    st.floats(-1e6, 1e6).map(lambda x: f"{x:.6g}"),
    st.integers(-(10**6), 10**6).map(str),
    st.sampled_from(["", "NULL", "x", "True", "--", "inf", "1e400"]),
)
ODD = st.sampled_from(["", "# a comment", "t;a;b", "1", "1;2;3;4", "end of file", '1;"2;3'])


@settings(max_examples=150, deadline=None)
@given(
    rows=st.lists(st.one_of(st.tuples(CELL, CELL), ODD), min_size=4, max_size=40),
    header=st.booleans(),
    block=st.integers(2, 50),
)
def test_what_is_read_and_what_is_told_is_all_there_is(tmp_path_factory, rows, header, block):
    """Values read and values told as left out are as many as the file's lines have."""
    path = tmp_path_factory.mktemp("t") / "a.csv"
    good = [("0.5", "1.5")] * 3  # say how the table is written
    lines, count = ["t;a;b"] * header, 0
    for k, row in enumerate([*good, *rows, *good * (len(rows) + 1)]):
        lines.append(row if isinstance(row, str) else ";".join((str(k), *row)))
        blank = not lines[-1].strip() or lines[-1].startswith("#")
        count += 3 * (not blank)
    path.write_text("\n".join(lines) + "\n")
    parts = list(table_blocks(path, tables.TextLayout(delimiter=";", header=header, comment="#"),
                              size=block))  # fmt: skip
    found = joined(parts)
    read = sum(
        len(c.values) if c.kind == "text" else int(np.isfinite(c.values).sum())
        for c in found.columns.values()
    )
    assert read + sum(one.cells for one in found.left) == count
    assert {one.text for one in found.left if one.column is None} <= {str(x) for x in rows}
