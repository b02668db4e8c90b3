"""Figs. 4 and 8: the force and the stress over time; the transient; eq. 13's phase."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from picchio.paper.figures.base import PaperFigure, rounded
from picchio.paper.fourier import amplitude_and_phase, printed_force, worst_of, worst_responses
from picchio.paper.study import Study
from picchio.visuals.plots.style import BLUE, INK, MUTED, VERMILION, look


def figure_4(study: Study) -> PaperFigure:
    """The pulse train and its Fourier sum."""
    blows, count = study.base.blows, study.given.harmonics
    time = np.linspace(0.0, 2.0 * blows.period, 1600)
    exact = np.where(np.mod(time, blows.period) < blows.width, blows.force, 0.0)
    sums = {n: printed_force(blows, n, time) for n in sorted({5, count, 10 * count})}
    over = max(float(s.max()) for s in sums.values()) / blows.force - 1.0

    def draw(ax: Axes) -> None:
        for k, (n, force) in enumerate(sums.items()):
            ax.plot(1e3 * time, force, linewidth=1.2, label=f"eq. 12, N = {n}", **look(k))
        ax.plot(1e3 * time, exact, color=INK, linewidth=1.6, label="exact")
        ax.set(xlabel="time [ms]", ylabel="force [N]")
        ax.legend(loc="upper right")

    return PaperFigure(
        "fig-4", "Fig. 4: the periodic pulse train",
        f"T = {1e3 * blows.period:.3g} ms and Td = {1e3 * blows.width:.3g} ms are assumed. However "
        f"many harmonics are taken, the sum overshoots at the edges, here by {100 * over:.0f} %; "
        "picchio solves the pulse itself and needs no harmonics.",
        "Force over time: rectangular pulses and Fourier sums of 5 and more harmonics",
        {"time": rounded(time[::8]), "force": {str(n): rounded(f[::8]) for n, f in sums.items()},
         "overshoot": over}, draw, height=3.0,
    )  # fmt: skip


def figure_8(study: Study) -> PaperFigure:
    """The stress of all joints over time, steady state."""
    world = study.base
    d, k, _ = worst_of(world)
    _, steady, n, _ = worst_responses(world, world.printed.task.hits_per_rivet)
    time = np.linspace(0.0, 3.0 * world.blows.period, 700)
    stress = world.stress(steady.deflection(time, n))
    name = world.printed.table2[d].direction

    def draw(ax: Axes) -> None:
        for j, row in enumerate(stress):
            ax.plot(1e3 * time, row, label=f"joint {j + 1}", **look(j))
        ax.axhline(0.0, color=MUTED, linewidth=0.7)
        ax.set(xlabel="time [ms]", ylabel="shear stress [MPa]")
        ax.legend(loc="upper right", ncols=3)
        ax.margins(y=0.2)

    return PaperFigure(
        "fig-8", "Fig. 8: joint shear stress under percussive riveting",
        f"Steady state at the most stressed rivet of the base world ({name}, rivet {k + 1}). "
        "Which pose and direction the paper shows is not told.",
        "Shear stress of the three joints over three blows",
        {"time": rounded(time[::5]), "stress": rounded(stress[:, ::5])}, draw, height=3.0,
    )  # fmt: skip


def steady_state(study: Study) -> PaperFigure:
    """A rivet from rest against the band of the steady state."""
    world, hits = study.base, study.printed.task.hits_per_rivet
    rest, steady, n, joint = worst_responses(world, hits)
    end = (hits + 8) * world.blows.period
    time = np.linspace(0.0, end, 1500)
    burst = world.stress(rest.deflection(time, n)[joint])
    band = world.stress(steady.turning_points(n)[joint][1])
    ratio = float(np.abs(burst).max() / np.abs(band).max())
    slowest = -float(rest.modes.poles.real.max())

    def draw(ax: Axes) -> None:
        ax.axhspan(band.min(), band.max(), color=VERMILION, alpha=0.25, linewidth=0,
                   label="steady state, which the paper takes")  # fmt: skip
        ax.plot(time, burst, color=BLUE, label=f"a rivet of {hits} hits from rest")
        ax.axvline(hits * world.blows.period, color=MUTED, linestyle=(0, (4, 2)), linewidth=1)
        ax.annotate("the rivet is done", (hits * world.blows.period, 0.02),
                    xycoords=("data", "axes fraction"), xytext=(-4, 2), ha="right",
                    textcoords="offset points", fontsize=8, color=MUTED)  # fmt: skip
        ax.set(xlabel="time [s]", ylabel="shear stress [MPa]")
        ax.set_xlim(0.0, end)
        ax.margins(y=0.25)
        ax.legend(loc="upper right")

    return PaperFigure(
        "steady-state", "A steady state in 12 hits",
        f"Joint {joint + 1} at the most stressed rivet. The slowest mode takes {1 / slowest:.2g} s "
        f"to fade to a third; the rivet is over in {hits * world.blows.period:.2g} s. The real "
        f"peak is {ratio:.3g} times the steady one.",
        "Stress from rest over a rivet: it swings far beyond the band of the steady state",
        {"time": rounded(time[::5]), "stress": rounded(burst[::5]), "steady": rounded(band),
         "ratio": ratio, "time_constant": 1.0 / slowest}, draw, height=3.0,
    )  # fmt: skip


def phase(study: Study) -> PaperFigure:
    """Eq. 13 with two arctangents."""
    found = amplitude_and_phase(study.base)

    def draw(ax: Axes) -> None:
        ax.plot(1e3 * found.time, found.exact, color=INK, linewidth=2.4, label="exact")
        ax.plot(1e3 * found.time, found.plain, color=VERMILION, linestyle=(0, (5, 2)),
                label="eq. 13, plain tan⁻¹")  # fmt: skip
        ax.plot(1e3 * found.time, found.right, color=BLUE, linestyle=(0, (1.4, 1.4)),
                label="eq. 13, full-circle arctangent")  # fmt: skip
        ax.set(xlabel="time [ms]", ylabel="deflection [mrad]")
        ax.margins(y=0.25)
        ax.legend(loc="upper right", ncols=3, fontsize=7.5)

    return PaperFigure(
        "phase", "Eq. 13's phase",
        f"Joint {found.joint + 1}, steady state, most stressed rivet. Taken as written, the "
        f"arctangents put harmonics above resonance half a turn off: the history errs by "
        f"{100 * found.plain_history:.2g} % of its peak. With the right quadrant it is exact.",
        "Deflection over one period: exact, by eq. 13 as written, and with the right quadrant",
        {"time": rounded(found.time[::4]), "exact": rounded(found.exact[::4]),
         "plain": rounded(found.plain[::4]), "right": rounded(found.right[::4])}, draw, height=3.0,
    )  # fmt: skip
