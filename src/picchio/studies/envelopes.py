"""The direction envelope of every joint at a pose: paper Fig. 9, without sampling directions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike

from picchio.core import spoken
from picchio.core.arrays import FloatArray, IndexArray
from picchio.core.errors import InputError
from picchio.core.listing import InUnit, Key, Listing
from picchio.core.processes import one_thread
from picchio.core.provenance import provenance
from picchio.core.results import TableResult
from picchio.core.shown import seeing
from picchio.excitation.excitation import Excitation
from picchio.fatigue.shaft_stress import shaft_stress_per_torque
from picchio.model.model import Model, ModelLike
from picchio.robot.units import JointUnits, units_of
from picchio.robot.varied import cases_of
from picchio.studies.default_task import task_of
from picchio.studies.rivet.pose import ModelAtPose
from picchio.studies.tasks import blows_of
from picchio.vibration.closed_form.response import Response, described, peak_deflections

FORMAT = "picchio-envelope/1"
Quantity = Literal["deflection", "torque", "stress"]
QUANTITIES: tuple[Quantity, ...] = ("deflection", "torque", "stress")
# Between these quantiles 80 % of drawn robots lie.
ENDS = (0.1, 0.9)
_TIMES = 1024  # of a drawn case's curve


@dataclass(frozen=True, eq=False, repr=False)
class DirectionEnvelope(TableResult):
    """What a force can do to each joint, by its direction.

    Joint j's deflection under a force along the unit vector n is g_j(t) . n, so its peak is the
    support function of the curve g_j and its mirror image: max over t of |g_j(t) . n|. Its
    largest value over n is max |g_j(t)|, along g_j there.

    Attributes:
        robot: name.
        joint_names: n names.
        kinds: (n) "revolute" or "prismatic"; of a prismatic joint, rad read m and N m read N.
        pose: (nv,) rad or m.
        tool_position: (3,) m.
        excitation: the blows.
        hits: of a burst from rest, or None for the steady state.
        natural_frequencies: (n,) Hz.
        peak_deflection: (n,) rad, exact maximum over time and direction.
        worst_direction: (n, 3) unit vectors, either sign.
        peak_tool_displacement: m, the tool's largest displacement over time and direction.
        worst_tool_direction: (3,) the force direction that gives it.
        torque_factor: (n,) N m/rad, torque per deflection.
        stress_factor: (n,) Pa/rad, shear stress per deflection; NaN without a shaft.
        response: the closed form behind it all.
        notes: what was left out, and why.
        cases: (c, n, 3, t) rad, where a stiffness or damping is an estimate: the curves g_j(t) of
            drawn robots at times so near that a peak is missed by 1 %; else c is 0.
        case_stiffness: (c, n) N m/rad, of theirs.
    """

    PLOTS: ClassVar = {"polar": "visuals.plots.polar:plot_polar_envelope"}

    robot: str
    joint_names: tuple[str, ...]
    kinds: tuple[str, ...]
    pose: FloatArray
    tool_position: FloatArray
    excitation: Excitation
    hits: int | None
    natural_frequencies: FloatArray
    peak_deflection: FloatArray
    worst_direction: FloatArray
    peak_tool_displacement: float
    worst_tool_direction: FloatArray
    torque_factor: FloatArray
    stress_factor: FloatArray
    response: Response
    notes: tuple[str, ...] = ()
    cases: FloatArray = field(default_factory=lambda: np.empty((0, 0, 3, 0)))
    case_stiffness: FloatArray = field(default_factory=lambda: np.empty((0, 0)))
    origin: Mapping[str, Any] = field(default_factory=dict)

    @property
    def units(self) -> tuple[JointUnits, ...]:
        """(n) how each joint's values are written."""
        return tuple(map(units_of, self.kinds))

    def peak(self, quantity: Quantity = "deflection") -> FloatArray:
        """(n,) largest value over all directions: rad, N m or Pa; along `worst_direction`.

        Args:
            quantity: "deflection", "torque" or "stress".
        """
        return self.peak_deflection * self._factor(quantity)

    @property
    def estimated(self) -> bool:
        """Whether a stiffness or damping that it depends on is an estimate."""
        return bool(len(self.cases))

    def peak_interval(self, quantity: Quantity = "deflection") -> FloatArray:
        """(n, 2) P10 and P90 of `peak` in the drawn cases; itself where nothing is estimated.

        Args:
            quantity: as in `peak`.
        """
        if not self.estimated:
            return np.repeat(self.peak(quantity)[:, None], 2, axis=1)
        longest = np.sqrt((self.cases**2).sum(axis=2).max(axis=2))
        return np.quantile(longest * self._case_factor(quantity), ENDS, axis=0).T

    def band(self, directions: ArrayLike, quantity: Quantity = "deflection") -> FloatArray:
        """(2, n, d) P10 and P90 of `support` in the drawn cases.

        Args:
            directions: (d, 3) unit vectors.
            quantity: as in `support`.
        """
        if not self.estimated:
            return np.repeat(self.support(directions, quantity)[None], 2, axis=0)
        wanted = np.atleast_2d(np.asarray(directions, dtype=float))
        every = np.array([np.abs(wanted @ case).max(axis=2) for case in self.cases])
        every *= self._case_factor(quantity)[:, :, None]
        return np.asarray(np.quantile(every, ENDS, axis=0))

    def _case_factor(self, quantity: Quantity) -> FloatArray:
        """(c, n), as `_factor`: a stiffer drawn spring brings more torque for its deflection."""
        factor = np.broadcast_to(self._factor(quantity), self.case_stiffness.shape)
        if quantity == "deflection":
            return factor
        return factor * self.case_stiffness / self.torque_factor

    def _factor(self, quantity: Quantity) -> FloatArray:
        factors = {
            "deflection": np.ones_like(self.torque_factor),
            "torque": self.torque_factor,
            "stress": self.stress_factor,
        }
        if quantity not in factors:
            raise InputError("unknown", key="quantity", value=quantity, choices=QUANTITIES)
        return factors[quantity]

    def support(self, directions: ArrayLike, quantity: Quantity = "deflection") -> FloatArray:
        """Peak of every joint for each direction, exact in time.

        Args:
            directions: (d, 3) unit vectors.
            quantity: "deflection" (rad), "torque" (N m) or "stress" (Pa).

        Returns:
            (n, d).
        """
        return peak_deflections(self.response, directions) * self._factor(quantity)[:, None]

    def surface(
        self, joint: str | int, subdivisions: int = 3, quantity: Quantity = "deflection"
    ) -> tuple[FloatArray, IndexArray]:
        """The envelope as a mesh: the paper's double ball.

        Args:
            joint: name or index.
            subdivisions: of an icosahedron; 3 gives 642 vertices.
            quantity: as in `support`.

        Returns:
            vertices (v, 3), each a direction times the peak for it, and faces (f, 3).
        """
        j = self.joint_names.index(joint) if isinstance(joint, str) else joint
        vertices, faces = self.surfaces(subdivisions, quantity)
        return vertices[j], faces

    def surfaces(
        self, subdivisions: int = 3, quantity: Quantity = "deflection"
    ) -> tuple[FloatArray, IndexArray]:
        """The envelopes of all joints as meshes.

        Args:
            subdivisions: of an icosahedron.
            quantity: as in `support`.

        Returns:
            vertices (n, v, 3) and faces (f, 3).
        """
        directions, faces = icosphere(subdivisions)
        # The envelope is the same both ways along a line, so each line is computed once.
        line = np.where(_upper_half(directions)[:, None], directions, -directions).round(9)
        _, first, which = np.unique(line, axis=0, return_index=True, return_inverse=True)
        radius = self.support(directions[first], quantity)[:, which.ravel()]
        return directions * radius[:, :, None], faces

    def _headline(self) -> str:
        peaks = dict(zip(self.joint_names, self.peak_deflection.tolist(), strict=True))
        return f"{self.robot!r}, peak_deflection={peaks}"

    def _rows(self) -> list[dict[str, Any]]:
        return [
            {key: value for key, value in joint.items() if key != "worst_direction"}
            | dict(zip(("worst_x", "worst_y", "worst_z"), joint["worst_direction"], strict=True))
            for joint in self._content()["joints"]
        ]

    def _listing(self) -> Listing:
        """What each joint bears at worst, and along which direction."""
        peaks, torques = self._told(1e3, "deflection"), self._told(1.0, "torque")
        stresses, along = 1e-6 * self.peak("stress"), self.worst_direction.round(9) + 0.0
        columns: dict[str, Key] = {
            "joint": lambda j: self.joint_names[j],
            "peak deflection": lambda j: InUnit(peaks[j], self.units[j].small),
            "peak torque": lambda j: InUnit(torques[j], self.units[j].load),
            "peak stress [MPa]": lambda j: stresses[j],
            "worst direction (either sign) [x, y, z]": lambda j: ", ".join(
                f"{c:.3f}" for c in along[j]
            ),
        }
        facts = {
            "pose [rad, m]": self.pose,
            "blows": self.excitation.describe(),
            "response": described(self.hits),
            "natural frequencies [Hz]": self.natural_frequencies,
        }
        k = int(self.peak_deflection.argmax())
        told = ", ".join(f"{c:.3g}" for c in self.worst_direction[k])
        most = f"{1e3 * self.peak_deflection[k]:.4g} {self.units[k].small}"
        return Listing.of(
            f"Direction envelope of {self.robot}",
            range(len(self.joint_names)),
            columns,
            facts=facts,
            head=f"{self.joint_names[k]} most, {most} along ({told})",
        )

    def _told(self, scale: float, quantity: Quantity) -> list[float | str]:
        """The peaks; as intervals where they are estimates."""
        both = zip(self.peak(quantity), self.peak_interval(quantity), strict=True)
        return [
            scale * peak if low == high else spoken.between((scale * low, scale * high))
            for peak, (low, high) in both
        ]

    def _content(self) -> dict[str, Any]:
        joints = {
            "name": self.joint_names,
            "kind": self.kinds,
            "peak_deflection": self.peak_deflection,
            "worst_direction": self.worst_direction,
            "peak_torque": self.peak("torque"),
            "peak_shear_stress": self.peak("stress"),
        }
        if self.estimated:
            joints |= {"peak_deflection_interval": self.peak_interval(),
                       "peak_torque_interval": self.peak_interval("torque")}  # fmt: skip
        return {
            "format": FORMAT,
            "robot": self.robot,
            "estimated": self.estimated,
            "pose": self.pose,
            "tool_position": self.tool_position,
            "excitation": {**self.excitation.to_dict(), "hits": self.hits},
            "response": described(self.hits),
            "natural_frequencies": self.natural_frequencies,
            "joints": [
                dict(zip(joints, row, strict=True)) for row in zip(*joints.values(), strict=True)
            ],
            "tool": {
                "peak_displacement": self.peak_tool_displacement,
                "worst_direction": self.worst_tool_direction,
            },
            "notes": list(self.notes),
            "provenance": dict(self.origin),
        }


@one_thread()
def envelope(
    robot: ModelLike,
    pose: ArrayLike | Mapping[str, float] | str | None = None,
    excitation: Excitation | None = None,
    *,
    hits: int | None = None,
    gravity_stiffness: bool | None = None,
) -> DirectionEnvelope:
    """The exact direction envelope of every joint at a pose.

    Args:
        robot: as `load_robot` takes it, with stiffnesses; or a model of it.
        pose: (nv,) rad or m; the first of the robot's task if not given.
        excitation: the blows; those of the robot's example task if not given, else 300 N, 4 ms
            wide, one every 40 ms.
        hits: of a burst from rest with its ring-down; None for the steady state.
        gravity_stiffness: add dg/dq to the springs; as the model has it if not given.

    Returns:
        the envelope, over the directions as programmed: a force that an effect turns is turned
        from each of them. Where a value is an estimate, drawn cases stand beside it.

    Raises:
        InputError: a bad pose, a resonance without damping, no flexible joint, a nonlinear model
            (whose worst direction has no closed form), an effect that has no steady state.
    """
    model = Model.of(robot, gravity_stiffness=gravity_stiffness)
    if pose is None:
        pose = task_of(model.robot).operations[0].poses[0]
    excitation = excitation or blows_of(model.robot)
    at = ModelAtPose(model, model.robot.pose(pose))
    response = at.response(excitation, hits)
    worst = response.worst_directions()
    if not all(np.isfinite(w.value) for w in worst):
        raise InputError("the deflections overflow", key="force", value=excitation.peak_force)
    tool, direction = at.tool_response(excitation, hits).worst_combination(np.eye(3))
    curves, stiffness = _cases(model, at.pose, excitation, hits)
    found = DirectionEnvelope(
        robot=model.robot.name,
        joint_names=model.robot.flexible_names,
        kinds=tuple(joint.kind for joint in model.robot.flexible_joints),
        pose=at.pose,
        tool_position=at.state.tool_position,
        excitation=excitation,
        hits=hits,
        natural_frequencies=at.natural_frequencies,
        peak_deflection=np.array([w.value for w in worst]),
        worst_direction=np.array([w.direction for w in worst]),
        peak_tool_displacement=tool,
        worst_tool_direction=direction,
        torque_factor=np.array(at.stiffness),
        stress_factor=at.stiffness * shaft_stress_per_torque(model.robot.flexible_joints),
        response=response,
        notes=model.without_load(),
        cases=curves,
        case_stiffness=stiffness,
        origin=provenance(model.robot.files),
    )
    return seeing(found, robot=model, pose=at.pose, excitation=excitation, hits=hits)


def _cases(
    model: Model, pose: FloatArray, excitation: Excitation, hits: int | None
) -> tuple[FloatArray, FloatArray]:
    """Of drawn robots, where springs are estimates: g_j(t) (c, n, 3, t) and stiffness (c, n)."""
    n = len(model.robot.flexible_joints)
    curves, stiffness = [], []
    for robot in cases_of(model.robot):
        at = ModelAtPose(replace(model, robot=robot), pose)
        response = at.response(excitation, hits)
        force, slowest = response.force, 1.0 / at.natural_frequencies[0]
        end = force.end if response.periodic else float(force.start[-1]) + slowest
        curves.append(response.unit_deflection(np.linspace(0.0, end, _TIMES)))
        stiffness.append(at.stiffness)
    if not curves:
        return np.empty((0, n, 3, 0)), np.empty((0, n))
    return np.array(curves), np.array(stiffness)


def icosphere(subdivisions: int) -> tuple[FloatArray, IndexArray]:
    """Unit vectors (v, 3) and faces (f, 3) of a subdivided icosahedron, v = 10 4^s + 2."""
    from trimesh.creation import icosphere as ball

    mesh = ball(subdivisions)
    return np.array(mesh.vertices), np.array(mesh.faces)


def _upper_half(directions: FloatArray) -> FloatArray:
    """One of each pair of opposite vectors."""
    x, y, z = np.round(directions, 9).T
    return np.asarray((z > 0) | ((z == 0) & ((y > 0) | ((y == 0) & (x > 0)))))
