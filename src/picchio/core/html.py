"""HTML: sheets that fold for notebooks, and whole pages that are written to a file."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from picchio.core.listing import Listing
from picchio.core.shown import Shown

MOST_ROWS = 30
"""More rows than this are cut off, and the table says how many."""


def sheet(
    title: str,
    facts: Mapping[str, Any] | None = None,
    columns: Sequence[str] = (),
    rows: Iterable[Sequence[Any]] = (),
    note: str = "",
    head: str = "",
) -> str:
    """A line; facts a line each, a table and a note below, open, to be folded; text is escaped.

    Args:
        title: what it is.
        facts: {name with unit: value}; None is left out.
        columns: headers, units included.
        rows: cells; numbers get four digits.
        note: a sentence below.
        head: the verdict or the number that matters, and what lowers trust in all of it.
    """
    parts = []
    known = {name: value for name, value in (facts or {}).items() if value is not None}
    if known:
        parts.append("<table>")
        for name, value in known.items():
            parts.append(
                f'<tr><th scope="row" style="text-align:left;white-space:nowrap">'
                f'{escape(name)}</th><td style="text-align:left">{cell(value)}</td></tr>'
            )
        parts.append("</table>")
    if columns:
        shown = list(rows)
        names = "".join(f'<th scope="col">{escape(name)}</th>' for name in columns)
        parts.append(f"<table><thead><tr>{names}</tr></thead><tbody>")
        for row in shown[:MOST_ROWS]:
            parts.append("<tr>" + "".join(f"<td>{cell(value)}</td>" for value in row) + "</tr>")
        parts.append("</tbody></table>")
        if len(shown) > MOST_ROWS:
            parts.append(f"<p>and {len(shown) - MOST_ROWS} more</p>")
    if note:
        parts.append(f"<p>{escape(note)}</p>")
    line = f"<strong>{escape(title)}</strong>{': ' * bool(head)}{escape(head)}"
    if not parts:
        return f"<div>{line}</div>"
    body = f'<div style="overflow-x:auto">{"".join(parts)}</div>'
    return f'<details open><summary style="cursor:pointer">{line}</summary>{body}</details>'


def listed(listing: Listing) -> tuple[list[str], list[tuple[str, ...]]]:
    """The headers and rows of a listing, for `sheet`.

    Args:
        listing: the table.
    """
    return listing.heads, listing.rows(told)


def cell(value: Any) -> str:
    """One value as `told` has it, escaped.

    Args:
        value: a number, text, an array or a sequence of them; None is a dash.
    """
    return escape(told(value))


def told(value: Any) -> str:
    """One value: numbers to four digits, a dash where there is none.

    Args:
        value: a number, text, an array or a sequence of them; None is a dash.
    """
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        if math.isnan(value):
            return "–"
        return "∞" if value == math.inf else f"{value:.4g}"
    if isinstance(value, (list, tuple)):
        text = ", ".join(map(told, value))
        return text if len(value) == 1 else f"({text})"
    return "–" if value is None else str(value)


class Page(Shown):
    """An HTML page that needs nothing but itself: shown in a notebook, or written to a file.

    Attributes:
        title: what it shows.
    """

    title: str

    def html(self) -> str:
        """The page."""
        raise NotImplementedError

    def save(self, path: str | Path) -> Path:
        """Write the page to a file, whole or not at all.

        Args:
            path: the file; its folder must exist.

        Returns:
            the same path.

        Raises:
            OutputError: it cannot be written there.
        """
        from picchio.core.files import write_text

        write_text(path, self.html())
        return Path(path)

    def _repr_html_(self) -> str:
        page = escape(self.html(), quote=True)
        return (
            f'<iframe title="{escape(self.title)}" srcdoc="{page}" '
            'style="width:100%;height:560px;border:0"></iframe>'
        )
