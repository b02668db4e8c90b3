"""Damage in maps against `assess`, its worst direction against a dense sphere; mesh surfaces."""

import dataclasses

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

import picchio
from picchio.core.errors import InputError
from picchio.studies.envelopes import icosphere
from picchio.studies.maps import places
from picchio.studies.maps.run import workspace_map as compute_map
from picchio.studies.rivet.life_rules import curves_of
from picchio.studies.rivet.poses import damage_at
from picchio.studies.tasks import Operation, Task

# Forty times the paper's blow: shafts of this steel then fail.
BLOWS = picchio.PulseTrain(12000.0, 0.040, 0.004)


def workspace_map(*arguments, **options):
    """The dataset of a map."""
    return compute_map(*arguments, **options).to_xarray()


@pytest.fixture(scope="module")
def robot():
    return picchio.load_robot("fanuc_like_3dof")


@pytest.mark.parametrize("ending", [".nc", ".zarr"])
def test_damage_is_that_of_assess(tmp_path, robot, ending):
    grid = places.joint_grid(robot, [1, 2, 3])
    found = workspace_map(
        robot, grid, BLOWS, tmp_path / f"map{ending}", direction=[0, 0, 1], damage=12, chunk=2
    )
    operation = Operation("", np.array([0, 0, 1.0]), BLOWS, 12, grid.rows(0, 6))
    told = picchio.assess(robot, Task((operation,))).operations[0]
    assert told.damage_per_rivet.max() > 0.0
    np.testing.assert_allclose(
        found["damage_per_rivet"].values, told.damage_per_rivet, rtol=1e-5, atol=1e-30
    )
    np.testing.assert_array_equal(found["damage_direction"].values, np.tile([0, 0, 1.0], (6, 3, 1)))
    assert found["damage_per_rivet"].attrs["units"] == "1"
    assert found.attrs["hits_of_damage"] == 12
    assert found.attrs["format"] == "picchio-map/1" and "sha256" in found.attrs["provenance"]


def test_the_searched_direction_is_as_bad_as_any(tmp_path, robot):
    poses = np.array([[0.3, 0.5, -0.8], [0.0, -0.4, 0.9]])
    listed = places.Listed("pose", poses)
    found = workspace_map(robot, listed, BLOWS, tmp_path / "map.nc", damage=12)
    directions = icosphere(3)[0]
    curves = curves_of(robot)
    for k, pose in enumerate(poses):
        every = np.tile(pose, (len(directions), 1))
        brute = damage_at(picchio.Model(robot), every, directions, BLOWS, 12, curves).damage.max(
            axis=0
        )
        own = found["damage_per_rivet"].values[k]
        assert brute.max() > 0.0
        assert (own >= brute * (1 - 2e-3)).all()
        for j in range(3):  # and it is that direction's damage
            there = found["damage_direction"].values[k, j]
            again = damage_at(picchio.Model(robot), pose[None], there, BLOWS, 12, curves).damage[
                0, j
            ]
            assert own[j] == pytest.approx(again, rel=1e-9)


def test_a_map_without_shafts_has_no_damage(tmp_path, robot):
    bare = dataclasses.replace(
        robot,
        flexible_joints=tuple(dataclasses.replace(j, shaft=None) for j in robot.flexible_joints),
    )
    with pytest.raises(InputError, match="shaft"):
        workspace_map(bare, places.joint_grid(robot, 2), BLOWS, tmp_path / "map.nc", damage=12)


BOX = trimesh.creation.box((0.4, 0.6, 0.3))
BALL = trimesh.creation.icosphere(2, 0.3)


@pytest.mark.parametrize("shape", [BOX, BALL], ids=["box", "ball"])
def test_points_on_a_mesh_do_not_depend_on_its_triangles(tmp_path, shape):
    counts = []
    for name, mesh in {"coarse": shape, "fine": shape.subdivide_to_size(0.01)}.items():
        mesh.export(tmp_path / f"{name}.ply")
        found = places.surface(tmp_path / f"{name}.ply", spacing=0.05)
        nearest = cKDTree(found.values).query(found.values, 2)[0][:, 1]
        assert 0.89 * 0.05 < nearest.min() <= nearest.max() < 1.2 * 0.05
        # Nothing is left out: no point of the surface is further away than a spacing.
        everywhere = trimesh.sample.sample_surface(mesh, 3000, seed=1)[0]
        assert cKDTree(found.values).query(everywhere)[0].max() < 0.05
        assert len(found) == pytest.approx(mesh.area / 0.05**2, rel=0.06)
        assert ((found.values * found.normals).sum(axis=1) > 0.1).all()  # outwards
        counts.append(len(found))
    assert counts[0] == pytest.approx(counts[1], rel=0.03)


def test_both_sides_of_a_thin_sheet_and_what_is_no_surface(tmp_path):
    trimesh.creation.box((0.002, 0.4, 0.4)).export(tmp_path / "sheet.stl")
    found = places.surface(tmp_path / "sheet.stl", spacing=0.05)
    sides = [(found.normals[:, 0] * sign > 0.9).sum() for sign in (1, -1)]
    assert sides == [pytest.approx(70, abs=8)] * 2
    for name, spacing in (("sheet.stl", 0.0), ("none.stl", 0.1)):
        with pytest.raises(InputError):
            places.surface(tmp_path / name, spacing=spacing)
    with pytest.raises(InputError, match=r"sheet.stl: spacing: .*points.*at most 100000.*1e-06"):
        places.surface(tmp_path / "sheet.stl", spacing=1e-6)
    (tmp_path / "text.stl").write_text("no mesh")
    with pytest.raises(InputError, match=r"text\.stl"):
        places.surface(tmp_path / "text.stl", spacing=0.1)


def test_force_along_a_surfaces_normal(tmp_path, robot):
    panel = trimesh.Trimesh([[1.3, -0.2, 0.4], [1.3, 0.2, 0.4], [1.3, 0.2, 0.6]], [[0, 2, 1]])
    panel.export(tmp_path / "panel.stl")
    listed = places.surface(tmp_path / "panel.stl", spacing=0.2)
    normal = workspace_map(robot, listed, BLOWS, tmp_path / "a.nc", direction="normal", damage=12)
    fixed = workspace_map(robot, listed, BLOWS, tmp_path / "b.nc", direction=[-1, 0, 0], damage=12)
    for name in ("peak_deflection", "damage_per_rivet"):
        np.testing.assert_allclose(normal[name].values, fixed[name].values, rtol=1e-6, atol=1e-30)
