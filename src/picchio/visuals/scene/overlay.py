"""Overlays on the robot: direction envelopes, worst directions, joint rings, rivets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import BoolArray, FloatArray
from picchio.studies.assessment.result import Assessment
from picchio.studies.envelopes import DirectionEnvelope
from picchio.visuals.kinematics import Frame
from picchio.visuals.plots.style import CMAP
from picchio.visuals.scene.robot.body import Body


@dataclass(frozen=True)
class Scale:
    """What a colour means: a quantity from 0 to `top` in a unit."""

    title: str
    unit: str
    top: float

    def colours(self, values: FloatArray) -> FloatArray:
        """The colours (k, 3), 0 to 255, of values.

        Args:
            values: (k,) in the scale's unit.
        """
        from matplotlib import colormaps

        share = np.clip(np.asarray(values) / self.top if self.top > 0 else values, 0.0, 1.0)
        return np.asarray(colormaps[CMAP](share))[:, :3] * 255.0

    def colour(self, value: float) -> str:
        """The colour "#rrggbb" of one value; grey where there is none.

        Args:
            value: in the scale's unit.
        """
        if not np.isfinite(value):
            return "#9aa3ad"
        return "#" + "".join(f"{round(c):02x}" for c in self.colours(np.array([value]))[0])

    def to_dict(self) -> dict[str, object]:
        """For the page's colour bar."""
        steps = np.linspace(0.0, self.top, 9)
        return {"title": self.title, "unit": self.unit, "top": self.top,
                "colours": [self.colour(value) for value in steps]}  # fmt: skip


def joint_values(
    assessment: Assessment | None, envelope: DirectionEnvelope, slides: BoolArray
) -> tuple[FloatArray, Scale]:
    """(n,) what the joints are coloured by: damage, else utilisation, else torque.

    `slides` (n,) says which joints are prismatic: theirs are forces, N, and on no scale of torques.
    """
    if assessment is None:
        torque = envelope.peak("torque")
        return torque, Scale("peak torque, worst direction", "N m", _largest(torque, ~slides))
    joints = assessment.joints
    damage = np.array([joint.damage_per_rivet for joint in joints])
    # A damage by estimated values is one of many: how much of what it bears is used, tells more.
    if np.nansum(damage) > 0.0 and not assessment.notice:
        share = 100.0 * damage / np.nanmax(damage)
        return share, Scale("damage, worst = 100", "%", 100.0)
    parts = np.array([[joint.utilisation, joint.reducer_utilisation] for joint in joints])
    utilisation = 100.0 * np.where(
        np.isfinite(parts).any(axis=1), np.nan_to_num(parts).max(axis=1), np.nan
    )
    if np.isfinite(utilisation).any():
        return utilisation, Scale("utilisation", "%", 100.0)
    torque = np.array([joint.peak_torque for joint in joints])
    return torque, Scale("peak torque in a rivet", "N m", _largest(torque, ~slides))


def _largest(values: FloatArray, among: BoolArray) -> float:
    return float(values[among].max(initial=0.0))


def rivet_values(assessment: Assessment) -> tuple[list[FloatArray], Scale]:
    """Per operation (n_poses,) what a rivet costs its worst joint, and the colours for it."""
    operations = assessment.operations
    shafts = any(joint.sn_curve for joint in assessment.joints)
    if shafts:
        damage = [np.nanmax(op.damage_per_rivet, axis=1) for op in operations]
        top = max(float(d.max()) for d in damage)
        if top > 0.0 and not assessment.notice:
            scale = Scale("damage of a rivet, worst = 100", "%", 100.0)
            return [d / top * 100 for d in damage], scale
        use = [100 * np.nanmax(op.utilisation, axis=1) for op in operations]
        return use, Scale("utilisation by a rivet", "%", 100.0)
    turning = [joint.kind != "prismatic" for joint in assessment.joints]
    torque = [op.peak_torque[:, turning].max(axis=1, initial=0.0) for op in operations]
    top = max(float(t.max()) for t in torque)
    return torque, Scale("largest joint torque in a rivet", "N m", top)


def ring_radius(frame: Frame, body: Body) -> float:
    """How wide a ring about a joint must be to lie around the link there, m."""
    smallest, largest = 0.03 * body.reach, 0.11 * body.reach
    if frame.axis is None:
        return smallest
    near = []
    for link, index, matrix in body.parts:
        if link != frame.link:
            continue
        points = body.shapes[index].vertices @ matrix[:3, :3].T + matrix[:3, 3]
        along = points @ frame.axis
        radial = np.linalg.norm(points - along[:, None] * frame.axis, axis=1)
        near.append(radial[(np.abs(along) < 0.05 * body.reach) & (radial < largest)])
    found = np.concatenate(near) if near else np.zeros(0)
    if found.size < 8:
        return smallest
    return float(np.clip(1.06 * np.percentile(found, 80), smallest, 0.085 * body.reach))
