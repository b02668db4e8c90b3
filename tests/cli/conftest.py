"""The command line, called as a shell calls it but in this process, which is many times faster."""

from __future__ import annotations

import contextlib
import io
import warnings
from types import SimpleNamespace

import pytest

from picchio.cli.main import main


@pytest.fixture(scope="session")
def picchio():
    """`picchio(*arguments, cwd=...)`: exit code and what went to stdout and stderr."""

    def call(*arguments, cwd="."):
        out, err = io.StringIO(), io.StringIO()
        with (
            contextlib.chdir(cwd),
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err),
            warnings.catch_warnings(),
            pytest.raises(SystemExit) as ended,
        ):
            main([str(argument) for argument in arguments])
        return SimpleNamespace(
            returncode=ended.value.code, stdout=out.getvalue(), stderr=err.getvalue()
        )

    return call
