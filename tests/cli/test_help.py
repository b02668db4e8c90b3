"""The help of every command, on a terminal of 80 columns."""

import re
from typing import Any

import pytest
import typer

from picchio.cli.main import app

GROUP: Any = typer.main.get_command(app)


@pytest.fixture(autouse=True)
def _narrow(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")


@pytest.mark.parametrize("name", GROUP.commands)
def test_every_option_is_told_whole_and_nothing_is_cut(picchio, name):
    text = picchio(name, "--help").stdout
    assert max(map(len, text.splitlines())) <= 80
    assert "Example: picchio" in text and "…" not in text
    for parameter in GROUP.commands[name].params:
        for word in (*parameter.opts, *parameter.secondary_opts):
            if word.startswith("--"):
                assert word in text, word
    # What the help says in brackets is no markup.
    told = " ".join(
        [GROUP.commands[name].help or "", *(p.help or "" for p in GROUP.commands[name].params)]
    )
    assert set(re.findall(r"\[+[\w/^]+\]+", told)) <= set(re.findall(r"\[+[\w/^]+\]+", text))


def test_what_each_command_does_fits_its_line(picchio):
    lines = picchio("--help").stdout.split("Commands:")[1].split("Example:")[0].strip().splitlines()
    assert len(lines) == len(GROUP.commands)
    for line in lines:
        assert not line.endswith("..."), line
