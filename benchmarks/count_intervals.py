"""How often the 90 % intervals of a count hold the truth, and how far a known force is from it.

    python benchmarks/count_intervals.py [--shifts 100] [--told force] [--exact]

Each shift is a robot of its own: stiffness and damping of each joint, the gain of its force sensor
(or the tool's force, where it is not logged), the model's error and the strength of each shaft are
drawn once for all of its blows. Its log is read at 2 kHz: ten samples a blow. What it suffered is
computed by scipy's oscillators and the `rainflow` package (`tests/ledger/shift.py`).

`--exact`: the nominal robot, a calibrated force at 5 kHz (25 samples a blow): the largest error.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np

sys.path[:1] = [
    str(Path(__file__).resolve().parents[1] / part) for part in ("tests", "tests/ledger")
]

import shift  # noqa: E402

import picchio  # noqa: E402

NAME = "fanuc_like_3dof"
FORCE, WIDTH = 2000.0, 0.005
SCATTER = 0.04  # of log10 strength
SPREADS = {"stiffness": 0.05, "damping": 0.20, "model": 0.10}
GAIN = {"force": 0.05, "acceleration": 0.05, "trigger": 0.15}
SENSOR = 0.05  # of an accelerometer's gain

TASK = f"""format = "picchio-task/1"
hits_per_rivet = 12
[excitation]
kind = "half_sine_train"
force = {FORCE}
period = 0.04
width = {WIDTH}
"""


def world(rng, told):
    normal = rng.standard_normal
    return {
        "stiffness": np.exp(SPREADS["stiffness"] * normal(3)),
        "damping": float(np.exp(SPREADS["damping"] * normal())),
        "load": np.exp(SPREADS["model"] * normal()) * 10.0 ** (-SCATTER * normal(3)),
    }, float(np.exp(GAIN[told] * normal()))


def logged(made, true, rng, told, real):
    """The table of a log: what its sensors read of the true blows."""
    rate, end = 2000.0, made[-1].begin + 2.0
    table = shift.log(made, rng, rate=rate, length=end)
    if told == "force":
        return table
    if told == "trigger":
        # The tool runs through its twelve blows.
        clock = np.arange(len(table)) / rate
        on = sum((clock >= r.begin) & (clock < r.begin + 11.5 * 0.04) for r in made)
        return table.drop(columns=["fx", "fy", "fz"]).assign(on=on.astype(float))
    world_only = {k: v for k, v in real.items() if k != "load"}
    reading = shift.felt(NAME, true, end, **world_only)[:: int(1.0 / rate / shift.STEP)]
    reading = reading[: len(table)] * np.exp(SENSOR * rng.standard_normal())
    reading = reading + 0.05 * rng.standard_normal(reading.shape)
    return table.assign(**dict(zip(("fx", "fy", "fz"), reading.T, strict=True)))


def mapping(told):
    text = shift.MAPPING
    if told == "acceleration":
        text = text.replace("force.", "acceleration.tool.")
        text = text.split("[blows]")[0]
    if told == "trigger":
        head, *parts = text.split("[[channel]]")
        kept = [part for part in parts if "force." not in part]
        kept[-1] = kept[-1].split("[blows]")[0]
        text = "[[channel]]".join([head, '\nfrom = "on"\nto = "trigger"\n', *kept])
    return text


def one(folder, rng, told, exact):
    even = (0.95, 1.05) if told == "trigger" else (0.7, 1.1)
    made = shift.rivets(3, rng, force=FORCE)
    for rivet in made:
        rivet.peaks = FORCE * rng.uniform(*even, 12)
    real, gain = world(rng, told)
    if exact:
        real, gain = {}, 1.0
    true = [shift.Rivet(r.begin, r.place, r.times, r.peaks * gain, r.widths) for r in made]
    suffered = shift.truth(NAME, true, **real)[0]
    logs = folder / "logs"
    logs.mkdir(exist_ok=True)
    table = shift.log(made, rng) if exact else logged(made, true, rng, told, real)
    table.to_parquet(logs / "log.parquet")
    (logs / "mapping.toml").write_text(mapping(told))
    scatter = "" if exact else f"scatter = {SCATTER}\nsurvival = 0.5\n"
    (folder / "curve.toml").write_text(shift.CURVE + scatter)
    (folder / "task.toml").write_text(TASK + "".join(
        f'[[operation]]\nname = "{k}"\ndirection = {d.tolist()}\nposes = [{p.tolist()}]\n'
        for k, (p, d) in enumerate(zip(shift.POSES, shift.DIRECTIONS, strict=True))
    ))  # fmt: skip
    ledger = folder / "ledger"
    ledger.unlink(missing_ok=True)
    found = picchio.count(robot(), logs, ledger, sn_curve=str(folder / "curve.toml"),
                          task=folder / "task.toml")  # fmt: skip
    return suffered, found


def robot(kept=[]):  # noqa: B006
    if not kept:
        kept.append(picchio.load_robot(NAME))
    return kept[0]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--shifts", type=int, default=100)
    parser.add_argument("--told", choices=tuple(GAIN), default="force")
    parser.add_argument("--exact", action="store_true")
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    held, lower, worn, errors, blows, begin = 0, 0, 0, [], [], time.perf_counter()
    with tempfile.TemporaryDirectory() as place:
        for seed in range(asked.first, asked.first + asked.shifts):
            rng = np.random.default_rng(seed)
            suffered, found = one(Path(place), rng, asked.told, asked.exact)
            wears = suffered > 1e-3 * suffered.max()
            errors.append(np.log(found.counted.totals.damage[wears] / suffered[wears]))
            blows.append(found.blows)
            for joint, real in zip(found.joints(), suffered, strict=True):
                if real > 1e-3 * suffered.max() and not asked.exact:
                    low, high = joint["damage_interval"]
                    worn += 1
                    held += low <= real <= high
                    lower += real < low
    every = np.concatenate(errors)
    print(f"{asked.shifts} shifts of 36 blows, {min(blows)} to {max(blows)} of them found; the "
          f"damage of {every.size} joints that wear is {np.expm1(every).min():+.2%} to "
          f"{np.expm1(every).max():+.2%} off, the median {np.expm1(np.median(every)):+.2%} "
          f"({time.perf_counter() - begin:.0f} s)")  # fmt: skip
    if worn:
        print(f"told by {asked.told}: 90 % intervals hold the damage of {held} of {worn} "
              f"({held / worn:.1%}); {lower} are below, {worn - held - lower} above")  # fmt: skip


if __name__ == "__main__":
    main()
