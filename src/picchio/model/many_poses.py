"""A model at many poses at once: the matrices that compiled code takes."""

from __future__ import annotations

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.model.conditions import Conditions
from picchio.model.model import Model
from picchio.model.plant import Changes
from picchio.robot.dynamics.rigid_model import RigidModel
from picchio.robot.dynamics.statics import balancing, stiffness_at_torque


class ManyPoses:
    """Mass matrix, Jacobian, springs and damping of a model at p poses of n flexible joints.

    Args:
        model: the robot and its effects.
        poses: (p, nv) rad or m, taken unchecked.

    Attributes:
        compiled: whether compiled code can take it: linear, modally damped, carried by nothing
            but the joints' own springs. Otherwise only `gravity_torque` holds, and each pose is
            a `ModelAtPose` of its own.
        stiffness: (p, n) N m/rad; with a stiffness curve, the slope at gravity's torque.
        damping_ratio: (n,).

    Raises:
        InputError: an effect whose target the robot does not have.
    """

    def __init__(self, model: Model, poses: FloatArray) -> None:
        robot = self._robot = model.robot
        self._model, self._poses = model, poses
        self._rigid = robot.rigid
        self._joint_inertia = np.zeros(len(robot.flexible_joints))
        self.damping_ratio = robot.damping_ratio
        self.stiffness = np.tile(robot.stiffness, (len(poses), 1))
        if any(joint.stiffness_curve is not None for joint in robot.flexible_joints):
            self.stiffness = stiffness_at_torque(robot.flexible_joints, self._held(robot.rigid))
        self.compiled = not (model.gravity_stiffness or model.nonlinear)
        if model.changes_structure and not model.nonlinear:
            self._change()

    def _change(self) -> None:
        """Take the effects in: what they do to the springs may depend on the pose."""
        first: Changes | None = None
        names = self._robot.flexible_names
        for k, row in enumerate(self.stiffness):
            springs = dict(zip(names, row, strict=True))
            angles = self._poses[k, self._robot.flexible_index]
            changes = Changes(self._robot, springs, Conditions(), angles)
            for effect in self._model.ordered:
                effect.structure(changes)
            self.stiffness[k] = list(changes.springs.values())
            first = first or changes
        if first is None:
            return
        self.compiled = self.compiled and first.joints_only and not first.force_offset.any()
        self.damping_ratio = first.damping_scale * self._robot.damping_ratio
        self._rigid = self._robot.rigid.with_masses(first.added_masses)
        for joint, inertia in first.added_inertias:
            if joint in names:
                self._joint_inertia[names.index(joint)] += inertia

    def mass_and_jacobian(self) -> tuple[FloatArray, FloatArray]:
        """M (p, n, n) kg m^2 and J (p, 3, n) m, force along the programmed direction, world."""
        robot, index = self._robot, self._robot.flexible_index
        point = self._rigid.frame(robot.tool_point)
        mass, jacobian = self._rigid.mass_and_jacobian(self._poses, point, index)
        if self._joint_inertia.any():
            mass = mass + np.diag(self._joint_inertia)
        if self._model.changes_blows:
            tool = self._rigid.frame(robot.tool_frame)
            turns = [
                self._model.force_directions(self._rigid.placement(pose, tool)[1])
                for pose in self._poses
            ]
            # J^T F with F = turn @ programmed.
            jacobian = np.einsum("pde,pdn->pen", np.array(turns).reshape(-1, 3, 3), jacobian)
        return mass, np.ascontiguousarray(jacobian)

    def modes(self) -> tuple[FloatArray, FloatArray]:
        """Undamped modes, by Cholesky's factor of the masses.

        Returns:
            (p, n) rad/s, ascending; (p, n, n) shapes S, a mode a column, with S^T M S = I.
        """
        mass, _ = self.mass_and_jacobian()
        root = np.linalg.inv(np.linalg.cholesky(mass))
        squared, vectors = np.linalg.eigh(np.einsum("pij,pj,pkj->pik", root, self.stiffness, root))
        return np.sqrt(squared), np.einsum("pji,pjk->pik", root, vectors)

    def gravity_torque(self) -> FloatArray:
        """(p, n) N m (N), that the springs carry at rest, added masses included."""
        if self._model.gravity_balanced:
            return np.zeros_like(self.stiffness)
        return self._held(self._rigid)

    def static_torque(self, preload: float, along: FloatArray) -> FloatArray:
        """(p, n) N m, through the springs before the first blow: feed force and gravity.

        Args:
            preload: N, the feed force.
            along: (3,) or (p, 3), its direction as programmed.
        """
        static = -self.gravity_torque()
        if not preload:
            return static
        jacobian = self.mass_and_jacobian()[1]
        return np.asarray(
            static
            + preload * np.einsum("pdn,pd->pn", jacobian, np.broadcast_to(along, (len(static), 3)))
        )

    def _held(self, rigid: RigidModel) -> FloatArray:
        robot, index = self._robot, self._robot.flexible_index
        held = np.array([rigid.gravity_torque(pose) for pose in self._poses])
        held = held.reshape(len(self._poses), len(robot.joint_names))[:, index]
        if any(joint.balancer is not None for joint in robot.flexible_joints):
            rows = self._poses[:, index]
            added = [balancing(robot.flexible_joints, robot.tree, row)[0] for row in rows]
            held = held + np.array(added).reshape(held.shape)
        return np.asarray(held)
