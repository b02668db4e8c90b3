"""The force acts beside the tool frame's origin."""

from __future__ import annotations

from picchio.model.effects.effect import Effect, Parameter
from picchio.model.plant import Changes


class ToolOffset(Effect):
    """The force's point is offset in the tool frame; the frame, and its sensors, stay."""

    name = "tool_offset"
    where = "structure"
    target_kind = "tool"
    parameters = tuple(
        Parameter(axis, "m", lower=-2.0, upper=2.0, meaning=f"offset along the tool's {axis}")
        for axis in "xyz"
    )
    meaning = "the tool's tip is not where the model has it"
    exceeds = "tool_point"
    mark = "offset"
    tried = tuple({axis: 0.03} for axis in "xyz")  # the fit then moves all three

    def structure(self, plant: Changes) -> None:
        """Move the force's point."""
        plant.force_offset = plant.force_offset + [self.values[axis] for axis in "xyz"]
