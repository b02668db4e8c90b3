"""One case of the blind trial: a campaign of an independent world, diagnosed, judged by the truth.

Used by the tests on a fixed sample and by `benchmarks/blind_trial.py` on the whole set.
"""

from __future__ import annotations

import math
import sys
import time
import zlib
from pathlib import Path

TESTS = str(Path(__file__).resolve().parents[2])
if TESTS not in sys.path:
    sys.path.insert(0, TESTS)

import burst  # noqa: E402
import follow_up  # noqa: E402
import other_code  # noqa: E402
import outcomes  # noqa: E402
import removed  # noqa: E402
from ablations import METHODS  # noqa: E402

import picchio  # noqa: E402
from picchio.diagnosis.percussion.diagnosis import diagnose_percussion  # noqa: E402
from picchio.model.effects.registry import catalogue  # noqa: E402
from worlds import campaign as worlds  # noqa: E402
from worlds import cases  # noqa: E402
from worlds.outside import IN_CATALOGUE  # noqa: E402

# Parameters whose error says nothing: what a handful of draws realises of a spread or a share,
# conventions that the worlds fix, and what `latent` effects tell in another way.
FREE = {"modal_share", "smoothing", "code", "blend", "frequency", "amplitude", "std", "fraction"}
# What is the same thing within a campaign: with one taken out of the catalogue, so are the others.
CLASSES = (
    {"payload", "link_mass", "joint_inertia"},
    {"joint_stiffness", "servo_compliance"},  # a servo's motor without inertia is a softer joint
    {"sensor_axes", "sensor_misalignment"},  # axes that are swapped are turned
)
# What few records cannot tell from something else: (target, records) of an accelerometer alone.
SETS = {
    "force_amplitude": ("tool", 3),
    "sensor_gain": ("accelerometer.tool", 3),
    "joint_stiffness": ("joint_1", 3),
    "base_compliance": ("rz", 3),
    "tool_offset": ("tool", 1),
    "force_direction": ("tool", 1),
    "sensor_misalignment": ("accelerometer.tool", 1),
    "stiffness_drift": (None, 2),
    "thermal_stiffness": (None, 2),
}

# Where the force is read, by a load cell: half-sines of 4 ms, 12 records of 1 s at 2 kHz.
READ = {
    "programmed": False, "blend": 1.0, "sampling": 2000.0, "hits": 5, "ring": 0.65, "records": 12,
}  # fmt: skip


def class_of(effect, target=""):
    """An effect and what cannot be told from it: its class."""
    for pairs in outcomes.in_series():
        if (effect, target) in pairs:
            return {name for name, _ in pairs}
    return next((kind for kind in CLASSES if effect in kind), {effect})


def all_but(*names):
    """Of the catalogue: what to leave out so that these compete, and a test takes half as long."""
    assert set(names) <= set(catalogue()), names
    return set(catalogue()) - set(names)


# What may stand for one another by the shape of what is read.
LIKE_A_FILTER = (
    "pulse_width", "pulse_shape", "rebound", "sensor_lowpass", "sensor_delay", "mount_resonance",
)  # fmt: skip


def name_of(case):
    """What a case is called: it is its own seed, too."""
    parts = [case["robot"], case["kind"], case.get("effect") or "", case["snr"], case["draw"]]
    if "mismatch" in case:
        parts.append(f"{case['mismatch']:g} times wrong")
        parts += ["+".join(case[key]) for key in ("only", "sensors") if case.get(key)]
    return "/".join(str(part) for part in parts)


def seed_of(case, salt=0):
    # The cause is left out of the catalogue, not of the data, which are those of the single.
    same = {**case, "kind": "single"} if case["kind"] == "left-out" else case
    # The same errors, ever larger, of the same robot under the same causes.
    same = {key: value for key, value in same.items() if key != "mismatch"}
    return zlib.crc32(f"{name_of(same)}/{salt}".encode()) % 2**31


def make(case, salt=0):
    """(campaign, truth) of a case: robot, kind, effect, snr, draw, sensors, records, and so on.

    With a `mismatch` everything is off, by so many times its tolerance; or what `only` names.
    """
    seed = seed_of(case, salt)
    robot = picchio.load_robot(case["robot"])
    accelerometer = f"accelerometer.{robot.tool_frame}"
    weak = case["kind"] == "weak"
    wrong = {}
    if "mismatch" in case:
        wrong = {"mismatch": float(case["mismatch"]), "only": case.get("only")}
    if case["kind"] == "sets":
        target, records = SETS[case["effect"]]
        return worlds.make(
            robot=case["robot"], seed=seed, causes=[(case["effect"], target, None)],
            sensors=(accelerometer,), records=records, snr_db=float(case["snr"]), **wrong,
        )  # fmt: skip
    few = case["kind"] in ("few", "few-null")
    alone = weak or few
    sensors = case.get("sensors") or ((accelerometer,) if alone else (accelerometer, "deflection"))
    kind = {"weak": "single", "left-out": "single", "few": "single", "few-null": "null"}
    kind = kind.get(case["kind"], case["kind"])
    options = {"sensors": tuple(sensors), "records": case.get("records", 3 if few else 18)}
    options |= wrong
    if "force" in sensors:
        options |= READ
    if case["kind"] == "mixed":  # a catalogued cause, and a little of what no catalogue has
        rest = {"robot": case["robot"], **options}
        causes = cases.causes("single", seed, effect=case.get("effect"), **rest)
        causes += cases.causes("outside", seed + 1, strength="weak", **rest)
        return worlds.make(seed=seed, causes=causes, snr_db=float(case["snr"]), **rest)
    causes = cases.causes(
        kind,
        seed,
        robot=case["robot"],
        effect=case.get("effect"),
        strength="weak" if weak else "typical",
        **options,
    )
    return worlds.make(
        robot=case["robot"], seed=seed, causes=causes, snr_db=float(case["snr"]), **options
    )


def outside(effect):
    """Names of the catalogue that stand for an effect of `worlds.outside`."""
    return IN_CATALOGUE.get(effect, set())


def run(case, salt=0, without=(), method="diagnose", workers=1):
    """Make, diagnose and judge one case: a flat dictionary.

    `outcomes` says what a verdict is worth in a world that is a little wrong everywhere; see there.

    A "weak" case that its own world's simulator says cannot be seen is not diagnosed. In a
    "left-out" case the catalogue lacks the true cause and its class.
    """
    try:
        campaign, truth = make(case, salt)
    except (ValueError, FloatingPointError) as error:  # no sensor for it; no such arm
        return {**_head(case), "verdict": "not made", "why": str(error)}
    if case["kind"] == "weak" and not cases.is_detectable(truth, float(case["snr"])):
        return {**_head(case), "verdict": "not detectable"}
    if case["kind"] == "left-out":
        without = {
            name for cause in truth["causes"] for name in class_of(cause["effect"], cause["target"])
        }
    # What is outside of the catalogue stays outside where the catalogue has learnt it.
    hidden = {name for cause in truth["causes"] for name in outside(cause["effect"])}
    without = {*without, *(hidden if case["kind"] == "outside" else ())}
    robot, read = picchio.load_robot(case["robot"]), "force" in case.get("sensors", ())
    began, spent = time.monotonic(), time.process_time()
    if method == "diagnose":
        found = diagnose_percussion(robot, campaign, without=without, workers=workers)
        result = judge(case, truth, found)
        if case["kind"] in ("few", "sets") and found.diagnosis.verdict == "ambiguous":
            result["follow_up"] = follow(robot, case, campaign, truth, found, seed_of(case, salt))
        if truth["causes"] and result["right"] and not read:
            result["burst"] = burst.errors(found, truth, seed_of(case, salt))
            if not case.get("mismatch"):  # else what the true causes remove is not all
                result["removed"] = removed.share(found, truth)
    elif method in METHODS:
        result = judge_labels(case, truth, METHODS[method](robot, campaign, without))
    else:
        told = other_code.diagnose(method, case["robot"], campaign, without)
        result = judge_labels(case, truth, map(":".join, told["claimed"])) | told
    if "mismatch" in case:
        result |= outcomes.judge(case, truth, result)
        if method == "diagnose" and result["outcome"] == "right":
            result["known"] = outcomes.known(found.diagnosis, robot, truth)
            result["lives"] = {} if read else burst.lives(found, truth, seed_of(case, salt))
    result["seconds"] = round(time.monotonic() - began, 1)
    result["cpu_seconds"] = round(time.process_time() - spent, 1)
    return result


def follow(robot, case, campaign, truth, found, seed):
    """What comes out when the measurement that was asked for is taken, too."""
    ask = found.diagnosis.next_measurement
    if ask is None:
        return None
    more = follow_up.taken(ask, campaign, truth, seed)
    after = judge(case, truth, diagnose_percussion(robot, more, workers=1))
    return {
        "foretold": [rival["chi_square"] for rival in ask["rivals"]],
        "told": [rival["told"] for rival in ask["rivals"]],
        "sensor": ask["sensor"],
        **{key: after[key] for key in ("verdict", "claimed", "alternatives", "right")},
    }


def judge(case, truth, found):
    said = found.diagnosis
    true = {(c["effect"], c["target"]) for c in truth["causes"]}
    claimed = {(c.effect, c.target) for c in said.causes}
    beside: list = []
    if case["kind"] == "mixed":  # what no catalogue has can't be claimed
        beside = sorted(map(list, (pair for pair in true if pair[0] not in catalogue())))
        true = {pair for pair in true if pair[0] in catalogue()}
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
            true_value = outcomes.true_value(cause, own, truth)
            got = match[0].parameters[own]
            errors[f"{cause['effect']}.{own}"] = [
                got.value / true_value - 1.0,
                abs(got.value - true_value) / got.std if got.std > 0 else math.nan,
            ]
    gain = said.gain
    return {
        **_head(case),
        "truth": sorted(map(list, true)),
        **({"beside": beside} if beside else {}),
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


def judge_labels(case, truth, labels):
    """Of a method that says no more than names."""
    claimed = {tuple(label.split(":")) for label in labels}
    true = {(c["effect"], c["target"]) for c in truth["causes"]}
    return {
        **_head(case),
        "truth": sorted(map(list, true)),
        "verdict": "named" if claimed else "nothing-wrong",
        "claimed": sorted(map(list, claimed)),
        "right": claimed == true,
        "errors": {},
    }


def _head(case):
    head = {
        "case": name_of(case),
        "robot": case["robot"],
        "kind": case["kind"],
        "snr": case["snr"],
    }
    if "mismatch" in case:
        given = case.get("sensors") or ()
        sensors = "force read" if "force" in given else "accelerometer" if given else "all"
        head |= {"mismatch": case["mismatch"], "sensors": sensors}
    return head
