"""What every figure of the page is: numbers, how they are drawn, and what they say."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from picchio.visuals.plots.style import STYLE


@dataclass(frozen=True, eq=False)
class PaperFigure:
    """A figure of the page.

    Attributes:
        name: unique on the page: "fig-9".
        title: of the figure; "Fig. 9: ..." where the paper has it.
        caption: what it shows.
        alt: the same for readers who cannot see it.
        data: the numbers behind it, for JSON.
        draw: draws it on its Axes: one, a row (columns,), or (rows, columns).
        columns, rows: of Axes.
        width, height: of the figure, inches.
        sharex: whether the Axes share their abscissa.
        wide: whether it takes the page's whole width.
    """

    name: str
    title: str
    caption: str
    alt: str
    data: Mapping[str, Any]
    draw: Callable[[Any], None]
    columns: int = 1
    rows: int = 1
    width: float = 6.4
    height: float = 3.4
    sharex: bool = False
    wide: bool = False

    def plot(self) -> Figure:
        """The figure, in the house style; for notebooks too."""
        with mpl.rc_context(STYLE):
            size = (self.width, self.height)
            figure = Figure(figsize=size, layout="constrained", facecolor="none")
            self.draw(figure.subplots(self.rows, self.columns, sharex=self.sharex))
        return figure

    def _repr_png_(self) -> bytes:
        stream = io.BytesIO()
        with mpl.rc_context(STYLE):
            self.plot().savefig(stream, format="png", dpi=110, facecolor="white")
        return stream.getvalue()

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {"name": self.name, "title": self.title, "caption": self.caption,
                "data": dict(self.data)}  # fmt: skip


def rounded(values: Any, digits: int = 6) -> list[Any]:
    """Numbers as lists with few digits, so that JSON stays readable."""
    array = np.asarray(values, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.where(array == 0, 1.0, 10.0 ** np.floor(np.log10(np.abs(array))))
        kept = np.round(array / size, digits - 1) * size
    return np.where(np.isfinite(array), kept, array).tolist()  # type: ignore[no-any-return]
