"""Logs of any habit: what is detected and told, against files that pandas and rosbags wrote."""

import contextlib
import io
import json
import sqlite3

import numpy as np
import pandas
import pytest

from picchio.campaign.importing.importer import detection, import_record, read_mapped, read_raw
from picchio.campaign.importing.mapping import read_mapping
from picchio.campaign.importing.template import mapping_template
from picchio.cli.main import run
from picchio.core.errors import InputError, PicchioWarning

BEGIN = 1_772_352_000_000_000_000  # 2026-03-01T08:00:00Z, ns


def mapping(folder, text, name="m.toml"):
    path = folder / name
    path.write_text('format = "picchio-mapping/1"\n' + text)
    return read_mapping(path)


def channel(series, to, more=""):
    return f'[[channel]]\nfrom = "{series}"\nto = "{to}"\n{more}\n'


MOTION = '[record]\nkind = "motion"\n'


def test_the_rate_is_measured_and_not_offered(tmp_path):
    """A 2,000 Hz CSV with `Time (s)` was offered rate = 1000.0, which halved every frequency."""
    path = tmp_path / "fast.csv"
    path.write_text("Time (s),q1\n" + "".join(f"{i / 2000:.6f},{i % 7}\n" for i in range(500)))
    assert any("rate 2000 Hz, measured" in line for line in detection(path).lines)
    text = mapping_template(read_raw(path))
    assert 'series = "Time (s)"' in text and "1000" not in text.split("[record]")[0]
    found = read_mapped(path, mapping(tmp_path, channel("q1", "position.a") + MOTION)).records[0]
    assert found.clock.rate == pytest.approx(2000.0)
    stated = "[time]\nrate = 1000.0\n" + channel("q1", "position.a") + MOTION
    with pytest.warns(PicchioWarning, match=r"1000 Hz.*'Time \(s\)' tell 2000 Hz"):
        read_mapped(path, mapping(tmp_path, stated))
    path.write_text("n,q1\n" + "".join(f"{i % 5},{i % 7}\n" for i in range(500)))
    text = mapping_template(read_raw(path))
    assert "# rate = ...               # Hz: no series is named as a time" in text


def test_a_file_without_header_keeps_its_first_row(tmp_path):
    path = tmp_path / "bare.csv"
    path.write_text("".join(f"{i / 1000:.3f},{i * 2.5}\n" for i in range(50)))
    raw = read_raw(path)
    assert list(raw.channels) == ["1", "2"]
    assert raw.channels["2"].values.tolist() == [i * 2.5 for i in range(50)]
    assert "no header" in raw.detected[0]
    assert "header = false" in mapping_template(raw)


def test_one_gap_divides_a_log_and_refuses_none(tmp_path):
    time = np.arange(2000) / 1000.0
    time[1200:] += 0.0085
    path = tmp_path / "panda.csv"
    pandas.DataFrame({"time": time, "q": np.sin(time)}).to_csv(path, index=False)
    for more in ("", '[time]\nresample = "linear"\nrate = 1000.0\n'):
        text = more + channel("q", "position.a") + MOTION
        found = read_mapped(path, mapping(tmp_path, text))
        assert [(r.file, r.clock.samples) for r in found] == [
            ("panda.csv", 1200), ("panda-2.csv", 800),
        ]  # fmt: skip
        assert found["panda-2.csv"].time[0] == pytest.approx(1.2085, abs=1e-9)
    refused = '[time]\ngaps = "refuse"\n' + channel("q", "position.a") + MOTION
    with pytest.raises(InputError, match=r"missing for 0\.0095 s from 1\.199 s on"):
        read_mapped(path, mapping(tmp_path, refused))
    assert any("1 gap, the longest 0.0095 s" in line for line in detection(path).lines)


@pytest.mark.parametrize(
    ("name", "unit"), [("s", 0), ("ms", 10**6), ("us", 10**3), ("ns", 1), ("iso", 0)]
)
def test_stamps_of_every_unit(tmp_path, name, unit):
    step = 2_000_000  # ns
    ns = BEGIN + step * np.arange(300)
    if name == "iso":
        stamps = [f"{pandas.Timestamp(int(n)).isoformat(timespec='nanoseconds')}Z" for n in ns]
    elif name == "s":
        stamps = [f"{n // 10**9}.{n % 10**9:09d}" for n in ns.tolist()]
    else:
        stamps = [str(n // unit) for n in ns.tolist()]
    path = tmp_path / "log.csv"
    rows = zip(stamps, range(300), strict=True)
    path.write_text("timestamp,F\n" + "".join(f"{s},{v}\n" for s, v in rows))
    made = import_record(path, mapping=mapping_file(tmp_path, channel("F", "force") + MOTION))
    assert made.record.clock.samples == 300
    assert made.record.clock.rate == pytest.approx(500.0, rel=1e-6)
    assert made.record.taken.isoformat().startswith("2026-03-01T08:00:00")
    wanted = "ns" if name == "iso" else name
    assert any(f"unit {wanted}," in line for line in made.detected), made.detected
    assert any("begins 2026-03-01 08:00:00 UTC" in line for line in made.detected)


def mapping_file(folder, text):
    mapping(folder, text)
    return folder / "m.toml"


HABITS = {
    "german": ("Messung 7\n\nZeit;Kraft\ns;kN\n", ";", ",", ("Zeit", "Kraft")),
    "commented": ("# robot log\n# of today\ntime,F\n", ",", ".", ("time", "F")),
    "tabs": ("t_ms\tF\n", "\t", ".", ("t_ms", "F")),
    "blanks": ("", " ", ".", ("1", "2")),
    "numbered": ("time,1\n", ",", ".", ("time", "1")),
    "bars": ("time|F\n", "|", ".", ("time", "F")),
}


@pytest.mark.parametrize("habit", HABITS)
def test_tables_of_any_habit(tmp_path, habit):
    head, delimiter, decimal, names = HABITS[habit]
    values = np.round(np.random.default_rng(1).normal(size=60), 4)
    stamps = [f"{i * 0.01:.2f}" if "ms" not in head else str(i * 10) for i in range(60)]
    rows = [f"{t}{delimiter}{v}".replace(".", decimal) for t, v in zip(stamps, values, strict=True)]
    path = tmp_path / "table.txt"
    path.write_text(head + "\n".join(rows) + "\n")
    raw = read_raw(path)
    assert tuple(raw.channels) == names
    assert (raw.channels[names[1]].values == values).all()
    found = [line for line in detection(path).lines if line.startswith("rate")]
    assert found[0].startswith("rate 100 Hz")


def test_a_refusal_quotes_the_row(tmp_path):
    (tmp_path / "rows.jsonl").write_text('{"t": 0}\n{"t": 1}\nhello\n')
    with pytest.raises(InputError, match=r"rows\.jsonl.*line 3.*hello"):
        read_raw(tmp_path / "rows.jsonl")


def test_windows_filters_and_coupled_axes(tmp_path):
    rng = np.random.default_rng(4)
    axes = rng.uniform(-90, 90, (3, 400))
    table = {"time": np.arange(400) / 100.0, "A1": axes[0], "A2": axes[1], "A3": axes[2],
             "mode": (np.arange(400) // 100 % 2).astype(float)}  # fmt: skip
    pandas.DataFrame(table).to_csv(tmp_path / "log.csv", index=False)
    text = """[time]
begin = 0.5
end = 3.49
[[filter]]
series = "mode"
least = 1.0
[[coupling]]
joints = ["joint_1", "joint_3"]
from = ["A1", "A2", "A3"]
matrix = [[1, 0, 0], [0, -1, -1]]
offset = [0.0, 90.0]
unit = "deg"
"""
    text = text.replace("1, 0, 0", "1.0, 0.0, 0.0").replace("0, -1, -1", "0.0, -1.0, -1.0")
    found = read_mapped(tmp_path / "log.csv", mapping(tmp_path, text + MOTION))
    assert [(r.time[0], r.time[-1]) for r in found] == [(1.0, 1.99), (3.0, 3.49)]
    expected = np.deg2rad(90.0 - axes[1] - axes[2])[300:350]
    np.testing.assert_allclose(found["log-2.csv"]["position.joint_3"], expected, rtol=1e-12)
    with pytest.raises(InputError, match=r"coupling\[0\].*rows of 3 numbers"):
        mapping(tmp_path, text.replace("[[1.0, 0.0, 0.0], ", "["))


def test_files_are_joined_on_their_clocks(tmp_path):
    """A slow log of angles and a fast one of the force, whose clock is 20 ms ahead."""
    slow, fast = np.arange(100) / 100.0, np.arange(2000) / 2000.0
    ns = BEGIN + np.rint(slow * 1e9).astype(np.int64)
    pandas.DataFrame({"stamp": ns, "q": np.cos(slow)}).to_csv(tmp_path / "run.csv", index=False)
    iso = [pandas.Timestamp(BEGIN + int(t * 1e9) + 20_000_000).isoformat() for t in fast]
    force = np.sin(9.0 * fast)
    pandas.DataFrame({"when": fast, "F": force, "timestamp": iso}).to_csv(
        tmp_path / "run_force.csv", index=False
    )
    text = f"""[time]
resample = "linear"
rate = 2000.0
[[join]]
name = "f"
file = "{{stem}}_force.csv"
shift = -0.02
[join.time]
series = "timestamp"
{channel("q", "position.a")}{channel("f:F", "force")}"""
    record = read_mapped(tmp_path / "run.csv", mapping(tmp_path, text + MOTION)).records[0]
    np.testing.assert_allclose(record["force"], np.sin(9.0 * record.time), atol=2e-5)
    np.testing.assert_allclose(record["position.a"], np.cos(record.time), atol=2e-5)
    (tmp_path / "run_force.csv").unlink()
    with pytest.raises(InputError, match=r"run_force\.csv"):
        read_mapped(tmp_path / "run.csv", mapping(tmp_path, text + MOTION))


def test_a_position_that_can_only_be_in_degrees_is_told(tmp_path):
    time = np.arange(200) / 100.0
    pandas.DataFrame({"time": time, "q": 80.0 * np.sin(time)}).to_csv(
        tmp_path / "log.csv", index=False
    )
    with pytest.warns(PicchioWarning, match=r"position\.a spans .* is q in deg"):
        read_mapped(tmp_path / "log.csv", mapping(tmp_path, channel("q", "position.a") + MOTION))


@pytest.fixture
def signal():
    return np.random.default_rng(7).normal(size=150)


def test_parquet_npz_and_json_lines(tmp_path, signal):
    ns = BEGIN + 4_000_000 * np.arange(150)
    frame = pandas.DataFrame({"stamp": pandas.to_datetime(ns), "F": signal, "text": "x"})
    frame.to_parquet(tmp_path / "log.parquet")
    np.savez(tmp_path / "log.npz", stamp=ns, F=signal, q=np.stack([signal, 2 * signal]))
    lines = [json.dumps({"stamp": int(n), "F": f, "q": [f, 2 * f]}) for n, f in zip(ns, signal)]  # noqa: B905
    (tmp_path / "log.jsonl").write_text("\n".join(lines))
    text = channel("F", "force") + MOTION
    for name in ("log.parquet", "log.npz", "log.jsonl"):
        made = import_record(tmp_path / name, mapping=mapping_file(tmp_path, text))
        assert (made.record["force"] == signal).all(), name
        assert made.record.clock.rate == pytest.approx(250.0)
        assert made.record.taken.isoformat() == "2026-03-01T08:00:00+00:00", name
    assert "q(2)" in read_raw(tmp_path / "log.npz").channels
    assert "q[1]" in read_raw(tmp_path / "log.jsonl").channels


LVM = """LabVIEW Measurement\t
Writer_Version\t2
Reader_Version\t2
Separator\tTab
Decimal_Separator\t,
Multi_Headings\tNo
X_Columns\t{columns}
Time_Pref\tAbsolute
Date\t2026/03/01
Time\t08:00:00,0000000
***End_of_Header***\t
\t
Channels\t2\t\t
Samples\t50\t50\t
Date\t2026/03/01\t2026/03/01\t
Time\t08:00:00,0\t08:00:00,0\t
Y_Unit_Label\tN\tm/s^2\t
X_Dimension\tTime\tTime\t
X0\t0,0000000000000000E+0\t0,0000000000000000E+0\t
Delta_X\t0,000500\t0,000500\t
***End_of_Header***\t\t\t
X_Value\tForce\tAcc\tComment
"""


@pytest.mark.parametrize("columns", ["One", "No"])
def test_lvm(tmp_path, signal, columns):
    path = tmp_path / "run.lvm"
    rows = [
        (f"{i * 5e-4:.6f}" if columns == "One" else "") + f"\t{a:.17g}\t{2 * a:.17g}"
        for i, a in enumerate(signal[:50])
    ]
    path.write_text(LVM.format(columns=columns) + "\n".join(rows).replace(".", ",") + "\n")
    raw = read_raw(path)
    assert raw.channels["Force"].unit == "N"
    assert (raw.channels["Force"].values == signal[:50]).all()
    np.testing.assert_allclose(raw.channels["Acc"].time, np.arange(50) * 5e-4, rtol=1e-12)
    assert raw.epoch == BEGIN
    path.write_text(path.read_text() + "1,0\tx\t3\n")
    raw = read_raw(path)
    assert [c.values.size for c in raw.channels.values()] == [50, 51]
    assert any("Force, 'x' in line 73: no number" in line for line in raw.told)


def bag(path, signal, kind):
    """JointState, WrenchStamped and a message of nobody's own, written by rosbags itself."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    one = kind == "bag"
    store = get_typestore(Stores.ROS1_NOETIC if one else Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg("float64 pressure\nint32[2] valve\n", "shop/msg/Gun"))
    t = store.types
    gun, wrench = "shop/msg/Gun", "geometry_msgs/msg/WrenchStamped"
    joints = "sensor_msgs/msg/JointState"

    def header(ns):
        stamp = t["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)
        more = {"seq": 0} if one else {}
        return t["std_msgs/msg/Header"](stamp=stamp, frame_id="tool", **more)

    if one:
        from rosbags.rosbag1 import Writer

        writer, serialize, options = Writer(path), store.serialize_ros1, {}
    else:
        from rosbags.rosbag2 import StoragePlugin, Writer

        writer = Writer(path, version=9, storage_plugin=StoragePlugin.SQLITE3)
        serialize, options = store.serialize_cdr, {}
    vector = t["geometry_msgs/msg/Vector3"]
    with writer:
        links = {k: writer.add_connection(f"/{k.rpartition('/')[2]}", k, typestore=store, **options)
                 for k in (gun, wrench, joints)}  # fmt: skip
        for i, value in enumerate(signal):
            ns = BEGIN + 2_000_000 * i
            made = {
                gun: t[gun](pressure=value, valve=np.array([i, 2], dtype=np.int32)),
                wrench: t[wrench](header(ns), t["geometry_msgs/msg/Wrench"](
                    vector(0.0, 0.0, value), vector(0.0, 0.0, 0.0))),
                joints: t[joints](header(ns), ["a"], np.array([3 * value]), np.array([]),
                                  np.array([])),
            }  # fmt: skip
            for k, message in made.items():
                writer.write(links[k], ns + 700_000, serialize(message, k))
    return path if one else next(path.glob("*.db3"))


@pytest.mark.parametrize("kind", ["bag", "db3"])
def test_bags_of_both_ros(tmp_path, signal, kind):
    path = bag(tmp_path / ("run.bag" if kind == "bag" else "run"), signal, kind)
    raw = read_raw(path)
    assert (raw.channels["/JointState:position.a"].values == 3 * signal).all()
    assert (raw.channels["/WrenchStamped:wrench.force.z"].values == signal).all()
    assert (raw.channels["/Gun:pressure"].values == signal).all()
    assert raw.channels["/Gun:valve[0]"].values.tolist() == list(range(150))
    assert raw.channels["/JointState:position.a"].suggestion == "position.a"
    assert raw.epoch == BEGIN
    # A message without a header was logged 0.7 ms after the others' stamps.
    assert raw.channels["/Gun:pressure"].time[0] == pytest.approx(0.0007, abs=1e-12)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match="is not a readable ROS bag"):
        read_raw(path)


def test_a_db3_of_messages_that_nobody_defines(tmp_path, signal):
    path = bag(tmp_path / "run", signal[:20], "db3")
    with sqlite3.connect(path) as database:
        database.execute("DELETE FROM message_definitions")
    database.close()
    with pytest.warns(PicchioWarning, match=r"shop/msg/Gun are defined nowhere"):
        raw = read_raw(path)
    assert "/JointState:position.a" in raw.channels


def test_the_command_tells_what_it_sees(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t;F\n" + "".join(f"{i},{i % 3};{i}\n" for i in range(20)))
    out = io.StringIO()
    with contextlib.chdir(tmp_path), contextlib.redirect_stdout(out):
        assert run(["import", "log.csv"]) == 0
        assert run(["import", "log.csv", "--json", "d.json"]) == 0
    assert "columns separated by semicolon, decimal comma" in out.getvalue()
    found = json.loads((tmp_path / "d.json").read_text())
    assert found["format"] == "picchio-detection/1"
    assert [s["name"] for s in found["series"]] == ["t", "F"]


def test_several_runs_in_one_table_have_a_clock_each(tmp_path):
    path = tmp_path / "runs.csv"
    rows = [f"{run},{i / 100:.2f},{100 * run + i}\n" for run in (3, 7, 9) for i in range(40)]
    path.write_text("run,time,q1\n" + "".join(rows))
    assert (
        detection(path)
        .lines[-1]
        .startswith(
            "no clock: 'time' is named as a time, but goes back in sample 41, from 0.39 to 0; "
        )
    )
    rules = channel("q1", "position.a") + MOTION
    with pytest.raises(InputError, match=r"goes back in sample 41.*\[\[filter\]\]"):
        read_mapped(path, mapping(tmp_path, rules))
    rules += '[[filter]]\nseries = "run"\nleast = 7\nmost = 7\n'
    found = read_mapped(path, mapping(tmp_path, rules)).records[0]
    assert found["position.a"].tolist() == [700 + i for i in range(40)]


def test_uneven_steps_are_told_with_their_average(tmp_path):
    path = tmp_path / "uneven.csv"
    stamps = np.cumsum([0.01, 0.01, 0.012] * 40)
    path.write_text("time,q1\n" + "".join(f"{t:.3f},{i}\n" for i, t in enumerate(stamps)))
    average = (stamps.size - 1) / (stamps[-1] - stamps[0])
    assert f"the steps are uneven: {average:.4g} samples a second on the average" in (
        detection(path).lines
    )


def test_stamps_in_ns_are_read_digit_by_digit(tmp_path):
    path = tmp_path / "ns.csv"
    stamps = 1_772_323_200_000_000_001 + 2_000_003 * np.arange(300)
    path.write_text("stamp,on\n" + "".join(f"{s},{i % 2}\n" for i, s in enumerate(stamps)))
    found = read_raw(path).channels["stamp"].values
    assert found.dtype == np.int64 and (found == stamps).all()


def test_dates_as_text_are_the_same_in_any_habit(tmp_path):
    """Those of one habit are read at once, others one by one."""
    path, found = tmp_path / "dates.csv", []
    for form in ("{}T{}.{:03d}", "{}T{}.{:03d}Z", "{} {}.{:03d}", "{}T{}.{:03d}+00:00"):
        rows = [form.format("2026-03-01", f"08:00:{k // 100:02d}", 10 * (k % 100)) + f",{k}\n"
                for k in range(200)]  # fmt: skip
        path.write_text("time,q1\n" + "".join(rows))
        found.append(read_raw(path).channels["time"].values)
    expected = 1_772_352_000_000_000_000 + 10_000_000 * np.arange(200)
    assert all((stamps == expected).all() for stamps in found)
