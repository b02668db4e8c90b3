"""`picchio count` on shifts whose damage is known, however their logs are cut, mixed and broken."""

import json
import re
import sqlite3
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas
import pytest
import shift

import picchio
from picchio.campaign.importing.mapping import Mapping
from picchio.core.errors import InputError, OutputError
from picchio.core.files import sha256
from picchio.fatigue.sn.library import load_sn_curve
from picchio.ledger import blows as ledger_blows
from picchio.ledger import count as counting
from picchio.ledger import counted as counted_module
from picchio.ledger import store
from picchio.ledger.blows import Blow, bursts, covered, uncovered
from picchio.ledger.count import add_log, blows_held, count, recount
from picchio.ledger.damage import AS_LOGGED, Sum, burst_damages_of, resting
from picchio.ledger.forecast import typical
from picchio.ledger.samples import Samples, read_samples
from picchio.ledger.store import SHIFT, Ledger, Stream
from picchio.model.model import Model
from picchio.studies.rivet.life_rules import curves_of
from picchio.studies.tasks import load_task

NAME = "fanuc_like_3dof"


@pytest.fixture(scope="module")
def robot():
    return picchio.load_robot(NAME)


@pytest.fixture(scope="module")
def task(robot):
    return load_task(robot.task_path, robot)


def folder(path, made, rng, parts=1, **how):
    """A folder of logs of a shift, with mapping and curve."""
    path.mkdir(exist_ok=True)
    table = shift.log(made, rng, **how)
    for k, rows in enumerate(np.array_split(np.arange(len(table)), parts)):
        table.iloc[rows].to_parquet(path / f"part{k}.parquet")
    (path / "mapping.toml").write_text(shift.MAPPING)
    (path.parent / "curve.toml").write_text(shift.CURVE)
    return path


@pytest.mark.parametrize(("rivets", "seed"), [(3, 1), pytest.param(12, 2, marks=pytest.mark.slow)])
def test_the_damage_of_a_shift_is_known_within_two_per_cent(
    tmp_path, robot, rivets, seed, monkeypatch
):
    rng = np.random.default_rng(seed)
    made = shift.rivets(rivets, rng)
    whole, alone = shift.truth(NAME, made)
    logs = folder(tmp_path / "logs", made, rng, parts=2)
    found = count(robot, logs, tmp_path / "l", sn_curve=str(tmp_path / "curve.toml"))
    assert found.blows == 12 * rivets and found.seen_share == 1.0
    wears = whole > 1e-3 * whole.max()
    np.testing.assert_allclose(found.counted.totals.damage[wears], whole[wears], rtol=0.02)
    np.testing.assert_allclose(found.counted.totals.alone[wears], alone[wears], rtol=0.02)
    for joint in found.joints():
        low, high = joint["damage_interval"]
        assert low < joint["damage"] < high
        left = joint["blows_left"]
        assert left["p10"] < left["p50"] < left["p90"]
    read = []
    monkeypatch.setattr(counting, "sha256", lambda file: read.append(file) or sha256(file))
    again = count(robot, logs, tmp_path / "l", sn_curve=str(tmp_path / "curve.toml"))
    assert again.added == () and len(again.known) == 2
    assert read and not [file for file in read if logs in file.parents]
    (logs / "part1.parquet").rename(logs / "part2.parquet")  # the same, by what is in it
    assert count(robot, logs, tmp_path / "l", sn_curve=str(tmp_path / "curve.toml")).added == ()
    assert logs / "part2.parquet" in read
    assert (again.counted.totals.damage == found.counted.totals.damage).all()


@pytest.fixture(scope="module")
def stretch(robot, tmp_path_factory):
    """A short shift as samples, its stream, and what it adds up to as one log."""
    rng = np.random.default_rng(5)
    made = shift.rivets(3, rng, apart=1.6, places=2)
    path = folder(tmp_path_factory.mktemp("shift") / "logs", made, rng, length=6.0)
    rules = picchio.campaign.importing.mapping.read_mapping(path / "mapping.toml")
    (samples,) = read_samples(path / "part0.parquet", rules, robot)
    stream = counting.stream_of(samples, rules, load_task(robot.task_path, robot), robot)
    return samples, stream, path.parent / "curve.toml"


class Faulty:
    """A connection that fails at its n-th statement."""

    def __init__(self, base, after):
        self._base, self._left = base, after

    def __getattr__(self, name):
        return getattr(self._base, name)

    def _count(self):
        self._left -= 1
        if self._left == 0:
            raise sqlite3.OperationalError("disk I/O error")

    def execute(self, *arguments):
        if arguments[0] != "ROLLBACK":
            self._count()
        return self._base.execute(*arguments)

    def executemany(self, *arguments):
        self._count()
        return self._base.executemany(*arguments)


def cuts(samples, rng, most=6):
    """The samples in pieces, some of them twice or of very few samples, in any order."""
    ends = np.sort(rng.choice(samples.stamps, int(rng.integers(1, most)), replace=False))
    edges = [samples.stamps[0], *ends, samples.stamps[-1] + 1]
    pieces = [(a, b - 1) for a, b in zip(edges[:-1], edges[1:], strict=True) if b > a]
    for _ in range(int(rng.integers(0, 3))):  # a second copy of some time, or of all
        a, b = np.sort(rng.choice(samples.stamps, 2, replace=False))
        pieces.append((a, b))
    return [pieces[k] for k in rng.permutation(len(pieces))]


def blows_in(book, robot, task):
    """All blows that a ledger holds."""
    how = counting.streams_of(book)[0], Model.of(robot), task
    return [b for number in book.shifts() for b in blows_held(book, *how, number * SHIFT)]


@pytest.mark.parametrize("seed", range(3))
def test_cuts_order_repeats_and_faults_change_nothing(tmp_path, robot, task, stretch, seed):
    samples, stream, curve = stretch
    curves = curves_of(robot, load_sn_curve(str(curve)))
    with Ledger(tmp_path / "whole", NAME) as book:
        book.add("log", "m", "log", stream, [samples])
        expected = recount(book, Model.of(robot), curves, task)
    assert expected.blows == 36
    rng = np.random.default_rng(seed)
    for trial in range(10):
        with Ledger(tmp_path / f"cut{trial}", NAME) as book:
            for number, (a, b) in enumerate(cuts(samples, rng)):
                part = samples.between(a, b)
                sound = book._base
                book._base = Faulty(sound, int(rng.integers(1, 14)))
                try:
                    book.add(str(number), "m", "part", stream, [part])
                except OutputError as error:
                    assert "disk I/O error" in str(error)  # noqa: PT017
                book._base = sound
                book.add(str(number), "m", "part", stream, [part])
            found = recount(book, Model.of(robot), curves, task)
        np.testing.assert_allclose(found.totals.damage, expected.totals.damage, rtol=1e-9, atol=0.0)
        assert found.blows == expected.blows
        assert (found.spans == expected.spans).all()
        assert found.cut == 0


@pytest.mark.parametrize("seed", range(2))
def test_the_parts_in_which_a_ledger_is_read_change_nothing(
    tmp_path, robot, task, stretch, seed, monkeypatch
):
    """In parts of a few samples, blows and bursts; all at once, by sorting, it is the same."""
    samples, stream, curve = stretch
    curves = curves_of(robot, load_sn_curve(str(curve)))
    rng = np.random.default_rng(seed)
    stamps = np.arange(samples.stamps[0] - 10**10, samples.stamps[-1] + 10**10, 2_000_000)
    on = (stamps // 10**9 % 2 == 1).astype(float)[:, None]
    poses = shift.POSES[stamps // (2 * 10**9) % 3] + 1e-9 * np.arange(stamps.size)[:, None]
    slow = Stream("poses", 10_000_000, 1, 0.5, 0.5, {"operation": "upward"})
    with Ledger(tmp_path / "l", NAME) as book:
        for number, (a, b) in enumerate(cuts(samples, rng)):
            book.add(str(number), "m", "part", stream, [samples.between(a, b)])
        for begin in range(0, stamps.size, 3250):  # of 8.5 s, one every 6.5 s
            rows = np.arange(begin, min(begin + 4250, stamps.size))
            few = rows[::700]  # poses come seldom: that of a run may be of another part
            part = Samples("poses", stamps[rows], on[rows], stamps[few], poses[few])
            book.add(f"slow{rows[0]}", "m", "slow", slow, [part])
        whole, blows = recount(book, Model.of(robot), curves, task), blows_in(book, robot, task)
        book._base.execute("DELETE FROM shift")
        for module, name, few in ((store, "_HELD", 50), (ledger_blows, "_AT_ONCE", 3),
                                  (counting, "_AT_ONCE", 2)):  # fmt: skip
            monkeypatch.setattr(module, name, few)
        again, parts = recount(book, Model.of(robot), curves, task), blows_in(book, robot, task)
    assert whole.seen == 36 < whole.blows
    told = [[(b.onset, b.kind, b.cut, b.force.tobytes(), b.pose.tobytes()) for b in each]
            for each in (blows, parts)]  # fmt: skip
    assert told[0] == told[1] == sorted(told[0], key=lambda b: b[0])
    np.testing.assert_allclose(again.totals.scaled, whole.totals.scaled, rtol=1e-12, atol=0.0)
    np.testing.assert_allclose(again.hours[1], whole.hours[1], rtol=1e-12, atol=0.0)
    assert again.kinds == whole.kinds


def test_what_is_held_of_bursts_is_bounded(robot, stretch, tmp_path, task, monkeypatch):
    """Ten times as many bursts at as many places take no more room; the sums are all of them."""
    samples, stream, curve = stretch
    curves = curves_of(robot, load_sn_curve(str(curve)))
    monkeypatch.setattr(counted_module, "_STRETCHES", 8)
    monkeypatch.setattr(counted_module, "_PLACES", 10)
    with Ledger(tmp_path / "l", NAME) as book:
        book.add("log", "m", "log", stream, [samples])
        blows = blows_in(book, robot, task)
    model, rng, found = Model.of(robot), np.random.default_rng(1), counted_module.Counted(curves)
    shifts = [counted_module.Counted(curves) for _ in range(11)]
    first = next(bursts(blows, resting(model)))
    (made,) = burst_damages_of(model, curves, [first])
    alone, heavy = made.alone[:, AS_LOGGED], 70
    for k in range(101):
        later = replace(first.blows[0], onset=first.onset + k * 6 * 10**11)
        burst = replace(first, blows=(later,), pose=first.pose + 0.1 * rng.integers(0, 9, 3))
        times = 1000.0 if k == heavy else 1.0
        shifts[k // 10].add([burst], [replace(made, alone=times * made.alone)])
    for each in shifts:
        assert len(each.stretches) <= 8
        found.merge(json.loads(json.dumps(each.told)))
    found.close(np.empty((0, 2), np.int64))
    # None stands for much more than the others.
    assert max(s.bursts for s in found.stretches) <= 2 * found._each
    assert found.blows == found.bursts == 101 and len(found.stretches) <= 8
    sums = [sum(s.damage for s in found.stretches), found.hours[1][:, 2:].sum(axis=0)]
    np.testing.assert_allclose(sums[0], 1100.0 * alone, rtol=1e-12)
    np.testing.assert_allclose(sums[1], found.totals.damage, rtol=1e-12)
    assert len(found.places) <= 10 and found.places[0].damage.max() > 0.9 * sums[1].max()
    (told,) = (n for n in counting._notes(found, None, model) if "too many to tell apart" in n)
    assert told.startswith(f"{found.forgotten} places ") and found.forgotten > 0
    # The one that did nearly all of it stands for its stretch.
    onsets = {each.onset for each in typical(found.stretches)}
    assert onsets == {first.onset + heavy * 6 * 10**11}


def test_only_the_shifts_that_a_log_touches_are_counted(
    tmp_path, robot, task, stretch, monkeypatch
):
    """Days on end, one log after the other: each costs the same; in any order, the same."""
    samples, stream, curve = stretch
    curves = curves_of(robot, load_sn_curve(str(curve)))
    middle = int(np.median([b.onset for b in _blows([samples], stream, tmp_path, robot, task)]))
    logs = []
    for k in range(8):  # each across the end of a shift
        late = (middle // SHIFT + 1 + k) * SHIFT - middle
        logs.append(replace(samples, stamps=samples.stamps + late,
                            pose_stamps=samples.pose_stamps + late))  # fmt: skip
    made = []
    real = counting.burst_damages_of

    def watched(model, curves, bursts):
        made.extend(bursts)
        return real(model, curves, bursts)

    monkeypatch.setattr(counting, "burst_damages_of", watched)
    totals, each = [], []
    for name, order in (("by time", range(8)), ("any", (3, 0, 6, 1, 7, 2, 5, 4))):
        with Ledger(tmp_path / name, NAME) as book:
            for k in order:
                book.add(f"{k}", "m", "log", stream, [logs[k]])
                made.clear()
                found = recount(book, Model.of(robot), curves, task)
                each.append(len(made))
            made.clear()
            again = recount(book, Model.of(robot), curves, task)
            assert not made and (again.totals.scaled == found.totals.scaled).all()
            assert found.blows == 8 * 36 and len(found.hours[0]) == 16
            totals.append(found.totals.scaled)
            book._base.execute("DELETE FROM shift")
            anew = recount(book, Model.of(robot), curves, task).totals.scaled
            assert (anew == found.totals.scaled).all()
    # By time: its own bursts and those of its first shift's log before it.
    assert each[0] > 0 and max(each[:8]) <= 2 * each[0]
    assert (totals[0] == totals[1]).all()


def test_a_sum_of_what_another_process_changed_meanwhile_is_not_kept(tmp_path, stretch):
    samples, stream, _ = stretch
    number = int(samples.stamps[0] // SHIFT)
    with Ledger(tmp_path / "l", NAME) as mine, Ledger(tmp_path / "l", NAME) as other:
        before = mine.shifts()
        other.add("log", "m", "log", stream, [samples])
        mine.tell(number, "key", "{}")
        assert mine.told(number, "key") is None
        assert number in mine.shifts() and number not in before
        mine.tell(number, "key", "{}")
        assert other.told(number, "key") == "{}" and other.told(number, "other") is None


def _blows(parts, stream, folder, robot, task):
    with Ledger(folder / "blows", NAME) as book:
        book.add("log", "m", "log", stream, parts)
        return blows_in(book, robot, task)


def test_a_tool_that_works_for_hours_is_where_the_robot_stood_when_it_began(tmp_path, robot, task):
    """The angles come only as they change, the log in stretches, over the end of a shift."""
    stamps = shift.BEGIN - 5000 * 10**9 + 10**9 * np.arange(12000)
    on = ((stamps > stamps[100]) & (stamps < stamps[11000])).astype(float)[:, None]
    stream = Stream("trigger", 5 * 10**9, 1, 0.5, 0.5, {"operation": "upward"})
    parts = []
    for k in range(0, 12000, 3000):
        known = slice(k, k + (k == 0))
        own = slice(k, k + 3000)
        parts.append(Samples("trigger", stamps[own], on[own], stamps[known],
                             shift.POSES[[1] * (k == 0)]))  # fmt: skip
    blows = _blows(parts, stream, tmp_path, robot, task)
    period = task.operations[2].excitation.period
    assert len(blows) == pytest.approx(10898 / period, abs=2)
    assert all((blow.pose == shift.POSES[1]).all() for blow in blows)
    gaps = np.diff([blow.onset for blow in blows]) * 1e-9
    assert (np.abs(gaps - period) < 1e-6).sum() >= gaps.size - 1


def test_a_blow_on_the_edge_waits_for_its_other_half(tmp_path, robot, task, stretch):
    samples, stream, curve = stretch
    curves = curves_of(robot, load_sn_curve(str(curve)))
    with Ledger(tmp_path / "l", NAME) as book:
        book.add("all", "m", "all", stream, [samples])
        whole = recount(book, Model.of(robot), curves, task)
        middle = blows_in(book, robot, task)[20]
        cut = middle.onset + int(0.4e9 * middle.time[-1])
    with Ledger(tmp_path / "m", NAME) as book:
        book.add("late", "m", "late", stream, [samples.between(cut + 1, 2**62)])
        half = blows_in(book, robot, task)
        assert half[0].cut and len(half) == 16
        book.add("early", "m", "early", stream, [samples.between(0, cut)])
        found, again = recount(book, Model.of(robot), curves, task), blows_in(book, robot, task)[20]
    assert again.onset == middle.onset
    assert (again.force == middle.force).all()
    assert (found.totals.damage == whole.totals.damage).all()


def test_a_changed_model_recounts_and_a_changed_mapping_replaces(tmp_path, robot, stretch):
    logs = stretch[2].parent / "logs"
    curve = str(stretch[2])
    first = count(robot, logs, tmp_path / "l", sn_curve=curve)
    steeper = tmp_path / "weak.toml"
    steeper.write_text(shift.CURVE.replace(f"{shift.STRENGTH}", f"{0.5 * shift.STRENGTH}"))
    weak = count(robot, None, tmp_path / "l", sn_curve=str(steeper))
    np.testing.assert_allclose(
        weak.counted.totals.damage, 2.0**shift.SLOPE * first.counted.totals.damage, rtol=1e-9
    )
    steeper.write_text(shift.CURVE.replace(f"{shift.STRENGTH}", f"{0.02 * shift.STRENGTH}"))
    gone = count(robot, None, tmp_path / "l", sn_curve=str(steeper))
    assert any("joint_2 is whole in 0 % of the drawn worlds" in note for note in gone.notes)
    assert not any("drawn worlds" in note for note in first.notes)
    scaled = tmp_path / "m.toml"
    scaled.write_text(shift.MAPPING.replace('to = "force.', 'scale = 0.5\nto = "force.'))
    half = count(robot, logs, tmp_path / "l", mapping=scaled, sn_curve=curve)
    assert half.logs == 1 and half.added == ("part0.parquet",) and half.blows == 36
    ratio = half.counted.totals.damage / first.counted.totals.damage
    np.testing.assert_allclose(ratio, 0.5**shift.SLOPE, rtol=0.02)


def test_who_the_ledger_belongs_to(tmp_path, robot, stretch):
    logs = stretch[2].parent / "logs"
    count(robot, logs, tmp_path / "l")
    with pytest.raises(InputError, match=r"ledger of another robot.*fanuc_like_3dof"):
        Ledger(tmp_path / "l", "ur10")
    (tmp_path / "text").write_text("hello " * 400)
    with pytest.raises(InputError, match="no ledger"):
        Ledger(tmp_path / "text", NAME)
    with pytest.raises(InputError, match="does not exist"):
        Ledger(tmp_path / "no" / "l", NAME)


def test_what_a_log_must_say(tmp_path, robot, task):
    path = tmp_path / "log.csv"
    path.write_text("t,F,q1\n" + "".join(f"{i / 1000},{i},0.1\n" for i in range(50)))
    text = '{"channel": [{"from": "F", "to": "force"}, {"from": "q1", "to": "position.joint_1"}]}'
    rules = Mapping.model_validate(json.loads(text))
    with Ledger(tmp_path / "l", NAME) as book:
        with pytest.raises(InputError, match=r"log\.csv.*time\.start.*when this log was recorded"):
            add_log(book, path, rules, Model.of(robot), task)
        later = rules.model_copy(
            update={"time": rules.time.model_validate({"start": "2026-03-01T08:00:00Z"})}
        )
        with pytest.raises(InputError, match=r"log\.csv.*blows\.operation.*forward"):
            add_log(book, path, later, Model.of(robot), task)
        wrong = text.replace("joint_1", "elbow")
        with pytest.raises(InputError, match=r"no such joint.*elbow.*joint_1"):
            add_log(book, path, Mapping.model_validate(json.loads(wrong)), Model.of(robot), task)
        assert book.logs() == []


def test_one_bad_log_of_many_is_told_and_no_other_lost(tmp_path, robot, stretch):
    rng = np.random.default_rng(8)
    logs = folder(tmp_path / "logs", shift.rivets(1, rng), rng)
    (logs / "bad.csv").write_text("stamp,fx\n1,2\n")
    with pytest.warns(picchio.PicchioWarning, match=r"not counted.*bad\.csv"):
        found = count(robot, logs, tmp_path / "l")
    assert found.blows == 12
    assert [name for name, _ in found.refused] == ["bad.csv"]
    assert found.to_dict()["refused"][0]["log"] == "bad.csv"


def test_a_moment_counts_once_whoever_saw_it(tmp_path, robot, task, stretch):
    """A trigger of the controller's beside the force: where both are there, the force counts."""
    samples, stream, curve = stretch
    curves = curves_of(robot, load_sn_curve(str(curve)))
    step = 10_000_000
    stamps = np.arange(samples.stamps[0], samples.stamps[-1] + 4_000_000_000, step)
    on = ((stamps - samples.stamps[0]) // 1_000_000_000 % 2 == 1).astype(float)[:, None]
    pose = np.tile(shift.POSES[0], (stamps.size, 1))
    trigger = Samples("trigger", stamps, on, stamps, pose)
    slow = Stream("trigger", trigger.gap, 1, 0.5, 0.5, {"operation": "upward"})
    with Ledger(tmp_path / "l", NAME) as book:
        book.add("slow", "m", "slow", slow, [trigger])
        assumed = recount(book, Model.of(robot), curves, task)
        assert (assumed.blows, assumed.seen) == (5 * 25, 0)
        book.add("fast", "m", "fast", stream, [samples])
        both, blows = recount(book, Model.of(robot), curves, task), blows_in(book, robot, task)
    assert both.seen == 36
    later = [b for b in blows if b.onset > samples.stamps[-1]]
    assert both.blows == 36 + len(later) and later and not any(b.seen for b in later)


class Square(shift.Rivet):
    """Rectangular blows, as the task has them."""

    def force(self, time):
        since = (time - self.begin)[:, None] - self.times
        return self.peaks[0] * ((since > 0.0) & (since < self.widths)).any(axis=1)


def test_accelerations_tell_the_size_of_a_blow(tmp_path, robot, task):
    """A simulated arm, whose springs pull while a blow lasts: not for the blow's fault."""
    blows = Square(0.5, 0, 0.04 * np.arange(12), np.full(12, 800.0), np.full(12, 0.004))
    reading = shift.felt(NAME, [blows], 2.0)
    time, mobility = 1e-4 * np.arange(len(reading)), np.abs(reading).max() / 800.0
    stamps = shift.BEGIN + np.rint(time * 1e9).astype(np.int64)
    reading = reading + 0.05 * np.random.default_rng(1).normal(size=reading.shape)
    samples = Samples("acceleration", stamps, reading, stamps[::50],
                      np.tile(shift.POSES[0], (time[::50].size, 1)))  # fmt: skip
    sensor = [f"acceleration.tool.{axis}" for axis in "xyz"]
    stream = Stream("acceleration", samples.gap, 3, 0.3 * mobility * 800.0,
                    0.1 * mobility * 800.0, {"sensor": sensor, "hold": 80_000_000})  # fmt: skip
    with Ledger(tmp_path / "l", NAME) as book:
        book.add("a", "m", "a", stream, [samples])
        peaks = np.array([blow.peak for blow in blows_in(book, robot, task)])
    assert len(peaks) == 12
    assert peaks.mean() == pytest.approx(800.0, rel=0.01)
    assert peaks == pytest.approx([800.0] * 12, rel=0.05)


def test_poses_alone_stand_for_rivets(tmp_path, robot, task):
    pose = task.operations[2].poses[4]
    stamps = shift.BEGIN + 4_000_000 * np.arange(1500)
    poses = np.tile(pose, (1500, 1))
    poses[500:1000] += 0.3  # away for two seconds
    poses[1200:1230] += 0.3  # 0.8 and 1.08 s at the pose before and after
    samples = counting.standing(
        Samples("poses", np.empty(0, np.int64), np.empty((0, 1)), stamps, poses), task
    )
    stream = Stream("poses", samples.gap, 1, 0.5, 0.5, {"operation": "upward"})
    with Ledger(tmp_path / "l", NAME) as book:
        book.add("a", "m", "a", stream, [samples])
        found = recount(book, Model.of(robot), curves_of(robot), task)
    assert dict(found.kinds) == {"poses": 3 * task.operations[2].hits_per_rivet}


def test_intervals_of_time():
    rng = np.random.default_rng(2)
    spans = rng.integers(0, 10_000, (200, 1)) + np.sort(rng.integers(0, 60, (200, 2)), axis=1)
    marked = np.zeros(10_100, bool)
    for a, b in spans:
        marked[a : b + 1] = True
    found = covered(spans, 1)
    assert sum(b - a + 1 for a, b in found) == marked.sum()
    when = np.arange(10_100)
    nothing = np.empty(0)
    blows = [Blow(int(t), "force", nothing, nothing, nothing, nothing) for t in when]
    assert [blow.onset for blow in uncovered(blows, found)] == when[~marked].tolist()
    assert list(uncovered(blows, found[:0])) == blows


def test_residues_counted_together_are_the_whole_history():
    """Against the whole history by the `rainflow` package."""
    from picchio.fatigue.sn.curve import SNCurve
    from picchio.ledger.damage import SCALES, BurstDamage

    curve = SNCurve(name="c", strength=shift.STRENGTH, cycles=shift.CYCLES, slopes=(shift.SLOPE,))
    rng = np.random.default_rng(3)
    from picchio.fatigue.counting.counter import RainflowCounter
    from picchio.fatigue.miner import damage

    made, histories = [], []
    for _ in range(20):
        history = 1e8 * rng.normal(size=300) * np.exp(-np.linspace(0, 3, 300))
        history[[0, -1]] = 0.0
        histories.append(history)
        counter = RainflowCounter()
        counter.add(history)
        closed = [[damage(counter.cycles("discarded").scaled(s), curve) for s in SCALES]]
        half = [[damage(counter.cycles("half-cycles").scaled(s), curve) for s in SCALES]]
        made.append(BurstDamage(np.array(closed), np.array(half), (counter.residue,)))
    added = Sum([curve])
    for part in (made[:7], made[7:8], made[8:]):
        own = Sum([curve])
        own.add(part)
        added.add([own.burst])  # many as one
    totals = added.totals
    assert totals.damage[0] == pytest.approx(shift.cost(np.concatenate(histories)), rel=1e-12)
    assert totals.alone[0] == pytest.approx(sum(map(shift.cost, histories)), rel=1e-12)
    scaled = totals.at(np.array([1.0, 1.3, 2.0, 4.0]))[0]
    assert scaled / scaled[0] == pytest.approx(np.array([1.0, 1.3, 2.0, 4.0]) ** 8.0, rel=1e-9)


@pytest.mark.slow
def test_many_robots_are_a_loop(tmp_path, robot):
    """The example of the page on counting, in processes of a cluster of its own."""
    rng = np.random.default_rng(12)
    (tmp_path / "cells").mkdir()
    for name, force in (("north", 1500.0), ("south", 2500.0)):
        folder(tmp_path / "cells" / name, shift.rivets(1, rng, force=force), rng)
    (tmp_path / "cells" / "broken").mkdir()
    (tmp_path / "cells" / "broken" / "log.csv").write_text("nothing\n")
    (tmp_path / "cells" / "mapping.toml").write_text(shift.MAPPING)
    (tmp_path / "curve.toml").write_text(shift.CURVE)
    code = next(code for code in examples() if code.startswith("# cells.py"))
    (tmp_path / "cells.py").write_text(code.replace("SN_CURVE = None", 'SN_CURVE = "curve.toml"'))
    subprocess.run([sys.executable, "cells.py"], cwd=tmp_path, check=True, timeout=300)
    found = pandas.read_csv(tmp_path / "cells.csv", index_col="robot")
    assert list(found.index) == ["south", "north", "broken"]
    assert found.damage["south"] > 20.0 * found.damage["north"] > 0.0
    assert "log.csv" in found.problem["broken"]
    curve = str(tmp_path / "curve.toml")
    alone = count(robot, tmp_path / "cells/south", tmp_path / "l", sn_curve=curve)
    assert found.damage["south"] == pytest.approx(max(alone.counted.totals.damage), rel=1e-12)


def examples():
    """The Python of the page on counting."""
    text = (Path(__file__).parents[2] / "docs" / "how_to" / "count.md").read_text()
    return [part.partition("```")[0] for part in text.split("```python\n")[1:]]


def test_what_other_programs_read(tmp_path, robot, stretch, monkeypatch):
    """The examples of the page on counting, by the grammar of Prometheus and ROS."""
    found = count(robot, stretch[2].parent / "logs", tmp_path / "l", sn_curve=str(stretch[2]))
    (tmp_path / "life.json").write_text(json.dumps(found.to_dict()))
    monkeypatch.chdir(tmp_path)
    made = {code.split()[1]: code for code in examples() if "make_log" not in code}
    del made["cells.py:"]
    names: dict[str, dict] = {name: {} for name in made}
    for name in ("prometheus.py", "ros_status.py"):
        exec(made[name], names[name])
    lines = (tmp_path / "life.prom").read_text().splitlines()
    sample = re.compile(r'[a-z_]+\{[a-z_]+="[^"]*"(,[a-z_]+="[^"]*")*\} (\+Inf|[-+0-9.e]+)')
    told = dict(line.rsplit(" ", 1) for line in lines if not line.startswith("#"))
    assert all(sample.fullmatch(line) for line in lines if not line.startswith("#"))
    assert float(told['picchio_blows_total{robot="fanuc_like_3dof"}']) == 36.0
    damage = found.counted.totals.damage
    own = 'picchio_damage_ratio{robot="fanuc_like_3dof",joint="joint_2"}'
    assert float(told[own]) == damage[1]
    status = names["ros_status.py"]["status"]
    assert [one["name"] for one in status] == [f"picchio: joint_{k}" for k in (1, 2, 3)]
    assert {one["level"] for one in status} <= {b"\x00", b"\x01", b"\x02"}
    assert float(status[1]["values"][0]["value"]) == damage[1]
    assert all(len(code.splitlines()) <= 30 for code in made.values())
    compile(made["opc_ua.py"], "opc_ua.py", "exec")


def test_the_command_counts_and_its_page_shows_it(tmp_path, stretch, in_process, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    logs = stretch[2].parent / "logs"
    done = in_process(
        "count", NAME, "--log", logs, "--ledger", "l", "--sn-curve", stretch[2], "--report",
        "p.html", "--json", "c.json", cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "36 blows in 1 log" in done.stdout and "ends the life" in done.stdout
    assert max(map(len, done.stdout.splitlines())) <= 80
    content = json.loads((tmp_path / "c.json").read_text())
    assert content["format"] == "picchio-count/1" and content["blows"] == 36
    left = {j["name"]: j["blows_left"]["p50"] for j in content["joints"]}
    assert content["ends"] == min(left, key=left.__getitem__)
    page = (tmp_path / "p.html").read_text()
    assert "life used and left" in page and "joint_2" in page
    # What picchio wrote into the folder is no log.
    done = in_process("count", NAME, "--log", tmp_path, "--ledger", "m", cwd=tmp_path)
    assert done.returncode == 2 and "holds no log" in done.stderr and not (tmp_path / "m").exists()


def test_a_model_that_must_be_computed_one_by_one_counts_the_same(robot, stretch, tmp_path, task):
    from picchio.ledger.damage import _exactly

    samples, stream, curve = stretch
    model = Model.of(robot)
    curves = curves_of(robot, load_sn_curve(str(curve)))
    with Ledger(tmp_path / "l", NAME) as book:
        book.add("log", "m", "log", stream, [samples])
        burst = next(bursts(blows_in(book, robot, task), resting(model)))
    (fast,) = burst_damages_of(model, curves, [burst])
    slow = _exactly(model, curves, burst)
    for mine, theirs in zip(fast.residue, slow.residue, strict=True):
        assert np.ptp(mine) == pytest.approx(np.ptp(theirs), rel=1e-6)
    np.testing.assert_allclose(fast.alone, slow.alone, rtol=1e-4)
    totals = []
    for each in (fast, slow):
        added = Sum(curves)
        added.add([each] * 3)
        totals.append(added.totals.damage)
    np.testing.assert_allclose(*totals, rtol=1e-4)


def test_a_bag_whose_topics_have_clocks_of_their_own(robot, tmp_path, task):
    """Angles at 100 Hz, the force at 5 kHz, as ROS 2 writes them; rosbags writes the file."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    rng = np.random.default_rng(21)
    made = shift.rivets(1, rng)
    table = shift.log(made, rng, length=1.6)
    store = get_typestore(Stores.ROS2_HUMBLE)
    t, wrench, joints = store.types, "geometry_msgs/msg/WrenchStamped", "sensor_msgs/msg/JointState"
    vector = t["geometry_msgs/msg/Vector3"]

    def header(ns):
        stamp = t["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)
        return t["std_msgs/msg/Header"](stamp=stamp, frame_id="base")

    with Writer(tmp_path / "run", version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        links = [
            writer.add_connection(f"/t{i}", k, typestore=store)
            for i, k in enumerate((wrench, joints))
        ]
        for i, row in enumerate(table.itertuples()):
            push = vector(row.fx, row.fy, row.fz)
            force = t["geometry_msgs/msg/Wrench"](push, vector(0.0, 0.0, 0.0))
            message = t[wrench](header(row.stamp), force)
            writer.write(links[0], row.stamp, store.serialize_cdr(message, wrench))
            if i % 50 == 0:
                angles = np.array([row.q1, row.q2, row.q3])
                names = ["joint_1", "joint_2", "joint_3"]
                message = t[joints](header(row.stamp), names, angles, np.array([]), np.array([]))
                writer.write(links[1], row.stamp, store.serialize_cdr(message, joints))
    path = next((tmp_path / "run").glob("*.db3"))
    topics = [c.topic for c in links]
    text = 'format = "picchio-mapping/1"\n[blows]\nthreshold = 150.0\nfoot = 12.0\n'
    for axis in "xyz":
        text += f'[[channel]]\nfrom = "{topics[0]}:wrench.force.{axis}"\nto = "force.{axis}"\n'
    for k in (1, 2, 3):
        text += f'[[channel]]\nfrom = "{topics[1]}:position.joint_{k}"\nto = "position.joint_{k}"\n'
    text = text.replace("foot = 12.0", 'foot = 12.0\nframe = "world"')
    (tmp_path / "m.toml").write_text(text)
    rules = picchio.campaign.importing.mapping.read_mapping(tmp_path / "m.toml")
    with Ledger(tmp_path / "l", NAME) as book:
        add_log(book, path, rules, Model.of(robot), task)
        found = blows_in(book, robot, task)
    assert len(found) == 12
    np.testing.assert_allclose([b.peak for b in found], made[0].peaks, rtol=0.01)
    np.testing.assert_allclose(found[0].pose, shift.POSES[made[0].place], atol=2e-4)
    np.testing.assert_allclose(found[3].direction, shift.DIRECTIONS[made[0].place], atol=0.01)


def test_a_topic_that_is_silent_for_blocks_holds_its_value(robot, tmp_path, monkeypatch):
    """A trigger that is told only as it changes; in blocks or at once the log holds the same."""
    from picchio.campaign.importing import importer
    from picchio.campaign.importing.raw import RawChannel, RawFile

    clock = np.arange(4000) * 0.002
    when = np.array([0.5, 1.9, 6.3])
    series = {"/j:a": (clock, 0.1 + 0.0 * clock), "/k:b": (when, np.array([0.2, 0.4, 0.6])),
              "/on:on": (clock, (clock % 1.0 < 0.3).astype(float))}  # fmt: skip

    def blocks(module, path, how, names):
        for begin in np.arange(0.0, 8.0, 1.0):
            own = {n: (t >= begin) & (t < begin + 1.0) for n, (t, _) in series.items()}
            made = {n: RawChannel(n, series[n][1][k], series[n][0][k])
                    for n, k in own.items() if k.any()}  # fmt: skip
            yield RawFile(path, "mcap", made, None, shift.BEGIN)

    monkeypatch.setattr(importer, "blocks_isolated", blocks)
    links = {"/j:a": "position.joint_1", "/k:b": "position.joint_2", "/on:on": "trigger"}
    rules = Mapping.model_validate({"channel": [{"from": a, "to": b} for a, b in links.items()]})
    (tmp_path / "x.mcap").touch()
    parts = list(read_samples(tmp_path / "x.mcap", rules, robot))
    assert sum(part.stamps.size for part in parts) == 4000
    stamps = np.concatenate([part.pose_stamps for part in parts])
    poses = np.concatenate([part.poses for part in parts])
    assert (stamps == shift.BEGIN + np.rint(clock * 1e9)).all()
    second = np.select([clock < 1.9, clock < 6.3], [0.2, 0.4], 0.6)
    assert (poses == np.column_stack([0.1 + 0.0 * clock, second, 0.0 * clock])).all()
    last = rules.channel[2].model_copy(update={"series": "/on:off"})
    wrong = rules.model_copy(update={"channel": [*rules.channel[:2], last]})
    with pytest.raises(InputError, match=r"no such series.*/on:off.*/on:on"):
        list(read_samples(tmp_path / "x.mcap", wrong, robot))
