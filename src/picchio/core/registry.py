"""What a package declares itself, joined by what others declare through entry points."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Callable, Iterable
from typing import TypeVar

from picchio.core.errors import InputError

T = TypeVar("T")


def classes_in(package: str, base: type[T]) -> list[type[T]]:
    """The concrete classes that the modules of a package define, rooms within it included.

    Args:
        package: dotted name.
        base: what they derive from.

    Returns:
        in the order of the modules' names.
    """
    found: list[type[T]] = []
    root = importlib.import_module(package)
    for info in pkgutil.walk_packages(root.__path__, f"{package}."):
        module = importlib.import_module(info.name)
        found += [
            value for value in vars(module).values()
            if is_concrete(value, base) and value.__module__ == module.__name__
        ]  # fmt: skip
    return found


def is_concrete(value: object, base: type) -> bool:
    """Whether a value is a class derived from `base` that can be made an object of."""
    return (
        isinstance(value, type)
        and issubclass(value, base)
        and value is not base
        and not inspect.isabstract(value)
    )


def with_entry_points(
    group: str,
    what: str,
    own: Iterable[T],
    fits: Callable[[object], bool],
    name: Callable[[T], str],
) -> dict[str, T]:
    """What is declared here and, by entry point, elsewhere; by name.

    Args:
        group: of entry points, such as "picchio.effects".
        what: a declaration is, for messages: "effect".
        own: what picchio declares itself.
        fits: whether an entry point's value is such a declaration.
        name: of a declaration; no two may share it.

    Raises:
        InputError: an entry point that cannot be loaded or is no such declaration, or two
            declarations of one name.
    """
    from importlib.metadata import entry_points

    found: dict[str, T] = {}
    for value in own:
        _add(found, value, name(value), what, "picchio")
    for entry in entry_points(group=group):
        place = f"entry point {entry.name} ({group})"
        try:
            value = entry.load()
        except (ImportError, AttributeError) as error:
            raise InputError(f"cannot be loaded: {error}", key=place, value=entry.value) from None
        if not fits(value):
            raise InputError(f"is no {what}", key=place, value=value)
        _add(found, value, name(value), what, place)
    return found


def _add(found: dict[str, T], value: T, name: str, what: str, place: str) -> None:
    if name in found and found[name] is not value:
        raise InputError(f"another {what} has this name already", key=place, value=name)
    found[name] = value
