"""What a measurement would do to the interval of a life: the value of information.

The drawn worlds tell it without another run. A measurement reads some of the uncertain values with
an error; the worlds that would read alike are those that would be left. How wide the life's
interval is among them, averaged over what might be read, is what is to be expected after it (value
of sample information by regression: Strong, Oakley and Brennan, Medical Decision Making 34 (2014)
311-326). Here the regression is quadratic in what is read, and the interval is that of its
residuals among neighbours.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from shlex import quote

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.joint import is_drive
from picchio.robot.loading.find import typed_name
from picchio.studies.uncertainty.inputs import Input

# Of a stiffness, a damping ratio and a force, relative, one standard deviation.
_STIFFNESS, _DAMPING, _FORCE = 0.10, 0.20, 0.02
# Worlds of a neighbourhood; what narrows by less, in decades, is not worth a measurement.
_NEIGHBOURS, _WORTH = 128, 0.02
_SEED = 7


@dataclass(frozen=True)
class Measurement:
    """What a measurement is expected to leave of a life's interval.

    Attributes:
        what: it would tell, such as "stiffness.joint_2", "stiffness", "reducer.joint_1", "force".
        words: the same in words, with its accuracy.
        command: that uses it, or None.
        interval_decades: width of the 80 % interval of the life, in decades, now and then; NaN
            where it has no upper end.
        kept: width then over width now, of the logarithm of the life (of the utilisation, where
            the life has no upper end).
    """

    what: str
    words: str
    command: str | None
    interval_decades: tuple[float, float]
    kept: float

    def to_dict(self) -> dict[str, object]:
        """As the JSON has it."""
        return {"what": self.what, "words": self.words, "command": self.command,
                "interval_decades": self.interval_decades, "kept": self.kept}  # fmt: skip


def measure_first(
    robot: FlexibleRobot,
    inputs: Sequence[Input],
    moved: FloatArray,
    lives: FloatArray,
    used: FloatArray,
) -> tuple[Measurement, ...]:
    """Every measurement that would narrow the life's interval, the best first.

    Args:
        robot: whose life it is.
        inputs: what varies.
        moved: (m, inputs) its normal scores in the drawn worlds, correlated.
        lives: (m,) of the robot; may be infinite.
        used: (m,) of the robot, positive.

    Returns:
        those that narrow it by more than the draws blur.
    """
    endless = bool(np.isinf(np.quantile(lives, 0.9, method="inverted_cdf")))
    if not endless:  # few enough to lie beyond the interval, wherever they are
        lives = np.minimum(lives, lives[np.isfinite(lives)].max())
    outcome = np.log10(used if endless else lives)
    now = _width(outcome)
    if not now > _WORTH:
        return ()
    rng = np.random.default_rng(_SEED)
    found = []
    for what, words, command, columns, error in _candidates(robot, inputs):
        size = np.array([inputs[i].uncertain.spread for i in columns])
        blur = rng.standard_normal((len(moved), len(columns))) * (error / size)
        then = expected_width(outcome, moved[:, columns] + blur)
        if then < now - _WORTH:
            decades = (math.nan, math.nan) if endless else (now, then)
            found.append(Measurement(what, words, command, decades, then / now))
    return tuple(sorted(found, key=lambda one: one.kept))


def expected_width(outcome: FloatArray, read: FloatArray) -> float:
    """The width from P10 to P90 of an outcome that is to be expected once something is read.

    Args:
        outcome: (m,) in drawn worlds.
        read: (m, k) what would be read in each.
    """
    scaled = (read - read.mean(axis=0)) / read.std(axis=0)
    k = scaled.shape[1]
    pairs = [scaled[:, i] * scaled[:, j] for i in range(k) for j in range(i, k)]
    design = np.column_stack([np.ones(len(outcome)), scaled, *pairs])
    told = design @ np.linalg.lstsq(design, outcome, rcond=None)[0]
    left = (outcome - told)[np.argsort(told, kind="stable")]
    parts = np.array_split(left, max(len(left) // _NEIGHBOURS, 1))
    # The fitted numbers take up as many degrees of freedom.
    free = math.sqrt(len(left) / max(len(left) - design.shape[1], 1))
    return free * float(np.mean([_width(part) for part in parts]))


def _width(values: FloatArray) -> float:
    low, high = np.quantile(values, [0.1, 0.9], method="median_unbiased")
    return float(high - low)


Candidate = tuple[str, str, str | None, list[int], float]


def _candidates(robot: FlexibleRobot, inputs: Sequence[Input]) -> list[Candidate]:
    """What can be measured: name, words, command, inputs that it reads, error of the logarithm."""
    drives = [(j, joint) for j, joint in enumerate(robot.flexible_joints) if is_drive(joint.name)]
    where = quote(typed_name(robot.name, robot.source))
    identify = f"picchio identify {where} --data CAMPAIGN --out flex.toml"

    def of(key: str, j: int | None = None) -> list[int]:
        return [i for i, each in enumerate(inputs) if each.key == key and each.spread is None
                and (j is None or each.joints == (j,)) and each.uncertain.shape == "lognormal"
                and each.uncertain.spread > 0.0]  # fmt: skip

    def named(joints: list[str]) -> str:
        told = " ".join(f"--reducer {quote(f'{name}=NAME')}" for name in joints)
        return f"picchio start {where} {told}"

    found: list[Candidate] = []
    springs, bears = (
        [(joint.name, columns) for j, joint in drives if (columns := of(key, j))]
        for key in ("stiffness", "bears")
    )
    for name, columns in springs:
        words = f"the stiffness of {name} to 10 % (a known load, or a hammer)"
        found.append((f"stiffness.{name}", words, identify, columns, _STIFFNESS))
    if len(springs) > 1 or (not springs and of("stiffness")):
        words = "the stiffness of every joint to 10 %"
        found.append(("stiffness", words, identify, of("stiffness"), _STIFFNESS))
    for name, columns in bears:
        words = f"the name of the reducer of {name}"
        found.append((f"reducer.{name}", words, named([name]), columns, 1e-6))
    if len(bears) > 1:
        words = "the names of all reducers"
        command = named([name for name, _ in bears])
        found.append(("reducer", words, command, of("bears"), 1e-6))
    for key, words, command, error in (
        ("damping_ratio", "the damping to 20 % (one hammer blow)", identify, _DAMPING),
        ("force", "the force of the blows to 2 % (a load cell under the tool)",
         f"picchio assess {where} --task TASK.toml", _FORCE),
    ):  # fmt: skip
        if columns := of(key):
            found.append((key, words, command, columns, error))
    # Only what is known less well than the measurement would tell it.
    return [one for one in found if any(inputs[i].uncertain.spread > one[4] for i in one[3])]
