"""Table 2's numbers, and the hypotheses about them."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from picchio.paper.figures.base import PaperFigure, rounded
from picchio.paper.study import Study
from picchio.paper.table2.by_curve import OTHER_CURVE
from picchio.visuals.plots.style import BLUE, GREY, INK, MUTED, ORANGE, VERMILION


def lives(study: Study) -> PaperFigure:
    """Printed over predicted N: the printed curve, rivets for hits, the other curve."""
    table = study.curve_of_table
    order = np.argsort(table.stress)
    places = [label.replace(", ", ",\n") for label in table.labels]
    ticks = [f"{places[k]}\n{table.stress[k]:g} MPa" for k in order]
    names = (
        ("the curve as printed", False, GREY, "s"),
        ("as printed, rivets for hits", False, BLUE, "^"),
        (OTHER_CURVE, True, VERMILION, "o"),
    )
    fits = [(table.fit(name, aside), colour, marker) for name, aside, colour, marker in names]

    def draw(ax: Axes) -> None:
        for fit, colour, marker in fits:
            label = fit.name + (" (one entry aside)" if fit.aside is not None else "")
            ax.plot(range(8), np.exp(fit.residuals[order]), marker, color=colour, label=label,
                    markersize=6)  # fmt: skip
        ax.axhline(1.0, color=INK, linewidth=0.8)
        ax.set_yscale("log")
        ax.set_ylim(None, 30)
        ax.set_xticks(range(8), ticks, fontsize=8)
        ax.set(ylabel="printed N over predicted N")
        ax.legend(loc="upper right", ncols=1, fontsize=8)

    values = table.other.values
    return PaperFigure(
        "table-2-lives", "Table 2's N against its own mean stresses",
        "No arm and no assumption is in this figure. The printed curve would give lives "
        f"{table.over_printed.min():.3g} to {table.over_printed.max():.3g} times as long; on "
        f"S = {values['a']:,.0f} N^{values['b']:.4f} seven of eight are right within "
        f"{100 * table.within:.2g} %, which is their rounding. The eighth is "
        f"{table.misprint}.",
        "Printed over predicted lives of the eight entries by three hypotheses",
        {"labels": list(table.labels), "stress": rounded(table.stress),
         "cycles": rounded(table.cycles), "over_printed": rounded(table.over_printed),
         "rounding": rounded(table.rounding),
         "hypotheses": [fit.to_dict() for fit in table.fits]},
        draw, width=8.4, height=3.5, wide=True,
    )  # fmt: skip


def hypotheses(study: Study) -> PaperFigure:
    """Each hypothesis's error on entries left out."""
    found = study.comparison.hypotheses

    def draw(ax: Axes) -> None:
        for k, h in enumerate(reversed(found)):
            errors = np.abs(h.left_out_life)
            errors = errors[np.isfinite(errors)]
            ax.plot(100 * errors.clip(1e-4), np.full(errors.size, k), "o", color=BLUE,
                    alpha=0.45, markersize=4.5)  # fmt: skip
            for left_out, colour in ((h.left_out_life, BLUE), (h.left_out_mean, ORANGE)):
                ax.plot(100 * np.nanmedian(np.abs(left_out)), k, "|", color=colour, markersize=15,
                        markeredgewidth=2.4)  # fmt: skip
        for words, colour in (("lives N", BLUE), ("mean stresses", ORANGE)):
            ax.plot([], [], "|", color=colour, markersize=11, markeredgewidth=2.4,
                    label=f"{words}, median")  # fmt: skip
        ax.set_xscale("log")
        ax.set_yticks(range(len(found)), [h.name for h in reversed(found)])
        ax.set(xlabel="error of an entry predicted from the other 15 [% of ln]")
        ax.tick_params(axis="y", color=MUTED)
        ax.legend(loc="upper right", fontsize=8)

    return PaperFigure(
        "hypotheses", "Nine hypotheses about Table 2, the same freedom for each",
        "Each is fitted to the eight mean stresses and the eight lives at once, with the same "
        "eight unreported inputs free; then each entry is left out in turn and predicted. Best "
        "(by the penalised likelihood) on top.",
        "Errors of left-out entries for every hypothesis",
        {"hypotheses": [h.to_dict() for h in found]},
        draw, width=9.2, height=0.9 + 0.36 * len(found), wide=True,
    )  # fmt: skip
