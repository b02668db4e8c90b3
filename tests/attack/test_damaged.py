"""Damaged maps, meshes and foreign files, and a scheduler that says nothing."""

from __future__ import annotations

import contextlib
import json
import random
import shutil
import socket
import sys
import time

import numpy as np
import pytest
from held import one_line

from picchio.campaign.importing import isolated
from picchio.campaign.importing.importer import read_raw
from picchio.core import spread
from picchio.core.errors import InputError
from picchio.robot.urdf.shapes import load_parts
from picchio.studies.maps.places import surface
from picchio.studies.maps.result import WorkspaceMap
from picchio.studies.maps.stored import open_map
from picchio.visuals.plots.workspace import best_branch

ARM = "fanuc_like_3dof"
READERS = """\
import os, resource, sys, time
from picchio.campaign.importing.isolated import Limits
LIMITS = Limits(seconds=2.0, memory=1 << 30)
def read(path, clock):
    {body}
"""
BODIES = {
    "hangs": ("time.sleep(60)", "within 2 s"),
    "swells": ("x = bytearray(2 << 30)", "needs more memory"),
    "dies": ("os.abort()", "reader crashed"),
    "fails": ("raise ZeroDivisionError", "reader crashed"),
}


@pytest.fixture(scope="module")
def maps(tmp_path_factory, in_process):
    folder = tmp_path_factory.mktemp("maps")
    for name in ("m.nc", "m.zarr"):
        done = in_process("map", ARM, "--joint-grid", "2", "--out", name, cwd=folder)
        assert done.returncode == 0, done.stderr
    return folder


def damaged(content, chance):
    """The bytes with some flipped, cut off, overwritten or all set."""
    found = bytearray(content)
    place = chance.randrange(len(found))
    kind = chance.randrange(4)
    if kind == 0:
        found[place] ^= 1 << chance.randrange(8)
    elif kind == 1:
        del found[place:]
    elif kind == 2:
        found[place : place + 16] = chance.randbytes(16)
    else:
        found[place : place + 8] = b"\xff" * 8
    return bytes(found)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", ["m.nc", "m.zarr"])
def test_a_damaged_map_is_refused_or_read(name, maps, tmp_path):
    chance = random.Random(1)
    target, refused = tmp_path / name, 0
    for _ in range(30):
        if name == "m.nc":
            target.write_bytes(damaged((maps / name).read_bytes(), chance))
        else:
            shutil.rmtree(target, ignore_errors=True)
            shutil.copytree(maps / name, target)
            file = chance.choice(sorted(p for p in target.rglob("*") if p.is_file()))
            file.write_bytes(damaged(file.read_bytes(), chance))
        try:
            with open_map(target) as found:
                best_branch(found, "joint_1")
        except InputError:
            refused += 1
        with contextlib.suppress(InputError), WorkspaceMap(open_map(target), target) as mapped:
            json.dumps(mapped.to_dict(), allow_nan=False)
            mapped._repr_html_()
    assert refused > 5


def test_a_map_of_impossible_values_is_refused(maps):
    with open_map(maps / "m.nc") as found:
        for name, changed in {
            "limiting_joint": found.assign(limiting_joint=found["limiting_joint"] - 9),
            "peak_deflection": found.assign(peak_deflection=found["peak_deflection"] * np.nan),
            "worst_direction": found.drop_vars("worst_direction"),
            "hits": found.assign_attrs(hits="many"),
            "joint_kinds": found.assign_attrs(joint_kinds=["revolute"]),
        }.items():
            with pytest.raises(InputError, match=name):
                WorkspaceMap(changed, maps / "m.nc").to_dict()


@pytest.mark.parametrize("name", ["m.nc", "m.zarr"])
def test_a_scene_of_a_damaged_map_is_one_line(name, maps, tmp_path, in_process):
    target = tmp_path / name
    if name == "m.nc":
        content = (maps / name).read_bytes()
        target.write_bytes(content[: len(content) // 2])
    else:
        shutil.copytree(maps / name, target)
        for part in (target / "peak_deflection" / "c").rglob("*"):
            if part.is_file():
                part.write_bytes(b"nonsense")
    done = in_process("view", ARM, "--pose=0,0.5,-0.8", "--map", target, "--out", "v.html",
                      cwd=tmp_path)  # fmt: skip
    one_line(done, 2, name, "cannot be read as a map")


def test_a_map_that_claims_more_than_it_holds(maps, tmp_path):
    shutil.copytree(maps / "m.zarr", tmp_path / "m.zarr")
    about = tmp_path / "m.zarr" / "peak_deflection" / "zarr.json"
    about.write_text(about.read_text().replace('"shape":[8', '"shape":[8000000000', 1)
                     .replace('"shape": [\n    8', '"shape": [\n    8000000000', 1))  # fmt: skip
    with pytest.raises(InputError, match=r"peak_deflection|dimension"), \
            open_map(tmp_path / "m.zarr") as found:  # fmt: skip
        best_branch(found, "joint_1")


@pytest.mark.parametrize("index", [7, 2**31])
def test_a_triangle_without_its_corner(index, tmp_path):
    import trimesh

    file = tmp_path / "box.glb"
    box = trimesh.creation.box()
    box.faces = np.array(box.faces)
    content = box.export(file_type="glb")
    old = np.asarray(box.faces, dtype=np.uint32).tobytes()
    assert content.count(old) == 1
    new = np.array(box.faces, dtype=np.uint32)
    new[3, 1] = len(box.vertices) + index
    file.write_bytes(content.replace(old, new.tobytes()))
    for read in (load_parts, lambda path: surface(path, spacing=0.5)):
        with pytest.raises(InputError, match=r"box\.glb.*(corner|mesh)"):
            read(file)


@pytest.mark.parametrize("name", BODIES)
def test_a_reader_of_foreign_files_is_bounded(name, tmp_path, monkeypatch):
    body, words = BODIES[name]
    folder = tmp_path / "modules"
    folder.mkdir()
    (folder / f"reader_{name}.py").write_text(READERS.format(body=body))
    monkeypatch.syspath_prepend(str(folder))
    (tmp_path / "x.dat").write_text("x")
    begun = time.monotonic()
    with pytest.raises(InputError, match=rf"x\.dat.*{words}"):
        isolated.read_isolated(f"reader_{name}", tmp_path / "x.dat", {})
    assert time.monotonic() - begun < 20.0


@pytest.mark.parametrize("ending", ["mcap", "uff", "mat"])
def test_foreign_files_are_read_in_another_process(ending, tmp_path, monkeypatch):
    """Nothing of a reader's library is loaded here."""
    module = {"mcap": "mcap", "uff": "pyuff", "mat": "scipy.io"}[ending]
    monkeypatch.setitem(sys.modules, module, None)
    (tmp_path / f"x.{ending}").write_bytes(b"none of its kind")
    with pytest.raises(
        InputError, match=rf"x\.{ending}: (is not a readable|holds no time history)"
    ):
        read_raw(tmp_path / f"x.{ending}")


def test_a_scheduler_that_does_not_answer(tmp_path, in_process, monkeypatch):
    monkeypatch.setattr(spread, "_PATIENCE", 0.5)
    map_by = ("map", ARM, "--joint-grid", "3", "--out", "m.nc", "--scheduler")
    with socket.create_server(("127.0.0.1", 0)) as mute:
        address = f"tcp://127.0.0.1:{mute.getsockname()[1]}"
        begun = time.monotonic()
        one_line(in_process(*map_by, address, cwd=tmp_path), 2, "--scheduler", address, "0.5 s")
    assert time.monotonic() - begun < 10.0
    one_line(in_process(*map_by, "no where", cwd=tmp_path), 2, "--scheduler", "no where")
    assert not list(tmp_path.iterdir())
