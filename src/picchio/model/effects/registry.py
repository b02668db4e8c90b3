"""All effects that are known: those of this folder, and others' by entry point."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping
from functools import cache
from typing import Any

from picchio.core.errors import InputError
from picchio.model.effects.effect import Effect

GROUP = "picchio.effects"


@cache
def catalogue() -> dict[str, type[Effect]]:
    """Every effect's class by name.

    Raises:
        InputError: two effects of one name, or an entry point that is no effect.
    """
    from importlib.metadata import entry_points

    package = importlib.import_module("picchio.model.effects")
    found: dict[str, type[Effect]] = {}
    for info in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        module = importlib.import_module(info.name)
        for value in vars(module).values():
            if _is_effect(value) and value.__module__ == module.__name__:
                _add(found, value)
    for entry in entry_points(group=GROUP):
        value = entry.load()
        if not _is_effect(value):
            raise InputError("is no effect", key=f"entry point {entry.name}", value=value)
        _add(found, value)
    return dict(sorted(found.items()))


def _is_effect(value: Any) -> bool:
    return isinstance(value, type) and issubclass(value, Effect) and hasattr(value, "name")


def _add(found: dict[str, type[Effect]], effect: type[Effect]) -> None:
    if effect.name in found and found[effect.name] is not effect:
        raise InputError("two effects have this name", value=effect.name)
    found[effect.name] = effect


def effect_class(name: str) -> type[Effect]:
    """The effect of a name.

    Raises:
        InputError: there is none.
    """
    try:
        return catalogue()[name]
    except KeyError:
        raise InputError("no such effect", value=name, choices=catalogue()) from None


def from_dict(table: Mapping[str, Any]) -> Effect:
    """An effect as a model file has it: effect, target, parameters.

    Raises:
        InputError: an unknown effect or parameter, a value out of bounds.
    """
    hidden = table.get("hidden", {})
    effect = effect_class(table["effect"])(table["target"], **table.get("parameters", {}))
    return effect.with_hidden(hidden) if hidden else effect
