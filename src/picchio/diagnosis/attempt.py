"""Trials that may fail: whatever one does, the diagnosis goes on without it."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, TypeVar

from picchio.core.errors import InputError

Found = TypeVar("Found")

_log = logging.getLogger("picchio.diagnosis")


def attempt(what: str, trial: Callable[[], Found]) -> Found | None:
    """What a trial finds; None where it fails, which a debug log tells.

    A trial may lead to where there is no model, diverge, or break a matrix: then it has failed, and
    that is all it means. Only what the user gave may end a diagnosis, and that is read before.

    Args:
        what: is tried, for the log (logger "picchio.diagnosis", level debug).
        trial: may raise anything.

    Returns:
        what it returns, or None.
    """
    try:
        return trial()
    except InputError as error:  # no model there: ordinary
        _log.debug("%s: %s", what, error)
    except Exception as error:
        _log.debug("%s failed: %s: %s", what, type(error).__name__, error, exc_info=True)
    return None


def trials(functions: Mapping[str, Callable[[Any], Any]]) -> dict[str, Callable[[Any], Any]]:
    """The same functions of one item, each of which gives None where it fails, as `attempt` does.

    Args:
        functions: by name, for the log.
    """

    def safe(name: str, function: Callable[[Any], Any]) -> Callable[[Any], Any]:
        return lambda item: attempt(name, partial(function, item))

    return {name: safe(name, function) for name, function in functions.items()}
