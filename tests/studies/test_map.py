"""Workspace maps: every row against the single-pose path, and interruptions that cost nothing."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import xarray

import picchio
from picchio.core.errors import InputError
from picchio.studies.envelopes import envelope as envelope_of
from picchio.studies.maps import places
from picchio.studies.maps.run import workspace_map as compute_map

BLOWS = picchio.PulseTrain(300.0, 0.040, 0.004)


def workspace_map(*arguments, **options):
    """The dataset of a map."""
    return compute_map(*arguments, **options).to_xarray()


@pytest.fixture(scope="module")
def robot():
    return picchio.load_robot("fanuc_like_3dof")


@pytest.mark.parametrize("ending", [".nc", ".zarr"])
def test_every_row_is_the_envelope_of_its_pose(tmp_path, robot, ending):
    grid = places.plane(robot, "xz", spacing=0.4)
    found = workspace_map(robot, grid, BLOWS, tmp_path / f"map{ending}", chunk=7)
    assert found.sizes["point"] > 20
    assert set(found["peak_deflection"].dims) == {"point", "joint"}
    assert found["worst_direction"].dims == ("point", "joint", "xyz")
    assert found["natural_frequency"].attrs["units"] == "Hz"
    assert found["joint"].values.tolist() == ["joint_1", "joint_2", "joint_3"]
    model = picchio.Model(robot)
    for k in range(0, found.sizes["point"], 5):
        row = found.isel(point=k)
        one = envelope_of(model, row["pose"].values, BLOWS)
        np.testing.assert_allclose(row["peak_deflection"], one.peak_deflection, rtol=1e-9)
        np.testing.assert_allclose(row["natural_frequency"], one.natural_frequencies, rtol=1e-9)
        np.testing.assert_allclose(row["position"], one.tool_position, atol=1e-9)
        asked = grid.rows(int(row["place"]), int(row["place"]) + 1)[0]
        np.testing.assert_allclose(row["position"], asked, atol=1e-7)
    found.close()
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"map{ending}"]


def test_both_endings_and_any_chunk_hold_the_same(tmp_path, robot):
    grid = places.joint_grid(robot, [2, 5, 5])
    maps = [
        workspace_map(robot, grid, BLOWS, tmp_path / name, chunk=chunk)
        for name, chunk in (("a.nc", 50), ("b.zarr", 50), ("c.nc", 3), ("d.zarr", 7))
    ]
    for other in maps[1:]:
        for name in maps[0].data_vars:
            np.testing.assert_array_equal(maps[0][name].values, other[name].values)


@pytest.mark.parametrize(("hits", "told"), [(None, "steady state"), (12, "12 hits from rest")])
@pytest.mark.parametrize("ending", [".nc", ".zarr"])
def test_envelopes_and_maps_say_which_response_they_are_of(tmp_path, robot, hits, told, ending):
    grid = places.joint_grid(robot, 2)
    with compute_map(robot, grid, BLOWS, tmp_path / f"m{ending}", hits=hits) as found:
        assert found.dataset.attrs["response"] == told == found.to_dict()["response"]
        assert told in found._repr_html_()
    shown = envelope_of(robot, (0.3, 1.1, -1.0), BLOWS, hits=hits)
    assert shown.to_dict()["response"] == told and told in shown._repr_html_()


def test_a_fixed_direction_and_surface_normals(tmp_path, robot):
    csv = tmp_path / "points.csv"
    csv.write_text("x [m],y [m],z [m],nx,ny,nz\n1.35,0,0.4,0,0,2\n1.35,0.25,0.65,0,0,1\n")
    listed = places.points_from_csv(csv)
    up = workspace_map(robot, listed, BLOWS, tmp_path / "a.nc", direction=[0, 0, 1])
    normal = workspace_map(robot, listed, BLOWS, tmp_path / "b.nc", direction="normal")
    np.testing.assert_array_equal(up["peak_deflection"], normal["peak_deflection"])
    assert np.abs(up["peak_deflection"].values[:, 0]).max() < 1e-12  # joint_1 feels no lift
    worst = workspace_map(robot, listed, BLOWS, tmp_path / "c.nc")
    assert (worst["peak_deflection"].values >= up["peak_deflection"].values - 1e-15).all()


def test_one_branch(tmp_path, robot):
    grid = places.plane(robot, "xz", spacing=0.3, bounds=[1.2, 1.6, 0.2, 0.8])
    every = workspace_map(robot, grid, BLOWS, tmp_path / "a.nc")
    up = workspace_map(robot, grid, BLOWS, tmp_path / "b.nc", branch="elbow-up")
    assert 0 < up.sizes["point"] < every.sizes["point"]
    assert len(set(up["place"].values.tolist())) == up.sizes["point"]


def test_rings_about_joint_2(tmp_path, robot):
    """In the plane of the arm the worst deflection of joints 2 and 3 hangs on the distance from
    joint 2 alone: rings, which the paper's Fig. 10 does not show."""
    found = workspace_map(robot, places.joint_grid(robot, [1, 9, 5]), BLOWS, tmp_path / "map.nc")
    distance = np.linalg.norm(found["position"].values - [0, 0, 0.4], axis=1).round(9)
    for radius in np.unique(distance):
        ring = found["peak_deflection"].values[distance == radius, 1:]
        # Elbow up and elbow down stand at one distance: two values at most.
        for j in range(2):
            assert len(np.unique((ring[:, j] / ring[0, j]).round(8))) <= 2


def test_bad_input(tmp_path, robot):
    grid = places.joint_grid(robot, 2)
    for options, part in (
        ({"direction": "best"}, "worst, normal"),
        ({"direction": [0, 0, 0]}, "zero length"),
        ({"branch": "elbow-left"}, "elbow-up"),
        ({"chunk": 0}, "chunk"),
    ):
        with pytest.raises(InputError, match=part):
            workspace_map(robot, grid, BLOWS, tmp_path / "map.nc", **options)
    with pytest.raises(InputError, match=r"\.nc, \.zarr"):
        workspace_map(robot, grid, BLOWS, tmp_path / "map.csv")
    far = places.plane(robot, "xz", bounds=[5, 6, 5, 6], spacing=0.5)
    with pytest.raises(InputError, match="no point of the map"):
        workspace_map(robot, far, BLOWS, tmp_path / "far.nc")
    with pytest.raises(InputError, match="bounds"):
        places.plane(robot, "xz", bounds=[1, 0, 0, 1], spacing=0.1)


COMMAND = "from picchio.cli.main import main; main()"


def start(out, *options, cwd):
    return subprocess.Popen(
        [
            sys.executable,
            "-c",
            COMMAND,
            "map",
            "fanuc_like_3dof",
            "--joint-grid",
            "10,60,60",
            "--chunk",
            "500",
            "--out",
            out,
            *options,
        ],
        cwd=cwd,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    )


def same(first, second):
    with (
        xarray.open_dataset(first, engine="h5netcdf") as a,
        xarray.open_dataset(second, engine="h5netcdf") as b,
    ):
        for name in a.data_vars:
            np.testing.assert_array_equal(a[name].values, b[name].values)


@pytest.mark.slow
@pytest.mark.parametrize("chunks_before", [1, 20, 50])
def test_a_map_killed_and_started_again_is_the_same_map(tmp_path, chunks_before):
    whole = start("whole.nc", "--workers", "0", cwd=tmp_path)
    assert whole.wait(300) == 0, whole.stderr.read()
    cut = start("cut.nc", "--workers", "0", cwd=tmp_path)
    folder = tmp_path / ".cut.nc.chunks"
    for _ in range(6000):
        if len(list(folder.glob("0*.npz"))) >= chunks_before or cut.poll() is not None:
            break
        time.sleep(0.005)
    cut.send_signal(signal.SIGKILL)
    assert cut.wait(60) == -signal.SIGKILL
    assert not (tmp_path / "cut.nc").exists()
    kept = {path.name: path.stat().st_mtime_ns for path in folder.glob("0*.npz")}
    again = start("cut.nc", "--workers", "0", cwd=tmp_path)
    assert again.wait(300) == 0, again.stderr.read()
    assert len(kept) >= chunks_before
    same(tmp_path / "whole.nc", tmp_path / "cut.nc")
    assert sorted(os.listdir(tmp_path)) == ["cut.nc", "whole.nc"]


@pytest.mark.parametrize("workers", [0, 1])
def test_one_worker_is_this_process(tmp_path, robot, monkeypatch, workers):
    monkeypatch.setitem(sys.modules, "distributed", None)  # importing it would fail
    grid = places.joint_grid(robot, [2, 3, 3])
    with workspace_map(robot, grid, BLOWS, tmp_path / "map.nc", workers=workers) as found:
        assert found.sizes["point"] == 18


@pytest.mark.parametrize("ending", [".nc", ".zarr"])
def test_rows_are_written_in_blocks(tmp_path, robot, monkeypatch, ending):
    """Blocks that end within a chunk, and chunks that end within a block."""
    grid = places.joint_grid(robot, [2, 5, 5])
    whole = workspace_map(robot, grid, BLOWS, tmp_path / f"whole{ending}")
    monkeypatch.setattr("picchio.studies.maps.files._ROWS", 12)
    for chunk in (5, 12, 31):
        cut = workspace_map(robot, grid, BLOWS, tmp_path / f"cut{chunk}{ending}", chunk=chunk)
        for name in whole.data_vars:
            np.testing.assert_array_equal(whole[name].values, cut[name].values)


def test_chunks_of_another_map_are_not_mixed_in(tmp_path, robot):
    grid = places.joint_grid(robot, [2, 3, 3])
    folder = tmp_path / ".map.nc.chunks"
    folder.mkdir()
    (folder / "plan.json").write_text("{}")
    with pytest.raises(InputError, match="another map"):
        workspace_map(robot, grid, BLOWS, tmp_path / "map.nc")


@pytest.mark.slow
def test_a_killed_dask_worker_costs_nothing_but_time(tmp_path, robot):
    from distributed import Client, LocalCluster

    grid = places.joint_grid(robot, [10, 60, 60])
    alone = workspace_map(robot, grid, BLOWS, tmp_path / "alone.nc", workers=0)
    alone.close()
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        killed = []

        def kill_one(done, total):
            if not killed:
                killed.append(next(iter(client.run(os.getpid).values())))
                os.kill(killed[0], signal.SIGKILL)

        found = workspace_map(
            robot,
            grid,
            BLOWS,
            tmp_path / "cluster.nc",
            chunk=1000,
            scheduler=cluster.scheduler_address,
            progress=kill_one,
        )
        found.close()
        assert killed
    same(tmp_path / "alone.nc", tmp_path / "cluster.nc")


def test_long_bursts_tell_their_progress(tmp_path, robot):
    told = []
    compute_map(
        robot, places.joint_grid(robot, [1, 10, 10]), BLOWS, tmp_path / "m.nc", hits=3000,
        direction=(1.0, 0.0, 0.0), workers=0, progress=lambda done, total: told.append(done),
    ).close()  # fmt: skip
    assert told == [0, 66, 100]
