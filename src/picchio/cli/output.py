"""What a command prints: tables for people, JSON for programs, progress on stderr."""

from __future__ import annotations

import itertools
import os
import re
import shlex
import sys
import textwrap
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from picchio.cli.layout import FittedTable, Row
from picchio.cli.waiting import waiting
from picchio.core.errors import InputError, OutputError, PicchioWarning
from picchio.core.files import atomic_write, is_stream
from picchio.core.guard import guard
from picchio.core.listing import plainly
from picchio.core.results import json_pieces

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from picchio.core.listing import Listing
    from picchio.core.results import Result

_PIPE = 10_000  # characters: no line wraps there
_LINES = 25  # of an answer on a screen, unless all is asked for
_MORE = "To know more: -v"
# ASCII's and Latin-1's, marks that turn the direction of writing, halves of characters.
_CONTROL = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff]"
)
_INDENT = re.compile(r" +(- )?")
_typed: list[str] = []
_said: list[str] = []
_awaited: dict[Path, tuple[int, ...] | None] = {}
# What an answer prints, held until it is known what of it fits; None begins the details.
_Held = tuple[tuple[Any, ...], dict[str, Any]]
_held: list[_Held | None] | None = None
_all = False


def begin(arguments: Sequence[str]) -> None:
    """Start a command: keep what was typed for a report, forget what an earlier one said."""
    _typed[:] = arguments
    _said.clear()
    _awaited.clear()
    show_all(False)


def show_all(wanted: bool) -> None:
    """Whether answers are printed whole (`-v`), not what fits 25 lines.

    Args:
        wanted: by the user.
    """
    global _all
    _all = wanted


def whole() -> bool:
    """Whether answers are printed whole."""
    return _all


def details() -> None:
    """What is printed from here on is for those who ask for more."""
    if _held is not None:
        _held.append(None)


def say_warning(message: str) -> None:
    """Print a warning on stderr, once, and keep it for a report."""
    line = " ".join(message.split())
    if line not in _said:
        _said.append(line)
        print(f"picchio: warning: {printable(line)}", file=sys.stderr)


@contextmanager
def notice_first(target: str | None) -> Iterator[None]:
    """Meanwhile no warning that drives are estimates: it heads what is printed.

    Args:
        target: of `--json`; where stdout holds the JSON alone, the warning stays.
    """
    with warnings.catch_warnings():
        if target != "-":
            warnings.filterwarnings("ignore", "Estimated: ", PicchioWarning)
        yield


def console() -> Console:
    """Where tables go: stdout, as wide as the terminal (or COLUMNS); into a pipe nothing wraps.

    Text is printed as it is: a robot may be called "[/x]", which is no markup.
    """
    from rich.console import Console

    class Plain(Console):
        def render_str(self, text: str, **options: Any) -> Text:
            return super().render_str(printable(text), **options)

        def print(self, *objects: Any, **options: Any) -> None:
            """What wraps of an indented line is indented, too; an answer is held."""
            if _held is None:
                super().print(*(_hanging(o, self.width) for o in objects), **options)
            else:
                _held.append((objects, options))

    known = sys.stdout.isatty() or os.environ.get("COLUMNS", "").isdigit()
    width = None if known else _PIPE
    return Plain(width=width, markup=False, emoji=False, highlight=False)


def _hanging(content: Any, width: int) -> Any:
    """An indented line in lines of this width, all indented; anything else as it is."""
    indent = _INDENT.match(content) if isinstance(content, str) else None
    if indent is None or len(content) <= width:
        return content
    return textwrap.fill(
        content, width, subsequent_indent=" " * indent.end(), break_long_words=False,
        break_on_hyphens=False, drop_whitespace=True,
    )  # fmt: skip


def styled(text: str, rest: str = "", *, style: str = "bold") -> Text:
    """A text, of which the first part stands out, to print.

    Args:
        text: the first part.
        rest: the second, as usual.
        style: of the first.
    """
    from rich.text import Text

    return Text.assemble((printable(text), style), printable(rest))


def printable(text: str) -> str:
    """The text with control characters spelled out: a name must not command the terminal."""
    return _CONTROL.sub(lambda found: found[0].encode("unicode_escape").decode(), text)


def definitions(rows: Iterable[tuple[str, str | Text]]) -> Table:
    """Names and what they mean, in two columns; no name is cut, the meaning wraps.

    Args:
        rows: (name, text).

    Returns:
        a table to print.
    """
    from rich.table import Table

    table = Table.grid(padding=(0, 2))
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for name, text in rows:
        table.add_row(f"  {name}", text)
    table.add_row("", "")
    return table


def table(headers: Iterable[str], rows: Iterable[Iterable[str | Text]], **look: Any) -> FittedTable:
    """A table to print; no width breaks a number or a name of it.

    Args:
        headers: of the columns; one that begins with ">" is set to the right.
        rows: cells: texts, or what `styled` makes; the first names its row.
        **look: of `picchio.cli.layout.FittedTable`, such as its title.
    """
    from rich.text import Text

    def cell(content: str | Text) -> Text:
        return content if isinstance(content, Text) else Text(printable(content))

    return FittedTable(list(headers), [Row([cell(c) for c in row]) for row in rows], **look)


def listed(listing: Listing, title: str | None = None) -> FittedTable:
    """A listing to print, units below the names of its columns.

    Args:
        listing: the table.
        title: in place of its own.
    """
    heads = [f"{'>' * each.numbers}{each.name}\n{each.unit}".rstrip() for each in listing.columns]
    made = table(
        heads, listing.rows(plainly), title=(listing.title if title is None else title) or None
    )
    for row in made.rows:
        row.style = "bold" if row.cells[0].plain == listing.bold else None
    return made


def count_of(count: float, noun: str) -> str:
    """A number with its noun: "1 rivet", "12 rivets"."""
    return f"{count:g} {noun}{'' if count == 1 else 's'}"


def to_write(text: str | Path, key: str, endings: Sequence[str] = (), **how: bool) -> Path:
    """A file that is to be written, refused before any work where it cannot be.

    What has been written is told at the end, by `say_written`.

    Args:
        text: its name as typed.
        key: the option.
        endings: of a name, where they are not all right.
        **how: see `Guard.declare`.

    Raises:
        InputError: another ending, the folder is missing, or another option writes it, too.
        OutputError: the folder is read-only.
    """
    path = Path(text)
    if str(path) == "-":
        raise InputError("must be a file", key=key, value=str(path))
    if not is_stream(path):
        if endings and path.suffix.lower() not in endings:
            raise InputError("this output has another ending", file=path, key=key,
                             value=path.suffix, choices=endings)  # fmt: skip
        if path.is_dir() and path.suffix != ".zarr":
            raise InputError("is a folder, not a file to write", file=path)
        if not path.parent.is_dir():
            raise InputError("cannot write here: the folder does not exist", file=path)
        if not os.access(path.parent, os.W_OK):
            raise OutputError("cannot be written: the folder is read-only", file=path)
        guard.declare(path, key, **how)
        _awaited.setdefault(path, _stamp(path))
    return path


def folder_to_write(text: str | Path, key: str) -> Path:
    """A campaign's folder that is to be written; it is checked where it is written.

    Args:
        text: its name as typed.
        key: the option.
    """
    path = Path(text)
    guard.declare(path, key)
    _awaited.setdefault(path, _stamp(path))
    return path


def _stamp(path: Path) -> tuple[int, ...] | None:
    """What changes when a file or folder is written anew; None where there is none."""
    with suppress(OSError):
        found = path.stat()
        return found.st_ino, found.st_mtime_ns, found.st_size
    return None


def say_written() -> None:
    """Say, on stderr, which of the command's targets it has written."""
    for path, before in _awaited.items():
        if _stamp(path) not in (None, before):
            print(f"picchio: wrote {printable(str(path))}", file=sys.stderr)
    _awaited.clear()


def write_report(result: Result, target: Path | None, **options: Any) -> None:
    """Write a result's page where one is asked for, with what was typed and the warnings so far.

    Args:
        result: what the command found.
        target: the file of `--report`.
        **options: what the page needs besides, see `picchio.report`.
    """
    if target is not None:
        import picchio

        waiting.say("drawing the page")
        typed = shlex.join(["picchio", *_typed])
        picchio.report(result, command=typed, warnings=_said, **options).save(target)


def deliver(
    content: Mapping[str, Any], target: str | None, show: Callable[[], object] = lambda: None
) -> None:
    """Write a result as JSON where that is asked for; show it, unless stdout holds the JSON.

    Args:
        content: of the result, `to_dict()`; arrays may stand in it.
        target: the file of `--json`; "-" for stdout, None where there is none.
        show: prints the result for people.
    """
    waiting.end()
    if target is not None:
        # In pieces: a task of many poses makes more text than its numbers take in memory.
        pieces = itertools.chain(json_pieces(content), ["\n"])
        if target == "-":
            sys.stdout.writelines(pieces)
            return
        with atomic_write(target) as stream:
            stream.writelines(pieces)
    _answer(show)


def _answer(show: Callable[[], object]) -> None:
    """Print an answer, of which the most important comes first: all, or what fits 25 lines."""
    global _held
    if _all:
        show()
        return
    held = _held = []
    try:
        show()
    finally:
        _held = None
    screen, cut = console(), False
    lines: list[str] = []
    for entry in held:
        room = _LINES - 1 - len(lines)
        if entry is None or room < 1:
            cut = True
            break
        (first, *rest), options = entry[0] or ("",), entry[1]
        if isinstance(first, FittedTable):
            first, less = first.brief(screen, room)
            cut |= less
            if len(first.heads) == 1:  # names alone say nothing
                break
        with screen.capture() as text:
            screen.print(first, *rest, **options)
        made = text.get().splitlines()
        if len(made) > room + (not made[-1].strip()):
            cut = True
            break
        lines += made[:room]
    if cut:
        while lines and not lines[-1].strip():
            lines.pop()
        lines.append(_MORE)
    sys.stdout.write("".join(f"{line}\n" for line in lines))


# What follows the steps of a command.
_AFTER = "preparing the results"


@contextmanager
def progress(description: str) -> Iterator[Callable[[int, int], None]]:
    """Tell how much of a step is done, in the command's bar.

    Args:
        description: what is counted.

    Yields:
        a function to call with (done, total).
    """
    guard.check()
    yield lambda done, total: waiting.say(description, done, total)
    waiting.say(_AFTER)


@contextmanager
def telling(what: str) -> Iterator[Callable[[str], None]]:
    """Tell what is being done, in the command's bar.

    Args:
        what: at first.

    Yields:
        a function to call with what is done now.
    """
    guard.check()
    waiting.say(what)
    yield waiting.say
    waiting.say(_AFTER)
