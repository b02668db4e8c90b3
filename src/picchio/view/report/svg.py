"""A matplotlib figure as inline SVG that takes the page's text colour and has an alt text."""

from __future__ import annotations

import io
import re
from typing import Any, cast

import matplotlib as mpl
from markupsafe import Markup, escape
from matplotlib.axes import Axes

from picchio.view.plots.style import INK, MUTED, STYLE

_SIZE = re.compile(r'<svg [^>]*?viewBox="(?P<box>[^"]+)"[^>]*>')
_ID = re.compile(r'\bid="([^"]+)"')
_REFERENCE = re.compile(r"(?P<before>xlink:href=\"#|url\(#)(?P<id>[^\")]+)")


def inline_svg(ax: Axes, alt: str, name: str) -> Markup:
    """The figure of some Axes as an `<svg>` element.

    Text and axes get the page's own colours (`currentColor`, `--muted`), so that a dark page
    shows light text; ids are made unique on the page by `name`.

    Args:
        ax: of a figure that is drawn whole.
        alt: what the figure shows, in words; escaped here.
        name: unique on the page, letters and digits.
    """
    stream = io.StringIO()
    with mpl.rc_context({**cast(Any, STYLE), "svg.fonttype": "path"}):
        # Neither date nor creator: the same result gives the same file.
        unstamped = dict.fromkeys(("Date", "Creator", "Format", "Type"))
        figure = ax.get_figure(root=True)
        assert figure is not None
        figure.savefig(stream, format="svg", facecolor="none", metadata=unstamped)
    text = stream.getvalue()
    text = text[text.index("<svg") :]
    found = _SIZE.search(text)
    assert found is not None
    body = text[found.end() :]
    body = re.sub(r"<metadata>.*?</metadata>", "", body, flags=re.DOTALL)
    body = re.sub(r"<!--.*?-->\s*", "", body, flags=re.DOTALL)
    body = _ID.sub(rf'id="{name}-\1"', body)
    body = _REFERENCE.sub(rf"\g<before>{name}-\g<id>", body)
    body = body.replace("xlink:href", "href")
    body = body.replace(INK, "currentColor").replace(MUTED, "var(--muted)")
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{found["box"]}" role="img" '
        f'aria-label="{escape(alt)}">'
    )
    return Markup(head + body)
