"""One look for every plot: quiet axes, colours that colour-blind readers can tell apart.

Colours are Okabe and Ito's (2008); joints differ in their line style as well, so that a print
in black and white can be read.
"""

from __future__ import annotations

import functools
import math
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.rcsetup import cycler

from picchio.core.errors import InputError
from picchio.core.files import atomic_write

INK = "#20262e"
"""Text and axes; the report swaps it for the page's own text colour."""
MUTED = "#6a7480"
"""Grid, references, what is less important."""
PAPER = "#ffffff"
BLUE, VERMILION, GREEN, ORANGE = "#0072b2", "#d55e00", "#009e73", "#e69f00"
PURPLE, SKY, GREY = "#cc79a7", "#56b4e9", "#8a939e"
COLOURS = (BLUE, VERMILION, GREEN, ORANGE, PURPLE, SKY, GREY)
DASHES: tuple[Any, ...] = (
    "-", (0, (5, 1.6)), (0, (1.4, 1.4)), (0, (6, 1.6, 1.4, 1.6)), (0, (9, 2)),
    (0, (3, 1.2, 1.2, 1.2, 1.2, 1.2)), (0, (2.6, 2.6)),
)  # fmt: skip
HATCH = "////"
"""Of what is an estimate."""
ESTIMATED = "estimated; hatched: P10 to P90 of the cases"
CMAP = "viridis"
"""Sequential, even in lightness, safe for the colour-blind."""
WIDTH, HEIGHT = 6.4, 3.4
PICTURES = (".png", ".svg", ".pdf")

STYLE: Any = {
    "font.family": ["DejaVu Sans"],
    "font.size": 9.0,
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titlepad": 9.0,
    "axes.labelsize": 9.0,
    "axes.labelcolor": INK,
    "axes.edgecolor": MUTED,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.prop_cycle": cycler(color=COLOURS),
    "grid.color": MUTED,
    "grid.alpha": 0.22,
    "grid.linewidth": 0.6,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.major.size": 3.0,
    "ytick.major.size": 3.0,
    "xtick.minor.size": 0.0,
    "ytick.minor.size": 0.0,
    "text.color": INK,
    "lines.linewidth": 1.5,
    "lines.solid_capstyle": "round",
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "legend.handlelength": 2.4,
    "figure.facecolor": PAPER,
    "axes.facecolor": "none",
    "axes.formatter.use_mathtext": True,
    "savefig.dpi": 160,
    "figure.dpi": 110,
    "svg.hashsalt": "picchio",
}

P = ParamSpec("P")
R = TypeVar("R")


def styled(plot: Callable[P, R]) -> Callable[P, R]:
    """Run a plot function in the house style, whatever the caller's rcParams are."""

    @functools.wraps(plot)
    def inner(*args: P.args, **kwargs: P.kwargs) -> R:
        if "IPython" in sys.modules:
            _wake_notebook()
        with mpl.rc_context(STYLE):
            return plot(*args, **kwargs)

    return inner


@functools.cache
def _wake_notebook() -> None:
    """Load a notebook's backend now: within the context what it sets would be undone."""
    from matplotlib.backends import backend_registry

    backend_registry.load_backend_module(mpl.get_backend())


def axes_or_new(
    ax: Axes | None, *, width: float = WIDTH, height: float = HEIGHT, polar: bool = False
) -> Axes:
    """The given Axes, or those of a new pyplot figure, so that a notebook shows it."""
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(width, height), layout="constrained")
    return figure.add_subplot(projection="polar" if polar else None)


def blank_figure(width: float = WIDTH, height: float = HEIGHT, *, polar: bool = False) -> Axes:
    """Axes of a figure that pyplot does not know, for reports; closed when forgotten."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(width, height), layout="constrained", facecolor="none")
        return figure.add_subplot(projection="polar" if polar else None)


def save_figure(ax: Axes, path: Path) -> None:
    """Write the figure of some Axes, as the file's ending says (.png, .svg, .pdf).

    Raises:
        InputError: another ending, or it cannot be written there.
    """
    if path.suffix.lower() not in PICTURES:
        raise InputError("unknown kind", key="plot", value=path.name, choices=PICTURES)
    figure = ax.get_figure(root=True)
    assert figure is not None
    with atomic_write(path, "wb") as stream:
        figure.savefig(stream, format=path.suffix[1:].lower(), dpi=160, facecolor=PAPER)


def look(index: int) -> dict[str, Any]:
    """The colour and dashes of a joint.

    Args:
        index: of the joint.
    """
    return {"color": COLOURS[index % len(COLOURS)], "linestyle": DASHES[index % len(DASHES)]}


def plain(text: str, width: int = 28) -> str:
    """A name as a label: cut to `width`, with matplotlib's maths switched off."""
    short = " ".join(text.split())
    short = short if len(short) <= width else short[: width - 1] + "\N{HORIZONTAL ELLIPSIS}"
    return short.replace("\\", "\\\\").replace("$", r"\$")


def note(ax: Axes, text: str) -> None:
    """Say in the middle of empty axes why there is nothing to see."""
    ax.text(
        0.5, 0.5, text, transform=ax.transAxes, ha="center", va="center", color=MUTED,
        fontsize=9, wrap=True,
    )  # fmt: skip


def direction_label(direction: Iterable[float]) -> str:
    """A direction in words where it has some: "+x", "-z", else its components."""
    values = [float(value) for value in direction]
    for axis, value in zip("xyz", values, strict=True):
        if math.isclose(abs(value), 1.0, abs_tol=1e-9):
            sign = "+" if value > 0 else "\N{MINUS SIGN}"
            return sign + axis
    return "(" + ", ".join(f"{value:.2f}" for value in values) + ")"
