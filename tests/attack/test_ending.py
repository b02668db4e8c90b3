"""A command that is ended ends whole: no worker outlives it, and it says one line at most."""

import os
import signal
import sys
import time
from contextlib import suppress

import pytest
from held import alive, children

from picchio.cli.ending import Ending, Terminated, shown
from picchio.prediction.plan import Plan
from picchio.prediction.simulation import simulate

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="looks at processes in Linux's /proc"),
]


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """Enough records that a diagnosis has something to share among workers, for a while."""
    folder = tmp_path_factory.mktemp("data") / "campaign"
    blows = {"kind": "pulse_train", "force": 300.0, "period": 0.04, "width": 0.004, "hits": 10}
    plan = Plan(
        poses=[[0.3, 0.5, -0.8], [-0.4, 0.9, -1.2], [0.0, 0.2, -0.5]],
        directions=[[0.6, 0.0, 0.8], [0.0, 1.0, 0.0]], sample_rate=2000.0, quiet=0.5, length=2.0,
        excitation=blows,
        effect=[{"effect": "joint_stiffness", "target": "joint_2", "parameters": {"scale": 0.8}}],
        sensor=[{"channels": "accelerometer.tool", "noise": 0.1}],
    )  # fmt: skip
    simulate("fanuc_like_3dof", plan, folder)
    return folder


def begun(start, campaign, command):
    """A process with workers, and they."""
    process = start(*command(campaign))
    until = time.monotonic() + 60.0
    while time.monotonic() < until and process.poll() is None:
        found = children(process.pid)
        if found:
            time.sleep(0.5)  # in the midst of their work
            return process, children(process.pid) | found
        time.sleep(0.05)
    raise AssertionError(process.communicate()[1])


def gone(pids, within):
    until = time.monotonic() + within
    while time.monotonic() < until:
        if not any(map(alive, pids)):
            return True
        time.sleep(0.05)
    return False


COMMANDS = {
    "diagnose": lambda data: ("diagnose", "fanuc_like_3dof", "--data", data),
    "map": lambda data: (
        "map", "fanuc_like_3dof", "--joint-grid", "60", "--workers", "2", "--out", "m.nc",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", COMMANDS)
def test_killed(name, start, campaign):
    process, workers = begun(start, campaign, COMMANDS[name])
    process.kill()
    process.wait()
    assert gone(workers, 3.0)


@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.parametrize(
    ("number", "status", "line"),
    [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 143, "terminated")],
)
def test_asked_to_end(name, number, status, line, start, campaign):
    process, workers = begun(start, campaign, COMMANDS[name])
    asked = time.monotonic()
    os.kill(process.pid, number)
    _, err = process.communicate(timeout=30)
    assert time.monotonic() - asked < 3.0
    assert process.returncode == status
    assert err.splitlines()[-1] == f"picchio: error: {line}"
    assert len([text for text in err.splitlines() if "warning" not in text]) == 1, err
    assert gone(workers, 1.0)


def test_ctrl_c_reaches_the_workers_too(start, campaign):
    """A terminal sends it to all processes of the command at once."""
    process = start(*COMMANDS["diagnose"](campaign), start_new_session=True)
    until = time.monotonic() + 60.0
    while not (workers := children(process.pid)) and time.monotonic() < until:
        time.sleep(0.05)
    time.sleep(0.5)
    os.killpg(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=30)
    assert process.returncode == 130
    assert err.splitlines()[-1] == "picchio: error: interrupted"
    assert "Traceback" not in err
    assert gone(workers, 1.0)


def _interrupted():
    signal.raise_signal(signal.SIGINT)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_what_drops_an_interrupt_does_not_lose_it():
    class Last:
        def __del__(self):
            _interrupted()

    def library():
        with suppress(BaseException):
            _interrupted()

    before = signal.getsignal(signal.SIGINT)
    for dropped in (Last, library):
        with pytest.raises(KeyboardInterrupt), Ending().obeyed():
            dropped()
            time.sleep(5.0)
    with Ending().obeyed():
        pass
    assert signal.getsignal(signal.SIGINT) is before


def test_a_signal_that_was_dropped_leaves_no_trace(capsys):
    """Cython shows what it drops by sys.excepthook; an error is shown as ever."""
    for error in (KeyboardInterrupt(), Terminated()):
        shown(type(error), error, None)
        assert capsys.readouterr().err == ""
    shown(ValueError, ValueError("wrong"), None)
    assert "ValueError: wrong" in capsys.readouterr().err


def test_what_tidies_up_is_not_interrupted_again():
    tidy = []
    with pytest.raises(KeyboardInterrupt), Ending().obeyed():
        try:
            _interrupted()
        finally:
            with suppress(ValueError):
                raise ValueError("another, met and dealt with while tidying up")
            time.sleep(0.3)
            tidy.append(True)
    assert tidy


def test_who_takes_it_for_the_end_goes_on():
    ending, done = Ending(), []
    with ending.obeyed():
        for _ in range(2):
            try:
                _interrupted()
            except KeyboardInterrupt:
                ending.heard()
            time.sleep(0.2)
            done.append(True)
    assert len(done) == 2


def test_what_compiles_is_left_when_it_is_done():
    scope = {"__name__": "llvmlite.binding.engine", "interrupted": _interrupted, "compiled": []}
    exec("def compile():\n    interrupted()\n    compiled.append(True)", scope)
    with pytest.raises(KeyboardInterrupt), Ending().obeyed():
        scope["compile"]()
        time.sleep(5.0)
    assert scope["compiled"]
