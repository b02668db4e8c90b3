"""Every key of every format is described, and nothing that a command writes is left out."""

import contextlib
import io
import json
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

import picchio
from picchio.campaign.tables import Tolerance
from picchio.cli.main import run
from picchio.core.errors import InputError
from picchio.diagnosis.begin import Begun
from picchio.diagnosis.percussion.search.far import Rough
from picchio.reference.formats import formats

ALL = {entry.name: entry for entry in formats().formats}
TABLES = [entry for entry in ALL.values() if entry.kind == "TOML"]
# Two kilograms more are hardly beyond what is tolerated of the links: here the files are exact.
EXACT = "\n".join(f"{key} = 0.0" for key in Tolerance.model_fields)
PLAN = f"""format = "picchio-plan/1"
poses = [[0.3, 0.5, -0.8], [0.0, 0.9, -0.5], [-0.4, 0.2, -0.3]]
directions = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
sample_rate = 2000.0
length = 1.0
hits = 12
[tolerance]
{EXACT}
[excitation]
kind = "pulse_train"
force = 300.0
period = 0.040
width = 0.004
[[sensor]]
channels = "accelerometer"
noise = 0.05
[[sensor]]
channels = "deflection"
noise = 1e-6
[[effect]]
effect = "payload"
target = "tool"
parameters = {{ mass = 2.0 }}
"""


@pytest.mark.parametrize("entry", ALL.values(), ids=list(ALL))
def test_every_key_has_a_type_and_a_meaning(entry):
    assert entry.keys and entry.meaning and entry.command
    for key in entry.keys:
        assert key.type and key.meaning, f"{entry.name}: {key.path}"
    paths = [key.path for key in entry.keys]
    assert len(set(paths)) == len(paths)


@pytest.mark.parametrize("entry", TABLES, ids=lambda entry: entry.name)
def test_every_number_of_a_table_has_a_unit(entry):
    # Without one are those whose unit another key or the effect decides.
    for key in entry.keys:
        free = key.path.endswith(("direction", "directions", "axis", ".noise", "hidden",
                                  "parameters", "sign"))  # fmt: skip
        if key.type.startswith(("number", "list of numbers", "list of 3")) and not free:
            assert key.unit, f"{entry.name}: {key.path}"


@pytest.mark.parametrize("name", ["task", "sidecar"])
def test_shipped_files_have_no_key_that_is_not_described(name, repository):
    file = {"task": "task.toml", "sidecar": "flex.toml"}[name]
    for path in sorted((repository / "robots").glob(f"*/{file}")):
        assert_described(tomllib.loads(path.read_text()), name)


@pytest.mark.parametrize(
    ("name", "folder"), [("sn-curve", "fatigue/data/sn"), ("reducers", "robot/drives/reducers")]
)
def test_shipped_data_have_no_key_that_is_not_described(name, folder, repository):
    for path in (repository / "src/picchio" / folder).glob("*.toml"):
        assert_described(tomllib.loads(path.read_text()), name)


def test_defaults_and_bounds_are_those_that_are_checked():
    keys = {key.path: key for key in ALL["task"].keys}
    assert keys["hits_per_rivet"].default == "12"
    assert keys["hits_per_rivet"].type == "whole number > 0, <= 10000"
    assert keys["operation[].direction"].required
    assert keys["excitation.force"].unit == "N"
    assert '"half_sine_train"' in keys["excitation.kind"].type


def test_a_name_or_a_format_finds_it_and_others_are_refused():
    assert formats("picchio-task/1").formats == formats("task").formats
    with pytest.raises(InputError, match="did you mean 'task'"):
        formats("tasks")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A plan, its campaign, S-N tests and a log to import."""
    folder = tmp_path_factory.mktemp("formats")
    (folder / "plan.toml").write_text(PLAN)
    rows = [f"{stress},{10**life:.0f},Failure" for stress, life in
            zip(range(300, 480, 9), [6 - 0.05 * i for i in range(20)], strict=True)]  # fmt: skip
    (folder / "tests.csv").write_text("\n".join(["Stress [MPa],Cycles,Outcome", *rows]))
    (folder / "log.csv").write_text("t,F\n" + "".join(f"{i},{i % 7}\n" for i in range(50)))
    rows = [f"{1772352000 + 0.004 * i:.3f},{i % 125 < 99},0.3" for i in range(500)]
    text = "\n".join(["time,on,q", *rows]).replace("True", "1").replace("False", "0")
    (folder / "stamped.csv").write_text(text + "\n")
    (folder / "stamped.toml").write_text(
        'format = "picchio-mapping/1"\n[[channel]]\nfrom = "on"\nto = "trigger"\n[[channel]]\n'
        'from = "q"\nto = "position.joint_1"\n[blows]\noperation = "upward"\n'
    )
    (folder / "mapping.toml").write_text(
        'format = "picchio-mapping/1"\n[time]\nseries = "t"\nunit = "ms"\n[[channel]]\nfrom = "F"\n'
        'to = "force"\n[record]\nkind = "percussion"\npose = { joint_1 = 0.3 }\n'
        'direction = [0.0, 0.0, 1.0]\n[campaign]\nrobot = "fanuc_like_3dof"\ntool = "tool"\n'
    )
    command(folder, "simulate fanuc_like_3dof --plan plan.toml --to made")
    command(folder, "assess fanuc_like_3dof --json life.json")
    text = (folder / "life.json").read_text()
    (folder / "other.json").write_text(text.replace('"force": 300.0', '"force": 400.0'))
    return folder


FAST = {
    "assessment": "assess fanuc_like_3dof",
    "envelope": "envelope fanuc_like_3dof --pose=0.3,0.5,-0.8",
    "robots": "robots",
    "comparison": "compare life.json other.json",
    "map-summary": "map fanuc_like_3dof --plane xz --spacing 0.5 --out map.nc",
    "check": "check made --robot fanuc_like_3dof",
    "simulation": "simulate fanuc_like_3dof --plan plan.toml --to again",
    "sn": "fit-sn tests.csv",
    "test-plan": "plan fanuc_like_3dof --budget 5min",
    "import": "import log.csv --mapping mapping.toml --to imported",
    "detection": "import log.csv",
    "count": "count fanuc_like_3dof --log stamped.csv --mapping stamped.toml --ledger l",
    "annotation": "annotate fanuc_like_3dof --flex {robots}/fanuc_like_3dof/flex.toml --out r.urdf",
    "start": "start ur10 --force",
    "effects": "effects",
    "formats": "formats",
}
SLOW = {
    "assessment": "assess fanuc_like_3dof --for-life 1e6 --uncertainty --compare-methods "
    "--sn-curve nie-2016",
    "diagnosis": "diagnose fanuc_like_3dof --data made",
    "identification": "identify fanuc_like_3dof --data made --out found.toml",
    "placement": "place fanuc_like_3dof --placements 3",
    "scene": "view fanuc_like_3dof --out scene.html",
    "reproduction": "reproduce --worlds 8",
}


@pytest.mark.parametrize(("name", "line"), FAST.items(), ids=list(FAST))
def test_what_a_command_writes_is_described(name, line, folder, repository):
    assert_described(written(folder, line, repository), name)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "line"),
    [
        pytest.param(*item, marks=[pytest.mark.minutes] * (item[0] == "reproduction"))
        for item in SLOW.items()
    ],
    ids=list(SLOW),
)
def test_what_a_long_command_writes_is_described(name, line, folder, repository):
    assert_described(written(folder, line, repository), name)


# What serves until it is interrupted writes what Python returns: tests/cli/test_explore_command.py.
SERVED = {"exploration": "explore"}


@pytest.mark.parametrize("name", SERVED)
def test_what_is_served_is_described(name):
    live = getattr(picchio, SERVED[name])("fanuc_like_3dof")
    try:
        assert_described(json.loads(json.dumps(live.to_dict())), name)
    finally:
        live.close()


def test_what_an_identification_began_from_is_described():
    robot = picchio.load_robot("fanuc_like_3dof")
    found = Rough(np.array([0.4, 1.9, 0.6]), np.full(3, 0.02), 0.4, left=0.01, before=0.8)
    began = Begun(robot, found, nrmse=0.9).to_dict(robot)
    told = {key.path for key in ALL["identification"].keys if key.path.startswith("from_nothing")}
    within = {path.replace("joint_1", "<joint>") for path in paths({"from_nothing": began})}
    assert {path for path in within if "joint_" not in path} == told


def test_every_json_output_is_held_against_a_command():
    outputs = {entry.name for entry in ALL.values() if entry.kind == "JSON"}
    assert outputs == FAST.keys() | SLOW.keys() | SERVED.keys()


def test_every_format_that_the_source_names_is_listed(repository):
    named = set()
    for path in (repository / "src/picchio").rglob("*"):
        if path.suffix in (".py", ".toml") and path.parent.name != "paper":
            named |= set(re.findall(r"picchio-[a-z-]+/\d", path.read_text()))
    # The paper's printed numbers are not the user's to write.
    assert named - {"picchio-paper/1"} <= {entry.format for entry in ALL.values()}


def written(folder, line, repository):
    text = command(folder, line.format(robots=repository / "robots") + " --json -")
    return json.loads(text)


def command(folder, line):
    out = io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(out):
        assert run(line.split()) == 0
    return out.getvalue()


def assert_described(content, name):
    """No path of the content is missing from the format, and nothing it always has is missing."""
    known = {pattern(part) for key in ALL[name].keys for part in (key.path, *tables(key.path))}
    known |= {pattern(key.path) + r"(\[\])?" for key in ALL[name].keys if "list" in key.type}
    known |= {
        pattern(key.path) + r"(\[\])?\..+"
        for key in ALL[name].keys
        if re.search("tables? of (numbers|lists|any)", key.type)
    }
    found = set(paths(content))
    for path in found:
        assert any(re.fullmatch(each, path) for each in known), f"{name}: {path} is not described"
    if ALL[name].kind == "JSON":
        tops = {path.partition(".")[0].partition("[")[0] for path in found}
        for key in ALL[name].keys:
            top = re.split(r"[.\[]", key.path)[0]
            if key.required and "." not in key.path and "[" not in key.path:
                assert top in tops, f"{name}: {key.path} was not written"


def tables(path):
    """The tables and lists around a key: where one is null or empty it has no leaf of its own."""
    parts = path.split(".")
    for n in range(1, len(parts) + 1):
        part = ".".join(parts[:n])
        yield from (part.removesuffix("[]" * k) for k in range(n < len(parts), 3))


def pattern(path):
    """A regular expression for a described path and for what stands within a free table."""
    parts = re.split(r"(<[^>]*>)", path)
    return "".join(".+" if part.startswith("<") else re.escape(part) for part in parts)


def paths(content, before=""):
    """The path of every leaf; tables within lists count, lists of numbers are leaves."""
    if isinstance(content, dict):
        for key, value in content.items():
            yield from paths(value, f"{before}.{key}" if before else key)
    elif isinstance(content, list) and content and isinstance(content[0], dict | list):
        for value in content:
            yield from paths(value, f"{before}[]")
    else:
        yield before


def test_a_key_that_nobody_described_is_noticed():
    with pytest.raises(AssertionError, match="surprise"):
        assert_described({"format": "picchio-annotation/1", "file": "x", "surprise": 1},
                         "annotation")  # fmt: skip


def test_map_variables_are_those_of_a_map(folder):
    import xarray as xr

    command(folder, "map fanuc_like_3dof --plane xz --spacing 0.5 --out again.nc")
    with xr.open_dataset(Path(folder) / "again.nc") as found:
        described = {key.path: key for key in ALL["map"].keys}
        assert {name for name, key in described.items() if key.required} == set(found.data_vars)
        for name in found.data_vars:
            assert found[name].attrs["units"] in (described[name].unit, "1")
