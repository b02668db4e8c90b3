"""Commands as processes of their own, in a folder of their own."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

HERE = str(Path(__file__).resolve().parent)
if HERE not in sys.path:
    sys.path.insert(0, HERE)
COMMAND = [sys.executable, "-c", "from picchio.cli.main import main; main()"]


@pytest.fixture(autouse=True)
def hears_ctrl_c():
    """What ignores Ctrl-C, such as a shell's background, leaves that to its children."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def start(tmp_path):
    """`start(*arguments)`: a `picchio` process whose current folder is `tmp_path`."""
    started = []

    def begin(*arguments, **options):
        options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True} | options
        process = subprocess.Popen(
            [COMMAND[0], "-P", *COMMAND[1:], *map(str, arguments)], cwd=tmp_path, **options
        )
        started.append(process)
        return process

    yield begin
    for process in started:
        if process.poll() is None:
            process.kill()
        process.communicate()


@pytest.fixture
def picchio_process(start):
    """`picchio_process(*arguments)`: exit status, stdout and stderr of a process that has ended."""

    def call(*arguments, timeout=120, **options):
        process = start(*arguments, **options)
        out, err = process.communicate(timeout=timeout)
        return subprocess.CompletedProcess(arguments, process.returncode, out, err)

    return call
