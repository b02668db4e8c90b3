"""The paper behind the method, reproduced claim by claim: Nie et al., RCIM 37 (2016) 292-301."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from picchio.paper.assumptions import Assumptions as Assumptions
    from picchio.paper.run import Reproduction as Reproduction
    from picchio.paper.run import reproduce as reproduce

__all__ = ["Assumptions", "Reproduction", "reproduce"]


def __getattr__(name: str) -> object:
    # Plotting and the models are loaded when they are used.
    from importlib import import_module

    if name in __all__:
        part = "assumptions" if name == "Assumptions" else "run"
        return getattr(import_module(f"picchio.paper.{part}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
