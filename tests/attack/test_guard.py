"""No output of a command replaces what it reads, or another output: refused, nothing touched."""

from __future__ import annotations

import os
import shutil

import pytest
from faults import ARM, inputs

import picchio
from picchio.campaign.campaign import load_campaign

# What is typed, and the file that must stay as it is.
OVER_INPUTS = {
    "the tests of an S-N curve": ("fit-sn tests.csv --out tests.csv", "tests.csv"),
    "a picture over the tests": ("fit-sn tests.png --plot tests.png", "tests.png"),
    "a sidecar beside a URDF": ("assess own/robot.urdf --json own/flex.toml", "own/flex.toml"),
    "the URDF": ("envelope arm.urdf --pose 0,0.5,-0.8 --json arm.urdf", "arm.urdf"),
    "the URDF by a link": ("annotate arm.urdf --out link.urdf", "arm.urdf"),
    "the URDF by another name": ("annotate arm.urdf --out ./new/../arm.urdf", "arm.urdf"),
    "a hard link": ("assess arm.urdf --json hard.json", "arm.urdf"),
    "a mesh": ("assess meshed.urdf --json link.stl", "link.stl"),
    "a task": ("assess arm.urdf --task task.toml --json task.toml", "task.toml"),
    "a force history": ("assess arm.urdf --task forced.toml --json force.csv", "force.csv"),
    "a task to place": ("place arm.urdf --task task.toml --out task.toml", "task.toml"),
    "an S-N curve": ("assess arm.urdf --sn-curve steel.toml --json steel.toml", "steel.toml"),
    "a plan": (f"simulate {ARM} --plan plan.toml --to made --json plan.toml", "plan.toml"),
    "a record": ("check campaign --json campaign/r01.csv", "campaign/r01.csv"),
    "a campaign": (f"check campaign --robot {ARM} --json campaign/campaign.toml",
                   "campaign/campaign.toml"),
    "a record to diagnose": (f"diagnose {ARM} --data campaign --json campaign/r01.csv",
                             "campaign/r01.csv"),
    "a record to identify": (f"identify {ARM} --data campaign --out campaign/r01.csv",
                             "campaign/r01.csv"),
    "a raw file": ("import raw.csv --json raw.csv", "raw.csv"),
    "a mapping": ("import raw.csv --mapping made.toml --to new/c --json made.toml", "made.toml"),
    "points of a map": ("map arm.urdf --points points.csv --out m.nc --json points.csv",
                        "points.csv"),
    "a saved result": ("compare a.json b.json --json a.json", "a.json"),
    "a log": (f"count {ARM} --log raw.csv --mapping made.toml --ledger l.ledger --json raw.csv",
              "raw.csv"),
    "a log in a folder": (f"count {ARM} --log logs --ledger l.ledger --json logs/raw.csv",
                          "logs/raw.csv"),
    "a logo": ("assess arm.urdf --report r.html --logo logo.svg --json logo.svg", "logo.svg"),
    "a sidecar that is given": ("assess bare.urdf --flex flex.toml --json flex.toml", "flex.toml"),
    "a diagnosis to view": ("view arm.urdf --out v.html --diagnosis a.json --json a.json",
                            "a.json"),
}  # fmt: skip
TWICE = {
    "assess": "assess arm.urdf --json same.html --report same.html",
    "by a path": "assess arm.urdf --json same.html --report ./new/../same.html",
    "fit-sn": "fit-sn tests.csv --out same.png --plot same.png",
    "map": "map arm.urdf --joint-grid 3 --out same.nc --json same.nc",
    "map-pages": "map arm.urdf --joint-grid 3 --out m.nc --html same.html --json same.html",
    "place": "place arm.urdf --out same.toml --json same.toml",
    "diagnose": f"diagnose {ARM} --data campaign --model same.toml --plan same.toml",
    "identify": f"identify {ARM} --data campaign --out same.toml --json same.toml",
    "view": "view arm.urdf --out same.html --json same.html",
    "annotate": "annotate arm.urdf --out same.urdf --json same.urdf",
    "count": f"count {ARM} --log logs --ledger same --json same",
    "within a folder": f"simulate {ARM} --plan plan.toml --to new --json new/campaign.toml",
    "start": "start ur10 --out new --json new/ur10.task.toml",
}  # fmt: skip
ENDINGS = {
    "--report": (f"assess {ARM} --report x.pdf", ".html"),
    "--plot": ("fit-sn tests.csv --plot x.html", ".png"),
    "--html": (f"map {ARM} --joint-grid 3 --out m.nc --html x.json", ".html"),
    "--out of view": (f"view {ARM} --out x.png", ".html"),
    "--out of map": (f"map {ARM} --joint-grid 3 --out x.csv", ".zarr"),
    "--rerun": (f"view {ARM} --rerun x.html", ".rrd"),
    "--model": (f"diagnose {ARM} --data campaign --model x.json", ".toml"),
}


@pytest.fixture(scope="module")
def given(tmp_path_factory):
    folder = tmp_path_factory.mktemp("given")
    inputs(folder)
    picchio.annotate(ARM).save(folder / "arm.urdf")
    shutil.copy(folder / "arm.urdf", folder / "bare.urdf")
    robot = picchio.load_robot(ARM)
    (folder / "flex.toml").write_text(
        'format = "picchio-sidecar/1"\n[joint.joint_1]\nstiffness = 2.4e5\n'
    )
    (folder / "new").mkdir()
    (folder / "own").mkdir()
    shutil.copy(folder / "arm.urdf", folder / "own" / "robot.urdf")
    shutil.copy(folder / "flex.toml", folder / "own" / "flex.toml")
    (folder / "link.urdf").symlink_to("arm.urdf")
    os.link(folder / "arm.urdf", folder / "hard.json")
    task = robot.task_path.read_text()
    (folder / "task.toml").write_text(task)
    (folder / "forced.toml").write_text(
        'format = "picchio-task/1"\nhits_per_rivet = 3\n'
        '[excitation]\nkind = "measured"\nfile = "force.csv"\nperiod = 0.04\n'
        '[[operation]]\nname = "a"\ndirection = [1.0, 0.0, 0.0]\nposes = [[0.0, 0.5, -0.8]]\n'
    )
    (folder / "force.csv").write_text(
        "time [s],force [N]\n" + "".join(f"{1e-3 * i},{300.0 * (i < 4)}\n" for i in range(40))
    )
    (folder / "points.csv").write_text("x [m],y [m],z [m]\n1.0,0.0,1.0\n0.9,0.1,1.0\n")
    shutil.copy(folder / "tests.csv", folder / "tests.png")
    (folder / "logo.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg"></svg>')
    (folder / "logs").mkdir()
    shutil.copy(folder / "raw.csv", folder / "logs" / "raw.csv")
    text = (folder / "made.toml").read_text()
    start = 'unit = "ms"\nstart = 2026-03-01T08:00:00Z'
    stands = '[blows]\noperation = "forward"\npose = [0.0, 0.5, -0.8]\n'
    text = text.replace('unit = "ms"', start, 1) + stands
    (folder / "logs" / "mapping.toml").write_text(text)
    (folder / "link.stl").write_text(
        "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
        "endloop\nendfacet\nendsolid a\n"
    )
    shape = '<visual><geometry><mesh filename="link.stl"/></geometry></visual>'
    text = (folder / "arm.urdf").read_text()
    (folder / "meshed.urdf").write_text(text.replace("<inertial>", shape + "<inertial>", 1))
    picchio.fit_sn(folder / "tests.csv").save(folder / "steel.toml")
    for name in ("a.json", "b.json"):
        from picchio.cli.main import run

        assert run(["envelope", ARM, "--pose", "0,0.5,-0.8", "--json", str(folder / name)]) == 0
    return folder


def state(folder):
    return {str(p): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def refused(in_process, given, typed, *words):
    before = state(given)
    done = in_process(*typed.split(), cwd=given)
    lines = [line for line in done.stderr.splitlines() if "error" in line]
    assert done.returncode == 2 and len(lines) == 1, (done.returncode, done.stderr)
    for word in words:
        assert word in lines[0], lines
    after = state(given)
    assert {name: after.get(name) for name in before} == before, lines
    assert all(".ledger" in name for name in after.keys() - before), after.keys() - before


@pytest.mark.parametrize("name", OVER_INPUTS)
def test_what_is_read_is_not_replaced(in_process, given, name):
    typed, _ = OVER_INPUTS[name]
    refused(in_process, given, typed, "would overwrite an input of this command")


@pytest.mark.parametrize("name", TWICE)
def test_two_outputs_are_two_files(in_process, given, name):
    words = ("would lie within",) if name == "within a folder" else ("is written by",)
    refused(in_process, given, TWICE[name], *words)


@pytest.mark.parametrize("name", ENDINGS)
def test_an_ending_says_what_is_in_a_file(in_process, given, name):
    typed, valid = ENDINGS[name]
    refused(in_process, given, typed, "valid: ", valid)


def test_one_s_own_output_is_replaced(in_process, given):
    for _ in range(2):
        done = in_process("check", "campaign", "--json", "campaign/check.json", cwd=given)
        assert done.returncode == 0, done.stderr


def test_a_folder_that_is_replaced_keeps_what_is_not_its_own(in_process, given):
    words = ("simulate", ARM, "--plan", "made2/plan.toml", "--to", "made2", "--overwrite")
    picchio.simulate(ARM, given / "plan.toml", given / "made2")
    shutil.copy(given / "plan.toml", given / "made2" / "plan.toml")
    (given / "made2" / "notes").mkdir()
    (given / "made2" / "notes" / "read.me").write_text("mine")
    assert in_process(*words, cwd=given).returncode == 0
    assert (given / "made2" / "plan.toml").read_bytes() == (given / "plan.toml").read_bytes()
    assert (given / "made2" / "notes" / "read.me").read_text() == "mine"
    assert len(load_campaign(given / "made2").records) == 1
