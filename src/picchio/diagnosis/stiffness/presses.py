"""The tool held fast while motors press: torques as a function of the springs, in closed form.

A motor turns by t, and what is between it and the fixture yields: the joints' springs k, whatever
else the arm stands on, and the fixture. The links' coordinates x make the energy least,

    1/2 (t - q)^T k (t - q) + 1/2 q^T (dg/dq) q + 1/2 x^T (k_other + J^T K_fixture J) x,

so the springs carry S t, and a spring's share of S is k e^T e with the row e of its elongations:
the energy's derivative by a spring is the energy in it. In such a loop a base or a bearing that
yields cannot be told from the fixture, which may yield in any direction.

First each drive's torque is split into S's row and friction: stop elements of several widths
(Prandtl; Lampaert, Swevers and Al-Bender, IEEE Trans. Autom. Control 47 (2002) 683,
doi:10.1109/9.995049), which turn over after each reversal, a part that grows with the load and one
with the speed. Pressing one way alone leaves S as uncertain as friction before. Then S's rows are
fitted like loadings.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np

from picchio.campaign.record import Record
from picchio.campaign.tables import Tolerance
from picchio.core.arrays import FloatArray, IndexArray
from picchio.core.errors import InputError
from picchio.diagnosis.stiffness.prior import LOOSE, REMAINDER, SIDEWAYS, Spring, remainder_of
from picchio.diagnosis.stiffness.statics import Stand, Yield
from picchio.model.expansion import WideChain
from picchio.prediction.motion.log import read_log
from picchio.prediction.percussion import pose_of
from picchio.robot.dynamics.statics import stiffness_at_torque
from picchio.robot.flexible_robot import FlexibleRobot

EXACT = 2e-3
"""Of the largest torque: what a row is off by beside all that is accounted for, as stated."""
_ROWS, _FINE = 600, 6000  # means over time that are split; samples that friction is followed by
_WIDTHS = (
    0.01,
    0.05,
    0.2,
)  # of a joint's whole turn: after how much of it friction has turned over
_FRICTION = 0.1  # of the largest torque, each stop element's, one standard deviation
_LOADED, _VISCOUS = 0.05, 0.05  # likewise: of the load; of the largest torque at the highest speed
_HELD = 4.0  # a fixture is so many times as stiff as a base might be, in the median
_COUPLED = 0.4  # two of its axes hang together so far, over the root of both
_MOVES = 0.03  # a motor presses whose turn is so much of the largest, each times its stiffness
_STANDS = 0.02  # of its highest speed: slower, a motor stands
_STUCK = 0.1  # of the torque that changes in a motor that stands: what its friction may carry
_SAMPLES = 96  # fewer follow no friction
_TIMES = 4  # the split is made anew with the load and the noise that it finds
_UNKNOWN = 1e6  # variance of what no motor's turn shows


@dataclass(frozen=True, eq=False)
class Press:
    """The torques of one record's r motors by the turns of its n, ready to be predicted.

    Attributes:
        file: the record's name.
        names: (c + 6,) of the coordinates, the n flexible joints first; last the fixture's.
        always: the springs of the fixture, which no record is without.
        pressed: (r,) of each row, the joint whose drive's torque it is.
        moves: (n,) whether the joint's motor turns.
        values: (r, n) how much of its largest torque each row has by each motor's largest turn.
        spread: (r, n, n) covariance of each row.
        scale: (r, n) what a row's values are of S's, rad/(N m).
        columns: (6, c) of the fixture's place: linear, then angular, in the tool's axes.
        gravity: (n, n) N m/rad, dg/dq.
        spring: (r, n) N m/rad or N/m, the nominal stiffness.
        step, unit: as of a table of loadings.
        turn: (m, n) rad or m, of the motors, about their mean, over time.
        torque: (m, r) N m or N, likewise.
        friction: (m, r) N m or N of it, as it was split.
    """

    file: str
    names: tuple[str, ...]
    always: tuple[Spring, ...]
    pressed: IndexArray
    moves: tuple[bool, ...]
    values: FloatArray
    spread: FloatArray
    scale: FloatArray
    columns: FloatArray
    gravity: FloatArray
    spring: FloatArray
    step: Mapping[str, float]
    unit: Mapping[str, float]
    turn: FloatArray
    torque: FloatArray
    friction: FloatArray
    zero: ClassVar[FloatArray] = np.zeros(0)

    def __len__(self) -> int:
        return len(self.values)

    @property
    def groups(self) -> tuple[str, ...]:
        """(n,) all of the drives' torques."""
        return ("torque",) * self.values.shape[1]

    @property
    def set(self) -> IndexArray:
        """(r,) -1: no row has a zero here."""
        return np.full(len(self), -1, dtype=np.intp)

    @property
    def lever(self) -> float:
        """m, how far from the base the fixture is, about."""
        turns = [self.names.index(f"base.{axis}") for axis in ("rx", "ry", "rz")]
        return float(max(np.linalg.norm(self.columns[:3][:, turns]) / np.sqrt(2.0), 1e-3))

    def ways(self, coordinate: str) -> FloatArray:
        """(6,) how the fixture's place moves with a coordinate.

        Args:
            coordinate: its name.
        """
        return np.asarray(self.columns[:, self.names.index(coordinate)])

    def play(self, joint: int) -> FloatArray:
        """(r, n) nothing: a play in the joint is a friction of the motor here.

        Args:
            joint: its number.
        """
        return np.zeros_like(self.values)

    def yields(self, active: Sequence[int], stiffness: FloatArray, *,
               gravity: bool = True, known: Yield | None = None) -> Yield:  # fmt: skip
        """What the rows are, and how they change, for given springs.

        Args:
            active: (q,) the coordinates that yield, the n joints first.
            stiffness: (r, q) N m/rad or N/m, the same in each row.
            gravity: whether gravity's change with the deflection counts.
            known: not used: everything is computed anew.

        Returns:
            values and derivatives.
        """
        n, c, k = self.gravity.shape[0], self.columns.shape[1], stiffness[0]
        wide = [i for i, at in enumerate(active) if at < c]
        fixed = [i for i, at in enumerate(active) if at >= c]
        place = self.columns[np.ix_([active[i] - c for i in fixed], [active[i] for i in wide])]
        matrix = np.diag(k[wide]) + place.T @ (k[fixed, None] * place)
        if gravity:
            matrix[:n, :n] += self.gravity
        follow = np.linalg.solve(matrix, np.eye(len(wide))[:, :n] * k[:n])
        stretch = np.zeros((len(active), n))  # of each spring by each motor's turn
        stretch[wide], stretch[fixed] = follow, place @ follow
        stretch[:n] = np.eye(n) - follow[:n]
        whole = k[:n, None] * stretch[:n]
        each = np.einsum("s,sj,sk->jks", k, stretch, stretch)
        values = whole[self.pressed] * self.scale
        by_step: dict[str, FloatArray] = {}
        for r, joint in enumerate(self.pressed):
            own = by_step[f"torque_gain.{self.names[joint]}"] = np.zeros_like(values)
            own[r] = values[r]
        root = np.sqrt(k[fixed, None]) * stretch[fixed]
        for name, i, j in self.couplings:
            crossed = np.outer(root[i], root[j])
            by_step[name] = (crossed + crossed.T)[self.pressed] * self.scale
        by_spring = each[self.pressed] * self.scale[..., None]
        return Yield(values, by_spring, by_step, self._root, whole)

    @cached_property
    def couplings(self) -> list[tuple[str, int, int]]:
        """Names and numbers of two of the fixture's axes: by what share one yields as the other."""
        return [(f"coupling.{self.file}.{i}{j}", i, j) for j in range(6) for i in range(j)]

    @cached_property
    def _root(self) -> FloatArray:
        return np.linalg.cholesky(self.spread)


def make_press(
    robot: FlexibleRobot, chain: WideChain, record: Record, tolerance: Tolerance
) -> Press:
    """A clamped record, ready to be predicted.

    Args:
        robot: flexible.
        chain: of this robot.
        record: of the kind "clamped".
        tolerance: how exact the drives' torques are.

    Raises:
        InputError: a torque of a joint that is not flexible or whose motor's position is not told;
            no motor that turns; a record too short.
    """
    log = _read(robot, record)
    torque = log.torque
    pressed = np.array([robot.flexible_names.index(name) for name in log.joints], dtype=np.intp)
    n, r = len(robot.flexible_names), len(log.joints)
    wide = np.zeros((len(torque), n))
    wide[:, pressed] = log.turn
    reach = np.abs(wide).max(axis=0)
    moves = reach * robot.stiffness > _MOVES * (reach * robot.stiffness).max()
    largest = np.abs(torque).max(axis=0)
    values, spread = np.zeros((r, n)), np.tile(_UNKNOWN * np.eye(n), (r, 1, 1))
    inside = np.ix_(moves, moves)
    friction = np.zeros_like(torque)
    for k, at in enumerate(pressed):
        if not largest[k] > 0.0:
            continue
        turns = wide[:, moves] / reach[moves]
        found, own, friction[:, k] = log.split(k, turns, float(largest[k]), bool(moves[at]))
        values[k, moves], spread[k][inside] = found, own
    pose = pose_of(robot, record)
    stand = Stand(robot, chain, pose, True)
    jacobian = stand.at_tool(None, np.zeros(3))
    axes = stand.place(stand.tool)[2].T
    gravity = robot.gravity_torque(pose)
    gravity[pressed] += 0.5 * largest  # on a curve the slope halfway stands for the chord
    spring = np.tile(stiffness_at_torque(robot.flexible_joints, gravity[None]), (r, 1))
    fixture = tuple(f"hold.{record.file}.{axis}" for axis in ("x", "y", "z", "rx", "ry", "rz"))
    table = Press(
        record.file, (*chain.coordinates, *stand.bends, *fixture), (), pressed,
        tuple(moves.tolist()), values, spread,
        np.maximum(reach, 1e-300) / np.maximum(largest, 1e-300)[:, None],
        np.concatenate([axes @ jacobian[:3], axes @ jacobian[3:]]),
        robot.gravity_stiffness(pose), spring, {}, {}, wide, torque, friction,
    )  # fmt: skip
    return _held(robot, table, tolerance)


def _read(robot: FlexibleRobot, record: Record) -> _Log:
    """A record's motors, as means over time."""
    log = read_log(robot, record)
    for name in log.torque:
        if name not in robot.flexible_names:
            raise InputError("is no flexible joint of the robot", file=record.source.path,
                             key=f"torque.{name}", value=name,
                             choices=robot.flexible_names)  # fmt: skip
        if log.group[name] != "motor_position":
            raise record.source.error(
                f"motor_position.{name} is needed: a tool that is held keeps the link side where "
                "it is", channel=f"position.{name}")  # fmt: skip
    joints = tuple(name for name in robot.flexible_names if name in log.torque)
    if not joints:
        raise record.source.error(
            "tells no motor's torque and position",
            hint="give columns motor_position.<joint>, torque.<joint>",
        )
    if log.samples < _SAMPLES:
        raise record.source.error(f"holds {log.samples} samples: {_SAMPLES} or more are needed")
    fine = _parts(log.samples, min(log.samples, _FINE))
    angle = np.array([_means(log.angle[name], fine) for name in joints]).T
    torque = np.array([_means(log.torque[name], fine) for name in joints]).T
    time = _means(record.time, fine)
    angle -= angle.mean(axis=0)
    if not np.ptp(angle) > 0.0:
        raise record.source.error("no motor turns", channel=f"motor_position.{joints[0]}",
                                  hint="each must press, forth and back")  # fmt: skip
    parts = _parts(len(time), min(_ROWS, len(time)))
    speed = np.gradient(angle, time, axis=0)
    speed /= np.maximum(np.abs(speed).max(axis=0), 1e-300)
    held = torque.mean(axis=0)
    sliding = np.stack([
        np.stack([_stops(one, width * float(np.ptp(one))) for width in _WIDTHS], axis=-1)
        for one in angle.T
    ], axis=1)  # fmt: skip
    return _Log(joints, _means(angle, parts), _means(torque - held, parts), held,
                _means(speed, parts), _means(sliding, parts))  # fmt: skip


class _Log(NamedTuple):
    """A record's r motors, as m means over time.

    Attributes:
        joints: (r,) their names.
        turn: (m, r) rad or m, about the mean.
        torque: (m, r) N m or N, likewise.
        held: (r,) the torques' mean.
        speed: (m, r) over the highest.
        sliding: (m, r, w) the states of friction's elements, -1 to 1.
    """

    joints: tuple[str, ...]
    turn: FloatArray
    torque: FloatArray
    held: FloatArray
    speed: FloatArray
    sliding: FloatArray

    def split(
        self, k: int, turns: FloatArray, largest: float, presses: bool
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """A drive's torque by the motors' turns, and its friction.

        Args:
            k: which drive.
            turns: (m, q) of the motors that press, each over its largest.
            largest: N m or N, of this drive's torque.
            presses: whether this motor is one of them.

        Returns:
            (q,) of the largest torque; (q, q) their covariance; (m,) N m or N, the friction.
        """
        torque, q = self.torque[:, k] / largest, turns.shape[1]
        stands = np.abs(self.speed[:, k]) < _STANDS
        extra = np.zeros(len(torque))
        for rows, share in ((stands, _STUCK), (~stands, REMAINDER)):
            if rows.any():
                extra[rows] = (share / REMAINDER) ** 2 * remainder_of(torque[rows])
        parts = [np.ones((len(torque), 1))]
        known = [1e-6]
        if presses:
            parts += [self.sliding[:, k], self.speed[:, k, None], self.sliding[:, k, :1]]
            known += [_FRICTION**-2] * len(_WIDTHS) + [_VISCOUS**-2, _LOADED**-2]
        found, noise = np.zeros(q), EXACT
        for _ in range(_TIMES):
            if presses:
                load = np.abs(turns @ found + self.held[k] / largest)
                parts[-1] = load[:, None] * self.sliding[:, k, :1]
            matrix = np.concatenate([turns, *parts], axis=1)
            weight = 1.0 / (noise**2 + extra)
            precise = (matrix.T * weight) @ matrix + np.diag([1e-9] * q + known)
            numbers = np.linalg.solve(precise, matrix.T @ (weight * torque))
            found = numbers[:q]
            left = torque - matrix @ numbers
            noise = float(np.sqrt(np.mean(left**2)))
        covariance = np.linalg.inv(precise)[:q, :q]
        return found, covariance, largest * (matrix[:, q:] @ numbers[q:])


def _held(robot: FlexibleRobot, table: Press, tolerance: Tolerance) -> Press:
    """With the springs of its fixture, and what is never exact."""
    turning = [joint.stiffness for joint in robot.flexible_joints if joint.kind == "revolute"]
    about = _HELD * SIDEWAYS * max(turning, default=1.0)
    along = about / table.lever**2
    if not turning:
        along = _HELD * SIDEWAYS * max(joint.stiffness for joint in robot.flexible_joints)
    springs = tuple(
        Spring((name,), about, LOOSE, "N*m/rad") if name[-2] == "r"
        else Spring((name,), along, LOOSE, "N/m")
        for name in table.names[-6:]
    )  # fmt: skip
    step = {f"torque_gain.{table.names[k]}": tolerance.torque_gain for k in table.pressed}
    step |= {name: _COUPLED for name, *_ in table.couplings}
    return replace(table, always=springs, step=step, unit=dict.fromkeys(step, 1.0))


def _parts(size: int, count: int) -> IndexArray:
    """(count + 1,) where parts of about equal length end."""
    return np.linspace(0, size, count + 1).astype(np.intp)


def _means(values: FloatArray, ends: IndexArray) -> FloatArray:
    """The mean of each part, along the first axis."""
    count = np.diff(ends).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray(np.add.reduceat(values, ends[:-1], axis=0) / count)


def _stops(way: FloatArray, width: float) -> FloatArray:
    """(m,) the state of a stop element, -1 to 1.

    Args:
        way: (m,) rad or m.
        width: how far it goes from sliding one way to sliding the other, rad or m.
    """
    found, state = np.zeros(len(way)), 0.0
    steps = np.diff(way) / max(0.5 * width, 1e-300)
    for k, step in enumerate(steps.tolist(), start=1):
        state = min(max(state + step, -1.0), 1.0)
        found[k] = state
    return found
