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
    head, examples = text.split("Examples:\n")
    assert examples.count("  picchio ") == 3 and "…" not in text
    used = set(re.findall(r"(?<= )--[a-z-]+", examples.replace("\n", " ")))
    assert used <= set(re.findall(r"--[a-z-]+", head)) | {"--flex"}  # what is typed is there
    first = head.partition("Options used most:")[2].split("\n\n")[0]
    assert all(word in first for word in used - {"--flex"}), first
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
