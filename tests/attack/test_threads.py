"""Linear algebra uses one thread a process in what picchio computes, whatever is set outside."""

import re

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import picchio
from picchio.core.processes import one_thread
from picchio.core.workers import worker_pool


def blas_threads(_=None):
    return [pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"]


@pytest.fixture
def two():
    np.linalg.inv(np.eye(3))
    with threadpool_limits(2, user_api="blas"):
        if set(blas_threads()) != {2}:
            pytest.fail("a BLAS that cannot be set")
        yield


def test_parent_and_workers_use_one(two):
    with one_thread():
        assert set(blas_threads()) == {1}
        with worker_pool(2, {"look": blas_threads}) as mapped:
            assert {n for found in mapped("look", range(4)) for n in found} == {1}
    assert set(blas_threads()) == {2}  # as the user had it


def test_every_study_does(two, monkeypatch):
    """A function that computes is marked by `one_thread`; it is the outermost of its frames."""
    found = {}
    for name in ("assess", "allowable", "uncertain_life", "envelope", "workspace_map", "place",
                 "check", "diagnose", "identify", "simulate", "fit_sn", "reproduce"):  # fmt: skip
        function = getattr(picchio, name)
        found[name] = function.__wrapped__.__name__ if hasattr(function, "__wrapped__") else None
    assert found == {name: name for name in found}
    seen = []
    robot = picchio.load_robot("fanuc_like_3dof")
    task = picchio.load_task(robot.task_path, robot)
    first = type(robot).state

    def look(self, *arguments, **options):
        seen.append(set(blas_threads()))
        return first(self, *arguments, **options)

    monkeypatch.setattr(type(robot), "state", look)
    picchio.assess(robot, task)
    assert seen and all(threads == {1} for threads in seen)


def test_nothing_sets_the_users_variables(repository):
    """A benchmark, a page or a test runs under what a user gets."""
    files = [
        path
        for folder in (".ci", "benchmarks", "docs", "notebooks", "tests")
        for path in (repository / folder).rglob("*")
        if path.suffix in ("", ".py", ".md", ".ipynb", ".sh") and path.is_file()
    ]
    assert len(files) > 100
    naming = {path for path in files if re.search(r"(OMP|OPENBLAS|MKL)_NUM_THREADS", text(path))}
    assert not naming


def text(path):
    return path.read_text("utf-8", errors="replace")


def test_a_warning_still_points_at_the_users_line():
    robot = picchio.load_robot("fanuc_like_3dof")
    with pytest.warns(picchio.PicchioWarning, match="overdamped") as loaded:
        picchio.load_robot("fanuc_like_3dof", values={"joint_1": {"damping_ratio": 1.5}})
    task = picchio.load_task(robot.task_path, robot)
    with pytest.warns(picchio.PicchioWarning, match="nie-2016") as assessed:
        picchio.assess(robot, task, method="paper", steady_check=False)
    assert {warning.filename for warning in [*loaded, *assessed]} == {__file__}
