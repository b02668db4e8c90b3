"""The workspace map: peaks, directions and frequencies all over the workspace (paper Fig. 10).

The work is cut into chunks. Each finished chunk is a file of its own, written whole or not at all,
so that a map that was stopped resumes and a killed worker loses only its own chunk.
The chunks are then joined, one at a time, to one netCDF file or Zarr store.
"""

from __future__ import annotations

import hashlib
import json
from collections import deque
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any

import numpy as np

from picchio.core.errors import InputError, OutputError
from picchio.core.extras import need
from picchio.core.files import atomic_write, locked, temporary_folder, write_text, writing
from picchio.core.processes import one_thread
from picchio.core.provenance import provenance
from picchio.core.shown import seeing
from picchio.core.spread import require_scheduler, spread
from picchio.core.unfinished import remove, unfinished
from picchio.excitation.excitation import Excitation
from picchio.excitation.piecewise import check_hits
from picchio.model.model import Model, ModelLike
from picchio.robot.annotations.flexibility import estimate_notice
from picchio.studies.maps.chunk import LEVELS, Columns, MapJob
from picchio.studies.maps.files import join_chunks
from picchio.studies.maps.places import Places, plane
from picchio.studies.maps.result import WorkspaceMap
from picchio.studies.maps.stored import open_map
from picchio.studies.rivet.pose import need_springs
from picchio.studies.tasks import blows_of
from picchio.vibration.closed_form.response import described, unit_vector

SMALL_CHUNK, CHUNK, FAST_CHUNK = 64, 4096, 16384
# A burst of so many hits at as many poses takes about a second.
_HITS = 200_000
MOST_PLACES = 10**10
ENDINGS = (".nc", ".zarr")
# Fewer places than this are not worth starting workers for; and where compiled code takes some
# microseconds a place: to start two workers takes as long as two million places.
_WORTH_WORKERS, _WORTH_WORKERS_FAST = 50_000, 4_000_000
MOST_WORKERS = 1024
# Chunks that are computed, and held in memory, while others are written.
_AHEAD = 8

# What has been computed, with its rows where this process has them.
_Running = Generator[tuple[tuple[int, int], Columns | None]]


@one_thread()
def workspace_map(
    robot: ModelLike,
    places: Places | str = "xz",
    excitation: Excitation | None = None,
    out: str | Path | None = None,
    *,
    direction: Any = "worst",
    branch: str = "all",
    hits: int | None = None,
    damage: int | None = None,
    chunk: int | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    restart: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> WorkspaceMap:
    """Compute a map, or resume one that was stopped, and open it.

    Args:
        robot: as `load_robot` takes it, with stiffnesses; or a model of it.
        places: points or poses, as `picchio.plane` makes them; "xy", "xz" or "yz" is the plane
            through the world's origin, some fifty places wide.
        excitation: the blows; as in `envelope` if not given.
        out: `.nc` for netCDF, `.zarr` for Zarr. Unfinished work is kept beside it. A file that
            lasts as long as this process if not given.
        direction: (3,) for one force direction, "worst" for each joint's own worst, "normal" for
            the surface's normal.
        branch: "all" branches of the inverse kinematics, "any" one, or words that choose.
        hits: of a burst from rest; None for the steady state.
        damage: count the damage of a rivet of so many hits, too, from rest with its ring-down; for
            the worst direction it is searched, which takes many times as long.
        chunk: places at a time; 4096 if not given, 16384 where a place takes microseconds, down to
            64 where it takes long: with damage, many hits, or a model that is integrated in time.
        workers: processes; up to one, this process does the work itself. As many as cores, and
            none for small maps, if not given.
        scheduler: address of a dask scheduler to use instead.
        restart: discard what an interrupted map has left, instead of resuming it.
        progress: called with (places done, places in all).

    Returns:
        the map, opened lazily. Where a spring is an estimate, the peaks' P10, P50 and P90 of 64
        drawn robots stand beside those at the most likely values.

    Raises:
        InputError: an unknown ending, direction or branch; no flexible joint; no row at all.
    """
    model = Model.of(robot)
    robot = model.robot
    if isinstance(places, str):
        places = plane(robot, places)
    excitation = excitation or blows_of(robot)
    target = Path(out) if out is not None else temporary_folder() / "map.nc"
    if target.suffix not in ENDINGS:
        raise InputError("unknown ending", key="out", value=target.name, choices=ENDINGS)
    if target.suffix == ".zarr":
        need("zarr", "Zarr stores", "zarr")
    if not target.parent.is_dir():
        raise InputError("the folder does not exist", file=target)
    need_springs(robot)
    if not isinstance(direction, str):
        direction = tuple(float(c) for c in unit_vector(direction))
    elif direction not in ("worst", "normal"):
        raise InputError("unknown", key="direction", value=direction, choices=["worst", "normal"])
    if branch != "all":
        from picchio.robot.ik.branch import branch_words

        branch_words(robot, branch)
    if chunk is not None and chunk < 1:
        raise InputError("must be at least 1", key="chunk", value=chunk)
    if workers is not None and not 0 <= workers <= MOST_WORKERS:
        raise InputError(f"must lie between 0 and {MOST_WORKERS}", key="workers", value=workers)
    if len(places) > MOST_PLACES:
        raise InputError(
            f"{len(places):.3g} places are more than the {MOST_PLACES:.0e} of one map",
            key="places",
            hint="take a wider spacing or a coarser grid",
        )
    if hits is None:
        model.refuse("steady state")
    if model.nonlinear and (direction == "worst" or damage is not None):
        raise InputError(
            "a map of a nonlinear model needs one force direction and no damage: every place is "
            "integrated in time",
            key="direction",
            value=direction,
            hint="give --direction x,y,z",
        )
    for key, count in {"hits": hits, "damage": damage}.items():
        if count is not None:
            check_hits(count, key)
    if damage is not None and all(joint.shaft is None for joint in robot.flexible_joints):
        raise InputError(
            "no joint has a shaft, so damage cannot be computed",
            key="damage",
            hint="give shafts in a sidecar",
        )
    job = MapJob(model, excitation, places, direction, branch, hits, damage)
    if chunk is None:
        slow = damage is not None or model.nonlinear
        most = SMALL_CHUNK if slow else FAST_CHUNK if job.fast else CHUNK
        chunk = min(most, max(SMALL_CHUNK, _HITS // (hits or 1)))
    if scheduler is not None:
        require_scheduler(scheduler)
    with locked(target), ExitStack() as opened:
        if restart:
            remove(_folder_of(target))
        folder = opened.enter_context(unfinished(lambda: _folder(target), _tidied))
        _label(folder, job, chunk)
        spans = [(k, min(k + chunk, len(places))) for k in range(0, len(places), chunk)]
        missing = [span for span in spans if not _file(folder, span).exists()]
        tell = progress or (lambda done, total: None)
        tell(done := len(places) - sum(last - first for first, last in missing), len(places))

        def finished() -> Iterator[Columns]:
            """The chunks in order; they are joined while workers compute those that follow."""
            nonlocal done
            fresh: dict[tuple[int, int], Columns | None] = {}
            lacking = set(missing)
            running = _run(job, folder, missing, workers, scheduler)
            with closing(running):
                for span in spans:
                    while span in lacking:
                        (first, last), columns = next(running)
                        fresh[first, last] = columns
                        lacking.discard((first, last))
                        done += last - first
                        tell(done, len(places))
                    yield fresh.pop(span, None) or _read(_file(folder, span))

        try:
            join_chunks(target, finished(), _attributes(job))
        except OutputError:  # a full disk wants room, not the chunks
            remove(folder)
            raise
        remove(folder)
    found = WorkspaceMap(open_map(target), target)
    return seeing(found, robot=model, excitation=excitation, hits=hits)


def _folder_of(target: Path) -> Path:
    return target.with_name(f".{target.name}.chunks")


def _folder(target: Path) -> Path:
    folder = _folder_of(target)
    with writing(target):
        folder.mkdir(exist_ok=True)
    return folder


def _tidied(folder: Path) -> None:
    """What an interrupted map leaves: whole chunks, from which it resumes, or nothing."""
    for part in folder.glob(".*.part"):
        remove(part)
    if not any(folder.glob("*.npz")):
        remove(folder)


def _label(folder: Path, job: MapJob, chunk: int) -> None:
    """Say whose chunks are in the folder; those of another map are not touched."""
    plan = _attributes(job) | {
        "robot": [hashlib.sha256(path.read_bytes()).hexdigest() for path in job.model.robot.files],
        "tool": job.model.robot.tool_frame,
        "joints": [repr(joint) for joint in job.model.robot.flexible_joints],
        "mounting": repr(job.model.robot.mounting),
        "places": job.places.describe(),
        "chunk": chunk,
        "provenance": provenance()["picchio"],
    }
    text = json.dumps(plan, sort_keys=True)
    label = folder / "plan.json"
    if label.exists() and label.read_text() != text:
        raise InputError(
            "holds the unfinished chunks of another map",
            file=folder,
            hint="--restart discards them; or write to another file",
        )
    if not label.exists():
        write_text(label, text)


def _file(folder: Path, span: tuple[int, int]) -> Path:
    return folder / f"{span[0]:015d}.npz"


def _read(path: Path) -> Columns:
    with np.load(path) as stored:
        return {name: stored[name] for name in stored.files}


def _kept(job: MapJob, folder: Path, span: tuple[int, int]) -> Columns:
    """Compute one chunk and write its file, into a folder."""
    columns = job.compute(*span)
    with atomic_write(_file(folder, span), "wb") as stream:
        np.savez(stream, **columns)  # type: ignore[arg-type]
    return columns


def compute_chunk(work: tuple[MapJob, Path], span: tuple[int, int]) -> tuple[int, int]:
    """What a worker does: it hands over no more than the file."""
    _kept(*work, span)
    return span


def _here(job: MapJob, folder: Path, missing: list[tuple[int, int]]) -> _Running:
    """Compute in this process; the next chunks of a fast map while those before are written."""
    if not job.fast:
        for span in missing:
            yield span, _kept(job, folder, span)
        return
    from numba import get_num_threads, set_num_threads

    waiting: deque[tuple[tuple[int, int], Future[Columns]]] = deque()
    # A thread a core, each with chunks of its own; this one joins what they have done.
    pool = ThreadPoolExecutor(get_num_threads(), initializer=set_num_threads, initargs=(1,))
    try:
        for span in missing:
            waiting.append((span, pool.submit(_kept, job, folder, span)))
            if len(waiting) > _AHEAD:
                span, future = waiting.popleft()
                yield span, future.result()
        for span, future in waiting:
            yield span, future.result()
    finally:
        pool.shutdown(cancel_futures=True)


def _run(
    job: MapJob,
    folder: Path,
    missing: list[tuple[int, int]],
    workers: int | None,
    scheduler: str | None,
) -> _Running:
    places = sum(last - first for first, last in missing)
    worth = _WORTH_WORKERS_FAST if job.fast else _WORTH_WORKERS
    alone = places < worth if workers is None else workers <= 1
    if not missing or (scheduler is None and alone):
        yield from _here(job, folder, missing)
        return
    for span in spread(compute_chunk, (job, folder), missing, workers=workers, scheduler=scheduler):
        yield span, None


def _attributes(job: MapJob) -> dict[str, Any]:
    robot = job.model.robot
    notice = estimate_notice(robot.name, robot.origins)
    unbanded = (
        "The map of a nonlinear model is at the most likely values alone, without P10 and P90"
        if notice and not job.cases
        else ""
    )
    return {
        "format": "picchio-map/1",
        "robot": robot.name,
        "joint": list(robot.flexible_names),
        "joint_kinds": [joint.kind for joint in robot.flexible_joints],
        "coordinate": list(robot.joint_names),
        "level": list(LEVELS) if job.cases else [],
        "excitation": job.excitation.describe(),
        "direction": str(job.direction),
        "branch": job.branch,
        "effects": [repr(effect) for effect in job.model.effects],
        "estimated": int(bool(notice)),
        "notes": [*filter(None, [notice, unbanded]), *job.model.without_load()],
        "hits": job.hits or 0,
        "response": described(job.hits),
        "hits_of_damage": job.damage or 0,
        "provenance": json.dumps(provenance(robot.files)),
    }
