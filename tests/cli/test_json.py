"""`--json` of a command is `to_dict()` of its function."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer

import picchio
from picchio.campaign.tables import Tolerance
from picchio.cli.main import app, run
from picchio.studies.maps.places import joint_grid

SLOW = {"diagnose", "identify", "place", "reproduce"}
POSE = "0.3,1.1,-1.0"
# Two kilograms more are hardly beyond what is tolerated of the links: here the files are exact.
EXACT = ", ".join(f"{key} = 0" for key in Tolerance.model_fields)
PLAN = f"""format = "picchio-plan/1"
poses = [[0.3, 0.5, -0.8], [-0.4, 0.9, -1.1], [0.6, 0.2, -0.5]]
directions = [[0.6, 0.5, 0.62]]
hits = 3
sample_rate = 500.0
length = 0.4
seed = 4
tolerance = {{ {EXACT} }}
excitation = {{ kind = "pulse_train", force = 300.0, period = 0.040, width = 0.004 }}
sensor = [{{ channels = "deflection", noise = 1e-6 }}]
effect = [{{ effect = "payload", target = "tool", parameters = {{ mass = 2.0 }} }}]
"""
MAPPING = """format = "picchio-mapping/1"
time = { series = "t" }
channel = [{ from = "F", to = "force" }]
record = { kind = "percussion", pose = { joint_1 = 0.3 }, direction = [0.0, 0.0, 1.0] }
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the commands run, with what they read."""
    monkeypatch.chdir(tmp_path)
    Path("plan.toml").write_text(PLAN)
    Path("mapping.toml").write_text(MAPPING)
    for name, force in (("old", 300.0), ("new", 400.0)):
        content = {"format": "picchio-assessment/1", "inputs": {"task": {"force": force}}}
        Path(f"{name}.json").write_text(json.dumps(content))
    Path("hit.csv").write_text("t,F\n" + "".join(f"{i / 1e3},{i}\n" for i in range(50)))
    on = [f"{1772352000 + i / 250:.3f},{int(i % 125 < 99)},0.3" for i in range(250)]
    Path("stamped.csv").write_text("\n".join(["time,on,q", *on]) + "\n")
    Path("stamped.toml").write_text(
        'format = "picchio-mapping/1"\nchannel = [{ from = "on", to = "trigger" }, '
        '{ from = "q", to = "position.joint_1" }]\nblows = { operation = "upward" }\n'
    )
    rng = np.random.default_rng(1)
    rows = ["Stress [MPa],Cycles,Comment"]
    for stress in np.repeat([280, 320, 360, 420, 480], 8):
        strength = 300 * 10 ** (0.03 * rng.normal())
        life = 1e6 * (stress / strength) ** -6.0
        broke = stress > strength and life < 1e7
        rows.append(f"{stress},{life:.0f},Failure" if broke else f"{stress},10000000,RunOut")
    Path("tests.csv").write_text("\n".join(rows))
    picchio.simulate("fanuc_like_3dof", "plan.toml", "measured")
    return tmp_path


def arm() -> tuple[Any, Any]:
    robot = picchio.load_robot("fanuc_like_3dof")
    return robot, picchio.load_task(robot.task_path, robot)


def annotated() -> Any:
    made = picchio.annotate("fanuc_like_3dof")
    made.save("a.urdf")
    return made


def imported() -> Any:
    shutil.rmtree("imported")
    return picchio.import_record("hit.csv", "imported", "mapping.toml")


def recounted() -> Any:
    Path("l").unlink()
    return picchio.count(arm()[0], "stamped.csv", "l", mapping="stamped.toml")


def scene() -> Any:
    made = picchio.view("fanuc_like_3dof", pose=[0.3, 1.1, -1.0])
    made.save("a.html")
    return made


def started() -> Any:
    made = picchio.start("fanuc_like_3dof", payload=25.0, seed=2)
    made.save(force=True)
    return made


# Command line, and what the function returns; both write what they write where the other did.
COMMANDS: dict[str, tuple[str, Any]] = {
    "annotate": ("annotate fanuc_like_3dof --out a.urdf", annotated),
    "assess": ("assess fanuc_like_3dof", lambda: picchio.assess(arm()[0])),
    "check": ("check measured", lambda: picchio.check("measured")),
    "compare": (
        "compare old.json new.json",
        lambda: picchio.compare("old.json", "new.json"),
    ),
    "count": (
        "count fanuc_like_3dof --log stamped.csv --mapping stamped.toml --ledger l",
        recounted,
    ),
    "diagnose": (
        "diagnose fanuc_like_3dof --data measured",
        lambda: picchio.diagnose("fanuc_like_3dof", "measured"),
    ),
    "effects": ("effects", picchio.effects),
    "envelope": (
        f"envelope fanuc_like_3dof --pose={POSE} --hits 3",
        lambda: picchio.envelope(
            arm()[0], [0.3, 1.1, -1.0], arm()[1].operations[0].excitation, hits=3
        ),
    ),
    "fit-sn": (
        "fit-sn tests.csv --kind normal --survival 0.9",
        lambda: picchio.fit_sn("tests.csv", kind="normal", survival=0.9),
    ),
    "formats": ("formats campaign", lambda: picchio.formats("campaign")),
    "identify": (
        "identify fanuc_like_3dof --data measured --out found.toml",
        lambda: picchio.identify("fanuc_like_3dof", "measured"),
    ),
    "import": (
        "import hit.csv --mapping mapping.toml --to imported",
        imported,
    ),
    "map": (
        "map fanuc_like_3dof --joint-grid 2 --out map.nc",
        lambda: picchio.workspace_map(
            arm()[0], joint_grid(arm()[0], 2), arm()[1].operations[0].excitation, "map.nc"
        ),
    ),
    "place": (
        "place fanuc_like_3dof --placements 8 --no-self-collision",
        lambda: picchio.place(*arm(), placements=8, self_collision=False),
    ),
    "plan": (
        "plan fanuc_like_3dof --budget 5min --with weight,dial",
        lambda: picchio.plan(*arm(), budget="5min", instruments=["weight", "dial"]),
    ),
    "reproduce": (
        "reproduce --worlds 8 --assume period=0.05",
        lambda: picchio.reproduce({"period": 0.05}, worlds=8),
    ),
    "robots": ("robots", picchio.robots),
    "simulate": (
        "simulate fanuc_like_3dof --plan plan.toml --to made --seed 9",
        lambda: picchio.simulate("fanuc_like_3dof", "plan.toml", "made", seed=9, overwrite=True),
    ),
    "start": ("start fanuc_like_3dof --payload 25 --seed 2", started),
    "view": (f"view fanuc_like_3dof --pose={POSE} --out a.html", scene),
}


def marks(name: str) -> list[pytest.MarkDecorator]:
    """The paper is reproduced by other tests in CI, too."""
    return [pytest.mark.slow] * (name in SLOW) + [pytest.mark.minutes] * (name == "reproduce")


@pytest.mark.parametrize("name", [pytest.param(n, marks=marks(n)) for n in COMMANDS])
def test_json_is_to_dict(
    name: str, folder: Path, capsys: pytest.CaptureFixture[str], tables: list[Any]
) -> None:
    words, function = COMMANDS[name]
    assert run([*words.split(), "--json", "out.json"]) == 0
    capsys.readouterr()
    written = json.loads(Path("out.json").read_text())
    returned = function().to_dict()
    assert json.dumps(written) == json.dumps(returned)
    assert written["format"].startswith("picchio-")


def test_every_command_is_here() -> None:
    commands: Any = typer.main.get_command(app)
    # `explore` serves until it is interrupted: test_explore_command.
    assert set(commands.commands) == set(COMMANDS) | {"explore"}
