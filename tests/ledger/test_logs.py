"""Logs as they lie about: switches, names, pipes, a pose that is fixed, failures, the pace."""

import json
import os
import time

import numpy as np
import pytest

import picchio
from picchio.core.errors import InputError
from picchio.ledger.count import count

NAME, BEGIN = "fanuc_like_3dof", 1_772_352_000
POSE = {"q1": 0.3, "q2": 1.1, "q3": -1.0}
MAPPING = 'format = "picchio-mapping/1"\n[[channel]]\nfrom = "out"\nto = "trigger"\n'
ANGLES = "".join(
    f'[[channel]]\nfrom = "q{k}"\nto = "position.joint_{k}"\nunit = "rad"\n' for k in (1, 2, 3)
)
BLOWS = '[blows]\noperation = "upward"\n'


def write(folder, states, *, rate=100, angles=True, mapping=None, name="log.csv", begin=BEGIN):
    """A switch's states, one a sample, and their mapping."""
    folder.mkdir(exist_ok=True)
    columns = {"out": states} | ({k: [v] * len(states) for k, v in POSE.items()} if angles else {})
    rows = [f"stamp,{','.join(columns)}"]
    for k, row in enumerate(zip(*columns.values(), strict=True)):
        rows.append(f"{begin + k / rate:.3f},{','.join(map(str, row))}")
    with open(os.path.join(os.fsencode(folder), os.fsencode(name)), "w") as stream:
        stream.write("\n".join(rows) + "\n")
    (folder / "mapping.toml").write_text(mapping or MAPPING + ANGLES + BLOWS)
    return folder


@pytest.fixture(scope="module")
def robot():
    return picchio.load_robot(NAME)


SECOND = np.repeat([0, 0, 1, 0, 0], 100)  # on for a second: blows at 0, 0.04, ..., 0.96 s


@pytest.mark.parametrize(
    ("low", "high", "threshold"),
    [(-10.0, 10.0, 5.0), (-24.0, 24.0, None), (0.0, 5.0, 2.5), (0, 1, None)],
)
def test_a_switch_has_a_sign(tmp_path, robot, low, high, threshold):
    rules = MAPPING + ANGLES + BLOWS + (f"threshold = {threshold}\n" if threshold else "")
    folder = write(tmp_path / "logs", np.where(SECOND, high, low), mapping=rules)
    assert count(robot, folder, tmp_path / "l").blows == 25


def test_a_robot_that_never_moves_needs_no_angles(tmp_path, robot):
    rules = MAPPING + BLOWS + "pose = [0.3, 1.1, -1.0]\n"
    found = count(robot, write(tmp_path / "a", SECOND, angles=False, mapping=rules), tmp_path / "l")
    logged = count(robot, write(tmp_path / "b", SECOND), tmp_path / "k")
    assert (found.blows, found.stations()[0]["pose"].tolist()) == (25, [0.3, 1.1, -1.0])
    assert (found.counted.totals.damage == logged.counted.totals.damage).all()
    for wrong, problem in (("pose = [0.3]\n", "each joint"), ("", r"\[blows\] pose")):
        folder = write(tmp_path / "c", SECOND, angles=False, mapping=MAPPING + BLOWS + wrong)
        with pytest.raises(InputError, match=problem):
            count(robot, folder, tmp_path / "m")
        assert not list(tmp_path.glob("m*"))


def test_names_that_are_no_text_and_pipes(tmp_path, in_process):
    folder = write(tmp_path / "logs", SECOND, name=b"m\xe4rz.csv")
    os.mkfifo(folder / "pipe.csv")
    done = in_process("count", NAME, "--log", folder, "--ledger", "l", "--json", "o.json",
                      "--report", "p.html", cwd=tmp_path)  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "25 blows" in done.stdout and "pipe.csv: is a pipe" in done.stderr
    told = json.loads((tmp_path / "o.json").read_text())
    assert told["added"] == ["m\\xe4rz.csv"]
    assert [row["log"] for row in told["refused"]] == ["pipe.csv"]
    done = in_process("count", NAME, "--log", folder / "pipe.csv", "--ledger", "m", cwd=tmp_path)
    assert done.returncode == 2 and "is a pipe" in done.stderr


@pytest.mark.parametrize("content", ["", "stamp,out\n1,2\n", "nothing\n", "\x00\x01\x02"])
def test_a_count_that_fails_leaves_no_ledger_and_a_watch_goes_on(
    tmp_path, in_process, monkeypatch, content
):
    folder = write(tmp_path / "logs", SECOND)
    (folder / "log.csv").write_text(content)
    done = in_process("count", NAME, "--log", folder, "--ledger", "l", cwd=tmp_path)
    assert done.returncode == 2 and "log.csv" in done.stderr
    assert not list(tmp_path.glob("l[-_]*")) and not (tmp_path / "l").exists()
    looks = []

    def sleep(_):
        looks.append(len(looks))
        if len(looks) == 3:
            raise KeyboardInterrupt
        write(folder, SECOND[: 350 + 50 * len(looks)])

    monkeypatch.setattr(time, "sleep", sleep)
    done = in_process("count", NAME, "--log", folder, "--ledger", "l", "--watch", cwd=tmp_path)
    assert done.returncode == 130
    assert "nothing is counted yet" in done.stderr and done.stdout.count("25 blows") == 2


@pytest.mark.parametrize(
    ("hours", "asked"), [(1 / 6, None), (1 / 6, 8.0), (30.0, None), (30.0, 4.0)]
)
def test_the_pace_is_stated_or_that_of_the_calendar(tmp_path, robot, hours, asked):
    """A blow every 100 s."""
    states = np.zeros(int(hours * 360), int)
    states[1::10] = 1  # one sample in ten, 10 s apart
    folder = write(tmp_path / "logs", states, rate=0.1)
    found = count(robot, folder, tmp_path / "l", hours_per_day=asked)
    logged = (len(states) - 1) / 360.0
    assert found.blows == states.sum()
    hourly = found.blows / logged
    told = found.to_dict()
    assert told["blows_per_hour"] == pytest.approx(hourly, rel=0.01)
    daily = {(30.0, None): 24.0 * hourly}.get((hours, asked), asked and asked * hourly)
    assert told["blows_a_day"] == (None if daily is None else pytest.approx(daily, rel=0.02))
    left = {"p10": daily or 1.0, "p50": 10.0 * (daily or hourly), "p90": 1e9}
    if daily is None:
        assert found.reached(left) == "10 h of work" and found.dates(left)["p50"] is None
    else:
        assert found.dates(left)["p50"][:7] == found.reached(left) == "2026-03"
