"""A world: the printed data, with a value assumed for everything that the paper leaves out."""

from __future__ import annotations

import dataclasses
import functools
import math
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.core.files import write_text
from picchio.core.unfinished import unfinished
from picchio.excitation.pulse_train import PulseTrain
from picchio.fatigue.shaft_stress import stress_per_torque
from picchio.model.model import Model
from picchio.paper.printed import Printed, PrintedArm, paper_file, printed, trials
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.joint import Shaft
from picchio.robot.loading.load import load_robot
from picchio.studies.rivet.pose import ModelAtPose
from picchio.studies.rivet.poses import peaks_at
from picchio.studies.tasks import Operation
from picchio.vibration.batch.peaks import BatchPeaks


@dataclass(frozen=True)
class Assumptions:
    """A value for every input that the paper leaves open; the defaults are the base world.

    SI units; `stress_per_twist` is G r / l, the stress in the shaft by the joint's deflection.
    Their ranges and reasons are in `data/trials.toml`.
    """

    period: float = 0.040
    duty: float = 0.10
    damping_ratio: float = 0.03
    harmonics: int = 30
    stress_per_twist: float = 27.77e9
    shear_modulus: float = 79.3e9
    inertia_about: str = "cg"
    path_x: float = 0.9
    elbow: str = "down"
    rows: int = 3
    columns: int = 5
    pitch: float = 0.25
    panel_x: float = 1.35
    panel_y: float = 0.0
    panel_z: float = 0.65

    @property
    def width(self) -> float:
        """T_d, s."""
        return self.duty * self.period

    def but(self, **changes: Any) -> Assumptions:
        """The same with some values changed.

        Args:
            changes: attribute = value.
        """
        return dataclasses.replace(self, **changes)


def parse_assumptions(given: Iterable[str]) -> Assumptions:
    """The base world's assumptions, changed by words such as "period=0.1".

    Raises:
        InputError: an unknown name, or a bad value.
    """
    import pandas

    values: dict[str, Any] = {}
    base = vars(Assumptions())
    for word in given:
        name, equals, text = word.partition("=")
        if name not in base:
            raise InputError("unknown assumption", key="--assume", value=name, choices=base)
        if not equals:
            raise InputError("must be NAME=VALUE", key="--assume", value=word)
        key, choices = f"--assume {name}", trials().inputs[name].choices
        if isinstance(base[name], str):
            if text not in choices:
                raise InputError("unknown", key=key, value=text, choices=choices)
            values[name] = text
            continue
        number = float(pandas.to_numeric(text, errors="coerce"))
        anywhere = name in ("panel_x", "panel_y", "panel_z", "path_x")
        if not math.isfinite(number) or (number <= 0.0 and not anywhere):
            problem = "must be a finite number, and positive where it is a size"
            raise InputError(problem, key=key, value=text)
        values[name] = type(base[name])(number)
        if values[name] != number:
            raise InputError("must be a whole number", key=key, value=text)
    if values.get("duty", 0.5) >= 1.0:
        raise InputError("must be below 1", key="--assume duty", value=values["duty"])
    return Assumptions(**values)


def arm(given: Assumptions, values: PrintedArm | None = None) -> FlexibleRobot:
    """The arm of section 4.1 with assumed damping and shafts.

    Each shaft is the one that is the whole of its joint's spring (k = G Jp / l) and has the
    assumed stress per twist G r / l: r = (2 k / (pi G r / l))^(1/3). No file of it is kept.
    """
    robot, joints = _bare_arm(values or printed().arm, given.inertia_about), []
    for joint in robot.flexible_joints:
        radius = (2.0 * joint.stiffness / (np.pi * given.stress_per_twist)) ** (1.0 / 3.0)
        length = given.shear_modulus * radius / given.stress_per_twist
        shaft = Shaft(radius=radius, length=length, shear_modulus=given.shear_modulus)
        ratio = given.damping_ratio
        joints.append(dataclasses.replace(joint, damping_ratio=ratio, shaft=shaft))
    return dataclasses.replace(robot, flexible_joints=tuple(joints))


@functools.cache
def _bare_arm(values: PrintedArm, about: str) -> FlexibleRobot:
    from jinja2 import Template

    template = Template(paper_file("arm.urdf.j2").read_text("utf-8"))
    with unfinished(lambda: Path(tempfile.mkdtemp(prefix="picchio-paper-"))) as folder:
        path = folder / f"paper_arm_{about}.urdf"
        write_text(path, template.render(arm=values, about=about))
        return dataclasses.replace(load_robot(path, tool="tool"), files=())


def poses_at(points: ArrayLike, elbow: str = "down") -> FloatArray:
    """Poses (..., 3) rad that put the tool on points (..., 3) m; NaN out of reach.

    Joint limits are ignored. The elbow "down" hangs below the line to the tool, the other is "up".
    """
    x, y, z = np.moveaxis(np.asarray(points, dtype=float), -1, 0)
    l1, l2, l3 = printed().arm.link_lengths
    out, up = np.hypot(x, y), z - l1
    cosine = (out**2 + up**2 - l2**2 - l3**2) / (2.0 * l2 * l3)
    cosine = np.where(np.abs(cosine) > 1.0 + 1e-12, np.nan, np.clip(cosine, -1.0, 1.0))
    q3 = np.arccos(cosine) * (1.0 if elbow == "down" else -1.0)
    q2 = np.arctan2(up, out) - np.arctan2(l3 * np.sin(q3), l2 + l3 * np.cos(q3))
    return np.stack([np.arctan2(y, x), q2, q3], axis=-1)


def places_of(poses: ArrayLike) -> FloatArray:
    """Where the tool is, (..., 3) m, at poses (..., 3) rad."""
    q1, q2, q3 = np.moveaxis(np.asarray(poses, dtype=float), -1, 0)
    l1, l2, l3 = printed().arm.link_lengths
    out = l2 * np.cos(q2) + l3 * np.cos(q2 + q3)
    up = l1 + l2 * np.sin(q2) + l3 * np.sin(q2 + q3)
    return np.stack([out * np.cos(q1), out * np.sin(q1), up], axis=-1)


def rivet_points(given: Assumptions) -> FloatArray:
    """The rivets of Fig. 12 as assumed, (k, 3) m: row by row from the bottom, to and fro."""
    across, up = (given.pitch * (np.arange(n) - (n - 1) / 2.0) for n in (given.columns, given.rows))
    to_and_fro = np.where(np.arange(given.rows)[:, None] % 2, -across, across)
    y, z = np.broadcast_arrays(given.panel_y + to_and_fro, given.panel_z + up[:, None])
    return np.stack([np.full(y.size, given.panel_x), y.ravel(), z.ravel()], axis=-1)


@dataclass(frozen=True, eq=False)
class ReachMap:
    """Fig. 10: peaks in the x-z plane, on a grid in joint space within the stated joint limits.

    Attributes:
        place: (turns, bends, 3) m, the side of positive x; the other is its mirror image.
        bend: (bends,) rad, joint 3.
        peaks: by "worst" (of all directions) and force along "x", "y", "z":
            (turns, bends, 3 joints) mrad.
    """

    place: FloatArray
    bend: FloatArray
    peaks: dict[str, FloatArray]

    @property
    def hub(self) -> float:
        """m, height of joint 2: that of the tool straight out along x."""
        return float(self.place[self.place.shape[0] // 2, 0, 2])

    @property
    def distance(self) -> FloatArray:
        """(turns, bends) m, from joint 2 to the tool."""
        return np.asarray(np.hypot(self.place[..., 0], self.place[..., 2] - self.hub))

    @property
    def ends_over_out(self) -> float:
        """Joint 2's largest deflection at the up and low end over that straight out."""
        peaks = self.peaks["worst"][..., 1]
        return float(max(peaks[0].max(), peaks[-1].max()) / peaks[len(peaks) // 2].max())

    def top(self, along: str, joint: int) -> FloatArray:
        """The place (3,) m where a joint's peak is largest.

        Args:
            along: "worst", or the force's axis.
            joint: its index.
        """
        return np.asarray(self.place.reshape(-1, 3)[int(self.peaks[along][..., joint].argmax())])


@dataclass(frozen=True, eq=False)
class World:
    """The paper's arm and blows under one set of assumptions.

    Attributes:
        given: the assumptions.
        printed: what the paper prints.
        fine: whether Fig. 10's maps are fine enough to be drawn.
    """

    given: Assumptions
    printed: Printed = field(default_factory=printed)
    fine: bool = False

    @cached_property
    def robot(self) -> FlexibleRobot:
        """The arm."""
        return arm(self.given, self.printed.arm)

    @cached_property
    def model(self) -> Model:
        """The arm as a vibrating system, as the paper has it: no gravity stiffness."""
        return Model(self.robot)

    @cached_property
    def blows(self) -> PulseTrain:
        """The pulse train of eq. 12."""
        return PulseTrain(self.printed.task.force, self.given.period, self.given.width)

    def peaks(
        self, poses: ArrayLike, direction: ArrayLike | None = None, hits: int | None = None
    ) -> BatchPeaks:
        """Peaks at poses: the worst direction's, or along one; steady, or of a burst.

        Args:
            poses: (p, 3) rad.
            direction: (3,) of the force; the worst one where None.
            hits: of a burst from rest; None for a steady train.

        Returns:
            deflections and torques, (p, 3) each.
        """
        rows = np.ascontiguousarray(poses, dtype=float)
        return peaks_at(self.model, rows, self.blows, hits=hits, direction=direction)[0]

    def stress(self, deflection: FloatArray) -> FloatArray:
        """The shear stress in MPa, by eqs. 14-17.

        Args:
            deflection: rad, any shape.
        """
        return np.asarray(deflection) * (self.given.stress_per_twist / 1e6)

    @cached_property
    def path_poses(self) -> FloatArray:
        """(4, 3) rad, Fig. 9's vertical path."""
        return self._reach(
            [(self.given.path_x, 0.0, z) for z in self.printed.task.path_heights], "path_x"
        )

    @cached_property
    def rivet_poses(self) -> FloatArray:
        """(15, 3) rad, Fig. 12's rivets."""
        return self._reach(rivet_points(self.given), "panel_x")

    def _reach(self, points: ArrayLike, key: str) -> FloatArray:
        poses = poses_at(points, self.given.elbow)
        if np.isnan(poses).any():
            value = getattr(self.given, key)
            problem = "puts rivets out of the arm's reach"
            raise InputError(problem, key=f"--assume {key}", value=value)
        return poses

    @cached_property
    def path_peaks(self) -> BatchPeaks:
        """Over all directions, on the vertical path."""
        return self.peaks(self.path_poses)

    def path_radii(self, angle: FloatArray, towards: ArrayLike = (0.0, 0.0, 1.0)) -> FloatArray:
        """Peaks on the vertical path under forces from +x by some angles towards a direction.

        Args:
            angle: (k,) rad.
            towards: (3,), square to x.

        Returns:
            (k, 4 poses, 3 joints) rad.
        """
        x = (1.0, 0.0, 0.0)
        cut = np.outer(np.cos(angle), x) + np.outer(np.sin(angle), np.asarray(towards))
        return np.array([self.peaks(self.path_poses, n).peak_deflection for n in cut])

    @property
    def lean(self) -> FloatArray:
        """(4 poses, 3 joints) degrees from +x to +z of the worst direction, in [-90, 90]."""
        n = self.path_peaks.direction
        return np.asarray(np.degrees(np.arctan2(n[..., 2] * np.sign(n[..., 0]), np.abs(n[..., 0]))))

    @property
    def waist(self) -> FloatArray:
        """(4 poses, 3 joints): an envelope's least radius in the arm's plane over its largest.

        0 for two balls that touch: a deflection with one direction of its own.
        """
        radii = self.path_radii(np.linspace(0.0, np.pi, 36, endpoint=False))
        found = radii.min(axis=0) / radii.max(axis=0).clip(1e-30)
        # Joint 1 answers to the force across the arm's plane alone.
        found[:, 0] = radii[:, :, 0].max(axis=0) / self.path_peaks.peak_deflection[:, 0]
        return np.asarray(found)

    @cached_property
    def reach(self) -> ReachMap:
        """Fig. 10's maps, in the steady state, of the elbow that is assumed."""
        turns, bends = (41, 24) if self.fine else (25, 13)
        limit, sign = self.printed.arm.limits, 1.0 if self.given.elbow == "down" else -1.0
        bend = sign * np.linspace(0.0, limit[2], bends)
        q2, q3 = np.meshgrid(np.linspace(-limit[1], limit[1], turns), bend, indexing="ij")
        poses = np.stack([np.zeros_like(q2), q2, q3], axis=-1).reshape(-1, 3)
        forces = {"worst": None, **dict(zip("xyz", np.eye(3), strict=True))}
        peaks = {k: 1e3 * self.peaks(poses, n).peak_deflection for k, n in forces.items()}
        shape = (turns, bends, 3)
        maps = {name: found.reshape(shape) for name, found in peaks.items()}
        return ReachMap(places_of(poses).reshape(shape), bend, maps)

    def rivet_peaks(self, hits: int | None = None) -> FloatArray:
        """Largest deflections at the rivets, (3 directions, 15 rivets, 3 joints) rad.

        Args:
            hits: of a burst from rest; None for the steady state.
        """
        directions = self.printed.directions
        return np.array([self.peaks(self.rivet_poses, n, hits).peak_deflection for n in directions])

    @cached_property
    def rivet_stress(self) -> FloatArray:
        """(3 directions, 15 rivets, 3 joints) MPa in the steady state: Figs. 13-15 (b)."""
        return self.stress(self.rivet_peaks())

    @property
    def worst(self) -> tuple[int, int, int]:
        """Direction, rivet and joint of the largest stress."""
        d, k, j = np.unravel_index(int(self.rivet_stress.argmax()), self.rivet_stress.shape)
        return int(d), int(k), int(j)

    @cached_property
    def at_worst(self) -> tuple[Any, FloatArray, int]:
        """The pose, the force's direction (3,) and the joint of the largest stress."""
        d, k, j = self.worst
        return ModelAtPose(self.model, self.rivet_poses[k]), self.printed.directions[d], j

    @cached_property
    def sweep(self) -> tuple[FloatArray, FloatArray]:
        """Joint 2 from full down to full up, joint 3 straight: (k,) rad, (k, 3) N m to hold it."""
        limit = self.printed.arm.limits[1]
        angle = np.linspace(-limit, limit, 181)
        return angle, np.abs([self.robot.gravity_torque([0.0, q, 0.0]) for q in angle])

    @property
    def share_held(self) -> float:
        """Share of that sweep in which joint 2's stated actuator is strong enough."""
        return float((self.sweep[1][:, 1] <= self.printed.arm.actuator_torques[1]).mean())

    @cached_property
    def gravity_stress(self) -> FloatArray:
        """(15, 3) MPa, gravity's steady stress in the shafts at the rivets."""
        torque = np.abs([self.robot.gravity_torque(pose) for pose in self.rivet_poses])
        return np.asarray(torque * stress_per_torque(self.robot.flexible_joints) / 1e6)

    def operations(self) -> tuple[Operation, ...]:
        """The three operations of section 4.3."""
        hits = self.printed.task.hits_per_rivet
        return tuple(
            Operation(row.direction, np.array(n), self.blows, hits, self.rivet_poses)
            for row, n in zip(self.printed.table2, self.printed.directions, strict=True)
        )


def random_worlds(
    count: int, seed: int = 0, base: Assumptions | None = None, paper: Printed | None = None
) -> list[World]:
    """Worlds with every unreported input drawn from its range (a Latin hypercube).

    Patterns that the arm cannot reach are drawn closer. The base gives what is not drawn: the
    shaft and the harmonics, which no peak depends on but by a factor that is the same for all
    joints.
    """
    rng = np.random.default_rng(seed)
    drawn = {name: entry for name, entry in trials().inputs.items() if entry.drawn}
    rank = np.argsort(rng.random((len(drawn), count)), axis=1)
    share = (rank + rng.random(rank.shape)) / count
    worlds = []
    for row in share.T:
        shares = zip(drawn.items(), row, strict=True)
        given = (base or Assumptions()).but(**{name: entry.at(u) for (name, entry), u in shares})
        while np.isnan(poses_at(rivet_points(given))).any():
            closer = {key: 0.9 * getattr(given, key) for key in ("panel_x", "panel_y", "pitch")}
            given = given.but(**closer)
        worlds.append(World(given, paper or printed()))
    return worlds
