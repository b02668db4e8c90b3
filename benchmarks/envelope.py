"""What the exact direction envelope of a pose costs, against the alternatives, in one run.

    python benchmarks/envelope.py [--json FILE] [--long]

Steady-state deflection of all joints, worst of all directions, on one core. Side by side:
Pinocchio's mass matrix and Jacobian alone (the floor); picchio, with them; the paper's procedure
in NumPy (200 harmonics, 512 samples, 642 directions); MuJoCo's time integration of the 3-DoF arm
to its steady state, for one direction. How far each is from the exact answer is printed beside its
time. Each is timed in turns, in the processor time of this thread, and the median of the ratios is
taken. Damage by rainflow, of a rivet from rest in one direction, is dearer: its ratio is printed,
too. --long adds how cost and memory go with up to 1e7 poses, the chunk and the cores, and those of
whole maps on disk.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import resource
import tempfile
import time
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from statistics import median
from typing import Any

import numba
import numpy as np
import pinocchio as pin
from numba import njit

import picchio
from picchio.core.files import atomic_write
from picchio.core.processes import on_threads
from picchio.fatigue.sn.curve import SNCurve
from picchio.model.linear_system import LinearSystem
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.joint import Shaft
from picchio.studies.envelopes import icosphere
from picchio.studies.maps import places
from picchio.studies.maps.run import workspace_map
from picchio.studies.rivet.poses import damage_at
from picchio.vibration.batch.peaks import batch_peaks

BLOWS = picchio.PulseTrain(force=300.0, period=0.040, width=0.004)
ROBOTS = {3: "fanuc_like_3dof", 6: "ur10", 7: "panda"}
POSE = np.array([0.3, 1.1, -1.0])
DIRECTION = np.array([0.48, 0.6, 0.64])
POSES = 4000
ROUNDS = 7
# Integrator, time step in s, periods until the last one is looked at.
MUJOCO = (("IMPLICITFAST", 1e-3, 120), ("RK4", 1e-3, 350), ("RK4", 1e-4, 350))

# Positions of each joint, and the file's ending: cubed, 1e4 to 1e7 poses.
MAPS = ((22, ".nc"), (22, ".zarr"), (46, ".nc"), (46, ".zarr"), (100, ".nc"), (100, ".zarr"),
        (215, ".zarr"))  # fmt: skip


def clock(work: Callable[[], object], now: Callable[[], float] = time.thread_time) -> float:
    began = now()
    work()
    return now() - began


def memory() -> float:
    """Most memory so far, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def random_poses(robot: FlexibleRobot, count: int) -> np.ndarray:
    lower = np.where(np.isfinite(robot.lower), robot.lower, -np.pi)
    upper = np.where(np.isfinite(robot.upper), robot.upper, np.pi)
    return np.random.default_rng(0).uniform(lower, upper, (count, len(lower)))


def floor(robot: FlexibleRobot, poses: np.ndarray) -> None:
    """The two calls that no pose can do without, and nothing else."""
    model, data = robot.rigid._model, robot.rigid._data()
    frame = robot.rigid.frame(robot.tool_point)
    every = poses if robot.rigid._plain else poses @ robot.rigid._follow.T
    for q in every:
        pin.crba(model, data, q)
        pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)


def ours(robot: FlexibleRobot, poses: np.ndarray, compiled: bool = True) -> np.ndarray:
    mass, jacobian = robot.mass_and_jacobian(poses)
    found = batch_peaks(
        mass, jacobian, robot.stiffness, robot.damping_ratio, BLOWS, compiled=compiled
    )
    return found.peak_deflection


def damaged(robot: FlexibleRobot, poses: np.ndarray, curve: SNCurve) -> None:
    """A rivet of 12 hits from rest in one direction, ring-down, cycles counted, in every joint."""
    curves = [curve] * len(robot.flexible_joints)
    damage_at(picchio.Model(robot), poses, [1.0, 0.0, 0.0], BLOWS, 12, curves)


def shafted(robot: FlexibleRobot) -> FlexibleRobot:
    """The robot with some shaft in every joint, so that there is a stress to count."""
    shaft = Shaft(radius=0.015, length=0.05, shear_modulus=79.3e9)
    joints = tuple(dataclasses.replace(j, shaft=shaft) for j in robot.flexible_joints)
    return dataclasses.replace(robot, flexible_joints=joints)


def plain(robot: FlexibleRobot, pose: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Paper eqs. 7-13: each mode's series summed once, then direction by direction."""
    from scipy.linalg import eigh

    state = robot.state(pose)
    squared, shapes = eigh(np.diag(state.stiffness), state.mass_matrix)
    base = 2 * np.pi / BLOWS.period
    j = np.arange(1, 201)
    duty = BLOWS.width / BLOWS.period
    a = BLOWS.force / (j * np.pi) * np.sin(2 * j * np.pi * duty)
    b = BLOWS.force / (j * np.pi) * (1 - np.cos(2 * j * np.pi * duty))
    r = j[:, None] * base / np.sqrt(squared)
    zeta = robot.damping_ratio[0]
    size = np.hypot(a, b)[:, None] / squared / np.sqrt((1 - r**2) ** 2 + (2 * zeta * r) ** 2)
    phase = np.arctan2(2 * zeta * r, 1 - r**2) + np.arctan2(b, a)[:, None]
    t = np.arange(512) / 512 * BLOWS.period
    waves = np.array(
        [
            BLOWS.force * duty / squared[i]
            + size[:, i] @ np.cos(np.outer(j * base, t) - phase[:, i, None])
            for i in range(len(squared))
        ]
    )
    peaks = np.zeros(len(squared))
    for n in directions:
        eta = (shapes.T @ state.jacobian.T @ n)[:, None] * waves
        peaks = np.maximum(peaks, np.abs(shapes @ eta).max(axis=1))
    return peaks


def mujoco_runs(robot: FlexibleRobot) -> list[dict[str, Any]]:
    """One pose, one direction, by time steps: what each setting costs, and how far off it is.

    MuJoCo's damping is one number a joint, which picchio takes, too, as other than modal damping.
    The force is a thousandth, so that the arm is linear to 1e-6; that changes no cost.
    """
    try:
        import mujoco
    except ImportError:
        return []
    state = robot.state(POSE)
    damping = 2 * 0.03 * robot.stiffness / (2 * np.pi * 6.0)
    system = LinearSystem(
        state.mass_matrix, np.diag(damping), np.diag(robot.stiffness), state.jacobian.T,
        np.eye(3), tuple(robot.flexible_names),
    )  # fmt: skip
    small = dataclasses.replace(BLOWS, force=1e-3 * BLOWS.force)
    response = picchio.steady_state(picchio.modal_analysis(system), small)
    exact = np.array([abs(peak.value) for peak in response.peaks(DIRECTION)])
    found = []
    for integrator, step, periods in MUJOCO:
        spec = mujoco.MjSpec.from_file(str(robot.source))
        spec.option.timestep = step
        spec.option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator}")
        spec.option.gravity = [0.0, 0.0, 0.0]
        model = spec.compile()
        model.jnt_stiffness[:], model.dof_damping[:] = robot.stiffness, damping
        data = mujoco.MjData(model)
        data.qpos[:] = model.qpos_spring[:] = POSE
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        jacobian = np.zeros((3, model.nv))
        mujoco.mj_jac(model, data, jacobian, None, state.tool_position, model.nbody - 1)
        push = small.force * DIRECTION @ jacobian
        on, off = round(BLOWS.width / step), round((BLOWS.period - BLOWS.width) / step)
        peak = np.zeros(3)
        began = time.thread_time()
        for _ in range(periods - 1):
            data.qfrc_applied[:] = push
            mujoco.mj_step(model, data, on)
            data.qfrc_applied[:] = 0.0
            mujoco.mj_step(model, data, off)
        for k in range(on + off):
            data.qfrc_applied[:] = push if k < on else 0.0
            mujoco.mj_step(model, data)
            peak = np.maximum(peak, np.abs(data.qpos - POSE))
        taken = time.thread_time() - began
        error = float(np.abs(peak / exact - 1.0).max())
        found.append(
            {"integrator": integrator, "step": step, "periods": periods, "seconds": taken,
             "error": error}
        )  # fmt: skip
    return found


def compare_dofs() -> tuple[dict[str, float], dict[str, float], dict[int, float]]:
    """Ratios to the floor, by degrees of freedom, without and with rainflow; our cost, us."""
    ratios: dict[str, float] = {}
    counted: dict[str, float] = {}
    costs: dict[int, float] = {}
    # No endurance limit: the whole ring-down is counted. (Its name is warned of; it is only cost.)
    warnings.simplefilter("ignore", picchio.PicchioWarning)
    curve = picchio.load_sn_curve("nie-2016")
    print("DoF  robot             two calls, us   picchio, us   ratio   ratio with rainflow")
    for dof, name in ROBOTS.items():
        robot = picchio.load_robot(name)
        poses = random_poses(robot, POSES)
        arm, few = shafted(robot), poses[: POSES // 20]
        ours(robot, few)
        damaged(arm, few, curve)
        alone, whole, rainflow, under = [], [], [], []
        for _ in range(ROUNDS):
            alone.append(clock(lambda: floor(robot, poses)))  # noqa: B023
            whole.append(clock(lambda: ours(robot, poses)))  # noqa: B023
            under.append(clock(lambda: floor(arm, few)))  # noqa: B023
            rainflow.append(clock(lambda: damaged(arm, few, curve)))  # noqa: B023
        costs[dof] = median(whole) / POSES * 1e6
        ratios[str(dof)] = round(median(w / a for w, a in zip(whole, alone, strict=True)), 2)
        counted[str(dof)] = round(median(d / a for d, a in zip(rainflow, under, strict=True)), 1)
        print(
            f"{dof:3d}  {name:16s}  {median(alone) / POSES * 1e6:13.2f}   {costs[dof]:11.2f}   "
            f"{ratios[str(dof)]:5.2f}   {counted[str(dof)]:19.1f}",
            flush=True,
        )
    return ratios, counted, costs


@njit(nogil=True)
def spin(first: int, last: int, out: np.ndarray) -> None:
    """Nothing but arithmetic, for a tenth of a second or so each: what the cores can give."""
    for k in range(first, last):
        x = 0.3
        for _ in range(60_000_000):
            x = 3.7 * x * (1.0 - x)
        out[k] = x


def on_cores(count: int, work: Callable[[], object]) -> float:
    """The wall's time of some work, s, while every thread of this process has so many cores."""
    cores = sorted(os.sched_getaffinity(0))
    numba.set_num_threads(count)
    try:
        _hold_threads(cores[:count])
        return clock(work, time.perf_counter)
    finally:
        _hold_threads(cores)
        numba.set_num_threads(1)


def _hold_threads(cores: Sequence[int]) -> None:
    for thread in os.listdir("/proc/self/task"):
        with suppress(ProcessLookupError):  # it has ended since
            os.sched_setaffinity(int(thread), cores)


def go_cores() -> None:
    """One core against all, in turns, the best of five of each (3 DoF)."""
    robot = picchio.load_robot(ROBOTS[3])
    block = random_poses(robot, 100_000)
    cores = numba.config.NUMBA_NUM_THREADS
    out = np.empty(cores)
    print(f"\n                                1 core, s   {cores} cores, s    gain    load")
    grid = places.joint_grid(robot, 100)

    def draw(path: Path) -> None:
        workspace_map(robot, grid, BLOWS, path, workers=1).close()

    def timed(count: int, work: Callable[[Path], object]) -> float:
        """In a folder of its own: to delete what was there before is not to draw a map."""
        with tempfile.TemporaryDirectory() as folder:
            return on_cores(count, lambda: work(Path(folder)))

    for name, work in {
        "arithmetic alone": lambda _: on_threads(spin, cores, 1, out),
        "kernels, 1e5 poses": lambda _: ours(robot, block),
        "a map of 1e6 poses, Zarr": lambda folder: draw(folder / "map.zarr"),
        "a map of 1e6 poses, netCDF": lambda folder: draw(folder / "map.nc"),
    }.items():
        timed(cores, work)
        both = [(timed(1, work), timed(cores, work)) for _ in range(5)]
        alone, together = (min(times) for times in zip(*both, strict=True))
        print(
            f"{name:28s}   {alone:10.2f}   {together:11.2f}   {alone / together:5.2f}   "
            f"{os.getloadavg()[0]:5.2f}",
            flush=True,
        )


def go_long() -> list[dict[str, Any]]:
    """Cost a pose and memory against poses, chunk and cores (3 DoF): kernel, then whole maps."""
    robot = picchio.load_robot(ROBOTS[3])
    rows: list[dict[str, Any]] = []
    print("\nkernel   poses   chunk  cores   us a pose   most memory so far, MB")
    runs = [(count, 4096, 1) for count in (10**4, 10**5, 10**6, 10**7)]
    runs += [(10**5, chunk, 1) for chunk in (64, 512, 32768)]
    runs += [(10**5, 4096, numba.config.NUMBA_NUM_THREADS)]
    for count, chunk, cores in runs:
        numba.set_num_threads(cores)
        block = random_poses(robot, chunk)

        def run(count: int = count, chunk: int = chunk, block: np.ndarray = block) -> None:
            for first in range(0, count, chunk):
                ours(robot, block[: count - first])

        # On several cores only the wall's clock tells what was gained.
        taken = clock(run, time.thread_time if cores == 1 else time.perf_counter) / count * 1e6
        rows.append({"poses": count, "chunk": chunk, "cores": cores, "us": taken, "MB": memory()})
        print(f"{count:14d}  {chunk:6d}  {cores:5d}   {taken:9.2f}   {memory():22.0f}", flush=True)
    numba.set_num_threads(1)
    print("\nmap on disk      poses   us a pose   most memory so far, MB")
    with tempfile.TemporaryDirectory() as folder:
        for ending in (".nc", ".zarr"):  # what they import
            start = Path(folder) / f"start{ending}"
            workspace_map(robot, places.joint_grid(robot, 3), BLOWS, start, workers=1).close()
        for side, ending in MAPS:
            out = Path(folder) / f"map{ending}"
            grid = places.joint_grid(robot, side)

            def draw(grid: places.Places = grid, out: Path = out) -> None:
                workspace_map(robot, grid, BLOWS, out, workers=1, restart=True).close()

            taken = clock(draw, time.process_time) / side**3 * 1e6
            rows.append({"map": ending, "poses": side**3, "us": taken, "MB": memory()})
            print(f"{ending:11s}  {side**3:9d}   {taken:9.2f}   {memory():22.0f}", flush=True)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", metavar="FILE")
    parser.add_argument("--long", action="store_true")
    parser.add_argument("--cores", action="store_true", help="one core against all, no more")
    options = parser.parse_args()
    numba.set_num_threads(1)
    arm = picchio.load_robot(ROBOTS[3])
    print("compiling, where it was not done before: about a minute ...", flush=True)
    ours(arm, POSE[None])
    if options.cores:
        go_cores()
        return
    ratios, counted, costs = compare_dofs()
    few = random_poses(arm, 50)
    own = float(np.abs(ours(arm, few) / ours(arm, few, compiled=False) - 1).max())
    directions = icosphere(3)[0]
    plain(arm, POSE, directions)
    seconds = median(clock(lambda: plain(arm, POSE, directions)) for _ in range(ROUNDS))
    off = float(np.abs(plain(arm, POSE, directions) / ours(arm, POSE[None])[0] - 1).max())
    print("\none pose of the 3-DoF arm                             s      error   times ours")
    print(f"picchio, all directions                    {costs[3] * 1e-6:12.7f}   {own:8.1e}")
    speedup_numpy = seconds / (costs[3] * 1e-6)
    print(
        f"plain NumPy, {len(directions)} directions                {seconds:12.7f}   {off:8.1e}   "
        f"{speedup_numpy:10,.0f}"
    )
    integrated = mujoco_runs(arm)
    for run in integrated:
        run["speedup"] = round(run["seconds"] / (costs[3] * 1e-6))
        label = f"MuJoCo, 1 direction, {run['integrator']}, {1e3 * run['step']:g} ms"
        print(f"{label:42s} {run['seconds']:12.7f}   {run['error']:8.1e}   {run['speedup']:10,d}")
    print(f"\nlargest memory of this run: {memory():.0f} MB")
    content = {
        "format": "picchio-benchmark/1",
        "ratio_to_floor": ratios,
        "ratio_to_floor_with_rainflow": counted,
        "speedup_numpy": round(speedup_numpy),
        # Of the finest setting: the one that comes nearest to our accuracy.
        "speedup_mujoco": integrated[-1]["speedup"] if integrated else None,
        "error": own,
        "error_numpy": off,
        "mujoco": integrated,
        "cores": 1,
    }
    if options.long:
        content["long"] = go_long()
    if options.json:
        with atomic_write(options.json) as stream:
            stream.write(json.dumps(content, indent=2) + "\n")


if __name__ == "__main__":
    main()
