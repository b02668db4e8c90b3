"""What all tests share: where measured data are, and that CI skips nothing for want of a tool."""

from __future__ import annotations

import contextlib
import io
import os
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

# pytest-xdist gives its workers a width of 80 columns; tests that want one set it.
os.environ.pop("COLUMNS", None)

if "PYTEST_XDIST_WORKER" in os.environ:
    # Every core has a worker of its own: threads of linear algebra would only wait for each other,
    # and what takes 10 s takes minutes.
    import scipy.linalg  # noqa: F401  # a library that is not loaded yet cannot be limited
    from threadpoolctl import threadpool_limits

    threadpool_limits(1, user_api="blas")

ROOT = Path(__file__).resolve().parent.parent
NO_DATA = "no measured data here: "
_skipped: list[str] = []


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with what takes minutes, lest one core waits for it at the end."""
    items.sort(key=lambda item: item.get_closest_marker("minutes") is None)


@pytest.fixture(scope="session")
def repository() -> Path:
    """The checkout's root."""
    return ROOT


@pytest.fixture(scope="session")
def measured_data() -> Path:
    """The folder of measured data beside the checkout, or named by PICCHIO_DATA."""
    folder = Path(os.environ.get("PICCHIO_DATA") or ROOT.parent / "shared" / "data")
    if not folder.is_dir():
        pytest.skip(f"{NO_DATA}{folder} is missing; set PICCHIO_DATA")
    return folder


@pytest.fixture(scope="session")
def in_process():
    """`in_process(*arguments, cwd=...)`: a command in this process, many times faster than as one.

    Its exit status and what went to stdout and stderr.
    """
    from picchio.cli.main import main

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
        assert "pyngrok" not in sys.modules  # it opens tunnels; meshcat brings it along
        return subprocess.CompletedProcess(
            arguments, ended.value.code, out.getvalue(), err.getvalue()
        )

    return call


@pytest.fixture(scope="session")
def worlds():
    """The independent simulators' campaigns: `worlds.campaign` of this folder."""
    sys.path.insert(0, str(ROOT / "tests"))
    try:
        from worlds import campaign
    finally:
        sys.path.pop(0)
    return campaign


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    if report.skipped and not hasattr(report, "wasxfail"):
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
        if NO_DATA not in reason:
            _skipped.append(f"{report.nodeid}: {reason}")


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    if os.environ.get("CI") and _skipped and exitstatus == 0:
        session.exitstatus = 1


def pytest_terminal_summary(terminalreporter) -> None:
    if os.environ.get("CI") and _skipped:
        terminalreporter.section("skipped in CI: a failure")
        for line in _skipped:
            terminalreporter.line(line)
