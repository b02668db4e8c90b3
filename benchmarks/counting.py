"""How long it takes to count a day's log, and how much memory: 500 Hz, six joints, 43 million rows.

    python benchmarks/counting.py [--hours 24] [--kind parquet|csv|mcap|bag|db3] [--days 1]

MCAP and bags: sensor_msgs/JointState, the trigger as one more joint. mcap-ros2-support reads the
one barely, rosbags the others; they decode one message after the other, so that `--bare` hours of
it are enough: the ratio is that of the processor time a message.

A robot that sets a rivet every 20 s; the log holds the trigger and six angles. The bare reading of
the same file is timed beside it. Each is a process of its own; what reads a log for it counts, too.
With `--days` there are so many logs, of as many days, in one folder. With `--each` they come one
after the other into one ledger, each counted by a process of its own and then deleted; at last all
of them are counted anew from the ledger. With `--ringing` it counts the blows of ringing mounts.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
from contextlib import contextmanager
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
    "bag": (
        BAGS := "from pathlib import Path\nfrom rosbags.highlevel import AnyReader\n"
        "with AnyReader([Path(sys.argv[1])]) as r:\n"
        "    n = sum(len(r.deserialize(d, c.msgtype).position) for c, _, d in r.messages())"
    ),
    "db3": BAGS,
    "csv": "import pandas\nn = sum(len(c) for c in pandas.read_csv(sys.argv[1], chunksize=131072))",
}
COUNT = """import warnings
warnings.simplefilter("ignore")
import picchio
robot = picchio.load_robot(sys.argv[4])
found = picchio.count(robot, sys.argv[1], sys.argv[2], mapping=sys.argv[3])
n = found.blows"""
# What the ledger remembers of shifts is emptied, as where the model has changed.
ANEW = 'import sqlite3\nsqlite3.connect(sys.argv[2]).executescript("DELETE FROM shift")\n' + (
    COUNT.replace("robot, sys.argv[1]", "robot, None")
)
# The memory is that of the process itself, and that of the largest of those that read for it.
TIMED = """import json, resource, sys, time
def cpu():
    return sum(sum(resource.getrusage(w)[:2]) for w in (0, -1))
begin, before = time.perf_counter(), cpu()
{code}
peak = next(int(x.split()[1]) for x in open("/proc/self/status") if x[:5] == "VmHWM") / 1024
child = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
print(json.dumps([n, time.perf_counter() - begin, cpu() - before, peak, child]))"""


def pieces(hours: float, poses: np.ndarray, day: int, rate: int):
    """Stamps ns, the trigger, the angles, a million rows at a time."""
    rows, rng = int(hours * 3600 * rate), np.random.default_rng(day)
    for first in range(0, rows, 1 << 20):
        time = np.arange(first, min(first + (1 << 20), rows)) / rate
        rivet = (time // APART).astype(int)
        on = ((time % APART) > 5.0) & ((time % APART) < 5.0 + ON)
        angles = poses[rivet % len(poses)]
        angles = angles + 1e-5 * rng.standard_normal(angles.shape)
        begin = BEGIN + day * 86_400 * 10**9
        yield begin + np.rint(time * 1e9).astype(np.int64), on.astype(float), angles


def write(
    path: Path, hours: float, names: list[str], poses: np.ndarray, day: int = 0, rate: int = RATE
) -> int:
    import pyarrow
    import pyarrow.parquet

    if path.suffix in (".mcap", ".bag", ".db3"):
        return write_messages(path, names, pieces(hours, poses, day, rate))
    rows, writer = 0, None
    with open(path, "w", newline="") as text:
        for stamp, on, angles in pieces(hours, poses, day, rate):
            columns = {"stamp": stamp, "on": on, **dict(zip(names, angles.T, strict=True))}
            table = pyarrow.table(columns)
            rows += len(stamp)
            if path.suffix == ".csv":
                first = rows == len(stamp)
                table.to_pandas().to_csv(text, index=False, header=first, float_format="%.6f")
                continue
            writer = writer or pyarrow.parquet.ParquetWriter(path, table.schema)
            writer.write_table(table, row_group_size=1 << 20)
    if writer is not None:
        writer.close()
    return rows


def write_messages(path: Path, names: list[str], made) -> int:
    """One message by rosbags; its stamp and numbers are exchanged in as many copies as are needed.

    rosbags and mcap write those, message by message: what they write is what others' logs hold.
    """
    from rosbags.typesys import Stores, get_typestore

    one = path.suffix == ".bag"
    store = get_typestore(Stores.ROS1_NOETIC if one else Stores.ROS2_HUMBLE)
    t, kind = store.types, "sensor_msgs/msg/JointState"
    stamp = t["builtin_interfaces/msg/Time"](sec=0, nanosec=0)
    head = t["std_msgs/msg/Header"](stamp=stamp, frame_id="", **({"seq": 0} if one else {}))
    marks = 1e300 + 1e290 * np.arange(len(names) + 1)
    message = t[kind](head, [*names, "on"], marks, np.array([]), np.array([]))
    raw = np.frombuffer(store.serialize_ros1(message, kind) if one
                        else store.serialize_cdr(message, kind), np.uint8)  # fmt: skip
    at, clock = raw.tobytes().index(marks.tobytes()), 4  # after the encapsulation, or seq
    with writer_of(path, store, kind) as put:
        rows = 0
        for ns, on, angles in made:
            for part in range(0, len(ns), 50_000):
                own = slice(part, part + 50_000)
                table = np.tile(raw, (len(ns[own]), 1))
                whole = np.divmod(ns[own], 10**9)
                table[:, clock : clock + 8] = np.column_stack(whole).astype("<u4").view(np.uint8)
                numbers = np.column_stack([angles[own], on[own]])
                table[:, at : at + 8 * numbers.shape[1]] = numbers.view(np.uint8)
                for when, row in zip(ns[own].tolist(), table, strict=True):
                    put(when, row.tobytes())
            rows += len(ns)
    return rows


@contextmanager
def writer_of(path: Path, store, kind: str):
    if path.suffix == ".mcap":
        from mcap.writer import Writer

        with open(path, "wb") as stream:
            made = Writer(stream)
            made.start()
            text = store.generate_msgdef(kind, ros_version=2)[0].encode()
            schema = made.register_schema(kind, "ros2msg", text)
            link = made.register_channel("/joint_states", "cdr", schema)
            yield lambda ns, data: made.add_message(link, ns, data, ns)
            made.finish()
        return
    if path.suffix == ".bag":
        from rosbags.rosbag1 import Writer as Bag

        with Bag(path) as made:
            link = made.add_connection("/joint_states", kind, typestore=store)
            yield lambda ns, data: made.write(link, ns, data)
        return
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Bag

    folder = path.with_suffix("")
    with Bag(folder, version=9, storage_plugin=StoragePlugin.SQLITE3) as made:
        link = made.add_connection("/joint_states", kind, typestore=store)
        yield lambda ns, data: made.write(link, ns, data)
    next(folder.glob("*.db3")).rename(path)
    shutil.rmtree(folder)


def timed(code: str, *arguments: object) -> list[float]:
    text = TIMED.format(code=code)
    done = subprocess.run([sys.executable, "-c", text, *map(str, arguments)], check=True,
                          capture_output=True, text=True)  # fmt: skip
    return json.loads(done.stdout.splitlines()[-1])


def one_by_one(folder: Path, days: int, make, rules: Path) -> None:
    """A log a day, as they come; then all of them once more."""
    ledger = folder / "ledger"
    for day in range(days):
        log = make(day)
        full = timed(COUNT, log.parent, ledger, rules, ROBOT)
        log.unlink()
        print(f"after {day + 1} days: {full[0]:.0f} blows, {full[1]:.1f} s ({full[2]:.1f} s of "
              f"CPU), {full[3]:.0f} MB and {full[4]:.0f} MB of the reader; the ledger "
              f"{ledger.stat().st_size / 1e6:.0f} MB", flush=True)  # fmt: skip
    full = timed(ANEW, "-", ledger, rules, ROBOT)
    print(f"{days} days counted anew: {full[0]:.0f} blows, {full[1]:.1f} s ({full[2]:.1f} s of "
          f"CPU), {full[3]:.0f} MB")  # fmt: skip


def ringing() -> None:
    """Blows of mounts that ring, counted: the logs are those of tests/ledger/test_jolts.py."""
    from itertools import product

    sys.path[:0] = [str(Path(__file__).parents[1] / "tests" / part) for part in ("", "ledger")]
    from test_jolts import PEAK, reading

    from picchio.ledger.jolts import jolts

    logs = [*product((100, 250, 500, 1000, 3000, 10_000), (0.005, 0.02, 0.1), (10, 25, 60),
                     (1000, 5000, 51_200), (True, False))]  # fmt: skip
    right = 0
    for *log, square in logs:
        time, felt, onsets, width = reading(*log, square=square)
        found = jolts(time, felt[:, None], 0.2 * PEAK, width, 1.0 / log[2])
        right += found is not None and len(found) == len(onsets)
    print(f"ringing mounts: {right} of {len(logs)} logs right")


def main() -> None:
    import picchio

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--days", type=int, default=1, help="logs of so many hours each")
    parser.add_argument("--each", action="store_true", help="one log after the other")
    parser.add_argument("--rate", type=int, default=RATE, help="samples a second")
    parser.add_argument("--bare", type=float, default=0.2, help="h of messages read barely")
    parser.add_argument("--kind", choices=tuple(READ), default="parquet")
    parser.add_argument("--folder")
    parser.add_argument("--ringing", action="store_true", help="blows of mounts that ring")
    asked = parser.parse_args()
    if asked.ringing:
        ringing()
        return
    robot = picchio.load_robot(ROBOT)
    task = picchio.load_task(robot.task_path, robot)
    names, poses = list(robot.joint_names), task.operations[0].poses
    with tempfile.TemporaryDirectory(dir=asked.folder) as place:
        folder, kind = Path(place), asked.kind
        logs, rules = folder / "logs", folder / "mapping.toml"
        logs.mkdir()
        days = [logs / f"day{k:02d}.{kind}" for k in range(asked.days)]
        text = MAPPING.format(operation=task.operations[0].name)
        messages = kind in ("mcap", "bag", "db3")
        if messages:
            text = text.replace('"on"', '"/joint_states:position.on"')
            text = text.replace('to = "trigger"', 'to = "trigger"\nunit = "1"')
        before = "/joint_states:position." if messages else ""
        for name in names:
            text += f'[[channel]]\nfrom = "{before}{name}"\nto = "position.{name}"\n'
        rules.write_text(text)

        def make(day: int) -> Path:
            write(days[day], asked.hours, names, poses, day, asked.rate)
            return days[day]

        if asked.each:
            one_by_one(folder, asked.days, make, rules)
            return
        rows = sum(
            write(day, asked.hours, names, poses, k, asked.rate) for k, day in enumerate(days)
        )
        size = sum(day.stat().st_size for day in days) / 1e6
        print(f"{rows} rows of {len(names)} joints in {len(days)} logs, {size:.0f} MB, {kind}")
        # What is compiled once is not counted.
        short = folder / f"short.{kind}"
        few = write(short, asked.bare if messages else 0.02, names, poses)
        timed(COUNT, short, folder / "first", rules, ROBOT)
        if not messages:
            few = rows // len(days)
        bare = timed(READ[kind], short if messages else days[0])
        print(f"bare reading of {few} rows: {bare[1]:.1f} s ({bare[2]:.1f} s of CPU), "
              f"{bare[3]:.0f} MB")  # fmt: skip
        full = timed(COUNT, logs, folder / "ledger", rules, ROBOT)
        ratio = full[2] / rows / (bare[2] / few)
        print(f"counting: {full[0]:.0f} blows, {full[1]:.1f} s ({full[2]:.1f} s of CPU), "
              f"{full[3]:.0f} MB and {full[4]:.0f} MB of the reader, {ratio:.2g} times the CPU of "
              "the bare reading")  # fmt: skip


if __name__ == "__main__":
    main()
