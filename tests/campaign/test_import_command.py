"""`picchio import` as a stranger meets it."""

import contextlib
import io
import json
import tomllib
from types import SimpleNamespace

import numpy as np
import pytest

from picchio.campaign.campaign import load_campaign
from picchio.cli.main import run

MAPPING = """format = "picchio-mapping/1"
[time]
series = "t"
unit = "ms"
[[channel]]
from = "F"
to = "force"
unit = "kN"
[record]
kind = "percussion"
pose = { joint_1 = 0.3 }
direction = [0.0, 0.0, 1.0]
[campaign]
robot = "fanuc_like_3dof"
tool = "tool"
"""


def picchio(*arguments, cwd):
    """Run in this process: what matters is the exit code and the two streams."""
    out, err = io.StringIO(), io.StringIO()
    with (
        contextlib.chdir(cwd),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        code = run([str(argument) for argument in arguments])
    return SimpleNamespace(returncode=code, stdout=out.getvalue(), stderr=err.getvalue())


@pytest.fixture
def folder(tmp_path):
    rows = "".join(f"{i},{i * 0.25}\n" for i in range(50))
    for name in ("hit1.csv", "hit2.csv"):
        (tmp_path / name).write_text("t,F\n" + rows)
    (tmp_path / "m.toml").write_text(MAPPING)
    return tmp_path


def refused(done, folder, *words, left=("hit1.csv", "hit2.csv", "m.toml")):
    assert done.returncode == 2
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1, done.stderr
    for word in words:
        assert word in done.stderr, done.stderr
    assert sorted(p.name for p in folder.iterdir()) == sorted(left)


def test_from_a_template_to_a_campaign(folder):
    done = picchio("import", "hit1.csv", "--to", "c", cwd=folder)
    refused(done, folder, "hit1.csv", "--mapping", "--write-mapping")
    done = picchio("import", "hit1.csv", "--write-mapping", "t.toml", cwd=folder)
    assert done.returncode == 0, done.stderr
    template = (folder / "t.toml").read_text()
    assert '# from = "F"' in template
    assert tomllib.loads(template)["time"]["series"] == "t"
    done = picchio("import", "hit1.csv", "--write-mapping", "t.toml", cwd=folder)
    refused(done, folder, "t.toml", "left alone", left=("hit1.csv", "hit2.csv", "m.toml", "t.toml"))

    done = picchio("import", "hit1.csv", "--mapping", "m.toml", "--to", "c", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "50 samples at 1000 Hz" in done.stdout
    campaign = load_campaign(folder / "c")
    np.testing.assert_allclose(campaign["hit1.csv"]["force"], np.arange(50) * 250.0)
    assert (folder / "c" / "mapping.toml").read_text() == MAPPING
    inputs = campaign.table.provenance["inputs"]
    assert [entry["file"] for entry in inputs] == ["hit1.csv", "m.toml"]


def test_json_and_appending(folder):
    assert (
        picchio("import", "hit1.csv", "--mapping", "m.toml", "--to", "c", cwd=folder).returncode
        == 0
    )
    again = ("import", "hit2.csv", "--mapping", "m.toml", "--to", "c")
    done = picchio(*again, cwd=folder)
    assert (done.returncode, "exists here already" in done.stderr) == (2, True)
    other = MAPPING.replace('kind = "percussion"', 'kind = "percussion"\nhits = 3')
    (folder / "m2.toml").write_text(other)
    arguments = ("import", "hit2.csv", "--mapping", "m2.toml", "--to", "c", "--append")
    done = picchio(*arguments, "--name", "second.parquet", "--json", "-", cwd=folder)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["format"] == "picchio-import/1"
    assert (found["record"], found["samples"], found["channels"]) == (
        "second.parquet",
        50,
        ["force"],
    )
    assert {entry["file"] for entry in found["provenance"]["inputs"]} == {"hit2.csv", "m2.toml"}
    campaign = load_campaign(folder / "c")
    assert [record.file for record in campaign] == ["hit1.csv", "second.parquet"]
    assert [record.hits for record in campaign] == [None, 3]
    assert (folder / "c" / "mapping.toml").read_text() == MAPPING
    assert (folder / "c" / "second.mapping.toml").read_text() == other
    assert len(campaign.table.provenance["inputs"]) == 4
    done = picchio(*arguments, "--name", "second.parquet", cwd=folder)
    assert (done.returncode, "same file" in done.stderr) == (2, True)
    (folder / "m3.toml").write_text(MAPPING.replace("fanuc_like_3dof", "ur10"))
    done = picchio(
        "import", "hit2.csv", "--mapping", "m3.toml", "--to", "c", "--append", cwd=folder
    )
    assert (done.returncode, "robot" in done.stderr, "ur10" in done.stderr) == (2, True, True)
    assert len(load_campaign(folder / "c")) == 2


def test_bad_input_leaves_nothing(folder):
    ok = ("--mapping", "m.toml", "--to", "c")
    refused(picchio("import", "none.csv", *ok, cwd=folder), folder, "none.csv", "no such file")
    refused(picchio("import", "m.toml", *ok, cwd=folder), folder, "m.toml", ".toml", ".mcap")
    refused(picchio("import", "hit1.csv", "--mapping", "m.toml", cwd=folder), folder, "--to")
    done = picchio("import", "hit1.csv", *ok, "--name", "a.txt", cwd=folder)
    refused(done, folder, "record[0].file", ".parquet")
    done = picchio("import", "hit1.csv", "--mapping", "m.toml", "--to", "no/c", cwd=folder)
    refused(done, folder, "no such folder")
    (folder / "hit1.csv").write_text("t,F\n0,a\n1,x\n2,3\n")
    refused(
        picchio("import", "hit1.csv", *ok, cwd=folder), folder, "hit1.csv", "'F'", "text", "'a'"
    )
    (folder / "hit1.csv").write_text("t,F\n0,1\n1,2\n9,3\n")
    refused(picchio("import", "hit1.csv", *ok, cwd=folder), folder, "hit1.csv", "not even")


def test_help_shows_an_example(folder):
    assert "Examples:" in picchio("import", "--help", cwd=folder).stdout
