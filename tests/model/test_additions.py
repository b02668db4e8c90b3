"""An effect, a kind of channel and an excitation from outside: one file, no change to picchio."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
ENTRY_POINTS = """
[picchio.effects]
supply_scatter = picchio_additions:SupplyScatter
[picchio.channels]
gyroscope = picchio_additions:GYROSCOPE
vibrometer = picchio_additions:VIBROMETER
[picchio.excitations]
triangle_train = picchio_additions:TriangleTrain
"""
BLOWS = {"kind": "triangle_train", "force": 300.0, "period": 0.04, "rise": 0.001, "fall": 0.003}
# What may be wrong beside the addition: rivals of every kind, few enough to be quick.
RIVALS = ("force_amplitude", "force_drift", "joint_stiffness", "missed_hits", "modal_damping",
          "payload", "pulse_jitter", "pulse_width", "rebound", "sensor_gain")  # fmt: skip


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """A folder that holds the file as an installed distribution does."""
    folder = tmp_path_factory.mktemp("site")
    shutil.copy(HERE / "picchio_additions.py", folder)
    about = folder / "picchio_additions-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: picchio-additions\nVersion: 1\n")
    (about / "entry_points.txt").write_text(ENTRY_POINTS)
    return folder


def run(folder, code, *, fails=False):
    """What a program prints as JSON where the distribution is installed; else what it says."""
    paths = [str(folder), *filter(None, sys.path)]
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
        cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode != 0) == fails, done.stderr
    return done.stderr if fails else json.loads(done.stdout)


def test_a_life_follows_an_excitation_from_outside(installed):
    """The same ramps given as a measured history have the same life; rectangles a shorter one."""
    (installed / "ramps.csv").write_text("time [s],force [N]\n0,0\n0.001,300\n0.004,0\n")
    code = f"""
import json, picchio
robot = picchio.load_robot("fanuc_like_3dof")
def life(**excitation):
    work = dict(name="a", direction=[0, 0.6, 0.8], poses=[[0.2, 0.5, -0.8]], **excitation)
    task = picchio.task_from_dict(dict(operation=[work]), robot)
    return picchio.assess(robot, task, method="paper").to_dict()["rivets_to_failure"]
envelope = picchio.envelope(robot, pose=[0.2, 0.5, -0.8], excitation=
    picchio.task_from_dict(dict(operation=[dict(name="a", direction=[0, 0, 1],
    poses=[[0.2, 0.5, -0.8]], **{BLOWS})]), robot).operations[0].excitation)
print(json.dumps(dict(
    mine=life(**{BLOWS}),
    measured=life(kind="measured", file="ramps.csv", period=0.04),
    pulses=life(kind="pulse_train", force=300.0, period=0.04, width=0.004),
    blows=envelope.to_dict()["excitation"],
)))
"""
    found = run(installed, code)
    assert found["mine"] == pytest.approx(found["measured"], rel=1e-9)
    assert found["pulses"] < 0.5 * found["mine"]
    assert found["blows"]["kind"] == "triangle_train"
    assert found["blows"]["width"] is None


def test_an_excitation_from_outside_says_what_it_lacks(installed):
    code = f"""
import picchio
work = dict(name="a", direction=[0, 0, 1], poses=[[0, 0.5, -0.8]], **{dict(BLOWS, width=0.004)})
picchio.task_from_dict(dict(operation=[work]), picchio.load_robot("fanuc_like_3dof"))
"""
    assert "a triangle_train has no use for this key" in run(installed, code, fails=True)


@pytest.mark.slow
def test_what_is_hidden_is_found_through_a_channel_from_outside(installed):
    """The only sensor is the new one, the only cause the new effect, the blows the new ones."""
    code = f"""
import json, warnings
warnings.simplefilter("ignore")
import picchio
from picchio.model.effects.registry import catalogue
from picchio.campaign.tables import Tolerance
from picchio.prediction.plan import Plan
robot = picchio.load_robot("fanuc_like_3dof")
plan = Plan(
    poses=[[0.2, 0.5, -0.8], [-0.6, 0.2, 0.4], [0.9, 0.9, -1.2]],
    directions=[[1, 0, 0], [0, 0.6, 0.8]], repeats=2, levels=[300.0], sample_rate=500.0,
    quiet=0.4, length=0.3, seed=4, excitation=dict({BLOWS}, hits=4),
    tolerance=Tolerance.zero(), sensor=[dict(channels="gyroscope", noise=1e-5)],
    effect=[dict(effect="supply_scatter", target="tool", parameters=dict(std=0.2))],
)
picchio.simulate(robot, plan, "campaign")
without = set(catalogue()) - {{"supply_scatter", *{RIVALS}}}
found = picchio.diagnose(robot, "campaign", without=without, workers=1).to_dict()
print(json.dumps({{key: found[key] for key in ("verdict", "causes", "gain")}}))
"""
    found = run(installed, code)
    assert found["verdict"] == "named"
    (cause,) = found["causes"]
    assert (cause["effect"], cause["target"]) == ("supply_scatter", "tool")
    std = cause["parameters"]["std"]
    assert std["value"] == pytest.approx(0.2, abs=3.0 * std["std"])
    assert found["gain"]["explained"] > 0.99


@pytest.mark.slow
def test_channels_from_outside_are_checked_and_planned_for(installed):
    """One declares what the checks need: swapped axes and a wrong unit are found, as of any other.

    What the other does not declare is told. Both are sensors that a diagnosis may ask for.
    """
    code = """
import json, warnings
warnings.simplefilter("ignore")
import picchio
from picchio.campaign.campaign import Campaign
from picchio.campaign.record import Record
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.follow_up.records import sensor_group
from picchio.diagnosis.percussion.follow_up.records import possible_records
from picchio.prediction.plan import Plan
robot = picchio.load_robot("fanuc_like_3dof")
plan = Plan(
    poses=[[0.2, 0.5, -0.8], [-0.6, 0.2, 0.4]], directions=[[1, 0, 0], [0, 0.6, 0.8]],
    levels=[300.0], sample_rate=2000.0, quiet=0.2, length=0.2,
    excitation=dict(kind="pulse_train", force=300.0, period=0.04, width=0.004, hits=2),
    sensor=[dict(channels="vibrometer", noise=1e-5), dict(channels="gyroscope", noise=1e-5)],
)
made = picchio.simulate(robot, plan).campaign
def spoilt(change):
    records = []
    for record in made:
        read = record.read()
        time = read.pop("time")
        table = record.table.model_dump(exclude_none=True, exclude={"file"})
        records.append(Record.from_arrays(record.file, time, change(read), **table))
    table = dict(robot=robot.name, excitation=made.table.excitation.model_dump(exclude_none=True))
    return [
        (f.check, f.channel, f.message)
        for f in picchio.check(Campaign.from_records(records, **table), robot).findings
    ]
x, y = "vibrometer.tool.x", "vibrometer.tool.y"
problem = Problem(robot, made)
setup = next(iter(possible_records(problem, problem.records[0])))
print(json.dumps(dict(
    sound=spoilt(lambda read: read),
    swapped=spoilt(lambda read: {**read, x: read[y], y: read[x]}),
    wrong=spoilt(lambda read: {n: 1e3 * v if n[0] == "v" else v for n, v in read.items()}),
    asked=[sensor_group(problem, name) for name in ("gyroscope", "vibrometer", "deflection")],
    groups=sorted(setup.groups),
)))
"""
    found = run(installed, code)
    about = lambda told, group: {(c, m) for c, g, m in told if g and g.startswith(group)}  # noqa: E731
    sound = about(found["sound"], "vibrometer")
    assert not {check for check, _ in sound} & {"axes", "units", "phase"}
    (told,) = [m for check, m in about(found["swapped"], "vibrometer") if check == "axes"]
    assert "x shows y, y shows x" in told
    assert {"units", "axes"} <= {check for check, _ in about(found["wrong"], "vibrometer")}
    unsaid = [m for check, m in about(found["sound"], "gyroscope") if check == "channels"]
    assert unsaid == [
        "its axes, its phase or its size are not checked: its kind does not declare derivative "
        "and plausible"
    ]
    assert found["asked"] == ["gyroscope.tool", "vibrometer.tool", "deflection"]
    assert found["groups"] == ["accelerometer.tool", "deflection", "gyroscope.tool",
                               "vibrometer.tool"]  # fmt: skip


CLASH = """
from picchio.model.effects.structure.masses.payload import Payload
class Cargo(Payload):
    pass
"""


@pytest.mark.parametrize(
    ("group", "target", "part"),
    [
        ("effects", "clash:Cargo", "another effect has this name already"),
        ("effects", "clash:Freight", "cannot be loaded"),
        ("effects", "picchio_additions:GYROSCOPE", "is no effect"),
        ("channels", "picchio_additions:SupplyScatter", "is no kind of channel"),
        ("excitations", "picchio_additions:SupplyScatter", "is no excitation"),
    ],
)
def test_what_is_no_addition_is_refused_by_its_entry_point(tmp_path, group, target, part):
    about = tmp_path / "bad-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: bad\nVersion: 1\n")
    (about / "entry_points.txt").write_text(f"[picchio.{group}]\nmine = {target}\n")
    (tmp_path / "clash.py").write_text(CLASH)
    shutil.copy(HERE / "picchio_additions.py", tmp_path)
    room, call = {
        "effects": ("model.effects.registry", "catalogue()"),
        "channels": ("campaign.channels", "kinds()"),
        "excitations": ("excitation.table", "catalogue()"),
    }[group]
    said = run(tmp_path, f"import picchio.{room} as room; room.{call}", fails=True)
    assert part in said
    assert f"entry point mine (picchio.{group})" in said
