"""Effects: what can be wrong with a simulation, one file each."""

from __future__ import annotations

from picchio.model.effects.effect import Effect, Parameter
from picchio.model.effects.registry import catalogue, effect_class, from_dict
from picchio.model.effects.scales import Scales

__all__ = ["Effect", "Parameter", "Scales", "catalogue", "effect_class", "from_dict"]
