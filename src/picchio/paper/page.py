"""From a reproduction to one self-contained HTML file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from importlib.resources import files
from typing import Any

import numpy as np
from markupsafe import Markup

from picchio.paper.claims import Verdict
from picchio.paper.printed import trials
from picchio.paper.run import Reproduction
from picchio.visuals.report.page import inline_svg, page_environment

_MARKS = dict(zip(map(str, Verdict), ("good", "partly", "bad", "open"), strict=True))
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
    environment = page_environment("picchio.paper")
    own = {"mark": _MARKS.__getitem__, "value": _value, "median": _median, "rms": _rms}
    environment.filters.update(own, power=power)
    sheet = files("picchio.paper") / "page_files" / "page.css"
    holds = (c.page for c in found.claims if c.verdict is Verdict.HOLDS)
    return environment.get_template("page.html.j2").render(
        style=Markup(environment.globals["style"]) + Markup(sheet.read_text("utf-8")),
        r=found,
        inputs=trials().inputs,
        svg={
            name: inline_svg(figure.plot().axes[0], figure.alt, name.replace("-", ""))
            for name, figure in found.figures.items()
        },
        redrawn=[found.figures[name] for name in REDRAWN],
        extra=[found.figures[name] for name in ("fig-9-found",) if name in found.figures],
        endless=math.isinf(found.study.steps[-1].rivets),
        gaps=[e["gap"] for e in found.equations if e["gap"] is not None],
        verdicts={c.name: str(c.verdict) for c in found.claims},
        of_abstract=sum(page == found.study.printed.abstract_page for page in holds),
        influence={row.name: row for row in found.study.influences},
        command=command or "picchio reproduce",
        warnings=warnings,
    )


def power(value: float) -> Markup:
    """A number such as 3.08 x 10^6, as HTML.

    Args:
        value: of any size.
    """
    if not math.isfinite(value):
        return Markup("∞")
    if value == 0 or 1e-3 <= abs(value) < 1e5:
        return Markup(f"{value:.3g}")
    digits, exponent = f"{value:.2e}".split("e")
    return Markup(f"{digits}\N{MULTIPLICATION SIGN}10<sup>{int(exponent)}</sup>")


def _value(value: Any) -> str:
    if isinstance(value, float):
        return f"{value / 1e9:.4g}e9" if value >= 1e6 else f"{value:.4g}"
    return str(value)


def _rms(errors: Any, aside: int | None = None) -> float:
    """Root mean square of errors (k,), one left aside."""
    return float(np.sqrt((np.delete(errors, [] if aside is None else aside) ** 2).mean()))


def _median(errors: Any) -> float:
    """Median size of errors, those that do not exist left out."""
    return float(np.nanmedian(np.abs(errors)))
