"""What every figure of the page is: numbers, how they are drawn, and what they say."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
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
        draw: makes it and returns one of its axes.
        wide: whether it takes the page's whole width.
    """

    name: str
    title: str
    caption: str
    alt: str
    data: Mapping[str, Any]
    draw: Callable[[], Axes]
    wide: bool = field(default=False)

    def plot(self) -> Figure:
        """The figure, in the house style; for notebooks too."""
        with mpl.rc_context(STYLE):
            figure = self.draw().get_figure(root=True)
        assert figure is not None
        return figure

    def _repr_png_(self) -> bytes:
        import io

        stream = io.BytesIO()
        with mpl.rc_context(STYLE):
            self.plot().savefig(stream, format="png", dpi=110, facecolor="white")
        return stream.getvalue()

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {"name": self.name, "title": self.title, "caption": self.caption,
                "data": dict(self.data)}  # fmt: skip


def panels(
    columns: int = 1, rows: int = 1, width: float = 6.4, height: float = 3.4, **options: Any
) -> Any:
    """Axes (rows, columns) of a figure that pyplot does not know; one if there is but one."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(width, height), layout="constrained", facecolor="none")
        axes = figure.subplots(rows, columns, squeeze=False, **options)
    return axes[0, 0] if axes.size == 1 else axes


def rounded(values: Any, digits: int = 6) -> list[Any]:
    """Numbers as lists with few digits, so that JSON stays readable."""
    array = np.asarray(values, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.where(array == 0, 1.0, 10.0 ** np.floor(np.log10(np.abs(array))))
        kept = np.round(array / size, digits - 1) * size
    return np.where(np.isfinite(array), kept, array).tolist()  # type: ignore[no-any-return]
