"""The deflection of the joints over time: a rivet as it happens, and the steady state."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.studies.rivet.pose import SampledResponse
from picchio.vibration.closed_form.response import Response, unit_vector
from picchio.visuals.plots.style import MUTED, axes_or_new, direction_label, look, plain, styled

_SAMPLES_PER_CYCLE = 24
# Labels of joints that hardly move would lie on top of one another.
_WORTH_A_LABEL = 0.12


def response_times(
    response: Response | SampledResponse, until: float, start: float = 0.0
) -> FloatArray:
    """Times (k,) s fine enough to draw a response, the force's jumps among them."""
    fastest = float(np.abs(response.modes.poles).max()) / (2.0 * np.pi)
    count = int(np.clip((until - start) * fastest * _SAMPLES_PER_CYCLE, 400, 20000))
    grid = np.linspace(start, until, count)
    jumps = response.force.start[(response.force.start > start) & (response.force.start < until)]
    return np.union1d(grid, jumps)


@styled
def plot_response(
    response: Response | SampledResponse,
    direction: ArrayLike | None = None,
    ax: Axes | None = None,
    *,
    joints: Sequence[str] | None = None,
    steady: Response | SampledResponse | None = None,
    unit: str = "mrad",
) -> Axes:
    """The deflection of the joints (mrad) over time (s), with the largest marked.

    Args:
        response: from rest (the first part of its ring-down is shown), or steady (two periods).
        direction: (3,) of the force; the worst of all joints if not given.
        ax: where to draw.
        joints: names; all if not given.
        steady: a steady state to show beside a response from rest, as its band.
        unit: "mrad", or "mm" for prismatic joints.

    Raises:
        InputError: an unknown joint.
    """
    ax = axes_or_new(ax)
    if direction is None:
        if not isinstance(response, Response):
            raise InputError(
                "is needed: the response is known along one direction alone", key="direction"
            )
        direction = max(response.worst_directions(), key=lambda worst: worst.value).direction
    names = response.modes.output_names
    chosen = list(names if joints is None else joints)
    for name in chosen:
        if name not in names:
            raise InputError("no such joint", key="joints", value=name, choices=names)
    last_blow = 2.0 * response.force.end if response.periodic else float(response.force.start[-1])
    end = last_blow if response.periodic else _first_part(response, last_blow)
    time = response_times(response, end)
    values = response.deflection(time, direction)
    marks = response.peaks(direction)
    largest = max((abs(marks[names.index(name)].value) for name in chosen), default=0.0)
    if not response.periodic:
        ax.axvspan(0.0, last_blow, color=MUTED, alpha=0.09, linewidth=0)
        ax.text(last_blow, 0.01, "last blow ", transform=ax.get_xaxis_transform(), ha="right",
                va="bottom", fontsize=8, color=MUTED)  # fmt: skip
    for name in chosen:
        j = names.index(name)
        style = look(j) if len(chosen) > 1 else {**look(j), "linestyle": "-"}
        ax.plot(time, values[j] * 1e3, label=plain(name), **style)
        if steady is not None:
            band = 1e3 * steady.turning_points(direction)[j][1]
            ax.axhspan(band.min(), band.max(), color=style["color"], alpha=0.18, linewidth=0,
                       label=f"{plain(name)}, steady state")  # fmt: skip
        if marks[j].time <= end and abs(marks[j].value) >= _WORTH_A_LABEL * largest:
            ax.plot(marks[j].time, marks[j].value * 1e3, "o", color=style["color"], markersize=5)
            ax.annotate(f"{abs(marks[j].value) * 1e3:.3g}",
                        (marks[j].time, marks[j].value * 1e3),
                        xytext=(6, 4 if marks[j].value > 0 else -11), fontsize=8,
                        textcoords="offset points", color=style["color"])  # fmt: skip
    ax.axhline(0.0, color=MUTED, linewidth=0.7)
    what = "Steady state" if response.periodic else "A rivet, from rest"
    ax.set(xlabel="time [s]", ylabel=f"deflection [{unit}]",
           title=f"{what}, force along {direction_label(unit_vector(direction))}")  # fmt: skip
    ax.set_xlim(0.0, end)
    ax.margins(y=0.1)
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return ax


def _first_part(response: Response | SampledResponse, last_blow: float) -> float:
    """Until the slowest mode has rung down to a twentieth."""
    slowest = -float(response.modes.poles.real.max())
    if slowest <= 0.0:
        return 3.0 * last_blow
    return min(last_blow + 3.0 / slowest, 3.0 * last_blow + 0.2 / slowest)
