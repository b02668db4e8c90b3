"""`picchio explore`: it serves until it is interrupted, then writes what was on the screen."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import picchio
from picchio.cli.main import run


def test_it_serves_until_ctrl_c_and_writes_the_last_state(tmp_path: Path) -> None:
    code = "import sys; from picchio.cli.main import main; main(sys.argv[1:])"
    command = [sys.executable, "-c", code, "explore", "fanuc_like_3dof", "--json", "last.json"]
    with subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stderr is not None
        said = ""
        for line in process.stderr:
            said += line
            if "Ctrl-C" in line:
                break
        found = re.search(r"http://127\.0\.0\.1:\d+/\S+/", said)
        assert found, said
        assert b"fanuc_like_3dof" in urllib.request.urlopen(found[0]).read()
        os.kill(process.pid, signal.SIGINT)
        out, _ = process.communicate(timeout=60)
    assert process.returncode == 0 and out == ""
    live = picchio.explore("fanuc_like_3dof")
    returned = live.to_dict()
    live.close()
    assert json.loads((tmp_path / "last.json").read_text()) == returned


def test_bad_input_is_one_line(tmp_path: Path, capsys) -> None:
    other = tmp_path / "model.toml"
    other.write_text("format = 'picchio-plan/1'\n")
    assert run(["explore", "fanuc_like_3dof", "--model", str(other)]) == 2
    assert "model.toml" in capsys.readouterr().err
    assert run(["explore", "fanuc_like_3dof", "--model", "ur10"]) == 2
    assert "another robot" in capsys.readouterr().err
