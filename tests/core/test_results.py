"""What all results share: plain data, one line of text, a table with units."""

import json
import tracemalloc
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from picchio.core.results import Result, TableResult, json_pieces, plain


@dataclass(frozen=True, eq=False, repr=False)
class Lives(TableResult):
    """Two joints, one of which never fails."""

    lives: tuple[float, ...]

    UNITS: ClassVar = {"radius": "m", "unknown": "kg"}

    def _rows(self) -> Iterator[dict[str, object]]:
        for number, life in enumerate(self.lives, 1):
            yield {"name": f"joint_{number}", "life": life, "radius": 0.01 * number}

    def _content(self) -> dict[str, object]:
        return {"format": "test/1", "lives": np.array(self.lives), "joints": list(self._rows())}

    def _headline(self) -> str:
        return f"{len(self.lives)} joints <b>"


def test_plain_is_what_json_takes() -> None:
    given = {
        1: np.float32(0.5),
        "ends": (np.inf, -np.inf, np.nan, 1.0),
        "array": np.array([[1, 2], [3, 4]]),
        "no": None,
        "yes": np.True_,
        "file": Path("a") / "b.csv",
        "deep": [{"x": np.array([np.nan])}],
    }
    made = plain(given)
    assert json.loads(json.dumps(made, allow_nan=False)) == made
    assert made["1"] == 0.5 and made["ends"] == [None, None, None, 1.0]
    assert made["array"] == [[1, 2], [3, 4]] and made["yes"] is True
    assert made["file"] == str(Path("a/b.csv")) and made["deep"] == [{"x": [None]}]


def test_a_result_is_a_line_a_dictionary_and_a_table() -> None:
    found = Lives((1e6, np.inf))
    assert repr(found) == "<Lives: 2 joints <b>>"
    assert "2 joints &lt;b&gt;" in found._repr_html_()
    assert found.to_dict()["lives"] == [1e6, None]
    json.dumps(found.to_dict(), allow_nan=False)
    frame = found.to_frame()
    # A life without end is None in JSON and infinite in a table of numbers.
    assert frame.loc["joint_2", "life"] == np.inf
    assert frame.attrs["units"] == {"radius": "m"}
    table = found.to_xarray()
    assert table["radius"].attrs["units"] == "m" and "units" not in table["life"].attrs
    np.testing.assert_allclose(table["radius"].sel(name="joint_2"), 0.02)
    assert Lives(()).to_frame().empty


def test_what_a_result_must_say_cannot_be_left_out() -> None:
    with pytest.raises(NotImplementedError):
        Result().to_dict()
    with pytest.raises(NotImplementedError):
        repr(Result())


def test_arrays_are_written_as_they_are() -> None:
    given = {
        "a": np.array([[1.5, np.nan], [2.0, np.inf]]),
        "b": [np.array([["x"]]), np.eye(3)[None]],
        "c": np.array([0.1, np.nan]),
        "d": np.zeros((0, 3)),
    }
    text = "".join(json_pieces(plain(given, arrays=True)))
    assert text == json.dumps(plain(given), indent=2)
    large = {"poses": np.random.default_rng(0).random((50_000, 12))}
    tracemalloc.start()
    for _ in json_pieces(plain(large, arrays=True)):
        pass
    needed = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert needed < 2.0 * large["poses"].nbytes
