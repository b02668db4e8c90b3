"""The catalogue of effects as it is described to people."""

import contextlib
import io
import json
import tomllib

import pytest

from picchio import load_robot
from picchio.cli.main import run
from picchio.core.errors import InputError
from picchio.model.effects.registry import catalogue, from_dict
from picchio.reference.effects import TARGETS, effects

ALL = {entry.name: entry for entry in effects().effects}


def test_all_of_them_are_there():
    assert set(ALL) == set(catalogue())


@pytest.mark.parametrize("entry", ALL.values(), ids=list(ALL))
def test_everything_about_it_is_said(entry):
    assert entry.meaning and entry.detail and entry.target in TARGETS
    for parameter in entry.parameters:
        assert parameter.unit and parameter.meaning, parameter.name


@pytest.mark.parametrize("entry", ALL.values(), ids=list(ALL))
def test_the_example_is_an_effect_that_does_something(entry):
    table = tomllib.loads(entry.example)["effect"][0]
    effect = from_dict(table, load_robot("fanuc_like_3dof"))
    assert effect.name == entry.name
    assert effect != type(effect)(effect.target), "every parameter of the example is neutral"


def test_an_unknown_one_is_refused():
    with pytest.raises(InputError, match="did you mean 'payload'"):
        effects("payloads")


def printed(*arguments, width, monkeypatch):
    """What the command prints on a terminal of this width."""
    from rich.console import Console

    module = "picchio.cli.reference.described"
    monkeypatch.setattr(
        f"{module}.console", lambda: Console(width=width, highlight=False, markup=False)
    )
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        assert run(list(arguments)) == 0
    return out.getvalue()


def test_no_name_and_no_number_is_cut_at_80_columns(monkeypatch):
    text = printed("effects", width=80, monkeypatch=monkeypatch)
    assert all(name in text for name in ALL)
    assert max(len(line.rstrip()) for line in text.splitlines()) <= 80
    for entry in ALL.values():
        text = printed("effects", entry.name, width=80, monkeypatch=monkeypatch)
        assert entry.example in text
        for parameter in entry.parameters:
            assert parameter.name in text and f"{parameter.upper:g}" in text.replace("any", "inf")


def test_no_key_is_cut_at_80_columns(monkeypatch):
    from picchio.reference.formats import formats

    for entry in formats().formats:
        text = printed("formats", entry.name, width=80, monkeypatch=monkeypatch)
        assert "…" not in text
        for key in entry.keys:
            assert key.path.rpartition(".")[2] in text, key.path


def test_json_is_what_the_function_gives(tmp_path):
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        assert run(["effects", "payload", "--json", "-"]) == 0
    assert json.loads(out.getvalue()) == effects("payload").to_dict()
