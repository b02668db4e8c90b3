"""The shear stress in a shaft over one rivet, and its counted cycles."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from picchio.fatigue.counting.cycles import Cycles
from picchio.visuals.plots.response import response_times
from picchio.visuals.plots.style import BLUE, MUTED, VERMILION, axes_or_new, note, plain, styled
from picchio.visuals.worst_rivet import WorstRivet


@styled
def plot_stress_history(
    time: ArrayLike,
    stress: ArrayLike,
    ax: Axes | None = None,
    *,
    turning_points: tuple[ArrayLike, ArrayLike] | None = None,
    static: float | None = None,
    allowable: float | None = None,
    joint: str = "",
) -> Axes:
    """The shear stress of the vibration (MPa) over time (s).

    Args:
        time: (k,) s.
        stress: (k,) Pa, of the vibration.
        ax: where to draw.
        turning_points: time (t,) s and stress (t,) Pa of the extrema that rainflow sees.
        static: Pa, stress by gravity and feed force, told in words.
        allowable: Pa, amplitude; drawn where it is near enough to be seen.
        joint: its name, for the title.
    """
    ax = axes_or_new(ax)
    t, tau = np.asarray(time, dtype=float), np.asarray(stress, dtype=float) / 1e6
    ax.plot(t, tau, color=BLUE, label="stress of the vibration")
    end = float(t[-1])
    if turning_points is not None:
        at, value = (np.asarray(part, dtype=float) for part in turning_points)
        seen = at <= end
        ax.plot(at[seen], value[seen] / 1e6, "o", color=VERMILION, markersize=3.2,
                label="turning points")  # fmt: skip
    largest = float(np.abs(tau).max(initial=0.0))
    if allowable is not None and allowable / 1e6 < 2.5 * largest:
        for sign in (1.0, -1.0):
            name = "allowable amplitude" if sign > 0 else None
            ax.axhline(sign * allowable / 1e6, color=VERMILION, linestyle=(0, (5, 2)),
                       linewidth=1.1, label=name)  # fmt: skip
    ax.axhline(0.0, color=MUTED, linewidth=0.7)
    title = "Shear stress during a rivet" + (f", {plain(joint)}" if joint else "")
    ax.set(xlabel="time [s]", ylabel="shear stress [MPa]", title=title)
    told = []
    if static is not None:
        told.append(f"on top of {abs(static) / 1e6:.3g} MPa by gravity and feed force")
    if allowable is not None:
        told.append(f"allowable amplitude {allowable / 1e6:.3g} MPa")
    if told:
        ax.text(0.995, 0.02, "\n".join(told), transform=ax.transAxes, ha="right", va="bottom",
                fontsize=8, color=MUTED)  # fmt: skip
    ax.set_xlim(0.0, end)
    ax.margins(y=0.12)
    ax.legend(loc="upper right", ncols=3)
    return ax


def plot_rivet_stress(
    worst: WorstRivet, ax: Axes | None = None, *, allowable: float | None = None
) -> Axes:
    """The shear stress in a joint's shaft over its worst rivet; see `plot_stress_history`.

    Args:
        worst: the rivet.
        ax: where to draw.
        allowable: Pa, amplitude.

    Raises:
        InputError: the joint has no shaft.
    """
    response, force = worst.response, worst.response.force
    end = 2.0 * force.end if response.periodic else 2.6 * float(force.start[-1])
    time = response_times(response, end)
    turning = worst.stress_turning_points()
    return plot_stress_history(
        time,
        worst.stress(time),
        ax,
        turning_points=turning,
        joint=worst.joint.name,
        static=worst.stress_of(worst.static_torque),
        allowable=allowable,
    )


@styled
def plot_counted_cycles(
    cycles: Cycles, ax: Axes | None = None, *, allowable: float | None = None, joint: str = ""
) -> Axes:
    """How many cycles lie above each amplitude (MPa): the exceedance curve of one rivet.

    Args:
        cycles: counted by rainflow, Pa.
        ax: where to draw.
        allowable: Pa, amplitude, drawn as a line.
        joint: its name, for the title.
    """
    ax = axes_or_new(ax)
    title = "Cycles counted in a rivet" + (f", {plain(joint)}" if joint else "")
    ax.set(xlabel="cycles at or above the amplitude [\N{EN DASH}]",
           ylabel="shear stress amplitude [MPa]", title=title)  # fmt: skip
    if not len(cycles):
        note(ax, "no cycles: the joint does not move")
        return ax
    order = np.argsort(-cycles.amplitude)
    amplitude, count = cycles.amplitude[order] / 1e6, np.cumsum(cycles.count[order])
    ax.stairs(amplitude, np.concatenate([[0.0], count]), color=BLUE, fill=True, alpha=0.16)
    ax.stairs(amplitude, np.concatenate([[0.0], count]), color=BLUE, linewidth=1.5)
    top = 1.15 * float(amplitude[0])
    if allowable is not None:
        if allowable / 1e6 < 4.0 * amplitude[0]:
            ax.axhline(allowable / 1e6, color=VERMILION, linestyle=(0, (5, 2)), linewidth=1.2)
            top = max(top, 1.15 * allowable / 1e6)
        ax.text(0.985, 0.96, f"allowable {allowable / 1e6:.3g} MPa", color=VERMILION, ha="right",
                va="top", transform=ax.transAxes, fontsize=8.5)  # fmt: skip
    ax.text(0.985, 0.88, f"largest {amplitude[0]:.3g} MPa, {cycles.total:.4g} cycles", ha="right",
            va="top", transform=ax.transAxes, fontsize=8.5, color=MUTED)  # fmt: skip
    ax.set_ylim(0.0, top)
    ax.set_xlim(0.0, float(count[-1]))
    return ax
