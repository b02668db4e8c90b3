"""What every answer of picchio can do: one line of text, plain data for JSON, a table."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Iterable, Iterator, Mapping
from os import PathLike
from typing import TYPE_CHECKING, Any, ClassVar

from picchio.core.listing import Column, Listing
from picchio.core.shown import Shown

if TYPE_CHECKING:
    import pandas
    import xarray


def plain(value: Any, *, arrays: bool = False) -> Any:
    """The same structure as `json.dumps` takes it.

    Arrays and tuples become lists, paths become text, keys become text, records what their
    `to_dict` or `model_dump` gives or else their fields; numbers that JSON cannot hold (NaN,
    infinity) become None.

    Args:
        value: anything of these.
        arrays: leave arrays of more than one dimension as they are: as lists they take ten times
            the memory. `json_pieces` writes them a row at a time.
    """
    if arrays and getattr(value, "ndim", 0) > 1:
        return value
    if hasattr(value, "tolist"):
        value = value.tolist()
    elif hasattr(value, "to_dict"):
        value = value.to_dict()
    elif hasattr(value, "model_dump"):
        value = value.model_dump()
    elif dataclasses.is_dataclass(value):
        value = {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(entry, arrays=arrays) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(entry, arrays=arrays) for entry in value]
    if isinstance(value, PathLike):
        return str(value)
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def json_pieces(value: Any) -> Iterator[str]:
    """The JSON text of a value that `plain` has made, in pieces; arrays a row at a time."""
    encoder = json.JSONEncoder(
        indent=2, allow_nan=False, default=lambda a: list(a) if a.ndim > 1 else plain(a)
    )
    return encoder.iterencode(value)


class Result(Shown):
    """What the answers of all commands have in common.

    A subclass says what it holds in `_content` and what matters in `_headline`; where a notebook
    shall unfold more below that line it has a `_repr_html_` (see `picchio.core.html.sheet`), or, if
    that is a table, a `_listing`. If it is a dataclass it is declared with `repr=False`, or the
    dataclass's own repr hides this one.

    Attributes:
        PAGE: the function that draws it for `picchio.report`, as "module:function" with the
            module below `picchio`. It is called with the result, `command`, `warnings` and the
            options given to `report`, and returns HTML. The default page shows what a notebook
            shows.
    """

    PAGE: ClassVar[str] = "visuals.report.page:plain_page"

    def _content(self) -> Mapping[str, Any]:
        """The keys of its JSON format; arrays, NaN and infinite numbers may stand in it."""
        raise NotImplementedError

    def _headline(self) -> str:
        """What matters, in a few words."""
        raise NotImplementedError

    def to_dict(self, *, arrays: bool = False) -> dict[str, Any]:
        """What `--json` prints: numbers, text, lists and dictionaries, as `json.dumps` takes them.

        A number without end, or one that does not exist, is None.

        Args:
            arrays: leave arrays of more than one dimension as they are, for little memory.
        """
        return {key: plain(value, arrays=arrays) for key, value in self._content().items()}

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self._headline()}>"

    def _repr_html_(self) -> str:
        from picchio.core.html import sheet

        return sheet(type(self).__name__, head=self._headline())


class TableResult(Result):
    """A result that is a table: `to_frame` and `to_xarray` beside what every result has.

    Attributes:
        INDEX: the column that names a row; "" where rows are counted.
        BARS: columns that `picchio.visuals.plots.results.plot_columns` draws.
        UNITS: {column: unit}; columns without a unit are left out.
    """

    INDEX: ClassVar[str] = "name"
    BARS: ClassVar[tuple[str, ...]] = ()
    UNITS: ClassVar[Mapping[str, str]] = {}

    def _rows(self) -> Iterable[Mapping[str, Any]]:
        """{column: value} a row, SI; NaN and infinite numbers stay what they are."""
        raise NotImplementedError

    def to_frame(self) -> pandas.DataFrame:
        """The table, SI; units by column in `attrs["units"]`."""
        import pandas

        frame = pandas.DataFrame([dict(row) for row in self._rows()])
        if self.INDEX and not frame.empty:
            frame = frame.set_index(self.INDEX)
        frame.attrs["units"] = {k: v for k, v in self.UNITS.items() if k in frame.columns}
        return frame

    def to_xarray(self) -> xarray.Dataset:
        """The same table, with each variable's unit in its `attrs["units"]`."""
        frame = self.to_frame()
        found = frame.to_xarray()
        for column, unit in frame.attrs.get("units", {}).items():
            found[column].attrs["units"] = unit
        return found

    def _listing(self) -> Listing:
        """The table as people read it."""
        rows = [dict(row) for row in self._rows()]
        names = dict.fromkeys(name for row in rows for name in row)
        columns = [
            Column(name, self.UNITS.get(name, ""), tuple(row.get(name) for row in rows))
            for name in names
        ]
        return Listing(type(self).__name__, tuple(columns))

    def _repr_html_(self) -> str:
        from picchio.core.html import listed, sheet

        shown = self._listing()
        head = shown.head or self._headline()
        return sheet(shown.title, shown.facts, *listed(shown), shown.note, head)
