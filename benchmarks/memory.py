"""Memory and time of what is large: a check of long records, a map and a task of many poses.

    python benchmarks/memory.py [--records 10 50 200] [--samples 1000000] [--poses 5000000]
                                [--tasks 1000 10000 100000]
                                [--folder DIR] [--json FILE]

The records (three channels in Parquet, 24 MB each a million samples) are made one by one in a
temporary folder, and deleted at the end: 200 take 6 GB. `picchio check` and `picchio map` run as a
user gets them, each as a process of its own; the peak is that of its resident memory, with that
of its largest worker beside it. The peak of a check must not depend on the number of records.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from picchio.campaign.campaign import Campaign
from picchio.campaign.record import Record
from picchio.core.files import write_text

ARM = "fanuc_like_3dof"
RATE, QUIET = 25_600.0, 0.5
BLOWS = {"kind": "pulse_train", "force": 300.0, "period": 0.04, "width": 0.004, "hits": 12}
# Linux keeps the peak of a parent in what it says of a child: read the process's own.
COMMAND = """import re, resource, sys
from picchio.cli.main import run
code = run(sys.argv[1:])
own = int(re.search(r"VmHWM:\\s*(\\d+)", open("/proc/self/status").read())[1])
print("PEAK", own, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss, file=sys.stderr)
sys.exit(code)"""


def record(number: int, samples: int) -> Record:
    """Blows from the side at a pose of its own: force, two channels that ring, and noise."""
    chance = np.random.default_rng(number)
    clock = np.arange(samples) / RATE - QUIET
    noise = chance.normal(size=(3, samples))
    force, ring = 3.0 * noise[0], np.zeros(samples)
    for hit in range(12):
        since = clock - 0.04 * hit
        force[(since >= 0.0) & (since < 0.004)] += 300.0
        after = np.maximum(since, 0.0)
        ring += np.exp(-12.0 * after) * np.sin(2.0 * np.pi * 17.0 * after)
    channels = {
        "force": force,
        "accelerometer.tool.x": 20.0 * ring + 0.3 * noise[1],
        "deflection.joint_2": 1e-3 * ring + 1e-6 * noise[2],
    }
    pose = dict(zip(("joint_1", "joint_2", "joint_3"), chance.uniform(-0.8, 0.8, 3), strict=True))
    return Record.from_arrays(
        f"r{number:04d}.parquet", clock, channels, kind="percussion", pose=pose,
        direction=[1.0, 0.0, 0.0],
    )  # fmt: skip


def measured(*arguments: object) -> dict[str, Any]:
    """Seconds, and MB at most, of a command and of its largest worker."""
    began = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-P", "-c", COMMAND, *map(str, arguments)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    took = time.perf_counter() - began
    if done.returncode not in (0, 2) or "PEAK" not in done.stderr:
        raise SystemExit(f"{arguments} failed: {done.stderr}")
    own, worker = map(int, done.stderr.rpartition("PEAK ")[2].split())
    return {"seconds": took, "peak_mb": own / 1024, "worker_mb": worker / 1024}


def checks(folder: Path, counts: list[int], samples: int) -> list[dict[str, Any]]:
    """`check` of the first records, so many of them."""
    print(f"{'records':>8} {'samples':>9} {'GB':>6} {'s':>8} {'peak, MB':>9}")
    rows, entries, size = [], [], 0
    for number in range(max(counts)):
        made = record(number, samples)
        saved = Campaign.from_records(
            [made], robot=ARM, tool="tool", excitation=BLOWS
        ).save(folder / "one", overwrite=True)  # fmt: skip
        text = (folder / "one" / "campaign.toml").read_text()
        head, _, entry = text.partition("[[record]]")
        entries.append("[[record]]" + entry)
        (folder / "one" / made.file).rename(folder / made.file)
        size += (folder / made.file).stat().st_size
        del made, saved
        if number + 1 in counts:
            write_text(folder / "campaign.toml", head + "\n".join(entries))
            row = {"records": number + 1, "samples": samples, "bytes": size}
            row |= measured("check", folder, "--json", folder.parent / "check.json")
            rows.append(row)
            print(f"{number + 1:8} {samples:9} {size / 1e9:6.2f} {row['seconds']:8.1f} "
                  f"{row['peak_mb']:9.0f}", flush=True)  # fmt: skip
    return rows


def mapped(folder: Path, poses: int) -> list[dict[str, Any]]:
    """`map` of a joint grid of about so many poses, to both kinds of file."""
    side = round(poses ** (1.0 / 3.0))
    print(f"{'map':>8} {'poses':>9} {'GB':>6} {'s':>8} {'peak, MB':>9} {'worker, MB':>11}")
    rows = []
    for ending in (".nc", ".zarr"):
        out = folder / f"map{ending}"
        row = {"ending": ending, "poses": side**3}
        row |= measured("map", ARM, "--joint-grid", side, "--out", out)
        files = [out] if out.is_file() else [path for path in out.rglob("*") if path.is_file()]
        row["bytes"] = sum(path.stat().st_size for path in files)
        rows.append(row)
        print(f"{ending:>8} {side**3:9} {row['bytes'] / 1e9:6.2f} {row['seconds']:8.1f} "
              f"{row['peak_mb']:9.0f} {row['worker_mb']:11.0f}", flush=True)  # fmt: skip
    return rows


def assessed(folder: Path, counts: list[int]) -> list[dict[str, Any]]:
    """`assess` of tasks with so many poses, to JSON."""
    print(f"{'assess':>8} {'poses':>9} {'GB':>6} {'s':>8} {'peak, MB':>9}")
    rows, told = [], folder / "life.json"
    for count in counts:
        poses = np.random.default_rng(0).uniform((-1, 0.2, -1.2), (1, 1.2, -0.2), (count, 3))
        blows = 'kind = "pulse_train"\nforce = 300.0\nperiod = 0.04\nwidth = 0.004\n'
        lines = ",\n".join(map(str, poses.round(5).tolist()))
        entry = f'name = "a"\ndirection = [1.0, 0.0, 0.0]\nposes = [\n{lines}]\n'
        text = f'format = "picchio-task/1"\n[excitation]\n{blows}[[operation]]\n{entry}'
        write_text(folder / "task.toml", text)
        row = {"poses": count}
        row |= measured("assess", ARM, "--task", folder / "task.toml", "--json", told)
        row["bytes"] = told.stat().st_size
        rows.append(row)
        print(f"{'':8} {count:9} {row['bytes'] / 1e9:6.2f} {row['seconds']:8.1f} "
              f"{row['peak_mb']:9.0f}", flush=True)  # fmt: skip
    return rows


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--records", type=int, nargs="*", default=[10, 50, 200])
    parser.add_argument("--samples", type=int, default=1_000_000)
    parser.add_argument("--poses", type=int, default=5_000_000, help="0: no map")
    parser.add_argument("--tasks", type=int, nargs="*", default=[1000, 10_000, 100_000])
    parser.add_argument(
        "--folder", type=Path, help="where there is room; the system's if not given"
    )
    parser.add_argument("--json", type=Path, help="write the figures here")
    given = parser.parse_args()
    found: dict[str, Any] = {}
    with tempfile.TemporaryDirectory(dir=given.folder) as name:
        campaign = Path(name) / "campaign"
        campaign.mkdir()
        if given.records:
            found["check"] = checks(campaign, given.records, given.samples)
        if given.poses:
            found["map"] = mapped(Path(name), given.poses)
        if given.tasks:
            found["assess"] = assessed(Path(name), given.tasks)
    if given.json:
        write_text(given.json, json.dumps(found, indent=2))


if __name__ == "__main__":
    main()
