"""Pipes, devices and links: written through, never replaced; never waited for as an input."""

import json
import os
import stat
import threading

import pytest
from held import one_line

ENVELOPE = ("envelope", "fanuc_like_3dof", "--pose", "0,0.5,-0.8", "--json")


def test_stdout_by_its_name_takes_the_json_and_the_table(picchio_process):
    done = picchio_process(*ENVELOPE, "/dev/stdout")
    assert done.returncode == 0, done.stderr
    content, end = json.JSONDecoder().raw_decode(done.stdout)
    assert content["format"] == "picchio-envelope/1"
    assert "natural frequencies" in done.stdout[end:]


def test_a_redirected_stdout_keeps_both(tmp_path, start):
    with (tmp_path / "all.txt").open("w") as stream:
        process = start(*ENVELOPE, "/dev/stdout", stdout=stream)
        process.communicate(timeout=120)
    text = (tmp_path / "all.txt").read_text()
    assert process.returncode == 0
    assert json.JSONDecoder().raw_decode(text)[0]["format"] == "picchio-envelope/1"
    assert "natural frequencies" in text


def test_a_full_device_is_one_line_and_stays_a_device(picchio_process):
    one_line(picchio_process(*ENVELOPE, "/dev/full"), 1, "/dev/full", "No space left")
    assert stat.S_ISCHR(os.stat("/dev/full").st_mode)


def test_a_full_stdout_is_one_line(start):
    with open("/dev/full", "w") as full:
        process = start(*ENVELOPE, "-", stdout=full)
        _, err = process.communicate(timeout=120)
    assert process.returncode == 1
    assert err.splitlines() == ["picchio: error: stdout: No space left on device"]


def test_a_pipe_is_written_to(tmp_path, picchio_process):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    read = []
    reader = threading.Thread(target=lambda: read.append(pipe.read_text()))
    reader.start()
    done = picchio_process(*ENVELOPE, pipe)
    reader.join(timeout=10)
    assert done.returncode == 0, done.stderr
    assert json.loads(read[0])["format"] == "picchio-envelope/1"
    assert stat.S_ISFIFO(os.stat(pipe).st_mode)


def test_what_a_link_points_to_is_replaced(tmp_path, picchio_process):
    target, link = tmp_path / "real.json", tmp_path / "link.json"
    target.write_text("old")
    link.symlink_to(target)
    assert picchio_process(*ENVELOPE, link).returncode == 0
    assert link.is_symlink()
    assert json.loads(target.read_text())["format"] == "picchio-envelope/1"


@pytest.mark.parametrize("kind", ["pipe", "zero"])
@pytest.mark.parametrize(
    "command",
    [
        ("assess", "IN.urdf"),
        ("assess", "fanuc_like_3dof", "--task", "IN.toml"),
        ("assess", "fanuc_like_3dof", "--flex", "IN.toml"),
        ("assess", "fanuc_like_3dof", "--sn-curve", "IN.toml"),
        ("fit-sn", "IN.csv"),
        ("import", "IN.mat", "--write-mapping", "m.toml"),
        ("import", "IN.uff", "--write-mapping", "m.toml"),
        ("import", "IN.mcap", "--write-mapping", "m.toml"),
        ("import", "IN.csv", "--write-mapping", "m.toml"),
        ("simulate", "fanuc_like_3dof", "--plan", "IN.toml", "--to", "c"),
        ("map", "fanuc_like_3dof", "--points", "IN.csv", "--out", "m.nc"),
        ("map", "fanuc_like_3dof", "--surface", "IN.stl", "--spacing", "1", "--out", "m.nc"),
        ("view", "fanuc_like_3dof", "--map", "IN.nc", "--out", "v.html"),
        ("view", "fanuc_like_3dof", "--diagnosis", "IN.json", "--out", "v.html"),
    ],
)
def test_an_input_that_never_ends_is_refused(tmp_path, command, kind, in_process):
    file = tmp_path / next(c for c in command if c.startswith("IN"))
    if kind == "pipe":
        os.mkfifo(file)
    else:
        file.symlink_to("/dev/zero")
    one_line(in_process(*command, cwd=tmp_path), 2, file.name)


def test_a_record_that_is_a_pipe_is_refused(tmp_path, in_process):
    (tmp_path / "campaign.toml").write_text(
        'format = "picchio-campaign/1"\nrobot = "fanuc_like_3dof"\n'
        '[[record]]\nfile = "r.csv"\nkind = "motion"\n'
    )
    os.mkfifo(tmp_path / "r.csv")
    one_line(in_process("check", tmp_path), 2, "r.csv", "record[0]")
