"""The command line, called as a shell calls it but in this process."""

from __future__ import annotations

import pytest


@pytest.fixture(scope="session")
def picchio(in_process):
    """`picchio(*arguments, cwd=...)`: exit status and what went to stdout and stderr."""
    return in_process
