"""Pinocchio's model of the rigid robot, with every call guarded.

Pinocchio crashes the interpreter on an unknown frame and corrupts memory when a model is
changed behind its data. Here the model is built once and never changed, frames are looked up
by name first, and every thread has its own data.
"""

from __future__ import annotations

import os
import tempfile
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from picchio.core.arrays import Vector, symmetric
from picchio.core.errors import InputError
from picchio.core.processes import on_threads
from picchio.robot.urdf.tree import UrdfTree

Array = NDArray[np.float64]
_STDERR_LOCK = threading.Lock()


Mass = tuple[float, str, tuple[float, ...] | None]
"""How often what `unit_inertia` gives of a link and a point: kg, or a factor; may be negative."""


class RigidModel:
    """Dynamics of the rigid robot in the coordinates that are free: mimic joints follow.

    Args:
        text: normalised URDF.
        tree: the robot's own tree, for its mimic joints.
        gravity: m/s^2, world.

    Raises:
        InputError: Pinocchio refuses the URDF; the message has its reason.
    """

    def __init__(self, text: str, tree: UrdfTree, gravity: Vector) -> None:
        self._text, self._tree, self._gravity = text, tree, gravity
        self._model = _build(text, tree.path)
        self._model.gravity.linear = np.asarray(gravity, dtype=float)
        every = list(self._model.names)[1:]
        free = [name for name in every if name not in tree.joints or not tree.joints[name].mimic]
        self.joint_names: tuple[str, ...] = tuple(free)
        # q = follow @ pose + offset; the identity where nothing mimics.
        self._follow, self._offset = _mimic_matrix(tree, every, free)
        self._plain = len(every) == len(free)
        self._all = len(every)
        self._frames: dict[str, int] = {
            frame.name: index
            for index, frame in enumerate(self._model.frames)
            if frame.type == pin.FrameType.BODY
        }
        self._local = threading.local()
        self._joints: tuple[NDArray[Any], ...] | None = None
        self._bodies: Array | None = None

    def with_masses(self, masses: Sequence[Mass]) -> RigidModel:
        """The same robot with masses added to its links; not picklable, unlike the original.

        Args:
            masses: what is fixed to which link.

        Raises:
            InputError: no such link, or one without a mass of its own.
        """
        if not masses:
            return self
        self._tables()  # where the joints are stays as it is
        changed = object.__new__(RigidModel)
        changed.__dict__.update(self.__dict__)
        changed._model, changed._local = self._model.copy(), threading.local()
        changed._bodies = None
        for weight, link, point in masses:
            own = unit_inertia(self._tree, link, point)
            frame = self._model.frames[self.frame(link)]
            # The ten parameters are linear in the mass: a body may be taken off, too.
            added = weight * frame.placement.act(own).toDynamicParameters()
            joint = frame.parentJoint
            now = changed._model.inertias[joint].toDynamicParameters()
            changed._model.inertias[joint] = pin.Inertia.FromDynamicParameters(now + added)
        return changed

    def __reduce__(self) -> tuple[Any, ...]:
        return RigidModel, (self._text, self._tree, self._gravity)

    @property
    def nv(self) -> int:
        """Degrees of freedom."""
        return len(self.joint_names)

    def _data(self) -> Any:
        data = getattr(self._local, "data", None)
        if data is None:
            data = self._local.data = self._model.createData()
        return data

    def _tables(self) -> tuple[NDArray[Any], ...]:
        """Rotations (k + 1, 3, 3) that lead the z axis to a joint's; what compiled code takes."""
        if self._joints is None:
            self._joints = _joint_tables(self._model)
        turns = self._joints[0]
        if self._bodies is None:
            rows = []
            for turn, body in zip(turns, self._model.inertias, strict=True):
                lever, mass = turn.T @ body.lever, body.mass
                about = turn.T @ body.inertia @ turn
                about += mass * (lever @ lever * np.eye(3) - np.outer(lever, lever))
                rows.append([mass, *(mass * lever), *about[np.tril_indices(3)]])
            self._bodies = np.array(rows)
        return (*self._joints, self._bodies)

    def _q(self, pose: Array) -> Array:
        if pose.shape != (self.nv,):
            raise InputError("the pose has the wrong shape", key="pose", value=pose.shape,
                             choices=[str((self.nv,))])  # fmt: skip
        return pose if self._plain else self._follow @ pose + self._offset

    def _reduce(self, matrix: Any) -> Array:
        # Pinocchio's bindings flatten matrices of one row or column.
        full = np.array(matrix).reshape(self._all, self._all)
        return full if self._plain else self._follow.T @ full @ self._follow

    def followed(self, joint: str) -> tuple[Array, float]:
        """A joint's position as row (nv,) @ pose + shift: more than a one where it mimics.

        Args:
            joint: its name.
        """
        row = list(self._model.names).index(joint) - 1
        return self._follow[row], float(self._offset[row])

    def frame(self, link: str) -> int:
        """The index, Pinocchio's, of a link's frame.

        Args:
            link: its name.

        Raises:
            InputError: no such link.
        """
        index = self._frames.get(link)
        if index is None:
            raise InputError("no such frame", key="frame", value=link, choices=self._frames)
        return index

    def _check_frame(self, frame: int) -> None:
        if not 0 <= frame < self._model.nframes:  # Pinocchio would crash
            raise InputError("no such frame", key="frame", value=frame)

    def mass_matrix(self, pose: Array) -> Array:
        """The mass matrix (nv, nv) in joint space, kg m^2, kg m, kg.

        Args:
            pose: (nv,) rad or m.
        """
        matrix = pin.crba(self._model, self._data(), self._q(pose))
        return self._reduce(matrix)

    def jacobian(self, pose: Array, frame: int) -> Array:
        """Jacobian (6, nv) of a frame's origin, world axes: linear m/rad, then angular.

        Args:
            pose: (nv,) rad or m.
            frame: of `frame`.
        """
        self._check_frame(frame)
        matrix = pin.computeFrameJacobian(
            self._model, self._data(), self._q(pose), frame, pin.LOCAL_WORLD_ALIGNED
        )
        full = np.array(matrix).reshape(6, self._all)
        return full if self._plain else full @ self._follow

    def mass_and_jacobian(
        self, poses: Array, frame: int, index: NDArray[np.intp] | None = None
    ) -> tuple[Array, Array]:
        """The mass matrices (p, n, n) and a frame's linear Jacobians (p, 3, n) at many poses.

        Compiled code, from Pinocchio's model: two calls a pose from Python take four times as long.

        Args:
            poses: (p, nv).
            frame: of `frame`.
            index: (n,) which coordinates are wanted; all if not given.

        Raises:
            InputError: poses of another shape, or no such frame.
        """
        follow = self._follow if index is None else self._follow[:, index]
        # Where a coordinate is one joint's, this joint's row is all that is wanted.
        picks = ((follow != 0.0).sum(axis=0) == 1).all() and (follow.max(axis=0) == 1.0).all()
        where = follow.argmax(axis=0) if picks else np.arange(self._all)
        mass, jacobian, _ = self._compiled(poses, frame, where)
        return (mass, jacobian) if picks else (follow.T @ mass @ follow, jacobian @ follow)

    def origins(self, poses: Array, frame: int) -> Array:
        """The positions (p, 3) in m, world, of a frame at many poses.

        Args:
            poses: (p, nv).
            frame: of `frame`.
        """
        return self._compiled(poses, frame, np.arange(0))[2]

    def _compiled(
        self, poses: Array, frame: int, where: NDArray[np.intp]
    ) -> tuple[Array, Array, Array]:
        """Mass matrices and Jacobians of n of Pinocchio's coordinates, and a frame's origins."""
        from picchio.robot.dynamics.rigid_kernel import SPAN, mass_and_jacobian

        self._check_frame(frame)
        if poses.ndim != 2 or poses.shape[1] != self.nv:
            raise InputError("the poses have the wrong shape", key="poses", value=poses.shape,
                             choices=[f"(p, {self.nv})"])  # fmt: skip
        rows = np.full(self._all + 1, -1)
        rows[where + 1] = np.arange(len(where))
        n, origin = len(where), np.empty((len(poses), 3))
        mass, jacobian = np.zeros((len(poses), n, n)), np.zeros((len(poses), 3, n))
        every = poses if self._plain else poses @ self._follow.T + self._offset
        turns, parent, rotation, offset, slides, bodies = self._tables()
        tip = self._model.frames[frame]
        on_threads(
            mass_and_jacobian, len(every), SPAN,
            parent, rotation, offset, slides, bodies, rows, tip.parentJoint,
            turns[tip.parentJoint].T @ tip.placement.translation,
            np.require(every, float, ("C", "W")), mass, jacobian, origin,
        )  # fmt: skip
        return mass, jacobian, origin

    def gravity_torque(self, pose: Array) -> Array:
        """Torque (nv,) that holds the arm against gravity, N m (N).

        Args:
            pose: (nv,) rad or m.
        """
        torque = pin.computeGeneralizedGravity(self._model, self._data(), self._q(pose))
        full = np.array(torque).reshape(self._all)
        return full if self._plain else self._follow.T @ full

    def gravity_gradient(self, pose: Array) -> Array:
        """The derivative (nv, nv) of gravity's torque by the pose, N m/rad.

        Args:
            pose: (nv,) rad or m.
        """
        matrix = pin.computeGeneralizedGravityDerivatives(self._model, self._data(), self._q(pose))
        return self._reduce(matrix)

    def inverse_dynamics(self, poses: Array, velocities: Array, accelerations: Array) -> Array:
        """Torques (m, nv) that the bodies' motion takes, N m (N); arguments (m, nv) each.

        Args:
            poses: (m, nv) rad or m.
            velocities: (m, nv) a second.
            accelerations: (m, nv) a second squared.
        """
        model, data = self._model, self._data()
        offset, zero = self._offset, np.zeros(self._all)
        full = [
            np.ascontiguousarray(x if self._plain else x @ self._follow.T + shift)
            for x, shift in ((poses, offset), (velocities, zero), (accelerations, zero))
        ]
        every = [np.array(pin.rnea(model, data, *state)) for state in zip(*full, strict=True)]
        torque = np.array(every).reshape(len(poses), self._all)
        return torque if self._plain else torque @ self._follow

    def placement(self, pose: Array, frame: int) -> tuple[Array, Array]:
        """The world position (3,) in m and rotation (3, 3) of a frame.

        Args:
            pose: (nv,) rad or m.
            frame: of `frame`.
        """
        self._check_frame(frame)
        data = self._data()
        pin.forwardKinematics(self._model, data, self._q(pose))
        placement = pin.updateFramePlacement(self._model, data, frame)
        return np.array(placement.translation), np.array(placement.rotation)

    def total_mass(self) -> float:
        """The mass of all bodies that can move, kg."""
        return float(sum(body.mass for body in list(self._model.inertias)[1:]))

    def mass_of(self, link: str) -> float:
        """The mass of all that is fixed to a link, kg.

        Args:
            link: its name.

        Raises:
            InputError: no such link.
        """
        place = self._model.frames[self.frame(link)]
        return float(self._model.inertias[place.parentJoint].mass)

    def length(self, link: str) -> float:
        """From the first joint to a link's frame along all joints between, m.

        Args:
            link: its name.

        Raises:
            InputError: no such link.
        """
        model, place = self._model, self._model.frames[self.frame(link)]
        joints = list(model.supports[place.parentJoint])[2:]
        offsets = [place.placement, *(model.jointPlacements[j] for j in joints)]
        return float(sum(np.linalg.norm(each.translation) for each in offsets))


def unit_inertia(tree: UrdfTree, link: str, point: tuple[float, ...] | None) -> pin.Inertia:
    """The inertia, in a link's frame, of 1 kg at a point; of the link itself without a point.

    Args:
        tree: the robot.
        link: its name.
        point: (3,) m in the link's frame.

    Raises:
        InputError: the URDF gives the link none.
    """
    if point is not None:
        return pin.Inertia(1.0, np.array(point, dtype=float), np.zeros((3, 3)))
    own = tree.links.get(link)
    if own is None:
        raise InputError(
            "the URDF gives this link no mass",
            value=link,
            choices=[name for name, inertial in tree.links.items() if inertial],
        )
    turn = pin.rpy.rpyToMatrix(*own.rpy)
    return pin.Inertia(own.mass, np.array(own.xyz), turn @ symmetric(own.inertia) @ turn.T)


def _joint_tables(model: pin.Model) -> tuple[NDArray[Any], ...]:
    """Turns, parents, rotations, offsets, slides: see `rigid_kernel.mass_and_jacobian`."""
    count, data = model.njoints, model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    turns, rotation = np.tile(np.eye(3), (count, 1, 1)), np.tile(np.eye(3), (count, 1, 1))
    parent, offset = np.array(list(model.parents), dtype=np.int64), np.zeros((count, 3))
    slides = np.zeros(count, dtype=np.int64)
    for j in range(1, count):
        # The bindings flatten matrices of one column.
        own = np.array(pin.getJointJacobian(model, data, j, pin.LOCAL)).reshape(6, -1)[:, j - 1]
        slides[j] = not own[3:].any()
        axis = own[:3] if slides[j] else own[3:]
        across = np.cross(np.eye(3)[np.abs(axis).argmin()], axis)
        across /= np.linalg.norm(across)
        turns[j] = np.stack([across, np.cross(axis, across), axis], axis=1)
        before, here = turns[parent[j]], model.jointPlacements[j]
        rotation[j] = before.T @ here.rotation @ turns[j]
        offset[j] = before.T @ here.translation
    return turns, parent, rotation, offset, slides


def _mimic_matrix(tree: UrdfTree, every: list[str], free: list[str]) -> tuple[Array, Array]:
    column = {name: index for index, name in enumerate(free)}
    follow = np.zeros((len(every), len(free)))
    offset = np.zeros(len(every))
    joints: Mapping[str, Any] = tree.joints
    for row, name in enumerate(every):
        factor, shift = 1.0, 0.0
        while name in joints and joints[name].mimic is not None:
            mimic = joints[name].mimic
            shift += factor * mimic.offset
            factor *= mimic.multiplier
            name = mimic.joint
        follow[row, column[name]] = factor
        offset[row] = shift
    return follow, offset


def _build(text: str, path: Path) -> pin.Model:
    with _caught_stderr() as said:
        try:
            return pin.buildModelFromXML(text)
        except Exception as error:
            reason = str(error)
    # urdfdom gives its reason on C++'s stderr only.
    spoken = " ".join(said[0].split()) if said else ""
    raise InputError(f"Pinocchio refuses this URDF: {spoken or reason}", file=path)


@contextmanager
def _caught_stderr() -> Iterator[list[str]]:
    """Collect what C++ writes to stderr in this block."""
    said: list[str] = []
    with _STDERR_LOCK, tempfile.TemporaryFile() as sink:
        try:
            kept = os.dup(2)
        except OSError:  # stderr is closed
            yield said
            return
        os.dup2(sink.fileno(), 2)
        try:
            yield said
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            sink.seek(0)
            said.append(sink.read(4000).decode("utf-8", "replace"))
