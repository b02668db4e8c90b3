"""What the first page of a report for a customer says besides the result."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path

from markupsafe import Markup

from picchio.core.errors import InputError
from picchio.core.files import read_bytes

_MOST_BYTES = 1_000_000
_MOST_PIXELS = 4_000 * 4_000
_KINDS = ["PNG", "JPEG", "SVG"]
# Elements of an SVG that run, fetch or embed something.
_ACTIVE = {"script", "foreignobject", "iframe", "object", "embed", "handler", "set", "animate",
           "animatetransform", "animatemotion", "audio", "video"}  # fmt: skip


@dataclass(frozen=True)
class Cover:
    """Who a report is for and from.

    Attributes:
        title: of the page; one that names the robot if empty.
        customer: for whom.
        author: by whom.
        logo: a PNG, JPEG or SVG file, which becomes a part of the page.
        day: of the report.
    """

    title: str = ""
    customer: str = ""
    author: str = ""
    logo: Path | None = None
    day: date = field(default_factory=date.today)

    @property
    def picture(self) -> Markup:
        """The logo as the `src` of an `<img>`, where nothing in it can run or fetch; or nothing."""
        return embedded(self.logo) if self.logo is not None else Markup("")


def embedded(path: Path) -> Markup:
    """A picture file as a data address.

    Args:
        path: of a PNG, JPEG or SVG.

    Raises:
        InputError: missing, too large, another kind, damaged, or an SVG that is more than a
            picture.
    """
    content = read_bytes(path, limit=_MOST_BYTES)
    kind = _bitmap(path, content) or _vector(path, content)
    return Markup(f"data:image/{kind};base64,{base64.b64encode(content).decode('ascii')}")


def _bitmap(path: Path, content: bytes) -> str:
    """Which of them the content is: "png" or "jpeg"; "" for neither."""
    from PIL import Image

    starts = {b"\x89PNG\r\n\x1a\n": "png", b"\xff\xd8\xff": "jpeg"}
    kind = next((kind for start, kind in starts.items() if content.startswith(start)), "")
    if not kind:
        return ""
    try:
        with Image.open(io.BytesIO(content), formats=[kind]) as image:
            width, height = image.size
            image.verify()
    except Exception as error:  # whatever a damaged file makes Pillow raise
        raise InputError(f"is a damaged {kind.upper()}: {error}", file=path, key="logo") from None
    if width * height > _MOST_PIXELS:
        raise InputError(f"is too large ({width} x {height} pixels)", file=path, key="logo")
    return kind


def _vector(path: Path, content: bytes) -> str:
    from lxml import etree

    parser = etree.XMLParser(resolve_entities=False, no_network=True, huge_tree=False)
    try:
        root = etree.fromstring(content, parser)
    except (etree.XMLSyntaxError, ValueError):
        root = None
    if root is None or etree.QName(root).localname != "svg":
        raise InputError("unknown kind of picture", file=path, key="logo", choices=_KINDS)
    problem = "an entity or document type" if root.getroottree().docinfo.doctype else ""
    for element in root.iter(etree.Element):
        name = etree.QName(element).localname.lower()
        if name in _ACTIVE:
            problem = f"<{name}>"
        for key, value in element.attrib.items():
            key = etree.QName(key).localname.lower()
            outside = key == "href" and not value.startswith(("#", "data:image/"))
            if key.startswith("on") or outside or "url(" in value.replace("url(#", ""):
                problem = f"{key}={value[:40]!r}"
        if name == "style" and any(w in (element.text or "") for w in ("@import", "url(")):
            problem = "a style that fetches"
    if problem:
        raise InputError(f"is more than a picture: it has {problem}", file=path, key="logo",
                         hint="give it as PNG")  # fmt: skip
    return "svg+xml"
