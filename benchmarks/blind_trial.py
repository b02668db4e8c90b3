"""The blind trial of the diagnosis: hidden effects in data of independent simulators.

Every case is a campaign made by `tests/worlds` (own multibody dynamics, another integrator,
coloured noise, finite bandwidth, quantisation), whose causes, places and sizes a seed draws. The
diagnosis sees the campaign; the truth is opened afterwards. One line of JSON a case is written as
it goes, keyed by the case and the seeds' salt: run it again and it goes on where it was.

    python benchmarks/blind_trial.py --out trial.jsonl            # go on, or begin
    python benchmarks/blind_trial.py --out trial.jsonl --summary  # only print the tables
    python benchmarks/blind_trial.py --out new.jsonl --fresh      # seeds never used before
    python benchmarks/blind_trial.py --out part.jsonl --only single --most 20
    python benchmarks/blind_trial.py --out trial.jsonl --summary --since b3ad859  # later code only
    python benchmarks/blind_trial.py --out trial.jsonl --summary --page trial.md
    python benchmarks/blind_trial.py --out trial.jsonl --against plain_bic.jsonl
    python benchmarks/blind_trial.py --out trial.jsonl --thin rows.jsonl  # what the tables need

Worlds that are a little wrong everywhere, by so many times the tolerances that the campaigns state:

    python benchmarks/blind_trial.py --out wrong.jsonl --mismatch 1 --seeds 0:20 \\
        --robots fanuc_like_3dof,ur10 --kinds null,single,pair,outside,left-out
    python benchmarks/blind_trial.py --out curve.jsonl --mismatch 0,0.5,1,2,4 --kinds single
    python benchmarks/blind_trial.py --out poses.jsonl --mismatch 1 --errors pose,pose_repeat
    python benchmarks/blind_trial.py --out wrong.jsonl --mismatch 1 --seeds 0:20 --summary
"""

from __future__ import annotations

import argparse
import json
import os
import secrets
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor, as_completed
from itertools import product
from multiprocessing import get_context
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
# Not the folder of benchmarks, which has a rainflow.py of its own.
sys.path[0] = str(ROOT / "tests" / "diagnosis" / "blind")
ARM = "fanuc_like_3dof"
SALT = 1  # of the seeds published in docs/; those with 0 were used while building


def cases(draws):
    """All cases, draw by draw, so that a trial cut short has seen a bit of everything."""
    from trial import SETS

    from worlds.effects import EFFECTS
    from worlds.outside import EFFECTS as OUTSIDE

    for draw in range(draws):
        for effect in EFFECTS:
            yield {"robot": ARM, "kind": "single", "effect": effect, "snr": 40, "draw": draw}
        for kind in OUTSIDE:
            yield {"robot": ARM, "kind": "outside", "effect": kind, "snr": 40, "draw": draw}
        for effect in EFFECTS:
            yield {"robot": ARM, "kind": "mixed", "effect": effect, "snr": 40, "draw": draw}
        for n in range(12):
            yield {"robot": ARM, "kind": "pair", "snr": 40, "draw": 12 * draw + n}
        for n in range(4):
            yield {"robot": ARM, "kind": "triple", "snr": 40, "draw": 4 * draw + n}
        for n in range(40):
            yield {"robot": ARM, "kind": "null", "snr": 40, "draw": 40 * draw + n}
        for n in range(20):
            yield {"robot": ARM, "kind": "null", "snr": 20, "draw": 20 * draw + n}
        for snr in (40, 20):
            for effect in EFFECTS:
                yield {"robot": ARM, "kind": "left-out", "effect": effect, "snr": snr, "draw": draw}
        for effect in EFFECTS:
            yield {"robot": ARM, "kind": "weak", "effect": effect, "snr": 20, "draw": draw}
        for effect in EFFECTS:
            yield {"robot": ARM, "kind": "few", "effect": effect, "snr": 40, "draw": draw}
        for effect in SETS:
            yield {"robot": ARM, "kind": "sets", "effect": effect, "snr": 40, "draw": draw}
        for n in range(20):
            yield {"robot": ARM, "kind": "few-null", "snr": 40, "draw": 20 * draw + n}
        for robot in ("ur10", "kinova_gen3"):
            for n in range(10):
                yield {"robot": robot, "kind": "null", "snr": 40, "draw": 10 * draw + n}
            for n in range(3):
                yield {"robot": robot, "kind": "single", "snr": 40, "draw": 3 * draw + n}


def wrong_cases(robots, kinds, seeds, times, sensors=None, keys=None, snr=40, effects=None):
    """Cases in worlds that are a little wrong, seed by seed.

    Args:
        robots, kinds: names.
        seeds: numbers of the draws.
        times: how many times its tolerance everything is off.
        sensors: that are read; accelerometer and deflections where None.
        keys: of what is off; everything where None.
        snr: dB.
        effects: names of what is hidden first, in turn; drawn where None.
    """
    more = {"sensors": sensors} if sensors else {}
    more |= {"only": keys} if keys else {}
    chosen = [{"effect": name} for name in effects or ()] or [{}]
    for draw, kind, own, robot, size in product(seeds, kinds, chosen, robots, times):
        head = {"robot": robot, "kind": kind, "snr": snr, "draw": draw}
        yield {**head, "mismatch": size, **more, **own}


def one(case, salt, method="diagnose", workers=1):
    """A row of the table; a case that fails is a wrong case, not the end."""
    import trial

    try:
        return trial.run(case, salt, method=method, workers=workers)
    except Exception as error:
        return {
            "case": trial.name_of(case), "robot": case["robot"], "kind": case["kind"],
            "snr": case["snr"], "truth": [], "verdict": f"failed: {error}",
            "claimed": [], "right": False, "errors": {},
            **({"mismatch": case["mismatch"], "outcome": "undecided",
                "sensors": "accelerometer" if case.get("sensors") else "all"}
               if "mismatch" in case else {}),
        }  # fmt: skip


def since(rows, commit):
    """Rows of code that has this commit's change."""
    told = subprocess.run(
        ["git", "rev-list", f"{commit}^..HEAD"], cwd=ROOT, capture_output=True, text=True
    )
    if told.returncode:
        raise SystemExit(f"--since {commit}: {told.stderr.strip()}")
    later = told.stdout.split()
    return [row for row in rows if any(full.startswith(row["commit"]) for full in later)]


def words(text):
    """Words by commas."""
    return [word for word in text.split(",") if word]


def numbers(text):
    """Numbers by commas."""
    return [float(word) for word in words(text)]


def span(text):
    """a:b as a range."""
    first, last = text.split(":")
    return range(int(first), int(last))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="one line of JSON a case")
    parser.add_argument("--draws", type=int, default=5, help="of every effect")
    parser.add_argument("--only", help="cases whose name holds one of these, by commas")
    parser.add_argument("--most", type=int, default=10**9, help="stop after so many new cases")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="cases at once")
    parser.add_argument("--workers", type=int, default=1, help="processes of each diagnosis")
    parser.add_argument("--fresh", action="store_true", help="seeds never used before")
    parser.add_argument("--development", action="store_true", help="the seeds used while building")
    parser.add_argument(
        "--method", default="diagnose", help="or: score-test, plain-bic, another checkout's folder"
    )
    parser.add_argument("--summary", action="store_true", help="run nothing")
    parser.add_argument("--cases", action="store_true", help="with --summary: all not right, too")
    parser.add_argument("--thin", type=Path, help="write what the tables need of the rows")
    parser.add_argument("--since", metavar="COMMIT", help="tables of rows since this change only")
    parser.add_argument("--against", type=Path, help="a simpler method's rows: compare")
    parser.add_argument(
        "--curve", metavar="NAME=ROWS", action="append", default=[],
        help="with --summary and --mismatch: other ways' rows, by size of mismatch",
    )  # fmt: skip
    parser.add_argument("--plot", type=Path, help="of --curve, a picture")
    parser.add_argument("--page", type=Path, help="a page whose tables to bring up to date")
    wrong = parser.add_argument_group("worlds that are a little wrong everywhere")
    wrong.add_argument("--mismatch", type=numbers, help="times the tolerances, by commas")
    wrong.add_argument("--robots", type=words, default=[ARM], help="by commas")
    wrong.add_argument("--kinds", type=words, default=["null", "single"], help="by commas")
    wrong.add_argument("--seeds", type=span, help="draws a:b, without b; 0:10")
    wrong.add_argument(
        "--sensors", type=words,
        help="such as accelerometer; with force among them it is read, not programmed; else all",
    )  # fmt: skip
    wrong.add_argument("--errors", type=words, help="keys of [tolerance] that are off; else all")
    wrong.add_argument("--effects", type=words, help="hidden first, in turn; else drawn")
    wrong.add_argument("--snr", type=int, default=40, help="dB")
    given = parser.parse_args()
    ways = ("diagnose", "score-test", "plain-bic")
    if given.method not in ways and not (Path(given.method) / "src" / "picchio").is_dir():
        parser.error(f"--method {given.method}: none of {', '.join(ways)}, and no checkout")
    rows = []
    if given.out.exists():
        rows = [json.loads(line) for line in given.out.read_text().splitlines() if line]
    salt = SALT
    if given.fresh:
        salt = secrets.randbits(31)
    elif given.development:
        salt = 0
    salt = rows[0]["salt"] if rows else salt
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True
    ).stdout.strip()
    if not (given.summary or given.against or given.thin):
        import trial

        import picchio

        for robot in given.robots:  # or a misspelt one is as many failed cases
            picchio.load_robot(robot)
        done = {row["case"] for row in rows}
        todo = []
        for case in cases(given.draws) if given.mismatch is None else wrong_cases(
            given.robots, given.kinds, given.seeds or range(10), given.mismatch, given.sensors,
            given.errors, given.snr, given.effects,
        ):  # fmt: skip
            name = trial.name_of(case)
            wanted = not given.only or any(part in name for part in given.only.split(","))
            if name not in done and wanted:
                todo.append(case)
        todo = todo[: given.most]
        with (
            given.out.open("a") as stream,
            ProcessPoolExecutor(given.jobs, get_context("spawn")) as pool,
        ):
            running = [pool.submit(one, case, salt, given.method, given.workers) for case in todo]
            for number, future in enumerate(as_completed(running), 1):
                row = future.result() | {"salt": salt, "commit": commit}
                stream.write(json.dumps(row) + "\n")
                stream.flush()
                rows.append(row)
                note = (row["case"], row["verdict"], row.get("claimed", ""))
                print(f"{number}/{len(todo)}", *note, file=sys.stderr)
    import trial_tables

    if given.thin:
        lines = (
            json.dumps(row, separators=(",", ":")) + "\n" for row in trial_tables.thinned(rows)
        )
        given.thin.write_text("".join(lines))
        return
    if given.curve:
        ways = {"picchio": rows}
        for name, _, path in (each.partition("=") for each in given.curve):
            ways[name] = trial_tables.read_rows(Path(path))
        trial_tables.print_curve(ways)
        if given.plot:
            trial_tables.draw_curve(ways, given.plot)
        return
    if given.mismatch is not None:
        rows = trial_tables.of_draws(rows, given.seeds, given.mismatch)
        told = since(rows, given.since) if given.since else rows
        trial_tables.mismatch_summary(told, given.cases)
        return
    if given.against:
        trial_tables.print_against(rows, trial_tables.read_rows(given.against))
        return
    if given.page:
        trial_tables.into_page(rows, given.page)
    trial_tables.summary(since(rows, given.since) if given.since else rows, given.cases)


if __name__ == "__main__":
    main()
