"""From a reproduction to one self-contained HTML file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from importlib.resources import files
from typing import Any

from picchio.paper.assumptions import INPUTS
from picchio.paper.run import Reproduction
from picchio.paper.verdict import Verdict
from picchio.visuals.report.page import inline_svg, page_environment

_MARKS = {"holds": "good", "holds only if": "partly", "does not hold": "bad",
          "cannot be known": "open"}  # fmt: skip
REDRAWN = ("fig-4", "fig-8", "fig-9", "fig-10", "fig-11", "fig-12", "fig-13-15")


def reproduction_page(
    found: Reproduction, *, command: str | None = None, warnings: Sequence[str] = ()
) -> str:
    """The page: claims, Table 2, what does not fit, the life, figures, assumptions, equations.

    It needs nothing from outside, prints, and follows the reader's light or dark theme.

    Args:
        found: of `picchio.reproduce`.
        command: the command line that gave this.
        warnings: what was warned of on the way.

    Returns:
        the HTML.
    """
    from markupsafe import Markup

    environment = page_environment("picchio.paper")
    environment.filters.update(
        mark=_MARKS.__getitem__, gap=_gap, value=_value,
        power=lambda x: Markup(power(float(x))),
    )  # fmt: skip
    template = environment.get_template("page.html.j2")
    own = files("picchio.paper") / "page_files" / "page.css"
    style = Markup(environment.globals["style"]) + Markup(own.read_text("utf-8"))
    shown: dict[str, Any] = {
        name: inline_svg(figure.plot().axes[0], figure.alt, name.replace("-", ""))
        for name, figure in found.figures.items()
    }
    return template.render(
        style=style,
        r=found,
        inputs=INPUTS,
        svg=shown,
        redrawn=[found.figures[name] for name in REDRAWN],
        extra=[found.figures[name] for name in ("fig-9-found",) if name in found.figures],
        endless=math.isinf(found.steps[-1].rivets),
        units={i.name: f" [{i.unit}]" if i.unit not in ("", "–") else "" for i in INPUTS},
        gaps=[e.gap for e in found.equations if e.gap is not None],
        verdicts={tried.claim.name: str(tried.finding.verdict) for tried in found.claims},
        of_abstract=sum(
            tried.finding.verdict is Verdict.HOLDS
            for tried in found.claims
            if tried.sentence.page == found.study.printed.abstract_page
        ),
        influence={row.name: row for row in found.influences},
        command=command or "picchio reproduce",
        warnings=warnings,
    )


def power(value: float) -> str:
    """A number such as 3.08 x 10^6, as HTML."""
    if not math.isfinite(value):
        return "∞"
    if value == 0 or 1e-3 <= abs(value) < 1e5:
        return f"{value:.3g}"
    digits, exponent = f"{value:.2e}".split("e")
    return f"{digits}\N{MULTIPLICATION SIGN}10<sup>{int(exponent)}</sup>"


def _gap(value: float | None) -> str:
    if value is None:
        return "–"
    return "0" if value == 0 else f"{value:.0e}"


def _value(value: Any) -> str:
    if isinstance(value, float) and value >= 1e6:
        return f"{value / 1e9:.4g}e9"
    if isinstance(value, float):
        return f"{value:.4g}"
    return str(value)
