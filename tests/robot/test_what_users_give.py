"""The wrong file, the wrong folder, the wrong unit; and an order that never changes."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from picchio.core.errors import InputError, PicchioWarning
from picchio.robot.loading.load import load_robot


def message(*arguments: object, **options: object) -> str:
    with pytest.raises(InputError) as caught:
        load_robot(*arguments, **options)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("name", ["flex.toml", "flex.txt", "FLEX.TOML"])
def test_a_sidecar_in_the_robots_place(write, sidecar_text, name):
    text = message(write(name, sidecar_text))
    assert "is a TOML file" in text
    assert "a sidecar belongs to --flex, a task to --task" in text


def test_a_broken_toml_file_is_one_still(write):
    assert "is a TOML file" in message(write("task.toml", "format = "))
    assert "is not valid XML" in message(write("notes.txt", "no format at all"))
    assert "no such file" in message("nowhere.toml")


def test_a_folder_without_a_urdf(tmp_path, write, arm_text):
    (tmp_path / "empty").mkdir()
    assert "is a folder without robot.urdf; there is no URDF in it" in message(tmp_path / "empty")
    write("arms/my.urdf", arm_text)
    assert "robot.urdf; name a URDF in it: my.urdf" in message(tmp_path / "arms")


def test_a_folder_does_not_hide_a_name(tmp_path, monkeypatch):
    (tmp_path / "fanuc_like_3dof").mkdir()
    monkeypatch.chdir(tmp_path)
    assert load_robot("fanuc_like_3dof").name == "fanuc_like_3dof"


@pytest.mark.parametrize(
    ("asked", "meant"),
    [("UR10", "ur10"), ("Ur5", "ur5"), ("PANDA", "panda"), ("KUKA_IIWA14", "kuka_iiwa14")],
)
def test_names_are_close_in_any_case(asked, meant):
    text = message(asked)
    assert text.count("did you mean") == 1
    assert f"did you mean {meant}" in text.replace("'", "")


def test_a_name_too_long_for_the_system():
    assert "cannot be read" in message("a" * 5000)


@pytest.mark.parametrize(
    ("entry", "says"),
    [
        ("shaft = { radius = 17.65, length = 0.05, shear_modulus = 79e9 }",
         "joint.a.shaft.radius: is above 2 m (in metres?), got 17.65"),
        ("shaft = { radius = 0.02, length = 50.4, shear_modulus = 79e9 }",
         "joint.a.shaft.length: is above 2 m (in metres?), got 50.4"),
    ],
)  # fmt: skip
def test_a_shaft_in_millimetres(arm, write, entry, says):
    text = f'format = "picchio-sidecar/1"\n[joint.a]\nstiffness = 1e4\n{entry}\n'
    assert says in message(arm, flex=write("mm.toml", text))


@pytest.mark.parametrize("value", [1.01e12, 1e300, 0.99e-3, 1e-300])
def test_a_stiffness_beyond_any_drive(arm, value):
    text = message(arm, values={"a": {"stiffness": value}})
    assert "joint.a.stiffness: is outside 0.001 to 1e+12 N m/rad (N/m for a prismatic" in text
    curve = {"k1": 1e4, "k2": value, "k3": 1e4, "t1": 1.0, "t2": 2.0}
    text = message(arm, values={"a": {"stiffness_curve": curve}})
    assert "joint.a.stiffness_curve.k2: is outside 0.001 to 1e+12 N m/rad" in text


@pytest.mark.parametrize("value", [1e12, 1e-3])
def test_the_limits_themselves_are_fine(arm, value):
    shaft = {"radius": 2.0, "length": 2.0, "shear_modulus": 79e9}
    robot = load_robot(arm, values={"a": {"stiffness": value, "shaft": shaft}})
    assert robot.stiffness.tolist() == [value]


def test_overdamped_is_allowed_with_a_warning(arm, flex, recwarn):
    with pytest.warns(PicchioWarning, match=r"joint 'b': damping_ratio 1\.5 is above 1") as seen:
        robot = load_robot(arm, flex=flex, values={"b": {"damping_ratio": 1.5}})
    assert len(seen) == 1
    assert robot.damping_ratio.tolist() == [0.02, 1.5, 0.03]
    load_robot(arm, flex=flex, values={"b": {"damping_ratio": 1.0}})
    assert not recwarn.list


ORDER = """
import sys
from picchio.robot.loading.load import load_robot
from picchio.robot.annotations.annotate import annotate
from picchio.robot.annotations.sidecar import read_sidecar
urdf, flex = sys.argv[1:]
print(list(load_robot(urdf, flex=flex).origins.items()))
print(annotate(urdf, read_sidecar(flex)))
try:
    load_robot(urdf, flex=flex, tool="nothing")
except Exception as error:
    print(error)
"""


def test_order_does_not_change_from_run_to_run(arm, write, sidecar_text):
    tool = (
        '[tool]\nmass = 1.0\nframe = "tip"\naxis = [0, 1, 0]\nxyz = [0, 0, 0.1]\n'
        "[base]\nrpy = [0, 0, 1]\nxyz = [1, 0, 0]\n"
    )
    flex = write("order.toml", sidecar_text + tool)
    said = [
        subprocess.run(
            [sys.executable, "-c", ORDER, str(arm), str(flex)],
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in ("1", "2")
    ]
    assert said[0] == said[1]
    names = list(load_robot(arm, flex=flex).origins)
    assert names[:4] == ["a.stiffness", "a.damping_ratio", "a.strength", "b.stiffness"]
    assert [name.split(".")[0] for name in names] == sorted(
        (name.split(".")[0] for name in names), key=["a", "b", "c", "tool", "base"].index
    )
