"""Clocks and tables of every kind end as the same series, at the rate that was written."""

import json

import numpy as np
import pandas
import pytest

from picchio.campaign.campaign import load_campaign
from picchio.campaign.importing.importer import detection, import_record, read_mapped, read_raw
from picchio.campaign.importing.mapping import read_mapping
from picchio.campaign.importing.template import write_mapping
from picchio.core.errors import InputError, PicchioWarning

ROWS = 240
STEP = 5_000_000  # ns: 200 Hz
BEGIN = 1_772_352_000_000_000_000  # 2026-03-01T08:00:00Z, ns
NS = BEGIN + STEP * np.arange(ROWS)
SIGNAL = np.round(np.random.default_rng(5).normal(size=ROWS), 5)
DAYS = BEGIN / 86400e9 + np.arange(ROWS) * (STEP / 86400e9)
MOTION = '[record]\nkind = "motion"\n'


def mapping(folder, text):
    (folder / "m.toml").write_text('format = "picchio-mapping/1"\n' + text + MOTION)
    return read_mapping(folder / "m.toml")


def channel(series, to="force"):
    return f'[[channel]]\nfrom = "{series}"\nto = "{to}"\n'


def days(form):
    return [form(pandas.Timestamp(int(ns))) for ns in NS]


CLOCKS = {  # the header, the cells of the clock, whether they say the date
    "days since 1899": ("Date", [f"{d + 25569:.10f}" for d in DAYS], True),
    "days since year 0": ("time", [f"{d + 719529:.10f}" for d in DAYS], True),
    "ticks of .NET": ("timestamp", [str(n // 100 + 621_355_968_000_000_000) for n in NS.tolist()],
                      True),
    "Windows' file time": ("time", [str(n // 100 + 116_444_736_000_000_000) for n in NS.tolist()],
                           True),
    "minutes": ("t [min]", [f"{k * 5e-3 / 60:.10f}" for k in range(ROWS)], False),
    "hours": ("Time (h)", [f"{k * 5e-3 / 3600:.12f}" for k in range(ROWS)], False),
    "milliseconds below the header": ("Zeit / ms", [str(5 * k) for k in range(ROWS)], False),
    "microseconds": ("time in µs", [str(5000 * k) for k in range(ROWS)], False),
    "seconds and nanoseconds": (
        "stamp.sec,stamp.nanosec", [f"{n // 10**9},{n % 10**9}" for n in NS.tolist()], True),
    "seconds and microseconds": (
        "sec,usec", [f"{n // 10**9},{n % 10**9 // 1000}" for n in NS.tolist()], True),
    "date and time": ("Date,Time", days(lambda t: f"{t:%d.%m.%Y},{t:%H:%M:%S.%f}"), True),
    "German date": ("Zeit", days(lambda t: f"{t:%d.%m.%Y %H:%M:%S.%f}"), True),
    "American date": ("Time", days(lambda t: f"{t:%m/%d/%Y %I:%M:%S.%f %p}"), True),
    "UTC after it": ("when", days(lambda t: f"{t:%Y-%m-%d %H:%M:%S.%f} UTC"), True),
    "past midnight": (
        "clock", [f"{pandas.Timestamp(int(n) + int(57599.5e9)):%H:%M:%S.%f}" for n in NS], False),
}  # fmt: skip


@pytest.mark.parametrize("habit", CLOCKS)
def test_the_clock_has_the_rate_at_which_it_was_written(tmp_path, habit):
    header, cells, dated = CLOCKS[habit]
    path = tmp_path / "a.csv"
    rows = [f"{c},{v}" for c, v in zip(cells, SIGNAL, strict=True)]
    path.write_text("\n".join([f"{header},F", *rows]) + "\n")
    record = read_mapped(path, mapping(tmp_path, channel("F"))).records[0]
    assert record.clock.samples == ROWS
    assert record.clock.rate == pytest.approx(200.0, rel=1e-4)
    assert (record["force"] == SIGNAL).all()
    assert (record.taken is not None) == dated
    if dated:
        assert abs(record.taken.timestamp() - BEGIN / 1e9) < 1e-3


REFUSED = {  # what is no clock, the reason, the way out
    "all the same": (["7"] * 90, "all are 7", "rate"),
    "whole seconds": ([str(k // 30) for k in range(90)], "too coarse", "rate = 30"),
    "back": ([*map(str, range(50)), *map(str, range(40))], "goes back in sample 51", "[[filter]]"),
    "no date": ([f"week {k} of 52" for k in range(90)], "'week 0 of 52' is no date", ""),
    "days or seconds": ([f"{46082 + k / 86400:.8f}" for k in range(90)],
                        "may be in days since 1899 or in s", "[time] unit"),
}  # fmt: skip


@pytest.mark.parametrize("kind", REFUSED)
def test_what_is_no_clock_is_refused_with_the_way_out(tmp_path, kind):
    cells, why, out = REFUSED[kind]
    path = tmp_path / "a.csv"
    path.write_text("time,F\n" + "".join(f"{c},{k % 7}.5\n" for k, c in enumerate(cells)))
    with pytest.raises(InputError) as caught:
        read_mapped(path, mapping(tmp_path, channel("F")))
    assert why in str(caught.value) and out in str(caught.value)
    assert any(why in line and out in line for line in detection(path).lines)
    stated = mapping(tmp_path, "[time]\nrate = 30.0\n" + channel("F"))
    assert read_mapped(path, stated).records[0].clock.rate == 30.0


def test_a_repeated_stamp_costs_one_sample(tmp_path):
    path = tmp_path / "a.csv"
    stamps = np.arange(300) / 100.0
    stamps[[50, 200]] = stamps[[49, 199]]
    pandas.DataFrame({"time": stamps, "F": np.arange(300.0)}).to_csv(path, index=False)
    found = detection(path)
    assert [one.cells for one in found.raw.left] == [2 * 2]
    assert any("2 samples" in line and "in sample 51" in line for line in found.lines)
    text = '[time]\ngaps = "bridge 20ms"\n' + channel("F")
    with pytest.warns(PicchioWarning, match="2 missing samples of 300 are bridged"):
        record = read_mapped(path, mapping(tmp_path, text)).records[0]
    assert record.clock.samples == 300
    np.testing.assert_allclose(record["force"], np.arange(300.0), atol=1e-9)
    with pytest.raises(InputError, match=r"time\.gaps.*bridge 20ms"):
        mapping(tmp_path, '[time]\ngaps = "bridge it"\n' + channel("F"))


@pytest.mark.parametrize("order", ["interleaved", "stacked", "at their own times"])
def test_a_column_that_tells_sensors_apart_divides_a_long_table(tmp_path, order):
    tables = []
    for k, who in enumerate(("a", "b", "c")):
        late = 0.0013 * k if order == "at their own times" else 0.0
        tables.append(pandas.DataFrame(
            {"time": np.arange(90) / 200.0 + late, "who": who, "F": np.arange(90.0) + 100 * k}
        ))  # fmt: skip
    table = pandas.concat(tables)
    if order != "stacked":
        table = table.sort_values("time", kind="stable")
    table.to_csv(tmp_path / "a.csv", index=False)
    table.to_parquet(tmp_path / "a.parquet", index=False)
    for name in ("a.csv", "a.parquet"):
        raw = read_raw(tmp_path / name)
        assert [c for c in raw.channels if c.startswith("F")] == ["F(a)", "F(b)", "F(c)"]
        assert raw.channels["F(b)"].values.tolist() == (np.arange(90.0) + 100).tolist()
        assert any("'who' tells 3 series apart: a, b, c" in line for line in raw.told)
        record = read_mapped(tmp_path / name, mapping(tmp_path, channel("F(b)"))).records[0]
        assert record.clock.rate == pytest.approx(200.0)


def test_a_word_of_state_divides_nothing(tmp_path):
    mode = np.where(np.arange(ROWS) // 40 % 2, "idle", "run")
    pandas.DataFrame({"time": np.arange(ROWS) / 200.0, "mode": mode, "F": SIGNAL}).to_csv(
        tmp_path / "a.csv", index=False
    )
    raw = read_raw(tmp_path / "a.csv")
    assert list(raw.channels) == ["time", "F"]
    assert any("mode" in line and "'run' in row 1: text" in line for line in raw.told)
    with pytest.raises(InputError, match=r"holds text.*run"):
        read_mapped(tmp_path / "a.csv", mapping(tmp_path, channel("mode")))


def write(path, kind):
    """The same readings in a file of this kind; what the two joints are called there."""
    both = np.column_stack([SIGNAL, -SIGNAL])
    frame = pandas.DataFrame({"F": SIGNAL}, index=pandas.to_datetime(NS))
    if kind == "parquet of lists":
        frame["q"] = list(both)
        frame["label"] = "x"
        frame.to_parquet(path)
    elif kind == "parquet of a zone":
        frame.index = frame.index.tz_localize("UTC").tz_convert("Asia/Tokyo")
        frame["q(1)"], frame["q(2)"] = both.T
        frame.to_parquet(path)
    elif kind == "npz":
        np.savez(path, F=SIGNAL, q=both, when=frame.index.to_numpy(),
                 bad=np.array([{}, None], dtype=object))  # fmt: skip
    elif kind == "npz of a rate":
        np.savez(path, F=SIGNAL, q=both.T, sample_rate=200.0)
    elif kind == "mat of a step":
        from scipy.io import savemat

        savemat(path, {"F": SIGNAL[:, None], "q": both, "Tinterval": STEP / 1e9})
    elif kind == "JSON, nested":
        path.write_text(json.dumps({"log": {"F": SIGNAL.tolist(), "q": both.tolist()}, "fs": 200}))
    elif kind == "JSON, a list":
        rows = [{"stamp": int(n), "F": v, "q": [v, -v]} for n, v in zip(NS, SIGNAL, strict=True)]
        path.write_text(json.dumps(rows))


KINDS = {
    "parquet of lists": ("a.parquet", "F", "q(2)"),
    "parquet of a zone": ("a.parquet", "F", "q(2)"),
    "npz": ("a.npz", "F", "q(2)"),
    "npz of a rate": ("a.npz", "F", "q(2)"),
    "mat of a step": ("a.mat", "F", "q(2)"),
    "JSON, nested": ("a.json", "log.F", "log.q(2)"),
    "JSON, a list": ("a.json", "F", "q[1]"),
}


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_file_ends_as_the_same_table(tmp_path, kind):
    name, force, joint = KINDS[kind]
    write(tmp_path / name, kind)
    rules = mapping(tmp_path, channel(force) + channel(joint, "position.b"))
    record = read_mapped(tmp_path / name, rules).records[0]
    assert record.clock.rate == pytest.approx(200.0, rel=1e-6)
    assert (record["force"] == SIGNAL).all() and (record["position.b"] == -SIGNAL).all()
    told = " ".join(read_raw(tmp_path / name).told)
    assert ("bad" in told) == (kind == "npz")
    assert ("label, 240 cells, the first 'x'" in told) == (kind == "parquet of lists")


def test_the_clock_may_stand_in_another_file(tmp_path):
    np.save(tmp_path / "clock.npy", np.arange(ROWS) / 200.0)
    np.save(tmp_path / "q.npy", SIGNAL)
    text = '[time]\nseries = "c:clock"\nunit = "s"\n[[join]]\nname = "c"\nfile = "clock.npy"\n'
    rules = mapping(tmp_path, text + channel("q"))
    record = read_mapped(tmp_path / "q.npy", rules).records[0]
    assert record.clock.rate == pytest.approx(200.0) and (record["force"] == SIGNAL).all()


@pytest.mark.parametrize("names", ["q({})", "actual_q_{}", "robot.q[{}]", "positions{}"])
@pytest.mark.parametrize("first", [0, 1])
def test_arrays_over_all_joints_fill_the_draft(tmp_path, names, first):
    joints = ["base", "elbow", "wrist"]
    rates = names.replace("actual_q", "dq").replace("robot.q", "tau").replace("q(", "tau(")
    series = {names.format(k + first): SIGNAL * 0.1 * (k + 1) for k in range(3)}
    series |= {f"target_{names.format(k + first)}": SIGNAL for k in range(3)}
    series |= {rates.format(k + first): SIGNAL for k in range(3)} if rates != names else {}
    pandas.DataFrame({"time": np.arange(ROWS) / 200.0, **series}).to_csv(
        tmp_path / "a.csv", index=False
    )
    known = write_mapping(tmp_path / "a.csv", tmp_path / "m.toml", joints, [])
    found = {one.series: one.to for one in known if one.to}
    expected = {names.format(k + first): f"position.{j}" for k, j in enumerate(joints)}
    what = "velocity" if "dq" in rates else "torque"
    if rates != names:
        expected |= {rates.format(k + first): f"{what}.{j}" for k, j in enumerate(joints)}
    assert found == expected
    text = (tmp_path / "m.toml").read_text()
    assert "# rate = 200.0" in text and '# resample = "linear"' in text


@pytest.mark.parametrize("way", ["arm.urdf", "./arm.urdf", "../{}/arm.urdf"])
def test_the_mapping_that_made_a_campaign_appends_to_it(tmp_path, monkeypatch, way):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.urdf").write_text('<robot name="r"><link name="a"/></robot>')
    path = tmp_path / "a.csv"
    path.write_text("time,F\n" + "".join(f"{k / 200},{v}\n" for k, v in enumerate(SIGNAL)))
    robot = way.format(tmp_path.name)
    mapping(tmp_path, channel("F") + f'[campaign]\nrobot = "{robot}"\n')
    import_record(path, "c", "m.toml")
    import_record(path, "c", "m.toml", name="b.csv", append=True)
    assert [r.file for r in load_campaign("c")] == ["a.csv", "b.csv"]
    (tmp_path / "arm2.urdf").write_text("<robot/>")
    mapping(tmp_path, channel("F") + '[campaign]\nrobot = "arm2.urdf"\n')
    with pytest.raises(InputError, match=r"robot.*the mapping says otherwise"):
        import_record(path, "c", "m.toml", name="d.csv", append=True)


def test_a_record_and_a_static_table_need_no_import(tmp_path, campaign):
    with pytest.raises(InputError, match=r"is a record of the campaign .* already"):
        import_record(campaign.folder / "r01.csv", tmp_path / "c")
    assert "already" in detection(campaign.folder / "r01.csv").lines[-1]
    (tmp_path / "m.toml").write_text(
        'format = "picchio-mapping/1"\n[record]\nkind = "static"\n' + channel("force.x [N]")
    )
    (tmp_path / "loads.csv").write_text("force.x [N]\n1\n2\n")
    with pytest.raises(InputError, match=r"kind static needs no import.*\[\[record\]\]"):
        import_record(tmp_path / "loads.csv", tmp_path / "c", tmp_path / "m.toml")


def test_packed_files_and_folders_say_what_to_do(tmp_path):
    (tmp_path / "a.mcap.zst").write_bytes(b"x")
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "bag_0.db3.zstd").write_bytes(b"x")
    (tmp_path / "empty").mkdir()
    for name, why in (("a.mcap.zst", "unpack it: zstd -d"), ("bag", "bag_0.db3.zstd"),
                      ("empty", "is a folder")):  # fmt: skip
        with pytest.raises(InputError, match=why):
            read_raw(tmp_path / name)
