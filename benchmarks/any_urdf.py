"""Does any URDF get an answer? A folder of them, each assessed from the file alone.

    python benchmarks/any_urdf.py FOLDER [--most N] [--json FILE]   # the *.urdf below it
    python benchmarks/any_urdf.py shipped                 # the robots of `picchio robots`

Each is loaded and assessed on the default task in a process of its own, so that a crash is counted
and not suffered. Where several frames could carry the tool (two arms, legs, wheels, fingers),
picchio asks for `--tool`: such files are counted apart, with the first frame that it names. Files
of the same bytes count once. Printed: how many loaded, how many of those got an interval, the
slowest, and why the others were refused; how many joints that can move are in no answer and not
named, and how many answers change with the number that stands at every effort limit (`--efforts`:
10, 100 and 1000, and what enters the answer must be the same). No URDF is part of picchio: a good
folder is the data set of Tola and Corke, "Understanding URDF: a dataset and analysis"
(github.com/Daniella1/urdf_files_dataset).
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import random
import re
import tempfile
import time
import warnings
from collections import Counter, defaultdict
from dataclasses import replace
from pathlib import Path
from typing import Any

import picchio
from picchio.core.errors import InputError
from picchio.robot.loading.catalogue import shipped_robots
from picchio.robot.urdf.tree import LOCKED, MOVABLE
from picchio.studies.default_task import default_task

LIMIT = 10.0
"""s of one core that an answer may take, importing what is needed not counted."""


EFFORTS = (10, 100, 1000)
"""N m, limits that people fill in where they know none."""


def with_efforts(urdf: Path, folder: str, effort: int) -> Path:
    """A copy of a URDF with one effort limit at every joint."""
    text = urdf.read_bytes()
    copy = Path(folder) / f"{urdf.stem}-{effort}.urdf"
    copy.write_bytes(
        re.sub(rb"(?<![\w:])effort\s*=\s*([\"'])[^\"']*\1", b'effort="%d"' % effort, text)
    )
    return copy


def enters(robot: Any) -> tuple[Any, ...]:
    """What of a robot's drives enters an answer."""
    spreads = {name: (one.value, one.size) for name, one in robot.spreads.items()}
    posterior = robot.posterior and (robot.posterior.names, robot.posterior.correlation)
    return [replace(one, effort_limit=0.0) for one in robot.flexible_joints], spreads, posterior


def flips(urdf: Path, tool: str | None) -> bool:
    """Whether an answer depends on the number that stands at every effort limit."""
    with tempfile.TemporaryDirectory() as folder:
        robots = [with_efforts(urdf, folder, effort) for effort in EFFORTS]
        tried = [enters(picchio.load_robot(robot, tool=tool)) for robot in robots]
        return any(one != tried[0] for one in tried)


def answer(robot: str, end: Any, asked: argparse.Namespace) -> None:
    """Load and assess one robot; what came of it goes through the pipe."""
    found: dict[str, Any] = {"step": "load"}
    began = time.process_time()
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            loaded = loaded_with_a_tool(robot, found)
            found |= {"step": "assess", "joints": len(loaded.flexible_joints)}
            life = picchio.assess(loaded, default_task(loaded), uncertainty=not asked.quick)
            ends = life.uncertainty.utilisation if life.uncertainty else {}
            found["interval"] = bool(ends) and 0.0 < ends["p10"] < ends["p90"] < math.inf
            found |= {"step": "answer", "verdict": life.verdict.status}
            told = {gap.joint for gap in life.verdict.not_assessed if gap.part == "joint"}
            moving = {j.name for j in loaded.tree.joints.values() if j.type in (*MOVABLE, *LOCKED)}
            found["unnamed"] = sorted(moving - told - {joint.name for joint in life.joints})
            out = any(one.moves_tool for one in life.left_out)
            found["safe_over_a_gap"] = out and life.verdict.status == "safe"
            if asked.efforts:
                found["flipped"] = flips(loaded.source, found.get("tool"))
        except InputError as error:
            found["why"] = str(error)
        except Exception as error:
            found |= {"why": f"{type(error).__name__}: {error}", "crash": True}
    found["seconds"] = time.process_time() - began
    found["told"] = sum("inertia" in str(w.message) or "mass" in str(w.message) for w in said)
    end.send(found)


def loaded_with_a_tool(robot: str, found: dict[str, Any]) -> Any:
    """The robot; of several frames that could carry its tool the first one's, and which that is."""
    try:
        return picchio.load_robot(robot)
    except InputError as error:
        if error.key != "tool" or not error.choices:
            raise
        found["tool"] = str(error.choices[0])
        return picchio.load_robot(robot, tool=found["tool"])


def warm_up() -> None:
    """Import what is needed once, before the processes part; no compiled code runs yet.

    What runs on threads must not have run before a fork.
    """
    import picchio.cli.life.assess
    import picchio.studies.rivet.damage_kernel
    import picchio.studies.uncertainty.sampler  # noqa: F401


def ask(robot: str, asked: argparse.Namespace) -> dict[str, Any]:
    """The answer, or how the process that looked for it ended."""
    ours, theirs = multiprocessing.Pipe(duplex=False)
    process = multiprocessing.get_context("fork").Process(
        target=answer, args=(robot, theirs, asked)
    )
    process.start()
    theirs.close()
    found: dict[str, Any] = {"step": "load", "crash": True, "seconds": math.nan}
    if ours.poll(20.0 * LIMIT):
        try:
            found = ours.recv()
        except EOFError:
            found["why"] = "the process died"
    else:
        found["why"] = "no answer in time"
        process.kill()
    process.join()
    return found


def kind(why: str) -> str:
    """A refusal without its file, names and numbers."""
    text = re.sub(r"^.*?\.urdf: ", "", why)
    text = re.sub(r"'[^']*'", "'...'", text)
    return re.sub(r"\d[\d.e+-]*", "#", text)[:110]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", help="a folder, or `shipped`")
    parser.add_argument("--most", type=int, help="so many of them, drawn; all if not given")
    parser.add_argument("--efforts", action="store_true", help="each again with placeholders")
    parser.add_argument("--quick", action="store_true", help="no intervals: stated values only")
    parser.add_argument("--json", type=Path, help="write every answer")
    asked = parser.parse_args()
    if asked.folder == "shipped":
        names = sorted(shipped_robots())
    else:
        paths = sorted(Path(asked.folder).rglob("*.urdf"))
        names = [str(path) for path in {path.read_bytes(): path for path in paths[::-1]}.values()]
        names.sort()
    if asked.most is not None and asked.most < len(names):
        print(f"{asked.most} of {len(names)}, drawn")
        names = sorted(random.Random(0).sample(names, asked.most))
    warm_up()
    all_found = {}
    for name in names:
        all_found[name] = found = ask(name, asked)
        print(f"{found['step']:7s} {found['seconds']:6.2f} s  {name}  {found.get('why', '')[:150]}",
              flush=True)  # fmt: skip
    asked_for = {n: f for n, f in all_found.items() if "tool" in f}
    several = sum(bool(f.get("interval")) for f in asked_for.values())
    loaded = {n: f for n, f in all_found.items() if f["step"] != "load" and n not in asked_for}
    told = {n: f for n, f in loaded.items() if f.get("interval")}
    fast = [n for n, f in told.items() if f["seconds"] < LIMIT]
    refused: dict[str, list[str]] = defaultdict(list)
    for name, found in all_found.items():
        if not found.get("interval"):
            refused[f"{found['step']}: {kind(found.get('why', 'no interval'))}"].append(name)
    share = 100 * len(told) / max(len(loaded), 1)
    print(
        f"\n{len(names)} files; loaded {len(loaded)}; an interval of {len(told)} of these "
        f"({share:.1f} %), of {len(fast)} within {LIMIT:g} s"
    )
    print(f"asked for --tool: {len(asked_for)}; with the first frame named {several} of these "
          f"get an interval")  # fmt: skip
    if told:
        slowest = max(told, key=lambda n: told[n]["seconds"])
        print(f"slowest: {told[slowest]['seconds']:.1f} s, {slowest}")
    print(f"crashes: {sum(bool(f.get('crash')) for f in all_found.values())}")
    print("verdicts:", dict(Counter(f["verdict"] for f in told.values())))
    answered = [f for f in all_found.values() if f["step"] == "answer"]
    print(
        f"of {len(answered)} answers: with a joint that is nowhere named "
        f"{sum(bool(f.get('unnamed')) for f in answered)}, safe over a joint left out "
        f"{sum(bool(f.get('safe_over_a_gap')) for f in answered)}, changed by which number stands "
        f"at every effort limit {sum(bool(f.get('flipped')) for f in answered)}"
    )
    for why, those in sorted(refused.items(), key=lambda one: -len(one[1])):
        print(f"{len(those):4d}  {why}   such as {Path(those[0]).name}")
    if asked.json:
        asked.json.write_text(json.dumps(all_found, indent=1))


if __name__ == "__main__":
    main()
