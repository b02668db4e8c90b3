"""How long it takes to count a day's log, and how much memory: 500 Hz, six joints, 43 million rows.

    python benchmarks/counting.py [--hours 24] [--kind parquet|csv|mcap] [--folder FOLDER]

MCAP: sensor_msgs/JointState, the trigger as one more joint; mcap-ros2-support reads it barely.

A robot that sets a rivet every 20 s; the log holds the trigger and six angles. The bare reading of
the same file is timed beside it. Each is a process of its own, whose peak memory is told.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

ROBOT = "fanuc_r2000ic"
RATE, APART, ON = 500, 20.0, 0.46
BEGIN = 1_772_323_200_000_000_000
MAPPING = """format = "picchio-mapping/1"
[[channel]]
from = "on"
to = "trigger"
[blows]
operation = "{operation}"
"""

READ = {
    "parquet": "import pyarrow.parquet as p\nf = p.ParquetFile(sys.argv[1])\n"
    "n = sum(b.num_rows for b in f.iter_batches(131072))",
    "mcap": "from mcap_ros2.reader import read_ros2_messages\n"
    "n = sum(len(m.ros_msg.position) for m in read_ros2_messages(sys.argv[1]))",
    "csv": "import pandas\nn = sum(len(c) for c in pandas.read_csv(sys.argv[1], chunksize=131072))",
}
COUNT = """import warnings
warnings.simplefilter("ignore")
import picchio
robot = picchio.load_robot(sys.argv[4])
found = picchio.count(robot, sys.argv[1], sys.argv[2], mapping=sys.argv[3])
n = found.blows"""
# Of the process itself: ru_maxrss would be that of the one that started it, too.
TIMED = """import json, sys, time
begin, cpu = time.perf_counter(), time.process_time()
{code}
peak = next(int(x.split()[1]) for x in open("/proc/self/status") if x[:5] == "VmHWM") / 1024
print(json.dumps([n, time.perf_counter() - begin, time.process_time() - cpu, peak]))"""


def write(path: Path, hours: float, names: list[str], poses: np.ndarray) -> int:
    import pyarrow
    import pyarrow.parquet

    rows, rng = int(hours * 3600 * RATE), np.random.default_rng(0)
    writer = None
    if path.suffix == ".mcap":
        return write_mcap(path, rows, rng, names, poses)
    with open(path, "w", newline="") as text:
        for first in range(0, rows, 1 << 20):
            time = np.arange(first, min(first + (1 << 20), rows)) / RATE
            rivet = (time // APART).astype(int)
            on = ((time % APART) > 5.0) & ((time % APART) < 5.0 + ON)
            angles = poses[rivet % len(poses)]
            angles = angles + 1e-5 * rng.standard_normal(angles.shape)
            stamp = BEGIN + np.rint(time * 1e9).astype(np.int64)
            columns = {"stamp": stamp, "on": on.astype(float),
                       **dict(zip(names, angles.T, strict=True))}  # fmt: skip
            table = pyarrow.table(columns)
            if path.suffix == ".csv":
                table.to_pandas().to_csv(text, index=False, header=first == 0, float_format="%.6f")
                continue
            writer = writer or pyarrow.parquet.ParquetWriter(path, table.schema)
            writer.write_table(table, row_group_size=1 << 20)
    if writer is not None:
        writer.close()
    return rows


def write_mcap(path: Path, rows: int, rng, names: list[str], poses: np.ndarray) -> int:
    from mcap_ros2.writer import Writer

    text = "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n"
    text += "float64[] effort\n" + "=" * 80 + "\nMSG: std_msgs/Header\n"
    text += "builtin_interfaces/Time stamp\nstring frame_id\n" + "=" * 80
    text += "\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
    with open(path, "wb") as stream:
        made = Writer(stream)
        schema = made.register_msgdef("sensor_msgs/msg/JointState", text)
        for i in range(rows):
            time = i / RATE
            on = 5.0 < time % APART < 5.0 + ON
            angles = poses[int(time // APART) % len(poses)] + 1e-5 * rng.standard_normal(len(names))
            ns = BEGIN + round(time * 1e9)
            stamp = {"sec": ns // 10**9, "nanosec": ns % 10**9}
            message = {"header": {"stamp": stamp, "frame_id": ""}, "name": [*names, "on"],
                       "position": [*angles.tolist(), float(on)], "velocity": [],
                       "effort": []}  # fmt: skip
            made.write_message("/joint_states", schema, message, ns, ns)
        made.finish()
    return rows


def timed(code: str, *arguments: object) -> list[float]:
    text = TIMED.format(code=code)
    done = subprocess.run([sys.executable, "-c", text, *map(str, arguments)], check=True,
                          capture_output=True, text=True)  # fmt: skip
    return json.loads(done.stdout.splitlines()[-1])


def main() -> None:
    import picchio

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--kind", choices=("parquet", "csv", "mcap"), default="parquet")
    parser.add_argument("--folder")
    asked = parser.parse_args()
    robot = picchio.load_robot(ROBOT)
    task = picchio.load_task(robot.task_path, robot)
    names = list(robot.joint_names)
    with tempfile.TemporaryDirectory(dir=asked.folder) as place:
        folder = Path(place)
        log, rules = folder / f"day.{asked.kind}", folder / "mapping.toml"
        rows = write(log, asked.hours, names, task.operations[0].poses)
        text = MAPPING.format(operation=task.operations[0].name)
        if asked.kind == "mcap":
            text = text.replace('"on"', '"/joint_states:position.on"')
            text = text.replace('to = "trigger"', 'to = "trigger"\nunit = "1"')
        before = "/joint_states:position." if asked.kind == "mcap" else ""
        for name in names:
            text += f'[[channel]]\nfrom = "{before}{name}"\nto = "position.{name}"\n'
        rules.write_text(text)
        print(
            f"{rows} rows of {len(names)} joints, {log.stat().st_size / 1e6:.0f} MB, {asked.kind}"
        )
        # What is compiled once is not counted.
        short = folder / f"short.{asked.kind}"
        write(short, 0.02, names, task.operations[0].poses)
        timed(COUNT, short, folder / "first", rules, ROBOT)
        bare = timed(READ[asked.kind], log)
        print(f"bare reading: {bare[1]:.1f} s ({bare[2]:.1f} s of CPU), {bare[3]:.0f} MB")
        full = timed(COUNT, log, folder / "ledger", rules, ROBOT)
        print(f"counting: {full[0]:.0f} blows, {full[1]:.1f} s ({full[2]:.1f} s of CPU), "
              f"{full[3]:.0f} MB, {full[1] / bare[1]:.1f} times the bare reading")  # fmt: skip


if __name__ == "__main__":
    main()
