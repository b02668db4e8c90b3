"""The robot as a vibrating system: what the solver gets."""

from __future__ import annotations

from picchio.model.effects import Effect
from picchio.model.linear_system import LinearSystem, modal_damping_matrix
from picchio.model.model import Model

__all__ = ["Effect", "LinearSystem", "Model", "modal_damping_matrix"]
