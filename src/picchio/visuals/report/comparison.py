"""From a comparison to one self-contained HTML page."""

from __future__ import annotations

from collections.abc import Sequence

from picchio.studies.comparison import Comparison
from picchio.visuals.report.page import render


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
    return render(
        "comparison.html.j2",
        headline=found._headline() + ".",
        items=found.items,
        inputs=found._listing(found.entered),
        results=found._listing(found.figures),
        rest=found._listing([row for row in found.results if row not in found.figures]),
        notes=found.notes,
        command=command,
        warnings=[*warnings, *found.notes],
        provenance=found.provenance,
    )
