"""From a comparison to one self-contained HTML page."""

from __future__ import annotations

import math
from collections.abc import Sequence

from picchio.studies.comparison import Comparison, Difference
from picchio.visuals.report.page import number, render


def comparison_page(
    found: Comparison, *, command: str | None = None, warnings: Sequence[str] = ()
) -> str:
    """The page of a comparison: verdicts side by side, what differs, how to reproduce.

    Args:
        found: the comparison.
        command: the command line that gave this.
        warnings: what was warned of on the way.

    Returns:
        the HTML.
    """
    names = [item.name for item in found.items]
    two = len(names) == 2

    def rows(differences: Sequence[Difference]) -> list[list[str]]:
        return [
            [row.label, *row.shown, *([_ratio(row.ratios[1])] if two else [])]
            for row in differences
        ]

    return render(
        "comparison.html.j2",
        headline=found._headline() + ".",
        items=found.items,
        heads=["", *names, *([f"{names[1]}| over {names[0]}"] if two else [])],
        inputs=rows(found.entered),
        results=rows(found.figures),
        rest=rows([row for row in found.results if row not in found.figures]),
        notes=found.notes,
        command=command,
        warnings=[*warnings, *found.notes],
        provenance=found.provenance,
    )


def _ratio(value: float) -> str:
    return "" if math.isnan(value) else number(value, 3)
