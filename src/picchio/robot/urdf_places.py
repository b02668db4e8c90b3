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
        insert: byte where new elements go: before the closing tag and its white space.
        lead: white space before each, a line break included where children have lines of
            their own; None until a child is seen.
        old: byte ranges of the present annotations, with the white space before them.
    """

    insert: int = 0
    lead: str | None = None
    old: list[tuple[int, int]] = field(default_factory=list)

    def see_child(self, blank: str) -> None:
        """Take the lead over from a child that has a line of its own, else from the first."""
        if self.lead is None or ("\n" in blank and "\n" not in self.lead):
            line = blank.rpartition("\n")
            self.lead = line[1] + line[2]


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

    Raises:
        ValueError: expat cannot follow the file's encoding.
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
        # Of each open element whether it is self-closing: expat then reports the end of
        # `<limit/>` at the byte after it, where another element's closing tag may stand.
        self._open: list[bool] = []
        self._joint: Place | None = None
        self._robot = {tag: Place() for tag in ROBOT_TAGS}

    def parse(self) -> None:
        try:
            self._parser.Parse(self.content, True)
        except (expat.ExpatError, LookupError) as error:
            raise ValueError(str(error)) from None

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        start = self._parser.CurrentByteIndex
        end = _tag_end(self.content, start)
        self._open.append(self.content[end - 2 : end] == b"/>")
        depth = len(self._open)
        blank = self._blank_before(start)
        old = (start - len(blank), end)
        mine = tag.startswith(f"{self.namespace} ")
        if depth == 1:
            self.root_name_end = _name_end(self.content, start)
        elif depth == 2:
            if tag == "joint":
                self._joint = self.places["joint", attributes["name"]] = Place()
            for name, place in self._robot.items():
                place.see_child(blank)
                if tag == f"{self.namespace} {name}":
                    place.old.append(old)
        elif depth == 3 and self._joint is not None:
            self._joint.see_child(blank)
            if mine:
                self._joint.old.append(old)

    def _end(self, tag: str) -> None:
        depth = len(self._open)
        if not self._open.pop():
            start = self._parser.CurrentByteIndex
            blank = self._blank_before(start)
            self._close(tag, depth, start - len(blank), _tag_end(self.content, start))
        if depth == 2:
            self._joint = None

    def _close(self, tag: str, depth: int, insert: int, end: int) -> None:
        """A closing tag that, with the white space before it, stands at insert..end."""
        if depth == 1:
            for name, place in self._robot.items():
                place.insert = insert
                self.places["robot", name] = place
        elif depth == 2 and self._joint is not None:
            self._joint.insert = insert
        elif tag.startswith(f"{self.namespace} "):
            name = tag.removeprefix(f"{self.namespace} ")
            holder = self._robot.get(name) if depth == 2 else self._joint if depth == 3 else None
            if holder is not None:
                holder.old[-1] = (holder.old[-1][0], end)

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
