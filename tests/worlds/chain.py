"""Bodies and what joins them: read from pinocchio's model, then added to."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin


@dataclass(frozen=True, eq=False)
class Chain:
    """Bodies and what joins them.

    Attributes:
        names: of the coordinates; the URDF's joints keep their names.
        parent: (n,) index of the parent body + 1; 0 is the world.
        rotation, offset: (n, 3, 3), (n, 3): the joint's frame in its parent body's.
        prismatic: (n,) bool.
        axis: (n, 3) in the joint's frame.
        mass, com, inertia: (n,), (n, 3), (n, 3, 3): in the body's frame, about its CoM.
        spin: (n, 3) angular momentum of a rotor fixed in the body, its axes.
        tool: body that carries the tool; tool_rotation, tool_offset: the tool frame in it.
        base: (mass, com, inertia) of what stands still as long as no base moves.
    """

    names: tuple[str, ...]
    parent: np.ndarray
    rotation: np.ndarray
    offset: np.ndarray
    prismatic: np.ndarray
    axis: np.ndarray
    mass: np.ndarray
    com: np.ndarray
    inertia: np.ndarray
    spin: np.ndarray
    tool: int
    tool_rotation: np.ndarray
    tool_offset: np.ndarray
    base: tuple[float, np.ndarray, np.ndarray]

    def arrays(self):
        """What the compiled functions take."""
        return (
            self.parent, self.rotation, self.offset, self.prismatic, self.axis,
            self.mass, self.com, self.inertia, self.spin,
        )  # fmt: skip

    def insert(self, before, name, axis, prismatic=False):
        """A massless body with a further coordinate, between coordinate `before` and its parent.

        The new joint has the frame of the old one, which keeps its axis and turns with it.
        """
        at = self.names.index(before)

        def put(array, value):
            return np.insert(array, at, value, axis=0)

        parent = np.where(self.parent > at, self.parent + 1, self.parent)
        own = parent[at]
        parent = put(parent, own)
        parent[at + 1] = at + 1
        rotation, offset = put(self.rotation, self.rotation[at]), put(self.offset, self.offset[at])
        rotation[at + 1], offset[at + 1] = np.eye(3), 0.0
        return replace(
            self,
            names=(*self.names[:at], name, *self.names[at:]),
            parent=parent,
            rotation=rotation,
            offset=offset,
            prismatic=put(self.prismatic, prismatic),
            axis=put(self.axis, axis),
            mass=put(self.mass, 0.0),
            com=put(self.com, 0.0),
            inertia=put(self.inertia, np.zeros((3, 3))),
            spin=put(self.spin, 0.0),
            tool=self.tool + 1 if self.tool >= at else self.tool,
        )

    def end_of(self, body):
        """(3,) m, body's axes: where the next body begins, or the tool is; else twice the CoM."""
        children = np.flatnonzero(self.parent == body + 1)
        ends = [self.offset[i] for i in children] or [self.tool_offset]
        end = max(ends, key=np.linalg.norm)
        return end if np.linalg.norm(end) > 1e-6 else 2.0 * self.com[body]

    def split(self, body, name, share, angle):
        """A hinge across a body, `share` of the way to its end: what lies beyond is a new body.

        Each half has half the mass, the halves' CoMs stand apart along the body, and together they
        are the old body. The hinge's axis is across the body, at `angle` (rad) from one such way.
        """
        end = self.end_of(body)
        along = end / np.linalg.norm(end)
        one, other = np.linalg.svd(along[None])[2][1:]
        mass, com, inertia = self.mass[body], self.com[body], self.inertia[body]
        spread = 0.5 * np.trace(inertia) * np.eye(3) - inertia  # second moments of the mass
        apart = np.zeros(3)
        if mass > 0.0 and along @ spread @ along > 0.0:
            apart = 0.8 * spread @ along / np.sqrt(mass * (along @ spread @ along))
        half = 0.5 * (inertia - mass * (apart @ apart * np.eye(3) - np.outer(apart, apart)))
        at, root = body + 1, share * end
        masses, coms, inertias = self.mass.copy(), self.com.copy(), self.inertia.copy()
        masses[body], coms[body], inertias[body] = 0.5 * mass, com - apart, half
        beyond = self.parent == body + 1
        offset = self.offset.copy()
        offset[beyond] -= root

        def put(array, value):
            return np.insert(array, at, value, axis=0)

        parent = np.where(self.parent > body, self.parent + 1, self.parent)
        carries = self.tool == body
        return replace(
            self,
            names=(*self.names[:at], name, *self.names[at:]),
            parent=put(parent, body + 1),
            rotation=put(self.rotation, np.eye(3)),
            offset=put(offset, root),
            prismatic=put(self.prismatic, False),
            axis=put(self.axis, np.cos(angle) * one + np.sin(angle) * other),
            mass=put(masses, 0.5 * mass),
            com=put(coms, com + apart - root),
            inertia=put(inertias, half),
            spin=put(self.spin, 0.0),
            tool=self.tool + 1 if self.tool >= body else self.tool,
            tool_offset=self.tool_offset - root if carries else self.tool_offset,
        )

    def on_moving_base(self, name, axis, prismatic):
        """The robot's base on a further coordinate along or about a world axis through its root."""
        mass, com, inertia = self.base
        parent = np.concatenate([[0], self.parent + 1])
        return replace(
            self,
            names=(name, *self.names),
            parent=parent,
            rotation=np.concatenate([np.eye(3)[None], self.rotation]),
            offset=np.concatenate([np.zeros((1, 3)), self.offset]),
            prismatic=np.concatenate([[prismatic], self.prismatic]),
            axis=np.concatenate([np.asarray(axis, float)[None], self.axis]),
            mass=np.concatenate([[mass], self.mass]),
            com=np.concatenate([com[None], self.com]),
            inertia=np.concatenate([inertia[None], self.inertia]),
            spin=np.concatenate([np.zeros((1, 3)), self.spin]),
            tool=self.tool + 1,
        )

    def hang(self, name, body, rotation, offset, axis, prismatic, mass):
        """A point mass on a further coordinate of its own, carried by a body (a branch)."""
        return replace(
            self,
            names=(*self.names, name),
            parent=np.append(self.parent, body + 1),
            rotation=np.concatenate([self.rotation, np.asarray(rotation, float)[None]]),
            offset=np.concatenate([self.offset, np.asarray(offset, float)[None]]),
            prismatic=np.append(self.prismatic, prismatic),
            axis=np.concatenate([self.axis, np.asarray(axis, float)[None]]),
            mass=np.append(self.mass, mass),
            com=np.concatenate([self.com, np.zeros((1, 3))]),
            inertia=np.concatenate([self.inertia, np.zeros((1, 3, 3))]),
            spin=np.concatenate([self.spin, np.zeros((1, 3))]),
        )

    def with_body(self, body, mass, com, inertia):
        """The same chain, one body's own inertia replaced."""
        masses, coms, inertias = self.mass.copy(), self.com.copy(), self.inertia.copy()
        masses[body], coms[body], inertias[body] = mass, com, inertia
        return replace(self, mass=masses, com=coms, inertia=inertias)

    def with_spin(self, body, momentum):
        """The same chain with a rotor in a body: its angular momentum in the body's axes."""
        spin = self.spin.copy()
        spin[body] = momentum
        return replace(self, spin=spin)


def merge(one, other):
    """Two rigid bodies (mass, com, inertia about com) as one."""
    (m1, c1, i1), (m2, c2, i2) = one, other
    mass = m1 + m2
    if mass == 0.0:
        return 0.0, np.zeros(3), i1 + i2
    com = (m1 * c1 + m2 * c2) / mass
    inertia = i1 + i2
    for m, c in ((m1, c1), (m2, c2)):
        d = c - com
        inertia = inertia + m * (d @ d * np.eye(3) - np.outer(d, d))
    return mass, com, inertia


def from_pinocchio(model, joints, tool, pose=None):
    """The chain of a pinocchio model; joints that are not named in `joints` stand as in `pose`.

    Args:
        model: of a URDF whose moving joints have one degree of freedom each.
        joints: the names of those that move.
        tool: frame name.
        pose: {name: value} of the joints that stand still; zero where not given.
    """
    locked = [i for i in range(1, model.njoints) if model.names[i] not in joints]
    if locked:
        q = pin.neutral(model)
        for index in locked:
            value = (pose or {}).get(model.names[index], 0.0)
            at, wide = model.joints[index].idx_q, model.joints[index].nq
            q[at : at + wide] = [value] if wide == 1 else [np.cos(value), np.sin(value)]
        model = pin.buildReducedModel(model, locked, q)
    n = model.njoints - 1
    frame = model.frames[model.getFrameId(tool)]
    axis, prismatic = np.zeros((n, 3)), np.zeros(n, bool)
    for i in range(n):
        joint = model.joints[i + 1]
        data = joint.createData()
        joint.calc(data, pin.neutral(model))
        subspace = np.asarray(data.S).reshape(6, -1)[:, 0]
        prismatic[i] = np.abs(subspace[:3]).max() > 0.5
        axis[i] = subspace[:3] if prismatic[i] else subspace[3:]

    def body(inertia):
        return inertia.mass, np.array(inertia.lever), np.array(inertia.inertia)

    bodies = [body(model.inertias[i + 1]) for i in range(n)]
    return Chain(
        names=tuple(model.names[i + 1] for i in range(n)),
        parent=np.array([int(model.parents[i + 1]) for i in range(n)]),
        rotation=np.array([model.jointPlacements[i + 1].rotation for i in range(n)]),
        offset=np.array([model.jointPlacements[i + 1].translation for i in range(n)]),
        prismatic=prismatic,
        axis=axis,
        mass=np.array([b[0] for b in bodies]),
        com=np.array([b[1] for b in bodies]),
        inertia=np.array([b[2] for b in bodies]),
        spin=np.zeros((n, 3)),
        tool=int(frame.parentJoint) - 1,
        tool_rotation=np.array(frame.placement.rotation),
        tool_offset=np.array(frame.placement.translation),
        base=body(model.inertias[0]),
    )
