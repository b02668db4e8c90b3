"""What the plan is for: how the life on a task hangs on every joint's stiffness and damping."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag
from scipy.special import ndtri
from scipy.stats import qmc

from picchio.core.arrays import FloatArray
from picchio.diagnosis.stiffness.prior import damping_std, prior_of
from picchio.fatigue.uncertain_lives import Uncertain
from picchio.model.model import Model
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.spread import root_of
from picchio.studies.rivet.variation import WornParts
from picchio.studies.tasks import Task
from picchio.studies.uncertainty.inputs import default_inputs
from picchio.studies.uncertainty.sampler import Sampler

_STEP = 0.1  # of the logarithms, for slopes: finer than a spread, coarser than a kink
_OTHERS = 256  # draws of all that is neither stiffness nor damping
_LEAST = 1e-12
_TORQUE = "the peak torque of every joint"


@dataclass(frozen=True, eq=False)
class Outcome:
    """ln of what ends the life, at s drawn robots, and its slopes.

    The numbers are the logarithms of the n joints' stiffness over the stated ones, then of their
    damping ratios.

    Attributes:
        words: what it is of.
        at: (s, 2 n) the drawn robots.
        slope: (s, g, 2 n) of g outcomes that count alike, mostly one: the governing part's.
        rest: variance of the outcome by all that no such test tells (blows, strength, model).
        covariance: (2 n, 2 n) of the numbers before the tests.
    """

    words: str
    at: FloatArray
    slope: FloatArray
    rest: float
    covariance: FloatArray

    def variance(self, covariance: FloatArray) -> float:
        """Of the outcome, by stiffness and damping, in the mean over the drawn robots.

        Args:
            covariance: (s, 2 n, 2 n) of the numbers, at each of them; or (2 n, 2 n).
        """
        spread = np.broadcast_to(covariance, (len(self.at), *covariance.shape[-2:]))
        return float(np.einsum("sgi,sij,sgj->sg", self.slope, spread, self.slope).mean())


@dataclass(frozen=True, eq=False)
class Life:
    """A task's life as a function of stiffness and damping.

    Attributes:
        covariance: (2 n, 2 n) of their logarithms over the stated values, before any test.
        sampler: runs drawn robots.
        columns: of the 2 n numbers among the sampler's inputs.
    """

    covariance: FloatArray
    sampler: Sampler
    columns: tuple[int, ...]

    @classmethod
    def of(cls, robot: FlexibleRobot, task: Task) -> Life:
        """Of a robot at work.

        Args:
            robot: flexible.
            task: its work.

        Raises:
            InputError: a task that the robot cannot do.
        """
        covariance = block_diag(prior_of(robot).covariance, np.diag(damping_std(robot) ** 2))
        kinds = ("stiffness", "damping_ratio")
        names = [f"{kind}.{name}" for kind in kinds for name in robot.flexible_names]
        size = np.sqrt(np.diag(covariance))
        given = {k: v for k, v in default_inputs(task).items() if k not in kinds}
        given |= {name: Uncertain(1.0, float(s)) for name, s in zip(names, size, strict=True)}
        stress = WornParts.of(robot, None, needed=False)
        sampler = Sampler.of(Model.of(robot), task, stress, given, [])
        inputs = [each.name for each in sampler.inputs]
        return cls(covariance, sampler, tuple(inputs.index(name) for name in names))

    def parts(self, at: FloatArray, others: FloatArray | None = None) -> tuple[str, FloatArray]:
        """In words what ends the life, and (k, m) its logarithm by part.

        Args:
            at: (m, 2 n) logarithms of stiffness and damping ratios over the stated ones.
            others: (m, inputs) scores of all else that is uncertain; as stated if None.
        """
        count = len(self.sampler.inputs)
        moved = np.zeros((len(at), count)) if others is None else others.copy()
        moved[:, self.columns] = at / np.sqrt(np.diag(self.covariance))
        drawn = self.sampler.run(moved)
        geared = drawn.geared[~np.isnan(drawn.geared).any(axis=1)]
        for words, values in (
            ("the utilisation of the shaft that is used most", drawn.used),
            ("the utilisation of the reducer that is used most", geared),
        ):
            if len(values) and values.max() > 0.0:
                return words, np.log(np.maximum(values, _LEAST * values.max()))
        return _TORQUE, np.log(np.maximum(drawn.peak, _LEAST * drawn.peak.max()))


def outcome_of(robot: FlexibleRobot, task: Task, *, draws: int, seed: int) -> Outcome:
    """The outcome of a task, linear about robots drawn from what is known.

    It is ln of the utilisation of the shaft (without one: the reducer) that is used most, which is
    finite where the life is not; of every joint's peak torque where no part's strength is known.

    Args:
        robot: flexible.
        task: its work.
        draws: of robots.
        seed: of the draws.

    Raises:
        InputError: a task that the robot cannot do.
    """
    life = Life.of(robot, task)
    m = len(life.covariance)
    uniform = qmc.Sobol(m, seed=seed).random(draws)
    at = ndtri(np.clip(uniform, 1e-6, 1.0 - 1e-6)) @ np.linalg.cholesky(life.covariance).T
    steps = _STEP * np.concatenate([np.zeros((1, m)), np.eye(m), -np.eye(m)])
    words, parts = life.parts((at[:, None] + steps).reshape(-1, m))
    parts = parts.reshape(len(parts), draws, len(steps))
    if words == _TORQUE:
        taken = parts.swapaxes(0, 1)
    else:
        taken = parts[parts[..., 0].argmax(axis=0), np.arange(draws)][:, None]
    slope = (taken[..., 1 : m + 1] - taken[..., m + 1 :]) / (2.0 * _STEP)
    root = root_of([each.name for each in life.sampler.inputs], robot.posterior)
    others = np.random.default_rng(seed).standard_normal((_OTHERS, len(root))) @ root
    rest = float(np.var(life.parts(np.zeros((_OTHERS, m)), others)[1].max(axis=0)))
    return Outcome(words, at, slope, rest, life.covariance)


def decades(deviation: float) -> float:
    """An 80 % interval's width, in decades.

    Args:
        deviation: of the natural logarithm.
    """
    return 2.0 * 1.2816 * deviation / math.log(10.0)
