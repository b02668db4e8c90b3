"""Write a sidecar's values into a URDF as `picchio:` annotations, changing nothing else.

The file is not parsed and rewritten: new elements are inserted into its bytes, so comments, order,
other tools' tags and odd spacing stay as they are. The result is read back and checked.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from shlex import quote
from typing import Any
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

from lxml import etree

from picchio.core.errors import InputError
from picchio.core.toml import StrictModel
from picchio.robot.annotations.flexibility import EXCLUDED, Source, check_names
from picchio.robot.annotations.inline import IN, IN_ROBOT, read_annotations
from picchio.robot.annotations.sidecar import Sidecar, given
from picchio.robot.spread import overlaid, value_of
from picchio.robot.urdf.check import read_tree
from picchio.robot.urdf.xml import NAMESPACE, parse_urdf, read_urdf_bytes

Edit = tuple[int, int, str]
"""Replace the bytes from a start to an end by a text."""
_NAME = re.compile(rb"<[^ \t\r\n/>]*")
# A ">" in an attribute does not end a tag.
_TAG = re.compile(rb"""<(?:"[^"]*"|'[^']*'|[^>"'])*>""")


@dataclass
class Place:
    """One element that can carry annotations.

    Args:
        insert: byte where new elements go: before the closing tag and its white space.
        lead: white space before each, a line break included where children have lines of
            their own; None until a child is seen.
        old: byte ranges of the present annotations, with the white space before them.
    """

    insert: int = 0
    lead: str | None = None
    old: list[tuple[int, int]] = field(default_factory=list)

    def see_child(self, blank: str) -> None:
        """Take the lead over from a child that has a line of its own, else from the first.

        Args:
            blank: the white space before the child.
        """
        if self.lead is None or ("\n" in blank and "\n" not in self.lead):
            line = blank.rpartition("\n")
            self.lead = line[1] + line[2]


class Places:
    """Where in a checked URDF's bytes annotations stand, and where new ones go.

    Args:
        content: the file's bytes, in a superset of ASCII; expat reports positions in them.

    Attributes:
        root_name_end: byte after `<robot`.
        at: by ("joint" or "link", its name) or ("robot", the annotation's name).

    Raises:
        ValueError: expat cannot follow the file's encoding.
    """

    def __init__(self, content: bytes) -> None:
        self.content = content
        self.at: dict[tuple[str, str], Place] = {}
        self.root_name_end = 0
        self._parser = expat.ParserCreate(namespace_separator=" ")
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        # Of each open element whether it is self-closing: expat then reports the end of
        # `<limit/>` at the byte after it, where another element's closing tag may stand.
        self._open: list[bool] = []
        self._holder: Place | None = None
        self._robot = {tag: Place() for tag in IN_ROBOT}
        try:
            self._parser.Parse(content, True)
        except (expat.ExpatError, LookupError) as error:
            raise ValueError(str(error)) from None

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        start = self._parser.CurrentByteIndex
        end = self._tag_end(start)
        self._open.append(self.content[end - 2 : end] == b"/>")
        depth = len(self._open)
        blank = self._blank_before(start)
        old = (start - len(blank), end)
        if depth == 1:
            name = _NAME.match(self.content, start)
            self.root_name_end = name.end() if name else start
        elif depth == 2:
            if tag in IN:
                self._holder = self.at[tag, attributes["name"]] = Place()
            for annotation, place in self._robot.items():
                place.see_child(blank)
                if tag == f"{NAMESPACE} {annotation}":
                    place.old.append(old)
        elif depth == 3 and self._holder is not None:
            self._holder.see_child(blank)
            if tag.startswith(f"{NAMESPACE} "):
                self._holder.old.append(old)

    def _end(self, tag: str) -> None:
        depth = len(self._open)
        if not self._open.pop():
            start = self._parser.CurrentByteIndex
            blank = self._blank_before(start)
            self._close(tag, depth, start - len(blank), self._tag_end(start))
        if depth == 2:
            self._holder = None

    def _close(self, tag: str, depth: int, insert: int, end: int) -> None:
        """A closing tag that, with the white space before it, stands at insert..end."""
        if depth == 1:
            for name, place in self._robot.items():
                place.insert = insert
                self.at["robot", name] = place
        elif depth == 2 and self._holder is not None:
            self._holder.insert = insert
        elif tag.startswith(f"{NAMESPACE} "):
            name = tag.removeprefix(f"{NAMESPACE} ")
            holder = self._robot.get(name) if depth == 2 else self._holder if depth == 3 else None
            if holder is not None:
                holder.old[-1] = (holder.old[-1][0], end)

    def _blank_before(self, place: int) -> str:
        begin = place
        while begin > 0 and self.content[begin - 1 : begin] in (b" ", b"\t", b"\r", b"\n"):
            begin -= 1
        return self.content[begin:place].decode("ascii")

    def _tag_end(self, start: int) -> int:
        tag = _TAG.match(self.content, start)
        return tag.end() if tag else len(self.content)


def annotate(urdf: str | Path, sidecar: Sidecar) -> bytes:
    """The URDF's bytes with the sidecar's values in them.

    The URDF's own annotations are kept where the sidecar has no value.

    Args:
        urdf: the file; it is not changed.
        sidecar: the values to write.

    Raises:
        InputError: the URDF or the sidecar cannot be used together, the URDF's encoding is
            not a superset of ASCII, or the result would not read back as the same values.
    """
    path = Path(urdf)
    content = read_urdf_bytes(path)
    root = parse_urdf(content, path)
    tree = read_tree(root, path)
    check_names(tree, Source("sidecar", sidecar))
    before = read_annotations(root, path) or Sidecar()
    if b"\0" in content:
        raise InputError("only URDFs in UTF-8 or another superset of ASCII can be annotated",
                         file=path)  # fmt: skip
    prefix = next((key for key, address in root.nsmap.items() if address == NAMESPACE and key), "")
    try:
        places = Places(content)
    except ValueError as error:
        raise InputError(f"cannot be annotated in this encoding: {error}", file=path) from None
    expected: dict[tuple[str, str], dict[str, Any]] = {}
    edits: list[Edit] = []
    if not prefix:
        prefix = "picchio"
        edits.append((places.root_name_end, places.root_name_end, f' xmlns:{prefix}="{NAMESPACE}"'))
    for kind, elements in IN.items():
        old = getattr(before, kind)
        for name, entry in getattr(sidecar, kind).items():
            merged = _merged(old.get(name), entry)
            type(entry).model_validate(merged)
            expected[kind, name] = merged
            edits += _replace(places, (kind, name), _elements(prefix, elements, merged))
    for tag in IN_ROBOT:
        if (stated := getattr(sidecar, tag)) is not None and given(stated):
            values = _merged(getattr(before, tag), stated)
            expected["robot", tag] = values
            edits += _replace(
                places, ("robot", tag), [_element(prefix, tag, values, IN_ROBOT[tag])]
            )
    result = _apply(content, edits)
    _read_back(result, path, root, expected)
    return result


def _merged(old: StrictModel | None, new: StrictModel) -> dict[str, Any]:
    """A table's values with a sidecar's over them, as loading both would have them."""
    weaker, stronger = given(old), given(new)
    excluded = {EXCLUDED[key] for key in stronger if key in EXCLUDED}
    weaker = {key: value for key, value in weaker.items() if value_of(key) not in excluded}
    for record, values in ((old, weaker), (new, stronger)):
        if not getattr(record, "flexible", True):  # an estimate is a statement about a stiffness
            values.pop("estimated", None)
    return overlaid(type(new), weaker, stronger)


def _read_back(
    result: bytes,
    path: Path,
    before: etree._Element,
    expected: Mapping[tuple[str, str], Mapping[str, Any]],
) -> None:
    """Refuse a result that does not read back as the values given."""
    try:
        root = parse_urdf(result, path)
        read_tree(root, path)
        found = read_annotations(root, path) or Sidecar()
    except InputError as error:
        raise InputError(f"cannot be annotated, the result would not read back: {error.problem}",
                         file=path, key=error.key) from None  # fmt: skip
    for (kind, name), values in expected.items():
        entry = getattr(found, kind).get(name) if kind in IN else getattr(found, name)
        if given(entry) != values:
            raise InputError("cannot be annotated, the result would not read back as the values "
                             "given", file=path, key=f"{kind}.{name}")  # fmt: skip
    if _outline(root) != _outline(before):
        raise InputError("cannot be annotated without changing its own elements", file=path)


def _outline(root: etree._Element) -> list[tuple[str, dict[str, str]]]:
    """Everything but the annotations, in the file's order."""
    return [(str(element.tag), {str(key): str(text) for key, text in element.attrib.items()})
            for element in root.iter(etree.Element)
            if not str(element.tag).startswith(f"{{{NAMESPACE}}}")]  # fmt: skip


def _elements(
    prefix: str,
    known: Mapping[str, tuple[str | None, dict[str, Any]]],
    values: Mapping[str, Any],
) -> list[str]:
    elements = []
    for tag, (target, attributes) in known.items():
        if target is None:
            own = {key: value for key, value in values.items() if key in attributes}
        else:
            own = given(values[target]) if target in values else {}
        if own:
            elements.append(_element(prefix, tag, own, attributes))
    return elements


def _element(prefix: str, tag: str, values: Mapping[str, Any], order: Iterable[str]) -> str:
    names = [name for name in order if name in values]
    text = " ".join(f"{name}={quoteattr(_text(values[name]))}" for name in names)
    return f"<{prefix}:{tag} {text}/>"


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, tuple):
        return " ".join(quote(x) if isinstance(x, str) else _text(x) for x in value)
    return repr(value) if isinstance(value, float) else str(value)


def _replace(places: Places, where: tuple[str, str], elements: list[str]) -> list[Edit]:
    """Take the old annotations at a place out and put new ones in."""
    place = places.at[where]
    lines = "".join(f"{place.lead or ''}{element}" for element in elements)
    return [*((start, end, "") for start, end in place.old), (place.insert, place.insert, lines)]


def _apply(content: bytes, edits: list[Edit]) -> bytes:
    newline = "\r\n" if b"\r\n" in content else "\n"
    # From the end, so that earlier places stay where they are; of two at one place the
    # insertion goes in last and stands first.
    for start, end, text in sorted(edits, key=lambda edit: edit[:2], reverse=True):
        inserted = text.replace("\n", newline).encode("ascii", "xmlcharrefreplace")
        content = content[:start] + inserted + content[end:]
    return content
