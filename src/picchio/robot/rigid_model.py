"""Pinocchio's model of the rigid robot, with every call guarded.

Pinocchio crashes the interpreter on an unknown frame and corrupts memory when a model is
changed behind its data. Here the model is built once and never changed, frames are looked up
by name first, and every thread has its own data.
"""

from __future__ import annotations

import os
import tempfile
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from picchio.core.errors import InputError
from picchio.robot.tool import Vector
from picchio.robot.urdf_tree import UrdfTree

Array = NDArray[np.float64]
_STDERR_LOCK = threading.Lock()


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

    def __reduce__(self) -> tuple[Any, ...]:
        return RigidModel, (self._text, self._tree, self._gravity)

    @property
    def nv(self) -> int:
        """Degrees of freedom."""
        return len(self.joint_names)

    @property
    def links(self) -> tuple[str, ...]:
        """Names of all links."""
        return tuple(self._frames)

    def _data(self) -> Any:
        data = getattr(self._local, "data", None)
        if data is None:
            data = self._local.data = self._model.createData()
        return data

    def _q(self, pose: Array) -> Array:
        if pose.shape != (self.nv,):
            raise InputError("a pose of the wrong shape", key="pose", value=pose.shape,
                             choices=[str((self.nv,))])  # fmt: skip
        return pose if self._plain else self._follow @ pose + self._offset

    def _reduce(self, matrix: Any) -> Array:
        # Pinocchio's bindings flatten matrices of one row or column.
        full = np.array(matrix).reshape(self._all, self._all)
        return full if self._plain else self._follow.T @ full @ self._follow

    def followed(self, joint: str) -> tuple[Array, float]:
        """A joint's position as row (nv,) @ pose + shift: more than a one where it mimics."""
        row = list(self._model.names).index(joint) - 1
        return self._follow[row], float(self._offset[row])

    def frame(self, link: str) -> int:
        """Pinocchio's index of a link's frame.

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
        """Joint-space mass matrix (nv, nv), kg m^2, kg m, kg."""
        matrix = pin.crba(self._model, self._data(), self._q(pose))
        return self._reduce(matrix)

    def jacobian(self, pose: Array, frame: int) -> Array:
        """Jacobian (6, nv) of a frame's origin, world axes: linear m/rad, then angular."""
        self._check_frame(frame)
        matrix = pin.computeFrameJacobian(
            self._model, self._data(), self._q(pose), frame, pin.LOCAL_WORLD_ALIGNED
        )
        full = np.array(matrix).reshape(6, self._all)
        return full if self._plain else full @ self._follow

    def mass_and_jacobian(self, poses: Array, frame: int) -> tuple[Array, Array]:
        """Mass matrices (p, nv, nv) and a frame's linear Jacobians (p, 3, nv) at many poses.

        Two Pinocchio calls a pose and nothing else: the floor under the cost of a map.
        """
        self._check_frame(frame)
        if poses.ndim != 2 or poses.shape[1] != self.nv:
            raise InputError("poses of the wrong shape", key="poses", value=poses.shape,
                             choices=[f"(p, {self.nv})"])  # fmt: skip
        if not len(poses):
            return np.empty((0, self.nv, self.nv)), np.empty((0, 3, self.nv))
        model, data, size = self._model, self._data(), self._all
        crba, frame_jacobian, world = pin.crba, pin.computeFrameJacobian, pin.LOCAL_WORLD_ALIGNED
        masses, jacobians = [], []
        every = poses if self._plain else poses @ self._follow.T + self._offset
        for q in np.ascontiguousarray(every):
            masses.append(crba(model, data, q))  # a copy of its own
            jacobians.append(frame_jacobian(model, data, q, frame, world))
        # The bindings flatten matrices of one row or column.
        mass = np.concatenate(masses, axis=None).reshape(-1, size, size)
        jacobian = np.concatenate(jacobians, axis=None).reshape(-1, 6, size)[:, :3]
        if self._plain:
            return mass, jacobian
        return self._follow.T @ mass @ self._follow, jacobian @ self._follow

    def gravity_torque(self, pose: Array) -> Array:
        """Torque (nv,) that holds the arm against gravity, N m (N)."""
        torque = pin.computeGeneralizedGravity(self._model, self._data(), self._q(pose))
        full = np.array(torque).reshape(self._all)
        return full if self._plain else self._follow.T @ full

    def gravity_gradient(self, pose: Array) -> Array:
        """Its derivative (nv, nv) by the pose, N m/rad."""
        matrix = pin.computeGeneralizedGravityDerivatives(self._model, self._data(), self._q(pose))
        return self._reduce(matrix)

    def placement(self, pose: Array, frame: int) -> tuple[Array, Array]:
        """World position (3,) in m and rotation (3, 3) of a frame."""
        self._check_frame(frame)
        data = self._data()
        pin.forwardKinematics(self._model, data, self._q(pose))
        placement = pin.updateFramePlacement(self._model, data, frame)
        return np.array(placement.translation), np.array(placement.rotation)

    def total_mass(self) -> float:
        """Mass of all bodies that can move, kg."""
        return float(sum(body.mass for body in list(self._model.inertias)[1:]))


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
