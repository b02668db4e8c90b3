"""The drawn cases of a robot at work, the same ones for every question asked of them."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.fatigue.uncertain_lives import Draws
from picchio.model.model import Model
from picchio.robot.spread import root_of
from picchio.studies.rivet.variation import WornParts
from picchio.studies.tasks import Task
from picchio.studies.uncertainty.drawn import Drawn
from picchio.studies.uncertainty.sampler import Sampler

# Cases of a question; how far a force is looked for, as a logarithm, and how often it is halved.
_FEW, _WIDE, _HALVINGS, _ROUGH = 256, math.log(20.0), 11, 7


class Cases:
    """The drawn cases of a robot at work, the same ones for every question asked of them.

    Args:
        model: the robot, whose values have spreads, and its effects.
        task: its work.
        stress: the joints with shafts; a curve without scatter does not vary.
    """

    def __init__(self, model: Model, task: Task, stress: WornParts) -> None:
        self._sampler = Sampler.of(model, task, stress, None, [])
        names = [each.name for each in self._sampler.inputs]
        draws = Draws(len(names))
        while draws.scores.shape[0] * draws.scores.shape[1] < _FEW:
            draws.more()
        self._moved = draws.scores.reshape(-1, len(names)) @ root_of(names, model.robot.posterior)

    @property
    def cheap(self) -> bool:
        """Whether many questions take seconds: compiled code answers, of one robot."""
        sampler = self._sampler
        return sampler._modal and sampler._plain and not sampler.rebuilt

    @cached_property
    def drawn(self) -> Drawn:
        """What they do as the task is."""
        return self._sampler.run(self._moved)

    @cached_property
    def intervals(self) -> dict[str, dict[str, tuple[float, float]]]:
        """As of `UncertainLife`."""
        return self._sampler.intervals(self.drawn)

    def at(self, task: Task, every: int = 4) -> Drawn:
        """What some of the cases do at another task, with the same model.

        Args:
            task: with blows that state a width where the first one's do.
            every: so-manyth case; 1 for all.
        """
        return replace(self._sampler, task=task).run(self._moved[::every])

    def force_factor(self, rivets: float, near: float, *, thorough: bool = True) -> FloatArray:
        """(m,) the largest factor on the force at which every part holds, of a linear model.

        Halved within a factor of 20 about `near`, to 0.3 % from the safe side; 0 or inf beyond.

        Args:
            rivets: the life for which it must hold.
            near: about where to look.
            thorough: False takes a quarter of the cases, and halves to 5 %.
        """
        moved = self._moved if thorough else self._moved[::4]
        low, high = np.full((2, len(moved)), math.log(near))
        low, high = low - _WIDE, high + _WIDE

        def holds(log: FloatArray) -> np.ndarray[Any, Any]:
            return self._sampler.run(moved, np.exp(log)).holds(rivets)

        never, always = ~holds(low), holds(high)
        for _ in range(_HALVINGS if thorough else _ROUGH):
            middle = 0.5 * (low + high)
            fine = holds(middle)
            low, high = np.where(fine, middle, low), np.where(fine, high, middle)
        return np.where(never, 0.0, np.where(always, np.inf, np.exp(low)))
