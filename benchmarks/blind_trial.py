"""The blind trial of the diagnosis: hidden effects in data of independent simulators.

Every case is a campaign made by `tests/worlds` (own multibody dynamics, another integrator,
coloured noise, finite bandwidth, quantisation), whose causes, places and sizes a seed draws. The
diagnosis sees the campaign; the truth is opened afterwards. One line of JSON a case is written as
it goes, keyed by the case and the seeds' salt: run it again and it goes on where it was.

    python benchmarks/blind_trial.py --out trial.jsonl            # go on, or begin
    python benchmarks/blind_trial.py --out trial.jsonl --summary  # only print the tables
    python benchmarks/blind_trial.py --out new.jsonl --fresh      # seeds never used before
    python benchmarks/blind_trial.py --out part.jsonl --only single --most 20
"""

from __future__ import annotations

import argparse
import json
import math
import os
import secrets
import subprocess
import sys
from collections import Counter, defaultdict
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")
ROOT = Path(__file__).resolve().parent.parent
# Not the folder of benchmarks, which has a rainflow.py of its own.
sys.path[0] = str(ROOT / "tests" / "diagnosis")
ARM = "fanuc_like_3dof"
UNNAMEABLE = {"outside": "out of the catalogue", "left-out": "true cause taken out"}
SALT = 1  # of the seeds published in docs/; those with 0 were used while building


def cases(draws):
    """All cases, draw by draw, so that a trial cut short has seen a bit of everything."""
    from worlds.effects import EFFECTS
    from worlds.outside import EFFECTS as OUTSIDE

    for draw in range(draws):
        for effect in EFFECTS:
            yield {"robot": ARM, "kind": "single", "effect": effect, "snr": 40, "draw": draw}
        for kind in OUTSIDE:
            yield {"robot": ARM, "kind": "outside", "effect": kind, "snr": 40, "draw": draw}
        for n in range(12):
            yield {"robot": ARM, "kind": "pair", "snr": 40, "draw": 12 * draw + n}
        for n in range(4):
            yield {"robot": ARM, "kind": "triple", "snr": 40, "draw": 4 * draw + n}
        for n in range(40):
            yield {"robot": ARM, "kind": "null", "snr": 40, "draw": 40 * draw + n}
        for effect in EFFECTS:
            yield {"robot": ARM, "kind": "left-out", "effect": effect, "snr": 40, "draw": draw}
        for effect in EFFECTS:
            yield {"robot": ARM, "kind": "weak", "effect": effect, "snr": 20, "draw": draw}
        for robot in ("ur10", "kinova_gen3"):
            for n in range(10):
                yield {"robot": robot, "kind": "null", "snr": 40, "draw": 10 * draw + n}
            for n in range(3):
                yield {"robot": robot, "kind": "single", "snr": 40, "draw": 3 * draw + n}


def summary(rows):
    """The tables of docs/diagnosis.md."""
    skipped = Counter(row["verdict"] for row in rows if row["verdict"].startswith("not "))
    rows = [row for row in rows if not row["verdict"].startswith("not ")]
    kinds = defaultdict(list)
    for row in rows:
        kinds[(row["robot"], row["kind"], row["snr"])].append(row)
    print(f"{'robot':<18}{'kind':<10}{'SNR':>4}{'cases':>7}{'right':>9}  verdicts")
    for (robot, kind, snr), found in sorted(kinds.items()):
        right = sum(row["right"] for row in found)
        verdicts = dict(Counter(row["verdict"] for row in found))
        share = f"{right}/{len(found)}" if kind not in UNNAMEABLE else "-"
        print(f"{robot:<18}{kind:<10}{snr:>4}{len(found):>7}{share:>9}  {verdicts}")
    if skipped:
        print(f"left aside: {dict(skipped)}")
    nulls = [row for row in rows if row["kind"] == "null"]
    if nulls:
        alarms = sum(row["verdict"] != "nothing-wrong" for row in nulls)
        bound = upper_bound(alarms, len(nulls))
        print(f"\nfalse alarms: {alarms} in {len(nulls)}; rate below {100 * bound:.2g} % (95 %)")
    for kind, what in UNNAMEABLE.items():
        found = [row for row in rows if row["kind"] == kind]
        if found:
            named = sum(row["verdict"] == "named" for row in found)
            print(f"{what}: {named} of {len(found)} named wrongly")
    for kind in ("single", "pair", "triple", "weak"):
        found = [row for row in rows if row["kind"] == kind]
        wrong = [row for row in found if row["verdict"] == "named" and not row["right"]]
        if found:
            print(f"{kind}: {len(wrong)} of {len(found)} named, but not (or not only) what it was")
    errors = [
        e for row in rows if row["right"] and row["snr"] == 40 for e in row["errors"].values()
    ]
    if errors:
        size = sorted(abs(e[0]) for e in errors)
        print(
            f"parameters at 40 dB: {len(size)}, median error {100 * size[len(size) // 2]:.2g} %, "
            f"95th percentile {100 * size[int(0.95 * len(size))]:.2g} %"
        )
        pulls = [e[1] for e in errors if math.isfinite(e[1])]
        inside = sum(p <= 1.96 for p in pulls)
        print(f"95 % intervals cover {inside} of {len(pulls)}")
    for snr in (40, 20):
        gains = sorted(
            row["explained"] for row in rows
            if row["right"] and row["snr"] == snr and row["truth"] and row.get("explained")
        )  # fmt: skip
        if gains:
            print(
                f"held-out excess explained at {snr} dB: median {gains[len(gains) // 2]:.4f}, "
                f"lowest {gains[0]:.4f}, of {len(gains)}"
            )
    times = sorted(row["cpu_seconds"] for row in rows if row["robot"] == ARM and row["truth"])
    if times:
        print(
            f"CPU time a data set with a cause ({ARM}): median {times[len(times) // 2]:.0f} s, "
            f"95th percentile {times[int(0.95 * len(times))]:.0f} s"
        )
    effects = defaultdict(list)
    for row in rows:
        if row["kind"] == "single" and row["robot"] == ARM and row["truth"]:
            effects[row["truth"][0][0]].append(row["right"])
    for effect, found in sorted(effects.items()):
        if not all(found):
            print(f"  {effect}: {sum(found)} of {len(found)}")
    for row in rows:
        wrong = row["verdict"] == "named" if row["kind"] in UNNAMEABLE else not row["right"]
        if wrong:
            print("wrong:", row["case"], row["truth"], "->", row["verdict"], row["claimed"])


def upper_bound(events, cases):
    """Of a rate, 95 %, one-sided (Clopper and Pearson)."""
    from scipy.stats import beta

    return float(beta.ppf(0.95, events + 1, cases - events)) if events < cases else 1.0


def one(case, salt, method="diagnose"):
    """A row of the table; a case that fails is a wrong case, not the end."""
    import trial

    try:
        return trial.run(case, salt, method=method)
    except Exception as error:
        return {
            "case": trial.name_of(case), "robot": case["robot"], "kind": case["kind"],
            "snr": case["snr"], "truth": [], "verdict": f"failed: {error}",
            "claimed": [], "right": False, "errors": {},
        }  # fmt: skip


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="one line of JSON a case")
    parser.add_argument("--draws", type=int, default=5, help="of every effect")
    parser.add_argument("--only", help="cases whose name holds one of these, by commas")
    parser.add_argument("--most", type=int, default=10**9, help="stop after so many new cases")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="cases at once")
    parser.add_argument("--fresh", action="store_true", help="seeds never used before")
    parser.add_argument("--development", action="store_true", help="the seeds used while building")
    parser.add_argument("--method", default="diagnose", help="or: score-test, plain-bic")
    parser.add_argument("--summary", action="store_true", help="run nothing")
    given = parser.parse_args()
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
    if not given.summary:
        import trial

        done = {row["case"] for row in rows}
        todo = []
        for case in cases(given.draws):
            name = trial.name_of(case)
            wanted = not given.only or any(part in name for part in given.only.split(","))
            if name not in done and wanted:
                todo.append(case)
        todo = todo[: given.most]
        with (
            given.out.open("a") as stream,
            ProcessPoolExecutor(given.jobs, get_context("spawn")) as pool,
        ):
            running = [pool.submit(one, case, salt, given.method) for case in todo]
            for number, future in enumerate(as_completed(running), 1):
                row = future.result() | {"salt": salt, "commit": commit}
                stream.write(json.dumps(row) + "\n")
                stream.flush()
                rows.append(row)
                note = (row["case"], row["verdict"], row["claimed"])
                print(f"{number}/{len(todo)}", *note, file=sys.stderr)
    summary(rows)


if __name__ == "__main__":
    main()
