"""Cases of a trial: which causes a campaign hides, drawn by a seed.

A case is what `campaign.make` takes, so that a trial stores no more than a kind and a seed.
"""

from __future__ import annotations

import numpy as np

from . import campaign, detect, draw, outside, robots
from .draw_effect import takes
from .effects import EFFECTS
from .world import World, groups_of

KINDS = {"null": 0, "single": 1, "pair": 2, "triple": 3, "outside": 1}


def causes(kind, seed, robot="fanuc_like_3dof", effect=None, strength="typical", **options):
    """Causes for `campaign.make(robot, seed, ...)` with the same options.

    Args:
        kind: one of `KINDS`.
        seed: of the campaign.
        robot: its name.
        effect: the first cause's, such as when each is to have its share; drawn where None.
        strength: "typical" or "weak".
        **options: as given to `campaign.make`; `sensors` decide which causes can be drawn.

    Returns:
        [(effect, target, parameters)], no two of them on one joint, channel group or base.
    """
    nominal = robots.load(robot)
    sensors = options.pop("sensors", ("accelerometer", "deflection"))
    groups = groups_of(sensors, nominal)
    own = {k: v for k, v in options.items() if k not in campaign.NOT_OF_THE_PLAN}
    plan = campaign.plan_of(robot, seed, **own)
    names = list(outside.EFFECTS if kind == "outside" else EFFECTS)
    rng = np.random.default_rng([seed, 5])
    out, taken = [], set()
    while len(out) < KINDS[kind]:
        name = effect if effect is not None and not out else str(rng.choice(names))
        if not takes(name, groups):
            if name == effect:
                raise ValueError(f"{name}: no sensor among {groups} can have it")
            continue
        target, parameters = draw.draw(name, robot, rng, strength, plan, groups)
        place = {"tool": name, "robot": name}.get(target, target)
        place = "base" if name == "base_compliance" else place
        if name in {cause[0] for cause in out} or place in taken:
            continue
        taken.add(place)
        out.append((name, target, parameters))
    return out


def is_detectable(truth, snr_db, beyond=10.0):
    """Whether the causes of a made campaign stand out; see `detect.detectability`."""
    world: World = truth["world"]
    groups = tuple(truth["noise"])
    return detect.detectability(world, groups, snr_db)["bic_gain"] > beyond
