"""All effects that are known: those of this folder, and others' by entry point."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

from picchio.core.errors import InputError
from picchio.core.registry import classes_in, is_concrete, with_entry_points
from picchio.model.effects.effect import Effect
from picchio.model.effects.evidence import check_target
from picchio.robot.flexible_robot import FlexibleRobot

GROUP = "picchio.effects"


@cache
def catalogue() -> dict[str, type[Effect]]:
    """Every effect's class by name.

    Raises:
        InputError: two effects of one name, or an entry point that is no effect.
    """
    own = classes_in("picchio.model.effects", Effect)
    found = with_entry_points(
        GROUP, "effect", own, lambda x: is_concrete(x, Effect), lambda x: x.name
    )
    return dict(sorted(found.items()))


def effect_class(name: str) -> type[Effect]:
    """The effect of a name.

    Args:
        name: as in a model file.

    Raises:
        InputError: there is none.
    """
    try:
        return catalogue()[name]
    except KeyError:
        raise InputError("no such effect", value=name, choices=catalogue()) from None


def from_dict(table: Mapping[str, Any], robot: FlexibleRobot) -> Effect:
    """An effect as a model file has it: effect, target, parameters.

    Args:
        table: of the file.
        robot: that has the target.

    Raises:
        InputError: an unknown effect, target or parameter, a value out of bounds.
    """
    effect = effect_class(table["effect"])(table["target"], **table.get("parameters", {}))
    check_target(effect, robot)
    return effect.with_hidden(table.get("hidden", {}))


effect_from_dict = from_dict  # its name in `picchio`
