"""What people see of a command besides its result: tables of any width, a bar, what was written."""

from __future__ import annotations

import io
import sys
import time
from pathlib import Path
from typing import get_type_hints

import pytest

import picchio as library
from picchio.cli import waiting as waiting_module
from picchio.cli.output import begin, console, folder_to_write, say_written, table, to_write
from picchio.cli.waiting import Waiting

ONE_POSE = """format = "picchio-task/1"
excitation = { kind = "pulse_train", force = 300.0, period = 0.040, width = 0.004 }
operation = [{ name = "forward", direction = [1.0, 0.0, 0.0], poses = [[0.0, 0.5, -0.8]] }]
"""
LONG = "the_second_joint_of_a_large_arm"  # over 30 characters


def test_an_assessment_is_whole_at_every_width(picchio, tables, tmp_path, monkeypatch):
    library.annotate("fanuc_like_3dof").save(tmp_path / "plain.urdf")
    text = (tmp_path / "plain.urdf").read_text().replace('"joint_2"', f'"{LONG}"')
    (tmp_path / "arm.urdf").write_text(text)
    task = tmp_path / "one.toml"
    task.write_text(ONE_POSE)
    monkeypatch.setenv("COLUMNS", "60")
    done = picchio("assess", tmp_path / "arm.urdf", "--task", task, "--for-life", "1e6",
                   "--compare-methods", "-v")  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert len(tables) >= 4 and done.stdout.count(LONG) > 4
    assert max(map(len, done.stdout.splitlines())) <= 60
    assert "…" not in done.stdout


def test_a_pipe_gets_full_lines(picchio, monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    lines = picchio("assess", "fanuc_like_3dof", "-v").stdout.splitlines()
    assert max(map(len, lines)) > 200
    assert sum(line.startswith("joint_2") for line in lines) == 2  # one a table


def test_what_does_not_fit_is_split_and_then_turned(tables):
    heads = ["joint", *(f">quantity {k}" for k in range(8)), "remark"]
    rows = [[f"{LONG}_{k}", *["123456.789"] * 8, "a remark of several words"] for k in range(2)]
    for name, parts in (("joint", 3), (f"{LONG}_on_the_left", 0)):
        cells = [[f"{name}_{k}", *row[1:]] for k, row in enumerate(rows)]
        made = table(heads, cells)
        text = io.StringIO()
        screen = console()
        screen.file, screen.width = text, 60
        screen.print(made)
        assert text.getvalue().count(f"{name}_1") == (parts or 1)


def test_what_was_written_is_said_once(picchio, tmp_path):
    words = ("envelope", "fanuc_like_3dof", "--pose=0.3,1.1,-1.0", "--json")
    done = picchio(*words, "worst.json", cwd=tmp_path)
    assert done.stderr.splitlines() == ["picchio: wrote worst.json"]
    assert "wrote" not in done.stdout
    assert "wrote" not in picchio(*words, "-", cwd=tmp_path).stderr


def test_every_output_of_every_command_is_awaited():
    """An option whose help says that it writes is checked before any work, and told at the end."""
    from picchio.cli.main import app

    outputs = {"json", "report", "out", "plot", "model", "to", "html", "save"}
    for command in app.registered_commands:
        name = command.name or command.callback.__name__
        for key, hint in get_type_hints(command.callback, include_extras=True).items():
            if key in outputs and (name, key) not in NO_OUTPUTS:
                (option,) = hint.__metadata__
                assert option.parser is not None, (name, key)


# `explore --model` and so on are read; the two files of `start` have names of its own.
NO_OUTPUTS = {("explore", "model"), ("start", "out")}


def test_only_what_changed_was_written(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("old.json").write_text("{}")
    begin([])
    folder_to_write("campaign", "--to")
    for name in ("old.json", "new\x1b.json", "never.json"):
        to_write(name, "--json")
    Path("new\x1b.json").write_text("{}")
    Path("campaign").mkdir()
    say_written()
    said = capsys.readouterr().err.splitlines()
    assert said == ["picchio: wrote campaign", "picchio: wrote new\\x1b.json"]


class _Terminal(io.StringIO):
    def isatty(self):
        return True


def test_long_work_shows_a_bar_and_short_work_none(monkeypatch):
    screen = _Terminal()
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setenv("TERM", "xterm")
    with Waiting().watched():
        pass
    assert screen.getvalue() == ""
    monkeypatch.setattr(waiting_module, "PATIENCE", 0.05)
    bar = Waiting()
    with bar.watched():
        bar.say("places", 3, 8)
        time.sleep(0.6)
        bar.say("drawing the page")
        time.sleep(0.4)
        assert "places" in screen.getvalue() and "3/8" in screen.getvalue()
    assert "drawing the page" in screen.getvalue() and "None" not in screen.getvalue()
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    with bar.watched():
        time.sleep(0.2)
    assert sys.stderr.getvalue() == ""


ANSWERS = (
    ("assess", "fanuc_like_3dof"), ("assess", "ur10"), ("assess", "ur10", "--for-life", "1e6"),
    ("compare", "ur10", "ur5"), ("robots",), ("envelope", "fanuc_like_3dof"),
)  # fmt: skip


@pytest.mark.parametrize("typed", ANSWERS, ids=" ".join)
def test_an_answer_fits_25_lines_and_all_of_it_stands_in_v(picchio, typed, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    short, whole = (picchio(*typed, *more).stdout.splitlines() for more in ((), ("-v",)))
    assert len(short) <= 25 and max(map(len, short)) <= 80
    told = short[-1] == "To know more: -v"
    assert told == (len(whole) > len(short))
    # What is printed first is the same, so the verdict stands at the top of both.
    assert short[0] == whole[0] or typed == ("robots",)


@pytest.mark.parametrize("typed", [("effects",), ("formats", "task"), ("effects", "payload")])
def test_a_reference_is_printed_whole(picchio, typed):
    assert picchio(*typed).stdout == picchio(*typed, "-v").stdout
    assert len(picchio(*typed).stdout.splitlines()) > 10


def test_the_verdict_comes_before_the_table(picchio):
    lines = picchio("assess", "fanuc_like_3dof").stdout.splitlines()
    assert lines[0].startswith("fanuc_like_3dof on task.toml: Safe.")
    table = next(k for k, line in enumerate(lines) if line.startswith("Life of the joints"))
    assert 0 < table < 8


def test_names_are_chosen_and_told(picchio, tmp_path):
    done = picchio("map", "fanuc_like_3dof", "--spacing", "1.0", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "fanuc_like_3dof-map.nc").exists()
    assert "wrote fanuc_like_3dof-map.nc" in done.stderr


def test_the_task_gives_the_pose_of_an_envelope(picchio):
    import json

    found = json.loads(picchio("envelope", "fanuc_like_3dof", "--json", "-").stdout)
    robot = library.load_robot("fanuc_like_3dof")
    from picchio.studies.default_task import task_of

    assert found["pose"] == task_of(robot).operations[0].poses[0].tolist()


@pytest.mark.parametrize(
    ("typed", "word", "names"),
    [
        (["assess"], "fanuc_l", {"fanuc_like_3dof"}),
        (["assess", "ur10", "--sn-curve"], "C45", {"C45-QT-shaft"}),
        (["view", "ur10", "--joint"], "wrist", {"wrist_1_joint", "wrist_2_joint", "wrist_3_joint"}),
    ],
)  # fmt: skip
def test_the_shell_completes_names(picchio, monkeypatch, typed, word, names):
    monkeypatch.setenv("_PICCHIO_COMPLETE", "complete_zsh")
    monkeypatch.setenv("_TYPER_COMPLETE_ARGS", " ".join(["picchio", *typed, word]))
    told = picchio().stdout
    assert all(name in told for name in names), told
