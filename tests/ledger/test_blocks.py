"""Logs that are read in blocks hold what they hold when they are read whole, to the bit."""

import importlib

import numpy as np
import pandas
import pytest
import shift

import picchio
from picchio.campaign.importing import importer
from picchio.campaign.importing.mapping import Mapping
from picchio.campaign.importing.readers import ros_messages
from picchio.core.errors import InputError
from picchio.ledger.samples import read_samples

NAME = "fanuc_like_3dof"
ROWS = 5000
STAMPS = shift.BEGIN + 1_000_000 * np.arange(ROWS)


@pytest.fixture(scope="module")
def robot():
    return picchio.load_robot(NAME)


def numbers():
    """A force at 1 kHz with a flag, angles at 130 Hz that begin earlier and end later."""
    rng = np.random.default_rng(4)
    flag = np.repeat(rng.integers(0, 2, ROWS // 50), 50)
    fast = pandas.DataFrame({"stamp": STAMPS, "F": rng.normal(size=ROWS),
                             "q1": rng.normal(size=ROWS), "flag": flag})  # fmt: skip
    clock = STAMPS[0] - 40_000_000 + 7_692_307 * np.arange(ROWS // 7)
    slow = pandas.DataFrame({"stamp": clock, "q2": rng.normal(size=clock.size),
                             "q3": rng.normal(size=clock.size)})  # fmt: skip
    return fast, slow


def told(path, rules, robot, size):
    """All samples of a log, and in how many stretches they came."""
    parts = list(read_samples(path, rules, robot, size))
    whole = [
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("stamps", "values", "pose_stamps", "poses")
    ]
    for name in parts[0].others:
        for k in (0, 1):
            whole.append(np.concatenate([p.others[name][k] for p in parts if name in p.others]))
    return whole, len(parts)


LINKS = {"F": "force", "q1": "position.joint_1"}
PLAIN = {"channel": [{"from": a, "to": b} for a, b in LINKS.items()]}
FLAG = {"filter": [{"series": "flag", "least": 0.5}]}
WINDOW = {"time": {"begin": 0.3, "end": 4.7}}
JOIN = {
    "channel": [
        *PLAIN["channel"], {"from": "slow:q2", "to": "position.joint_2"},
        {"from": "slow:q3", "to": "torque.joint_3"},
    ],
    "join": [{"name": "slow", "file": "{stem}-slow.{ending}", "shift": 0.0123}],
}  # fmt: skip


@pytest.mark.parametrize("ending", ["csv", "parquet"])
@pytest.mark.parametrize("asked", [PLAIN | FLAG, PLAIN | WINDOW | FLAG, JOIN, JOIN | FLAG | WINDOW])
def test_rows_and_joins_in_blocks_are_the_whole_tables(tmp_path, robot, ending, asked):
    fast, slow = numbers()
    for table, name in ((fast, "day"), (slow, "day-slow")):
        if ending == "csv":
            table.to_csv(tmp_path / f"{name}.csv", index=False)
        else:
            table.to_parquet(tmp_path / f"{name}.parquet", row_group_size=1201)
    text = Mapping.model_validate(asked).model_dump_json(by_alias=True)
    rules = Mapping.model_validate_json(text.replace("{ending}", ending))
    path = tmp_path / f"day.{ending}"
    whole, once = told(path, rules, robot, 1 << 20)
    parts, often = told(path, rules, robot, 97)
    assert often > 10 * once
    assert [a.tobytes() for a in whole] == [b.tobytes() for b in parts]
    held = np.ones(ROWS, bool) if "filter" not in asked else fast["flag"].to_numpy() > 0.5
    if "time" in asked:
        # The file begins with its first row that passes.
        since = STAMPS - STAMPS[held][0]
        held &= (since >= 300_000_000) & (since <= 4_700_000_000)
    assert (whole[0] == STAMPS[held]).all()
    assert (whole[1][:, 0] == fast["F"].to_numpy()[held]).all()
    if asked is JOIN:
        late = slow["stamp"].to_numpy() + 12_300_000
        at = np.maximum(np.searchsorted(late, STAMPS, side="right") - 1, 0)
        assert (whole[3][:, 1] == slow["q2"].to_numpy()[at]).all()


def message_log(path):
    """Topics with clocks of their own, whose messages come late; the flag only as it changes."""
    from mcap.writer import Writer
    from rosbags.typesys import Stores, get_typestore

    fast, slow = numbers()
    store = get_typestore(Stores.ROS2_HUMBLE)
    t, kind = store.types, "sensor_msgs/msg/JointState"

    def put(ns, names, values):
        stamp = t["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)
        head = t["std_msgs/msg/Header"](stamp=stamp, frame_id="")
        none = np.array([])
        return bytes(store.serialize_cdr(t[kind](head, names, np.array(values), none, none), kind))

    made = [(ns, 3_000_000, "/fast", ["F", "q1"], [f, q])
            for ns, f, q, _ in fast.itertuples(index=False)]  # fmt: skip
    made += [(ns, 41_000_000, "/slow", ["q2"], [q]) for ns, q, _ in slow.itertuples(index=False)]
    flips = np.flatnonzero(np.diff(fast["flag"], prepend=2))
    made += [(int(STAMPS[k]), 9_000_000, "/on", ["flag"], [float(fast["flag"][k])]) for k in flips]
    made.sort(key=lambda m: m[0] + m[1])
    with open(path, "wb") as stream:
        writer = Writer(stream, chunk_size=1 << 12)
        writer.start()
        text = store.generate_msgdef(kind, ros_version=2)[0].encode()
        schema = writer.register_schema(kind, "ros2msg", text)
        links = {n: writer.register_channel(n, "cdr", schema) for n in ("/fast", "/slow", "/on")}
        for ns, late, topic, names, values in made:
            writer.add_message(links[topic], ns + late, put(int(ns), names, values), ns + late)
        writer.finish()
    return fast


@pytest.mark.parametrize("filtered", [False, True])
def test_topics_in_blocks_are_the_whole_log(tmp_path, robot, filtered, monkeypatch):
    fast = message_log(tmp_path / "log.mcap")
    links = {"/fast:position.F": "force", "/fast:position.q1": "position.joint_1",
             "/slow:position.q2": "position.joint_2"}  # fmt: skip
    channels = [{"from": a, "to": b, "unit": "N" if b == "force" else "rad"}
                for a, b in links.items()]  # fmt: skip
    filters = [{"series": "/on:position.flag", "least": 0.5}] if filtered else []
    rules = Mapping.model_validate({"channel": channels, "filter": filters})

    def here(module, path, clock, names):
        return importlib.import_module(module).blocks(path, clock, names)

    monkeypatch.setattr(importer, "blocks_isolated", here)
    whole, once = told(tmp_path / "log.mcap", rules, robot, 0)
    monkeypatch.setattr(ros_messages, "AT_ONCE", 60)
    parts, often = told(tmp_path / "log.mcap", rules, robot, 0)
    assert often > 10 * once
    assert [a.tobytes() for a in whole] == [b.tobytes() for b in parts]
    held = fast["flag"].to_numpy() > (0.5 if filtered else -1.0)
    assert (whole[0] == STAMPS[held]).all()
    assert (whole[1][:, 0] == fast["F"].to_numpy()[held]).all()
    lost = rules.filter[0].model_copy(update={"series": "/off:x"}) if filtered else None
    if lost is not None:
        wrong = rules.model_copy(update={"filter": [lost]})
        with pytest.raises(InputError, match=r"no such series.*/off:x.*/on:position\.flag"):
            list(read_samples(tmp_path / "log.mcap", wrong, robot))


def test_a_rate_alone_goes_on_from_block_to_block(tmp_path, robot):
    """And a last block of one row is no log that is too short."""
    fast, _ = numbers()
    fast[["F", "q1"]][:4097].to_parquet(tmp_path / "log.parquet", row_group_size=4096)
    rules = Mapping.model_validate(
        PLAIN | {"time": {"rate": 1000.0, "start": "2026-03-01T08:00:00Z"}}
    )
    for size in (100, 4096):
        assert (told(tmp_path / "log.parquet", rules, robot, size)[0][0] == STAMPS[:4097]).all()


def test_a_line_of_units_holds_for_tables_of_nothing_but_numbers(tmp_path, robot):
    path = tmp_path / "log.csv"
    path.write_text("time,F,q1\ns,kN,deg\n" + "".join(f"{i / 1000},{i},90\n" for i in range(99)))
    rules = Mapping.model_validate(PLAIN | {"time": {"start": "2026-03-01T08:00:00Z"}})
    (_, values, _, poses), _ = told(path, rules, robot, 10)
    assert (values[:, 0] == 1000.0 * np.arange(99)).all()
    assert poses[:, 0] == pytest.approx(0.5 * np.pi)
