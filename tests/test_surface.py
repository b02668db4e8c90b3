"""`import picchio`: which names it shows, that they are what they seem, and what they return."""

from __future__ import annotations

import inspect
import json
import pkgutil
import re
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas
import pytest
from matplotlib.axes import Axes

import picchio
from picchio.core.fitted import Fit
from picchio.core.html import Page
from picchio.core.results import Result, TableResult
from picchio.core.shown import Shown, named_function
from picchio.fatigue.sn.test_table import SNTests
from picchio.studies.maps.places import joint_grid

FUNCTIONS = {
    "allowable", "annotate", "assess", "check", "compare", "count", "diagnose", "effects",
    "envelope", "explore", "fit_sn", "formats", "identify", "import_record", "place", "plan",
    "report", "reproduce",
    "robots", "simulate", "start", "uncertain_life", "view", "workspace_map",
}  # fmt: skip
SLOW = {"diagnose", "identify", "reproduce"}
# What they return stands within the JSON of `picchio assess`.
PARTS_OF_ASSESS = {"allowable", "uncertain_life"}
LOADERS = {"load_campaign", "load_robot", "load_sn_curve", "load_task"}
BLOWS = picchio.PulseTrain(300.0, 0.040, 0.004)
POSE = [0.3, 1.1, -1.0]
TASK = {
    "excitation": {"kind": "pulse_train", "force": 300.0, "period": 0.040, "width": 0.004},
    "operation": [{"name": "up", "direction": [0.0, 0.0, 1.0], "poses": [POSE]}],
}
PLAN = """format = "picchio-plan/1"
poses = [[0.3, 0.5, -0.8], [-0.4, 0.9, -1.1], [0.6, 0.2, -0.5]]
directions = [[0.6, 0.5, 0.62]]
hits = 3
sample_rate = 500.0
length = 0.4
excitation = { kind = "pulse_train", force = 300.0, period = 0.040, width = 0.004 }
sensor = [{ channels = "deflection", noise = 1e-6 }]
"""
MAPPING = """format = "picchio-mapping/1"
[time]
series = "t"
[[channel]]
from = "F"
to = "force"
[record]
kind = "percussion"
pose = { joint_1 = 0.3 }
direction = [0.0, 0.0, 1.0]
"""


COUNTED = """format = "picchio-mapping/1"
channel = [{ from = "on", to = "trigger" }, { from = "q", to = "position.joint_1" }]
blows = { operation = "up" }
"""


def modules() -> list[str]:
    """Every module of the package, imported."""
    found = [m.name for m in pkgutil.walk_packages(picchio.__path__, "picchio.")]
    for name in found:
        import_module(name)
    return found


def test_dir_shows_the_functions_the_loaders_and_what_the_guides_use(repository: Path) -> None:
    guides = [repository / "README.md", *(repository / "docs").glob("*/*.md")]
    guides += (repository / "docs" / "gallery").glob("*.py")
    guides += (repository / "notebooks").glob("*.ipynb")
    shown = {
        name for path in guides
        for name in re.findall(r"\bpicchio\.([A-Za-z]\w*)", path.read_text())
    }  # fmt: skip
    assert set(dir(picchio)) == FUNCTIONS | LOADERS | (shown & set(picchio.__all__)) | {"datasets"}
    assert picchio.__all__ == dir(picchio)
    assert re.fullmatch(r"\d+\.\d+.*", picchio.__version__)
    with pytest.raises(AttributeError, match="no attribute 'asses'"):
        picchio.asses  # noqa: B018
    for name in LOADERS | FUNCTIONS:
        assert inspect.isfunction(getattr(picchio, name)), name
    # Those who check types see the same names.
    stated = re.findall(r" import \(?\s*\w+ as (\w+)", Path(picchio.__file__).read_text())
    assert sorted(stated) == picchio.__all__


def test_no_module_stands_in_the_way_of_a_name() -> None:
    before = {name: getattr(picchio, name) for name in dir(picchio)}
    known = modules()
    assert len(known) > 300
    for name, value in before.items():
        assert getattr(picchio, name) is value, name
        if name == "datasets":
            assert inspect.ismodule(value) and value.__doc__
            continue
        assert f"picchio.{name}" not in known, name
        assert f"{value.__module__}.{value.__qualname__}" not in sys.modules, name
        assert value.__doc__, name


def rubbing(robot: picchio.FlexibleRobot) -> picchio.Campaign:
    """Motion records of an arm whose second joint has dry friction."""
    sys.path.insert(0, str(Path(__file__).parent / "diagnosis" / "motion"))
    try:
        import motion_records
    finally:
        sys.path.pop(0)
    return motion_records.campaign(robot, {("coulomb", 1): 30.0}, 1)


def calls(folder: Path) -> dict[str, Any]:
    """Every public function, called on something small."""
    robot = picchio.load_robot("fanuc_like_3dof")
    task = picchio.task_from_dict(TASK, robot)
    (folder / "plan.toml").write_text(PLAN)
    (folder / "mapping.toml").write_text(MAPPING)
    (folder / "hit.csv").write_text("t,F\n" + "".join(f"{i / 1e3},{i}\n" for i in range(50)))
    rows = [f"{1772352000 + i / 250:.3f},{int(i % 125 < 99)},0.3" for i in range(500)]
    (folder / "stamped.csv").write_text("\n".join(["time,on,q", *rows]) + "\n")
    (folder / "stamped.toml").write_text(COUNTED)
    rng = np.random.default_rng(0)
    stress = np.repeat([300e6, 340e6, 380e6, 420e6], 4)
    cycles = 1e6 * (stress / 300e6) ** -9.0 * np.exp(0.4 * rng.standard_normal(16))
    return {
        "allowable": lambda: picchio.allowable(robot, task, 1e6),
        "annotate": lambda: picchio.annotate("fanuc_like_3dof"),
        "assess": lambda: picchio.assess(robot, task),
        "check": lambda: picchio.check(picchio.simulate(robot, folder / "plan.toml").campaign),
        "compare": lambda: picchio.compare(robot, robot.with_stiffness(joint_1=1e5)),
        "count": lambda: picchio.count(
            robot,
            folder / "stamped.csv",
            folder / "ledger",
            mapping=folder / "stamped.toml",
            task=task,
        ),
        "diagnose": lambda: picchio.diagnose(robot, rubbing(robot)),
        "effects": lambda: picchio.effects("payload"),
        "envelope": lambda: picchio.envelope(robot, POSE, BLOWS),
        "explore": lambda: picchio.explore(robot, task=task, save=folder / "kept.toml"),
        "fit_sn": lambda: picchio.fit_sn(SNTests(stress, cycles, np.ones(16, bool)), knee=False),
        "formats": lambda: picchio.formats("task"),
        "identify": lambda: picchio.identify(robot, rubbing(robot)),
        "import_record": lambda: picchio.import_record(
            folder / "hit.csv", mapping=folder / "mapping.toml"
        ),
        "place": lambda: picchio.place(robot, task, placements=8, self_collision=False),
        "plan": lambda: picchio.plan(robot, task),
        "report": lambda: picchio.report(picchio.envelope(robot, POSE, BLOWS)),
        "reproduce": lambda: picchio.reproduce(worlds=8),
        "robots": lambda: picchio.robots(examples=False),
        "simulate": lambda: picchio.simulate("fanuc_like_3dof", folder / "plan.toml"),
        "start": lambda: picchio.start("ur10", payload=10.0),
        "uncertain_life": lambda: picchio.uncertain_life(robot, task, samples=256),
        "view": lambda: picchio.view(robot, pose=POSE, excitation=BLOWS),
        "workspace_map": lambda: picchio.workspace_map(
            robot, joint_grid(robot, 2), BLOWS, folder / "map.nc"
        ),
    }


def test_every_function_is_called_here(tmp_path: Path) -> None:
    assert set(calls(tmp_path)) == FUNCTIONS


@pytest.mark.filterwarnings("ignore::picchio.PicchioWarning")
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(
            name,
            marks=[pytest.mark.slow] * (name in SLOW)
            + [pytest.mark.minutes] * (name == "reproduce"),
        )
        for name in sorted(FUNCTIONS)
    ],
)
def test_what_a_function_returns(name: str, tmp_path: Path) -> None:
    modules()
    found = calls(tmp_path)[name]()
    text = repr(found)
    shown = found._repr_html_()
    assert shown.startswith("<") and "object at 0x" not in text + shown
    assert "\n" not in text and len(text) < 300
    check_plot_show_and_frame(found)
    if isinstance(found, Page):
        page = found.save(tmp_path / "page.html").read_text()
        assert page.lower().startswith("<!doctype html>")
    if name == "report":
        return
    assert isinstance(found, Result)
    content = found.to_dict()
    assert json.loads(json.dumps(content, allow_nan=False)) == content
    if name not in PARTS_OF_ASSESS:
        assert re.fullmatch(r"picchio-[a-z-]+/\d+", content["format"])
    if isinstance(found, TableResult):
        frame, table = found.to_frame(), found.to_xarray()
        units = frame.attrs.get("units", {})
        assert len(frame) > 0 and set(units) <= set(frame.columns)
        assert all(table[column].attrs["units"] == unit for column, unit in units.items())
    if name == "workspace_map":
        assert found.to_xarray().sizes["point"] >= 1
        found.close()


def check_plot_show_and_frame(found: Shown) -> None:
    """Each of the three works, or says in words why there is none."""
    for name, reason in found.LACKS.items():
        with pytest.raises(picchio.InputError, match=re.escape(reason)):
            getattr(found, name)()
    if "plot" not in found.LACKS:
        for what in (None, *found.PLOTS):
            if what == "scan" and not found.scans:  # no stiffness along which the life turns
                with pytest.raises(picchio.InputError, match="no such scan"):
                    found.plot(what)
                continue
            assert isinstance(found.plot(what), Axes)
        plt.close("all")
        with pytest.raises(picchio.InputError, match=next(iter(found.PLOTS))):
            found.plot("no such plot")
    if "to_frame" not in found.LACKS:
        assert isinstance(found.to_frame(), pandas.DataFrame)
    if "show" not in found.LACKS and not isinstance(found, Page):
        seen = found._seen()
        assert picchio.view(**seen).items if seen else found.show() is found


def classes_of(kind: type) -> set[type]:
    return {kind} | {each for child in kind.__subclasses__() for each in classes_of(child)}


def test_whatever_is_shown_can_be_plotted_and_made_a_table_or_says_why_not() -> None:
    modules()
    every = classes_of(Shown) - {Shown, Result, TableResult, Page, Fit}
    assert len(every) > 30
    given = {"Assessment", "DirectionEnvelope", "UncertainLife", "AllowableLoads", "Placement",
             "WorkspaceMap", "Count", "PlannedTests", "Simulation"}  # fmt: skip
    for each in every:
        if not each.__module__.startswith("picchio."):
            continue
        scene = each.show is not Shown.show or each._seen is not Shown._seen
        has = {"plot": bool(each.PLOTS), "show": scene or each.__name__ in given,
               "to_frame": each.to_frame is not Shown.to_frame}  # fmt: skip
        assert {name for name, there in has.items() if not there} == set(each.LACKS), each
        for address in each.PLOTS.values():
            assert inspect.signature(named_function(address)).parameters["ax"].default is None


def test_a_report_says_what_its_page_needs() -> None:
    robot = picchio.load_robot("fanuc_like_3dof")
    with pytest.raises(picchio.InputError, match="no result of picchio"):
        picchio.report(robot)  # type: ignore[arg-type]
    made = picchio.robots(examples=False)
    with pytest.raises(picchio.InputError, match=r"RobotList.*'colour'"):
        picchio.report(made, colour="red")
    page = picchio.report(made, command="picchio <robots>", warnings=["a & b"]).html()
    for word in ("fanuc_like_3dof", "picchio &lt;robots&gt;", "a &amp; b"):
        assert word in page
