"""A campaign from a world: drawn poses and blows, nuisances, hidden causes, and noise."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from functools import lru_cache

import numpy as np

from picchio.campaign.campaign import Campaign
from picchio.campaign.record import Record
from picchio.campaign.tables import Tolerance

from . import plan as plans
from . import robots
from .bench import nominal_chain
from .errors import ALWAYS, Errors
from .world import (
    TOLERANCE,
    Nuisances,
    World,
    channels,
    clean,
    columns,
    groups_of,
    quantities,
)

__all__ = [
    "NOT_OF_THE_PLAN",
    "TOLERANCE",
    "Nuisances",
    "World",
    "channels",
    "clean",
    "columns",
    "errors_of",
    "groups_of",
    "make",
    "noise",
    "noise_levels",
    "plain",
    "plan_of",
    "quantities",
]

# Of a world that is as in the files but for what was always drawn.
_EXACT = Tolerance.zero().model_dump() | {key: TOLERANCE[key] for key in ALWAYS}
_START = datetime(2026, 3, 2, 8, 0, tzinfo=UTC)


def noise_levels(data, times, snr_db):
    """{group: standard deviation}: so far below the group's RMS over the campaign, t >= 0."""
    after = times >= 0.0
    return {
        group: 10.0 ** (-snr_db / 20.0)
        * float(np.sqrt(np.mean([np.mean(record[group][after] ** 2) for record in data])))
        for group in data[0]
    }


def noise(shape, rng, colour=0.2, memory=0.7):
    """White, with a stationary first-order part; unit variance."""
    white = rng.normal(size=shape)
    slow = rng.normal(size=(shape[0] + 50, *shape[1:])) * np.sqrt(1.0 - memory**2)
    for i in range(1, len(slow)):
        slow[i] += memory * slow[i - 1]
    return np.sqrt(1.0 - colour) * white + np.sqrt(colour) * slow[50:]


_ZERO = 0.01  # of the programmed force, by which a load cell that stands for it is off at rest
NOT_OF_THE_PLAN = (
    "snr_db",
    "folder",
    "bandwidth",
    "nuisances",
    "engine",
    "modal",
    "programmed",
    "strength",
    "causes",
    "mismatch",
    "only",
)


@lru_cache(maxsize=8)
def plan_of(robot, seed, records=18, **options):
    """The plan of the campaign that `make` makes for this seed."""
    return plans.make(robot, np.random.default_rng([seed, 1]), records, **options)


def plain(truth):
    """The truth without its arrays and objects: what JSON can hold."""
    return {k: v for k, v in truth.items() if k not in ("world", "clean")}


def errors_of(robot, seed, mismatch=1.0, only=None) -> Errors:
    """What is not exact in the campaign that `make` makes for this seed."""
    return Errors.draw(nominal_chain(robot), seed, mismatch, only)


def make(
    robot="fanuc_like_3dof",
    seed=0,
    causes=(),
    snr_db=40.0,
    sensors=("accelerometer.tool", "deflection"),
    records=18,
    folder=None,
    bandwidth=5000.0,
    nuisances=None,
    engine="arm",
    modal="joints",
    mismatch=0.0,
    only=None,
    programmed=True,
    **options,
):
    """A campaign, and the truth about it.

    Args:
        robot: a shipped robot's name.
        seed: of all that is drawn.
        causes: of (effect, target, parameters); target and parameters are drawn where None, then
            `strength` among the options says "typical" or "weak".
        snr_db: of each channel group over the campaign.
        sensors: channel groups; "accelerometer" is short for that of the tool.
        records: of three a pose.
        folder: where to save it; in memory where None.
        bandwidth: Hz of the sensors; None for endless.
        nuisances: factors; drawn where None.
        engine: "arm", or "mujoco" for the second world.
        modal: what the modal damping is made of, "joints" or "all"; see `Bench`.
        mismatch: how many times its tolerance everything is off, 0 to 4. With 0 all is as in the
            files but for stiffness, damping ratio and force, none of them beyond 1.9 standard
            deviations, and the campaign says so; else all is normal, and it says nothing: the
            format's tolerances hold.
        only: keys of `[tolerance]` that are off, with a mismatch; all where None.
        programmed: whether the campaign states the blows; else the force is read, as "force", by a
            load cell whose zero is off by a few newtons.
        **options: `strength`, and of `plan.make`: hits, period, width, sampling, force, offset, ...

    Returns:
        (Campaign, dict): the truth has `causes`, `nuisances`, `errors`, `noise`, `world`, `clean`.
    """
    strength = options.pop("strength", "typical")
    plan = plan_of(robot, seed, records=records, **options)
    nominal = robots.load(robot)
    groups = groups_of(sensors, nominal)
    chosen = _chosen(causes, plan, groups, seed, strength)
    errors = errors_of(robot, seed, mismatch, only) if mismatch else None
    if nuisances is None and errors is not None:
        nuisances = Nuisances.of(errors)
    elif nuisances is None:
        rng_nuisances = np.random.default_rng([seed, 2])
        nuisances = Nuisances.draw(len(nominal.joints), rng_nuisances)
        while not _told_apart(chosen, nuisances, nominal):
            nuisances = Nuisances.draw(len(nominal.joints), rng_nuisances)
    world = _ENGINES[engine]()(plan, nuisances, chosen, seed, bandwidth, modal, errors=errors)
    data = clean(world, groups)
    times = plan.times()
    levels = noise_levels(data, times, snr_db)
    rng = np.random.default_rng([seed, 3])
    zero = np.random.default_rng([seed, 6]).normal(0.0, _ZERO * plan.force)
    taken = []
    for i, (shot, record) in enumerate(zip(plan.shots, data, strict=True)):
        arrays = {}
        for group in groups:
            level = levels[group]
            read = record[group] + level * noise(record[group].shape, rng)
            if group == "force" and not programmed:
                read = read + zero
            if level > 0.0:
                read = np.round(read / (level / 8.0)) * (level / 8.0)
            arrays |= dict(zip(channels(group, nominal), read.T, strict=True))
        taken.append(
            Record.from_arrays(
                f"r{i + 1:02d}.csv",
                times,
                {name: np.ascontiguousarray(values) for name, values in arrays.items()},
                pose=dict(zip(nominal.joints, map(float, shot.pose), strict=True)),
                direction=[float(v) for v in shot.direction],
                force=shot.force if programmed else None,
                time=_START + timedelta(days=shot.when),
                temperature=shot.temperature,
            )
        )
    table = {"kind": "pulse_train", "force": plan.force, "period": plan.period, "width": plan.width}
    if plan.hits is not None:
        table["hits"] = plan.hits
    campaign = Campaign.from_records(
        taken,
        robot=robot,
        tool=nominal.tool,
        excitation=table if programmed else None,
        tolerance=None if mismatch else _EXACT,
    )
    truth = {
        "robot": robot,
        "seed": seed,
        "causes": [
            {"effect": name, "target": target, "parameters": dict(parameters)}
            for name, target, parameters in chosen
        ],
        "nuisances": {
            "stiffness": dict(zip(nominal.joints, map(float, nuisances.stiffness), strict=True)),
            "damping_ratio": nuisances.damping_ratio,
            "force": nuisances.force,
        },
        "mismatch": mismatch,
        "errors": errors.numbers(nominal, plan, groups) if mismatch else {},
        "snr_db": snr_db,
        "noise": levels,
        "world": world,
        "clean": data,
    }
    return campaign if folder is None else campaign.save(folder), truth


def _mujoco():
    from .mujoco_world import MujocoWorld

    return MujocoWorld


_ENGINES = {"arm": lambda: World, "mujoco": _mujoco}


def _told_apart(causes, nuisances, robot):
    """Whether no cause is pulled back into the tolerance by the nuisance that it adds to."""
    for name, target, parameters in causes:
        if name == "joint_stiffness":
            factor, sigma = nuisances.stiffness[robot.joints.index(target)], TOLERANCE["stiffness"]
        elif name == "modal_damping":
            factor, sigma = nuisances.damping_ratio, TOLERANCE["damping_ratio"]
        elif name == "force_amplitude":
            factor, sigma = nuisances.force, TOLERANCE["force"]
        else:
            continue
        if abs(factor * parameters["scale"] - 1.0) < 2.5 * sigma:
            return False
    return True


def _chosen(causes, plan, groups, seed, strength):
    """The causes with whatever was left open drawn."""
    from . import draw

    out = []
    for i, cause in enumerate(causes):
        name, target, parameters = (cause, None, None) if isinstance(cause, str) else cause
        if parameters is None:
            rng = np.random.default_rng([seed, 4, i])
            target, parameters = draw.draw(
                name, plan.robot, rng, strength, plan=plan, groups=groups, target=target
            )
        out.append((name, target, parameters))
    return tuple(out)
