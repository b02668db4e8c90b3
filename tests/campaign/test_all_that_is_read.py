"""What is read of a binary table and what is told as left out is all that the file holds."""

import numpy as np
import pandas
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from picchio.campaign.importing.readers import read_matlab, read_npz, read_parquet
from picchio.core.dates import MISSING

ROWS, GROUP = 12, 5  # at most in a column, in a row group of Parquet
NUMBER = st.floats(allow_nan=True, allow_infinity=True, width=64)
CELLS = {  # what a column may hold
    "numbers": NUMBER,
    "whole numbers": st.integers(-(2**63), 2**63 - 1),
    "truths": st.booleans(),
    "text": st.sampled_from(["run", "idle", "", "1.5", "2026-03-01T08:00:00", "08:00:01", "nan"]),
    "words": st.sampled_from(["run", "idle", "1.5", "08:00:01"]),
    "dates": st.sampled_from([np.datetime64("2026-03-01T08:00:00", "ns"), np.datetime64("NaT")]),
    "objects": st.one_of(st.none(), st.floats(-1e9, 1e9), st.just(float("nan"))),
    "text or nothing": st.one_of(st.none(), st.sampled_from(["run", "1.5", "idle"])),
    "lists": st.one_of(st.none(), st.lists(st.floats(-9, 9), min_size=0, max_size=3)),
    "pairs": st.one_of(st.none(), st.lists(st.floats(-9, 9), min_size=2, max_size=2)),
    "complex numbers": st.complex_numbers(max_magnitude=9),
}
PLAIN = ("numbers", "whole numbers", "truths", "text", "dates", "complex numbers")
KINDS = {  # of file: kinds of column that it can hold, whether all are of one length
    "npz": (PLAIN, False),
    "mat": (["numbers", "truths", "words", "objects", "text or nothing", "lists", "pairs",
             "complex numbers"], False),
    "parquet": (["numbers", "whole numbers", "truths", "text", "dates", "objects",
                 "text or nothing", "lists", "pairs"], True),
}  # fmt: skip


@st.composite
def tables(draw, kind):
    """{name: (kind of column, its cells)}; one column is of numbers, so that there is a series."""
    known, even = KINDS[kind]
    length, found = draw(st.integers(2, ROWS)), {"x": ("numbers", None)}
    for k, what in enumerate(draw(st.lists(st.sampled_from(known), max_size=5))):
        found[f"c{k}"] = what, None
    for name, (what, _) in found.items():
        size = length if even or name == "x" else draw(st.integers(0, ROWS))
        found[name] = what, draw(st.lists(CELLS[what], min_size=size, max_size=size))
    return found


def written(path, table):
    """Write the table; how many values it has."""
    if path.suffix == ".parquet":
        frame = pandas.DataFrame({name: pandas.Series(cells, dtype=object if what in (
            "objects", "text or nothing", "lists", "pairs") else None)
            for name, (what, cells) in table.items()})  # fmt: skip
        frame.to_parquet(path, row_group_size=GROUP)
    else:
        arrays = {}
        for name, (what, cells) in table.items():
            nothing = [] if what in ("lists", "pairs") else np.nan
            loose = what in ("objects", "text or nothing", "lists", "pairs")
            arrays[name] = np.empty(len(cells), dtype=object) if loose else np.array(cells)
            if loose:
                arrays[name][:] = [nothing if cell is None else cell for cell in cells]
            if what == "dates":
                arrays[name] = np.array(cells, dtype="datetime64[ns]")
        if path.suffix == ".npz":
            np.savez(path, **arrays)
        else:
            from scipy.io import savemat

            savemat(path, arrays)
    part = GROUP if path.suffix == ".parquet" else ROWS
    return sum(
        held(cells[k : k + part]) if what in ("lists", "pairs") else len(cells[k : k + part])
        for what, cells in table.values()
        for k in range(0, len(cells), part)
    )


def held(cells):
    """How many values lists have; where all are of one length, one that is missing has as many."""
    sizes = [0 if cell is None else len(cell) for cell in cells]
    return sum(sizes) if len(set(sizes) - {0}) > 1 else max([1, *sizes]) * len(sizes)


def told(raw):
    """How many values of a file were read, and how many are told as left out."""
    read = sum(
        int((np.isfinite(c.values) if c.values.dtype.kind == "f" else c.values != MISSING).sum())
        for c in raw.channels.values()
    )
    return read + sum(map(len, raw.texts.values())) + len(raw.scalars), sum(
        one.cells for one in raw.left
    )


READERS = {"npz": read_npz, "mat": read_matlab, "parquet": read_parquet}


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_read_and_what_is_told_is_all_there_is(tmp_path_factory, kind):
    folder = tmp_path_factory.mktemp("t")

    @settings(max_examples=60, deadline=None)
    @given(table=tables(kind))
    def check(table):
        path = folder / f"a.{kind}"
        count = written(path, table)
        raw = READERS[kind].read(path, {})
        read, left = told(raw)
        assert read + left == count, (table, raw.told)

    check()
