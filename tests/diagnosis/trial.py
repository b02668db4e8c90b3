"""One case of the blind trial: a campaign of an independent world, diagnosed, judged by the truth.

Used by the tests on a fixed sample and by `benchmarks/blind_trial.py` on the whole set.
"""

from __future__ import annotations

import math
import sys
import time
import zlib
from pathlib import Path

TESTS = str(Path(__file__).resolve().parent.parent)
if TESTS not in sys.path:
    sys.path.insert(0, TESTS)

import picchio  # noqa: E402
from picchio.diagnosis.percussion.diagnose import diagnose_percussion  # noqa: E402
from worlds import campaign as worlds  # noqa: E402
from worlds import cases  # noqa: E402

# What a world calls a parameter, and which of ours says the same, where names differ.
FREE = {"modal_share", "smoothing", "code", "blend", "frequency", "amplitude"}


def name_of(case):
    """What a case is called: it is its own seed, too."""
    parts = (case["robot"], case["kind"], case.get("effect") or "", case["snr"], case["draw"])
    return "/".join(str(part) for part in parts)


def seed_of(case, salt=0):
    return zlib.crc32(f"{name_of(case)}/{salt}".encode()) % 2**31


def make(case, salt=0):
    """(campaign, truth) of a case: robot, kind, effect, snr, draw, strength."""
    seed = seed_of(case, salt)
    robot = picchio.load_robot(case["robot"])
    sensors = case.get("sensors") or (f"accelerometer.{robot.tool_frame}", "deflection")
    options = {"sensors": tuple(sensors), "records": case.get("records", 18)}
    causes = cases.causes(
        case["kind"],
        seed,
        robot=case["robot"],
        effect=case.get("effect"),
        strength=case.get("strength", "typical"),
        **options,
    )
    return worlds.make(
        robot=case["robot"], seed=seed, causes=causes, snr_db=float(case["snr"]), **options
    )


def run(case, salt=0, without=()):
    """Make, diagnose and judge one case: a flat dictionary."""
    campaign, truth = make(case, salt)
    robot = picchio.load_robot(case["robot"])
    began, spent = time.monotonic(), time.process_time()
    found = diagnose_percussion(robot, campaign, without=without)
    result = judge(case, truth, found)
    result["seconds"] = round(time.monotonic() - began, 1)
    result["cpu_seconds"] = round(time.process_time() - spent, 1)
    return result


def judge(case, truth, found):
    said = found.diagnosis
    true = {(c["effect"], c["target"]) for c in truth["causes"]}
    claimed = {(c.effect, c.target) for c in said.causes}
    sets = [claimed, *({tuple(p) for p in each} for each in said.alternatives)]
    right = any(true == each for each in sets)
    errors = {}
    for cause in truth["causes"]:
        match = [
            c for c in said.causes if (c.effect, c.target) == (cause["effect"], cause["target"])
        ]
        for own, value in (cause["parameters"] or {}).items():
            if not match or own in FREE or own not in match[0].parameters:
                continue
            if not isinstance(value, (int, float)) or not value:
                continue
            true_value = float(value) * _within(cause, own, truth)
            got = match[0].parameters[own]
            errors[f"{cause['effect']}.{own}"] = [
                got.value / true_value - 1.0,
                abs(got.value - true_value) / got.std if got.std > 0 else math.nan,
            ]
    gain = said.gain
    return {
        "case": name_of(case),
        "robot": case["robot"],
        "kind": case["kind"],
        "snr": case["snr"],
        "truth": sorted(map(list, true)),
        "verdict": said.verdict,
        "claimed": sorted(map(list, claimed)),
        "alternatives": [sorted(map(list, each)) for each in said.alternatives],
        "leads": [list(pair) for pair in said.leads],
        "right": right,
        "confidence": [c.confidence for c in said.causes],
        "explained": None if gain is None else gain.explained,
        "errors": errors,
        "chi_square": found.after.chi_square,
        "worst_band": found.after.worst_band,
        "worst_pose": found.after.worst_pose,
    }


def _within(cause, parameter, truth):
    """A nuisance that is a cause was drawn within its tolerance on top."""
    if parameter != "scale":
        return 1.0
    drawn = truth["nuisances"]
    if cause["effect"] == "joint_stiffness":
        return drawn["stiffness"][cause["target"]]
    return {"modal_damping": drawn["damping_ratio"], "force_amplitude": drawn["force"]}.get(
        cause["effect"], 1.0
    )
