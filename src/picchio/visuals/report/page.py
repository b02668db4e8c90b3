"""How a report's page is made: template, style sheet, and numbers as text."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from inspect import signature
from typing import TYPE_CHECKING, Any, ClassVar, cast

import matplotlib as mpl
from markupsafe import Markup, escape
from matplotlib.axes import Axes

from picchio.core import spoken
from picchio.core.errors import InputError
from picchio.core.html import Page
from picchio.core.listing import plainly
from picchio.core.provenance import package_version
from picchio.core.results import Result
from picchio.core.shown import named_function
from picchio.visuals.plots.style import BLUE, INK, MUTED, STYLE, VERMILION

if TYPE_CHECKING:
    from jinja2 import Environment

# A matplotlib figure as inline SVG that takes the page's text colour and has an alt text.

_SIZE = re.compile(r'<svg [^>]*?viewBox="(?P<box>[^"]+)"[^>]*>')
_ID = re.compile(r'\bid="([^"]+)"')
_REFERENCE = re.compile(r"(?P<before>xlink:href=\"#|url\(#)(?P<id>[^\")]+)")


def inline_svg(ax: Axes, alt: str, name: str, *, themed: bool = False) -> Markup:
    """The figure of some Axes as an `<svg>` element.

    Text and axes get the page's own colours (`currentColor`, `--muted`), so that a dark page
    shows light text; ids are made unique on the page by `name`.

    Args:
        ax: of a figure that is drawn whole.
        alt: what the figure shows, in words; escaped here.
        name: unique on the page, letters and digits.
        themed: blue and vermilion, too, become the page's own, which differ by theme.
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
    if themed:
        body = body.replace(BLUE, "var(--accent)").replace(VERMILION, "var(--bad)")
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{found["box"]}" role="img" '
        f'aria-label="{escape(alt)}">'
    )
    return Markup(head + body)


def page_environment(package: str = "picchio.visuals.report") -> Environment:
    """The templates of a package's folder `page_files`; all that goes into them is escaped.

    Args:
        package: its full name.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        loader=PackageLoader(package, "page_files"),
    )
    environment.filters.update(number=number, percent=percent, count=spoken.count)
    environment.filters["typeset"] = typeset
    environment.globals["plainly"] = plainly
    style = files("picchio.visuals.report") / "page_files" / "style.css"
    environment.globals["style"] = Markup(style.read_text("utf-8"))
    return environment


def render(template: str, **content: Any) -> str:
    """A page from a template of this package.

    Args:
        template: its file's name.
        **content: what the template names, but for style sheet and version; what most pages leave
            empty (a scene, headings below another's) may be left out.
    """
    environment = page_environment()
    # What most pages leave empty.
    nothing = ("at", "tone", "scene", "moves", "ask", "stiffness", "channels", "warnings",
               "traces", "pictures", "sentences")  # fmt: skip
    environment.globals.update(dict.fromkeys(nothing, ""), level=2, version=package_version())
    return environment.get_template(template).render(**content)


@dataclass(frozen=True)
class Picture:
    """An inline SVG and what is written under it."""

    svg: Markup
    caption: str


class Pictures:
    """Draws the pictures of a page.

    Attributes:
        PREFIX: a letter that no other pictures of the page have; their ids begin with it.
    """

    PREFIX = "p"
    _made = 0

    def picture(self, ax: Axes, alt: str, caption: str) -> Picture:
        """The figure of some Axes with its alt text and caption."""
        self._made += 1
        return Picture(inline_svg(ax, alt, f"{self.PREFIX}{self._made}", themed=True), caption)


_TOLD = re.compile(r"-?[\d,.]+(e-?\d+)?")
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def number(value: float | None, digits: int = spoken.DIGITS) -> str:
    """A number as on a terminal, with a true minus, a true dash and raised powers of ten."""
    return typeset(spoken.number(value, digits))


def typeset(text: str) -> str:
    """The same, where it is told already; words stay as they are.

    Args:
        text: of a cell.
    """
    if text == "-":
        return "\N{EN DASH}"
    if not _TOLD.fullmatch(text):
        return text
    mantissa, e, power = text.partition("e")
    raised = f" × 10{power.translate(_RAISED)}" if e else ""
    return mantissa.replace("-", "\N{MINUS SIGN}") + raised


def signed(value: float, places: int) -> str:
    """A change, with its sign."""
    return f"{value:+.{places}f}".replace("-", "\N{MINUS SIGN}")


def percent(value: float | None, digits: int = 3) -> str:
    """A share as a percentage without its sign."""
    return number(None if value is None else 100.0 * value, digits)


def spread(value: float, std: float, unit: str = "") -> str:
    """A value with its standard deviation, both to where the latter begins."""
    unit = "" if unit == "1" else f" {unit.replace('*', ' ')}"
    if not (math.isfinite(value) and math.isfinite(std)) or std <= 0.0:
        return number(value) + unit
    size = max(abs(value), std)
    if not 1e-4 <= size < 1e7:
        digits = min(max(2 + math.floor(math.log10(size / std)), 2), 9)
        return f"{number(value, digits)} ± {number(std, 2)}{unit}"
    places = max(0, 1 - math.floor(math.log10(std)))
    if places == 0:
        round_to = math.floor(math.log10(std)) - 1
        value, std = round(value, -round_to), round(std, -round_to)
    text = f"{value:,.{places}f} ± {std:,.{places}f}{unit}"
    return text.replace("-", "\N{MINUS SIGN}")


def capitalised(text: str) -> str:
    """With a capital, and names as they are."""
    return text[:1].upper() + text[1:]


def words(name: str) -> str:
    """An effect's name as people say it."""
    return name.replace("_", " ")


@dataclass(frozen=True, eq=False, repr=False)
class Report(Page):
    """A result as a page to read, to print and to mail: `save` writes it.

    Attributes:
        title: what it shows.
        text: the HTML.
    """

    LACKS: ClassVar = dict.fromkeys(("plot", "show", "to_frame"), "it is a page: save it")

    title: str
    text: str

    def html(self) -> str:
        """The page."""
        return self.text

    def __repr__(self) -> str:
        return f"<Report: {self.title}, {len(self.text.encode()) / 1e3:.0f} kB>"


def report(
    result: Result | Page,
    *,
    command: str | None = None,
    warnings: Sequence[str] = (),
    **options: Any,
) -> Report:
    """A result as one HTML page that needs nothing from outside.

    Args:
        result: what a function of picchio returned: an assessment, a check, a diagnosis, ...
            One that has no page of its own is shown as in a notebook; a scene is a page.
        command: how it was made, for the page's foot.
        warnings: what was warned of on the way.
        **options: what the result's own page needs or can be told besides: an assessment's needs
            `robot` and `task`.

    Returns:
        the page; `report(...).save("page.html")` writes it.

    Raises:
        InputError: no result of picchio, or one that its page cannot show.
    """
    if isinstance(result, Page):
        return Report(result.title, result.html())
    if not isinstance(result, Result):
        raise InputError("is no result of picchio", key="result", value=result)
    title = result._headline()
    page = named_function(result.PAGE)
    try:
        asked = signature(page).bind(result, command=command, warnings=warnings, **options)
    except TypeError as error:
        raise InputError(f"the page of {type(result).__name__}: {error}") from None
    return Report(title, page(*asked.args, **asked.kwargs))


def plain_page(
    result: Result,
    *,
    command: str | None = None,
    warnings: Sequence[str] = (),
    pictures: Sequence[Any] = (),
    sentences: Sequence[str] = (),
) -> str:
    """The page of a result that has none of its own: what a notebook shows, and its inputs."""
    return render(
        "plain.html.j2",
        pictures=pictures,
        sentences=sentences,
        headline=result._headline(),
        body=Markup(result._repr_html_()),
        command=command,
        warnings=warnings,
        provenance=result.to_dict().get("provenance"),
    )
