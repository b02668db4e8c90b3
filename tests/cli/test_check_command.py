"""`picchio check`: what it prints, what it writes, and how it fails."""

import importlib.util
import json
import subprocess
import sys

import numpy as np
import pytest

from picchio.campaign.campaign import Campaign
from picchio.campaign.record import Record
from picchio.cli.main import run

PULSES = {"kind": "pulse_train", "force": 300.0, "period": 0.04, "width": 0.004, "hits": 12}
POSE = {"joint_1": 0.3, "joint_2": 0.5, "joint_3": -0.8}


def made(records=3, *, clip=None, **table):
    """Damped sines and noise."""
    rng = np.random.default_rng(0)
    time = np.arange(-100, 1900) / 1000.0
    late = np.clip(time, 0.0, None)
    found = []
    for index in range(records):
        arrays = {}
        for joint, hz in (("joint_1", 5.0), ("joint_2", 7.0)):
            x = 1e-3 * np.exp(-1.5 * late) * np.sin(2 * np.pi * hz * late)
            x += 1e-5 * rng.normal(size=time.size)
            arrays[f"deflection.{joint}"] = x if clip is None else np.clip(x, -clip, clip)
        along = np.roll([1.0, 0, 0], index).tolist()
        found.append(Record.from_arrays(f"r{index}.csv", time, arrays, pose=POSE, direction=along))
    keys = {"robot": "fanuc_like_3dof", "tool": "tool", "excitation": PULSES, **table}
    return Campaign.from_records(found, **keys)


@pytest.fixture
def folder(tmp_path):
    made().save(tmp_path / "campaign")
    return tmp_path / "campaign"


def broken(repository):
    path = repository / "tests" / "campaign" / "test_broken_campaigns.py"
    text = path.read_text().replace("from .conftest import write_good", "")
    spec = importlib.util.spec_from_loader("broken_campaigns", loader=None)
    module = importlib.util.module_from_spec(spec)
    exec(compile(text, str(path), "exec"), module.__dict__)
    return module


def conftest(repository):
    path = repository / "tests" / "campaign" / "conftest.py"
    spec = importlib.util.spec_from_file_location("campaign_conftest", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_tables_for_people(folder, capsys):
    assert run(["check", str(folder), "-v"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    words = ("3 records", "1 pose, 3 directions", "1000 Hz", "12 x 300 N / 40 ms",
             "deflection.joint_1", "Channels and their noise",
             "nothing wrong was found")  # fmt: skip
    for word in words:
        assert word in out


def test_json(folder, capsys, tmp_path):
    assert run(["check", str(folder), "--json", "-"]) == 0
    out, _ = capsys.readouterr()
    found = json.loads(out)
    assert found["format"] == "picchio-check/1"
    assert found["robot"] == "fanuc_like_3dof"
    assert [r["file"] for r in found["records"]] == ["r0.csv", "r1.csv", "r2.csv"]
    record = found["records"][0]
    assert record["rate"] == pytest.approx(1000.0)
    assert record["pose"] == POSE
    assert record["channels"]["deflection.joint_1"]["unit"] == "rad"
    noise = found["noise"]["deflection.joint_1"]
    assert noise["std"] == pytest.approx(1e-5, rel=0.1)
    assert {entry["file"] for entry in found["provenance"]["inputs"]} >= {"campaign.toml", "r0.csv"}
    target = tmp_path / "check.json"
    assert run(["check", str(folder), "--no-robot", "--json", str(target)]) == 0
    assert json.loads(target.read_text())["robot_used"] is False


def test_warnings_on_stderr_where_stdout_is_json(tmp_path, capsys):
    made(clip=5e-4).save(tmp_path / "c")
    assert run(["check", str(tmp_path / "c"), "--json", "-"]) == 0
    out, err = capsys.readouterr()
    first = json.loads(out)["findings"][0]
    assert first["check"] == "clipping"
    assert set(first) == {"check", "severity", "message", "advice", "record", "channel", "value",
                          "unit"}  # fmt: skip
    assert "reaches its limit" in err
    assert run(["check", str(tmp_path / "c")]) == 0
    assert "reaches its limit" in " ".join(capsys.readouterr().out.split())


def test_verbose_lists_every_record(tmp_path, capsys):
    made(20).save(tmp_path / "c")
    run(["check", str(tmp_path / "c"), "--no-robot"])
    assert "To know more: -v" in capsys.readouterr().out
    run(["check", str(tmp_path / "c"), "--no-robot", "--verbose"])
    assert "r19.csv" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nowhere"], ["nowhere", "no such campaign"]),
        (["{folder}", "--robot", "fanuk"], ["fanuk"]),
        (["{folder}", "--tool", "hand"], ["hand"]),
        (["{folder}", "--flex", "none.toml"], ["none.toml"]),
        (["{folder}", "--no-robot", "--robot", "ur10"], ["--no-robot"]),
        (["{folder}", "--json", "{folder}/r0.csv"], ["overwrite"]),
        (["{folder}", "--json", "no/where.json"], ["does not exist"]),
    ],
)
def test_bad_arguments(folder, capsys, arguments, words):
    before = (folder / "r0.csv").read_bytes()
    assert run(["check", *(a.format(folder=folder) for a in arguments)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert len(err.splitlines()) == 1
    for word in words:
        assert word in err
    assert (folder / "r0.csv").read_bytes() == before


def test_a_robot_that_is_not_there_is_a_finding(tmp_path, capsys):
    made(robot="no_such_robot").save(tmp_path / "c")
    assert run(["check", str(tmp_path / "c"), "--json", "-"]) == 2
    out, err = capsys.readouterr()
    first = json.loads(out)["findings"][0]
    assert first["check"] == "robot"
    assert first["severity"] == "error"
    assert "1 error found, first:" in err.splitlines()[-1]
    assert "no_such_robot" in err.splitlines()[-1]
    assert run(["check", str(tmp_path / "c"), "--robot", "fanuc_like_3dof"]) == 0


def test_records_that_cannot_be_read(folder, capsys, tmp_path):
    lines = (folder / "r1.csv").read_text().splitlines()
    lines[49] = lines[49].rpartition(",")[0] + ",nan"
    (folder / "r1.csv").write_text("\n".join(lines) + "\n")
    target = tmp_path / "out.json"
    assert run(["check", str(folder), "--json", str(target)]) == 2
    _, err = capsys.readouterr()
    assert "r1.csv" in err and "line 50" in err
    assert not target.exists()
    assert run(["check", str(folder), "--keep-going", "--json", str(target)]) == 2
    found = json.loads(target.read_text())
    assert [r["file"] for r in found["records"]] == ["r0.csv", "r2.csv"]
    assert found["findings"][0]["severity"] == "error"
    assert "line 50" in found["findings"][0]["message"]


# Readable, and wrong: they are told of, not refused.
UNEVEN = ("a lost sample", "a lost second")


@pytest.mark.slow
def test_every_broken_file(repository, tmp_path, capsys):
    """All the broken campaigns of the reader's tests: one line, exit 2, nothing else changes."""
    ways, campaign = broken(repository), conftest(repository)
    cases = [("table", name) for name in ways.TABLE]
    cases += [("samples", name) for name in ways.SAMPLES]
    cases += [("bytes", name) for name in ways.BYTES]
    assert len(cases) >= 80
    for number, (kind, name) in enumerate(cases):
        folder = campaign.write_good(tmp_path / f"c{number}")
        if kind == "table":
            old, new, words = ways.TABLE[name]
            file = folder / "campaign.toml"
            file.write_text(file.read_text().replace(old, new, 1))
        elif kind == "samples":
            edit, words = ways.SAMPLES[name]
            file = folder / "r01.csv"
            file.write_text("".join(x + "\n" for x in edit(file.read_text().splitlines())))
        else:
            change, words = ways.BYTES[name]
            file = folder / "r01.csv"
            file.write_bytes(change(file.read_bytes()))
        before = ways.fingerprint(folder)
        target = tmp_path / "out.json"
        code = run(["check", str(folder), "--json", str(target)])
        out, err = capsys.readouterr()
        assert ways.fingerprint(folder) == before, name
        if target.exists():  # a finding instead
            findings = json.loads(target.read_text())["findings"]
            worst = {f["severity"] for f in findings} - {"note"}
            assert worst and code == (2 if "error" in worst else 0), name
            if name in UNEVEN:
                assert any(f["check"] == "clock" and "not even" in f["message"] for f in findings)
            target.unlink()
            continue
        assert name not in UNEVEN
        assert code == 2, name
        assert out == "", name
        errors = [line for line in err.splitlines() if "error" in line]
        assert len(errors) == 1, (name, err)
        if name in (
            "a time that runs back",
            "a time typed wrong",
        ):  # the step before it is told of where clocks may jump
            words = ["time", "ascend"]
        assert all(word in err for word in words), (name, err)


MEMORY = """
import re, sys
from pathlib import Path
from picchio.cli.main import run
code = run(["check", sys.argv[1], "--no-robot", "--json", sys.argv[2]])
status = Path("/proc/self/status")
print(code, re.search(r"VmHWM:\\s*(\\d+)", status.read_text())[1] if status.exists() else 0)
"""


@pytest.mark.slow
def test_memory_does_not_grow_with_the_record(tmp_path):
    rng = np.random.default_rng(0)
    peak = {}
    for samples in (600_000, 2_400_000):
        time = np.arange(samples) / 8192.0
        arrays = {f"position.{j}": np.sin(time) + 1e-4 * rng.normal(size=samples) for j in "abc"}
        arrays["position.c"][samples - 5000 : samples - 4900] = 0.0  # beyond what is kept
        record = Record.from_arrays("r.parquet", time, arrays, kind="motion")
        saved = Campaign.from_records([record]).save(tmp_path / str(samples))
        target = tmp_path / f"{samples}.json"
        done = subprocess.run([sys.executable, "-c", MEMORY, str(saved.folder), str(target)],
                              capture_output=True, text=True, check=True)  # fmt: skip
        code, memory = done.stdout.split()[-2:]
        assert code == "0"
        peak[samples] = int(memory) / 1024
        found = json.loads(target.read_text())["findings"]
        assert any(f["check"] == "dropouts" and f["channel"] == "position.c" for f in found)
    print(f"MiB: {peak}")
    # The larger one holds 55 MiB more of numbers.
    assert peak[2_400_000] - peak[600_000] < 25.0
