"""What a command prints: tables for people, JSON for programs, progress on stderr."""

from __future__ import annotations

import json
import os
import re
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from picchio.core.errors import InputError, OutputError
from picchio.core.files import is_stream, write_text

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from picchio.core.results import Result

_PATIENCE = 2.0
# ASCII's and Latin-1's, marks that turn the direction of writing, halves of characters.
_CONTROL = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff]"
)
_typed: list[str] = []
_said: list[str] = []


def begin(arguments: Sequence[str]) -> None:
    """Start a command: keep what was typed for a report, forget an earlier command's warnings."""
    _typed[:] = arguments
    _said.clear()


def say_warning(message: str) -> None:
    """Print a warning on stderr, once, and keep it for a report."""
    line = " ".join(message.split())
    if line not in _said:
        _said.append(line)
        print(f"picchio: warning: {printable(line)}", file=sys.stderr)


def console() -> Console:
    """Where tables go: stdout, 120 columns wide where it is no terminal.

    Text is printed as it is: a robot may be called "[/x]", which is no markup.
    """
    from rich.console import Console

    class Plain(Console):
        def render_str(self, text: str, **options: Any) -> Text:
            return super().render_str(printable(text), **options)

    width = None if sys.stdout.isatty() else 120
    return Plain(width=width, markup=False, emoji=False, highlight=False)


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


def table(headers: Iterable[str], rows: Iterable[Iterable[str | Text]], **style: Any) -> Table:
    """A table to print; where there is little room, the first column alone is not broken.

    Args:
        headers: of the columns; one that begins with ">" is set to the right.
        rows: cells: texts, or what `styled` makes.
        **style: of `rich.table.Table`, such as its title.
    """
    from rich import box
    from rich.table import Table

    look: dict[str, Any] = {"box": box.SIMPLE_HEAD, "pad_edge": False, "title_justify": "left"}
    made = Table(title_style="bold", caption_justify="left", **look | style)
    for header in headers:
        side: Literal["left", "right"] = "right" if header.startswith(">") else "left"
        first = not made.columns
        made.add_column(
            header.removeprefix(">"),
            justify=side,
            no_wrap=first,
            overflow="ellipsis" if first else "fold",
        )
    for row in rows:
        made.add_row(*row)
    return made


def count_of(count: float, noun: str) -> str:
    """A number with its noun: "1 rivet", "12 rivets"."""
    return f"{count:g} {noun}{'' if count == 1 else 's'}"


def check_targets(
    targets: Iterable[str | Path | None], inputs: Iterable[str | Path | None]
) -> None:
    """Refuse, before any work, outputs that cannot be written or would destroy an input.

    Args:
        targets: where results shall go; None or "-" for nowhere.
        inputs: files that the command reads.

    Raises:
        InputError: the folder is missing, or the file is one of the inputs.
        OutputError: the folder is read-only.
    """
    read = [Path(source) for source in inputs if source is not None and Path(source).exists()]
    for target in targets:
        if target is None or str(target) == "-":
            continue
        path = Path(target)
        if is_stream(path):
            continue
        if path.is_dir() and path.suffix != ".zarr":
            raise InputError("is a folder, not a file to write", file=path)
        if not path.parent.is_dir():
            raise InputError("cannot write here: the folder does not exist", file=path)
        if not os.access(path.parent, os.W_OK):
            raise OutputError("cannot be written: the folder is read-only", file=path)
        if path.exists() and any(path.samefile(source) for source in read):
            raise InputError("would overwrite an input of this command", file=path)


def write_report(result: Result, target: Path | None, **options: Any) -> None:
    """Write a result's page where one is asked for, with what was typed and the warnings so far.

    Args:
        result: what the command found.
        target: the file of `--report`.
        **options: what the page needs besides, see `picchio.report`.
    """
    if target is not None:
        import picchio

        typed = shlex.join(["picchio", *_typed])
        picchio.report(result, command=typed, warnings=_said, **options).save(target)


def deliver(
    content: Mapping[str, Any], target: str | None, show: Callable[[], object] = lambda: None
) -> None:
    """Write a result as JSON where that is asked for; show it, unless stdout holds the JSON.

    Args:
        content: of the result, `to_dict()`.
        target: the file of `--json`; "-" for stdout, None where there is none.
        show: prints the result for people.
    """
    if target is not None:
        text = json.dumps(content, indent=2, allow_nan=False) + "\n"
        if target == "-":
            sys.stdout.write(text)
            return
        write_text(target, text)
    show()


@contextmanager
def progress(description: str) -> Iterator[Callable[[int, int], None]]:
    """A progress bar on stderr, once work takes over two seconds and stderr is a terminal.

    Yields:
        a function to call with (done, total).
    """
    if not sys.stderr.isatty():
        yield lambda done, total: None
        return
    import threading

    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed}/{task.total}"),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
    )
    # Before the first report there may be a minute of compiling, which should not look like death.
    task = bar.add_task(f"{description} (a first run compiles for a minute)", total=None)
    patience = threading.Timer(_PATIENCE, bar.start)
    patience.daemon = True
    patience.start()
    try:
        yield lambda done, total: bar.update(
            task, description=description, completed=done, total=total
        )
    finally:
        patience.cancel()
        patience.join()
        bar.stop()


@contextmanager
def telling() -> Iterator[Callable[[str], None]]:
    """What is being done, on stderr, where that is a terminal."""
    if not sys.stderr.isatty():
        yield lambda text: None
        return
    from rich.console import Console

    with Console(stderr=True).status("") as status:
        yield status.update
