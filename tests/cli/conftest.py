"""The command line, called as a shell calls it but in this process."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from picchio.cli.layout import FittedTable

WIDTHS = (60, 80, 120, 10_000)  # the last one is a pipe


@pytest.fixture(scope="session")
def picchio(in_process):
    """`picchio(*arguments, cwd=...)`: exit status and what went to stdout and stderr."""
    return in_process


@pytest.fixture
def tables(monkeypatch):
    """The tables that are printed; at the end, each is whole at every width."""
    made = []
    shown = FittedTable.__rich_console__

    def recorded(self, *rest):
        made.append(self)
        return shown(self, *rest)

    monkeypatch.setattr(FittedTable, "__rich_console__", recorded)
    yield made
    monkeypatch.undo()
    for table in made:
        for width in WIDTHS:
            stream = io.StringIO()
            Console(file=stream, width=width).print(table)
            text = stream.getvalue()
            # Nothing is cut; what a cell quotes may have an ellipsis of its own.
            own = sum(cell.plain.count("…") for row in table.rows for cell in row.cells)
            assert text.count("…") <= own, text
            assert max(len(line.rstrip()) for line in text.splitlines()) <= width, text
            # Numbers, names and units stand there whole.
            words = {
                word for row in table.rows for cell in row.cells for word in cell.plain.split()
            }
            words |= {word for head in table.heads[1:] for word in head.lstrip(">").split()}
            lost = {word for word in words if len(word) <= 32} - set(text.split())
            assert not lost, f"{width}: {lost}\n{text}"
