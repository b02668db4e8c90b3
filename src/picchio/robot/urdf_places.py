"""Where in a URDF's bytes annotations stand and where new ones go."""

from __future__ import annotations

from dataclasses import dataclass, field
from xml.parsers import expat


@dataclass(frozen=True)
class Edit:
    """Replace `length` bytes from `start` by a text."""

    start: int
    length: int
    text: str


@dataclass
class Place:
    """One element that can carry annotations.

    Args:
        insert: byte where new elements go.
        indent: white space before each.
        old: byte ranges of the present annotations, with the white space before them.
    """

    insert: int = 0
    indent: str = ""
    old: list[tuple[int, int]] = field(default_factory=list)


@dataclass
class Places:
    """Every place of a file.

    Args:
        root_name_end: byte after `<robot`.
        newline: as the file has it.
        at: by ("joint", its name) or ("robot", the annotation's name).
    """

    root_name_end: int
    newline: str
    at: dict[tuple[str, str], Place]


ROBOT_TAGS = ("tool", "gun", "base")


def find_places(content: bytes, namespace: str) -> Places:
    """Read the places off a URDF that has been checked before.

    Args:
        content: the file's bytes, in a superset of ASCII.
        namespace: of the annotations.
    """
    reader = _Reader(content, namespace)
    reader.parse()
    newline = "\r\n" if b"\r\n" in content else "\n"
    return Places(reader.root_name_end, newline, reader.places)


class _Reader:
    """Walks the file with expat, which knows the byte it is at."""

    def __init__(self, content: bytes, namespace: str) -> None:
        self.content = content
        self.namespace = namespace
        self.places: dict[tuple[str, str], Place] = {}
        self.root_name_end = 0
        self._parser = expat.ParserCreate(namespace_separator=" ")
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._depth = 0
        self._joint: Place | None = None
        self._robot = {tag: Place() for tag in ROBOT_TAGS}

    def parse(self) -> None:
        self._parser.Parse(self.content, True)

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        start = self._parser.CurrentByteIndex
        end = _tag_end(self.content, start)
        self._depth += 1
        mine = tag.startswith(f"{self.namespace} ")
        name = tag.removeprefix(f"{self.namespace} ")
        if self._depth == 1:
            self.root_name_end = _name_end(self.content, start)
        elif self._depth == 2 and tag == "joint":
            self._joint = Place(insert=end)
            self.places["joint", attributes["name"]] = self._joint
        elif self._depth == 3 and self._joint is not None:
            if not self._joint.indent:
                self._joint.indent = self._blank_before(start).rpartition("\n")[2]
            if mine:
                self._joint.old.append((start - len(self._blank_before(start)), end))
            else:
                self._joint.insert = end  # a child with children moves on at its end
        if self._depth == 2:
            if mine and name in self._robot:
                self._robot[name].old.append((start - len(self._blank_before(start)), end))
            for place in self._robot.values():
                place.indent = place.indent or self._blank_before(start).rpartition("\n")[2]

    def _end(self, tag: str) -> None:
        start = self._parser.CurrentByteIndex
        closing = self.content[start : start + 2] == b"</"
        end = _tag_end(self.content, start)
        mine = tag.startswith(f"{self.namespace} ")
        if self._depth == 3 and self._joint is not None and closing:
            if mine:
                self._joint.old[-1] = (self._joint.old[-1][0], end)
            else:
                self._joint.insert = end
        if self._depth == 2:
            self._joint = None
            name = tag.removeprefix(f"{self.namespace} ")
            if mine and closing and self._robot[name].old:
                self._robot[name].old[-1] = (self._robot[name].old[-1][0], end)
        if self._depth == 1:
            for name, place in self._robot.items():
                place.insert = start - len(self._blank_before(start))
                self.places["robot", name] = place
        self._depth -= 1

    def _blank_before(self, place: int) -> str:
        begin = place
        while begin > 0 and self.content[begin - 1 : begin] in (b" ", b"\t", b"\r", b"\n"):
            begin -= 1
        return self.content[begin:place].decode("ascii")


def _name_end(content: bytes, start: int) -> int:
    place = start + 1
    while content[place : place + 1] not in (b" ", b"\t", b"\r", b"\n", b"/", b">", b""):
        place += 1
    return place


def _tag_end(content: bytes, start: int) -> int:
    """The byte after the tag that starts at `start`; a ">" in an attribute does not end it."""
    quote = b""
    for place in range(start, len(content)):
        byte = content[place : place + 1]
        if quote:
            quote = b"" if byte == quote else quote
        elif byte in (b'"', b"'"):
            quote = byte
        elif byte == b">":
            return place + 1
    return len(content)
