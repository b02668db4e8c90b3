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
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")
ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests" / "diagnosis"))
SALT = 1  # of the seeds published in docs/; those with 0 were used while building


def cases(draws):
    from worlds.effects import EFFECTS
    from worlds.outside import EFFECTS as OUTSIDE

    arm = "fanuc_like_3dof"
    for draw in range(draws):
        for effect in EFFECTS:
            yield {"robot": arm, "kind": "single", "effect": effect, "snr": 40, "draw": draw}
        for kind in OUTSIDE:
            yield {"robot": arm, "kind": "outside", "effect": kind, "snr": 40, "draw": draw}
        for n in range(12):
            yield {"robot": arm, "kind": "pair", "snr": 40, "draw": 12 * draw + n}
        for n in range(4):
            yield {"robot": arm, "kind": "triple", "snr": 40, "draw": 4 * draw + n}
        for n in range(50):
            yield {"robot": arm, "kind": "null", "snr": 40, "draw": 50 * draw + n}
        for robot in ("ur10", "kinova_gen3"):
            for n in range(3):
                yield {"robot": robot, "kind": "single", "snr": 40, "draw": 3 * draw + n}
                yield {"robot": robot, "kind": "null", "snr": 40, "draw": 3 * draw + n}


def summary(rows):
    kinds = defaultdict(list)
    for row in rows:
        kinds[(row["robot"], row["kind"], row["snr"])].append(row)
    print(f"{'robot':<18}{'kind':<10}{'SNR':>4}{'cases':>7}{'right':>8}{'verdicts':>10}")
    for (robot, kind, snr), found in sorted(kinds.items()):
        right = sum(row["right"] for row in found)
        verdicts = dict(Counter(row["verdict"] for row in found))
        share = f"{right}/{len(found)}" if kind != "outside" else "-"
        print(f"{robot:<18}{kind:<10}{snr:>4}{len(found):>7}{share:>8}   {verdicts}")
    nulls = [row for row in rows if row["kind"] == "null"]
    if nulls:
        alarms = sum(row["verdict"] != "nothing-wrong" for row in nulls)
        bound = 1.0 - 0.05 ** (1.0 / len(nulls)) if alarms == 0 else math.nan
        print(f"\nfalse alarms: {alarms} in {len(nulls)}; rate below {100 * bound:.2g} % (95 %)")
    outside = [row for row in rows if row["kind"] == "outside"]
    if outside:
        named = sum(row["verdict"] == "named" for row in outside)
        print(f"out of the catalogue: {named} of {len(outside)} named wrongly")
    errors = [e[0] for row in rows if row["right"] for e in row["errors"].values()]
    if errors:
        size = sorted(abs(e) for e in errors)
        print(
            f"parameters: {len(size)}, median error {100 * size[len(size) // 2]:.2g} %, "
            f"95th percentile {100 * size[int(0.95 * len(size))]:.2g} %"
        )
        pulls = [e[1] for row in rows if row["right"] for e in row["errors"].values()]
        pulls = [p for p in pulls if math.isfinite(p)]
        inside = sum(p <= 1.96 for p in pulls)
        print(f"95 % intervals cover {inside} of {len(pulls)}")
    wrong = [row for row in rows if not row["right"] and row["kind"] in ("single", "pair", "null")]
    for row in wrong:
        print("wrong:", row["case"], row["truth"], "->", row["verdict"], row["claimed"])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="one line of JSON a case")
    parser.add_argument("--draws", type=int, default=5, help="of every effect")
    parser.add_argument("--only", help="cases whose name holds this")
    parser.add_argument("--most", type=int, default=10**9, help="stop after so many new cases")
    parser.add_argument("--fresh", action="store_true", help="seeds never used before")
    parser.add_argument("--summary", action="store_true", help="run nothing")
    given = parser.parse_args()
    rows = []
    if given.out.exists():
        rows = [json.loads(line) for line in given.out.read_text().splitlines() if line]
    salt = rows[0]["salt"] if rows else (secrets.randbits(31) if given.fresh else SALT)
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True
    ).stdout.strip()
    if not given.summary:
        import trial

        done = {row["case"] for row in rows}
        new = 0
        with given.out.open("a") as stream:
            for case in cases(given.draws):
                name = trial.name_of(case)
                if name in done or (given.only and given.only not in name):
                    continue
                if new >= given.most:
                    break
                try:
                    row = trial.run(case, salt)
                except Exception as error:  # a case that fails is a wrong case, not the end
                    row = {
                        "case": name, "robot": case["robot"], "kind": case["kind"],
                        "snr": case["snr"], "truth": [], "verdict": f"failed: {error}",
                        "claimed": [], "right": False, "errors": {},
                    }  # fmt: skip
                row |= {"salt": salt, "commit": commit}
                stream.write(json.dumps(row) + "\n")
                stream.flush()
                rows.append(row)
                new += 1
                print(name, row["verdict"], row["claimed"], file=sys.stderr)
    summary(rows)


if __name__ == "__main__":
    main()
