"""Frequency response functions that could be taken: an instrumented hammer, an accelerometer."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from picchio.campaign.record import Record
from picchio.campaign.tables import Tolerance
from picchio.core.arrays import FloatArray
from picchio.diagnosis.planning.kind import Offered, Possible, Test, within_reach
from picchio.diagnosis.planning.outcome import Outcome
from picchio.diagnosis.stiffness.prior import prior_of, remainder_of
from picchio.diagnosis.stiffness.responses import make_problem
from picchio.robot.flexible_robot import FlexibleRobot

_POSES = 10  # of those that are tried: a function takes longer to look at than a loading
_LINES, _HIGHEST, _BEYOND = 160, 250.0, 1.5  # Hz; over the highest mode as stated
_NOISE, _FLOOR = 0.01, 1e-3  # of a line; of the largest
_HIT = 200.0  # N, about, of a hammer's blow
WAYS = np.diag([1.0, 1.0, -1.0])
"""World: along what the hammer hits and the accelerometer reads."""


class TapTest(Test):
    """A hammer that measures its force, and an accelerometer, as functions of an analyser."""

    name = "frf"
    loads = frozenset({"hammer"})
    reads = frozenset({"accelerometer"})
    seconds = (60.0, 45.0, 45.0)
    least = 4
    file = "tap{:02d}.csv"

    def row(
        self, robot: FlexibleRobot, one: Possible, instruments: Sequence[str]
    ) -> dict[str, object]:
        """As `Test`: the analyser writes the file."""
        return {}

    def table(self, robot: FlexibleRobot, one: Possible) -> dict[str, object]:
        """As `Test`."""
        assert one.reads is not None
        return {
            "pose": {name: round(float(x), 9)
                     for name, x in zip(robot.joint_names, one.pose, strict=True)},
            "force_direction": one.direction.tolist(),
            "response_direction": one.reads.tolist(),
            "response_frame": one.frame or robot.tool_frame,
            "quantity": "accelerance",
        }  # fmt: skip

    def candidates(
        self,
        robot: FlexibleRobot,
        poses: FloatArray,
        outcome: Outcome,
        force: float,
        instruments: Sequence[str],
        tolerance: Tolerance,
    ) -> Offered:
        """As `Test`; the sensor at the tool or halfway along the arm."""
        middle = robot.flexible_names[(len(robot.flexible_names) - 1) // 2]
        frames = (None, robot.tree.joints[middle].child) if middle in robot.tree.joints else (None,)
        each: list[Possible] = []
        slopes: list[FloatArray] = []
        names: tuple[str, ...] = ()
        for place, pose in enumerate(poses[:_POSES]):
            own = [
                Possible(self.name, place, pose, hit, _HIT, reads, (frame, *reads.tolist()), frame)
                for frame in frames if frame is None or within_reach(robot, pose, frame)
                for hit in WAYS for reads in WAYS
            ]  # fmt: skip
            found, names = _told(robot, own, self, outcome, tolerance)
            each += own
            slopes.append(found)
        return Offered(self, tuple(each), names, np.concatenate(slopes))


def _told(
    robot: FlexibleRobot, own: Sequence[Possible], test: TapTest, outcome: Outcome,
    tolerance: Tolerance,
) -> tuple[FloatArray, tuple[str, ...]]:  # fmt: skip
    """(c, s, r, p) slopes of c functions at one pose, and the numbers' names."""
    highest = _highest(robot, own[0].pose)
    frequency = highest * np.arange(1, _LINES + 1) / _LINES
    columns = {"frequency": frequency, "real": np.ones(_LINES), "imag": np.zeros(_LINES)}
    records = [
        Record.from_columns(f"{k}.csv", columns, **_table(test, robot, one))
        for k, one in enumerate(own)
    ]
    problem = make_problem(robot, records, tolerance, prior_of(robot))
    core = problem.springs
    alone = [name.startswith("direction.") for name in problem.steps]
    shared = [core + k for k, once in enumerate(alone) if not once]
    wanted = [*range(core), *shared]
    # Each record's own: its direction, and how its modes' damping is off at this pose.
    drawn = [k for k in range(len(problem.precision)) if k not in set(wanted)]
    most = core + 6
    found = np.zeros((len(own), len(outcome.at), most, len(wanted)))
    for s, at in enumerate(outcome.at):
        parts = problem.predict(np.concatenate([at, np.zeros(len(problem.precision) - core)]))
        for k, (part, table) in enumerate(zip(parts, problem.tables, strict=True)):
            value = np.stack([table.measured.real, table.measured.imag], axis=1)
            value = np.linalg.norm(value - part.residual * table.scale[:, None], axis=1)
            size = _NOISE * value + _FLOOR * value.max()
            # A remainder is no noise that more lines average out.
            if not value.max() > 0.0:
                continue  # the sensor shows nothing of this hit
            size = np.sqrt(size**2 + remainder_of(value))
            slope = part.slope * (table.scale / size)[:, None, None]
            flat = slope.reshape(-1, slope.shape[-1])
            told = flat.T @ flat
            cross = told[np.ix_(wanted, drawn)]
            rest = told[np.ix_(drawn, drawn)] + np.eye(len(drawn))
            told = told[np.ix_(wanted, wanted)] - cross @ np.linalg.solve(rest, cross.T)
            values, vectors = np.linalg.eigh(0.5 * (told + told.T))
            kept = np.argsort(values)[::-1][:most]
            sizes = np.sqrt(np.maximum(values[kept], 0.0))
            found[k, s, : len(kept)] = sizes[:, None] * vectors[:, kept].T
    return found, tuple(problem.steps[k - core] for k in shared)


def _table(test: TapTest, robot: FlexibleRobot, one: Possible) -> dict[str, Any]:
    return {"kind": test.name, **test.table(robot, one)}


def _highest(robot: FlexibleRobot, pose: FloatArray) -> float:
    """Hz, to which an analyser is set: beyond the modes as stated, as far as taps reach."""
    state = robot.state(pose)
    inverse = np.linalg.inv(np.linalg.cholesky(state.mass_matrix))
    squared = np.linalg.eigvalsh(inverse @ np.diag(state.stiffness) @ inverse.T)
    return float(min(_HIGHEST, _BEYOND * np.sqrt(squared[-1]) / (2.0 * np.pi)))
