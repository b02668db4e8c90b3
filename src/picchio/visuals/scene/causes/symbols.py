"""The shapes that mark a cause: spring, turning and sliding arrows, hose, ball.

Each is made where it stands, in world coordinates, m.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.visuals.scene.robot.mesh import Mesh, arrow, merged, moved, rod, sphere, turned_to


def tube(points: FloatArray, radius: float, colour: str) -> Mesh:
    """A round bar along (k, 3) points."""
    along = np.gradient(points, axis=0)
    along /= np.linalg.norm(along, axis=1)[:, None]
    angle = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    side = np.cross(along[0], np.eye(3)[int(np.abs(along[0]).argmin())])
    rings = []
    for point, t in zip(points, along, strict=True):
        # The side is carried along, so that the bar does not twist.
        side = side - (side @ t) * t
        side /= np.linalg.norm(side)
        other = np.cross(t, side)
        rings.append(
            point + radius * (np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * other)
        )
    n = len(angle)
    i, j = np.divmod(np.arange((len(points) - 1) * n), n)
    a, b = i * n + j, i * n + (j + 1) % n
    sides = np.concatenate([np.column_stack([a, b, a + n]), np.column_stack([b, b + n, a + n])])
    # The ends are closed by fans about their middles.
    first, last = len(points) * n, len(points) * n + 1
    j = np.arange(n)
    k, end = (j + 1) % n, (len(points) - 1) * n
    caps = [np.column_stack([np.full(n, first), k, j]),
            np.column_stack([np.full(n, last), end + j, end + k])]  # fmt: skip
    vertices = np.concatenate([*rings, points[:1], points[-1:]])
    return Mesh(vertices, np.concatenate([sides, *caps]), colour=colour)


def coil(
    centre: FloatArray,
    axis: FloatArray,
    radius: float,
    length: float,
    thickness: float,
    colour: str,
) -> Mesh:
    """A coil spring of four turns about an axis."""
    s = np.linspace(0.0, 1.0, 112)
    angle = 8.0 * np.pi * s
    own = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), length * (s - 0.5)])
    return moved(tube(own, thickness, colour), turned_to(axis, centre))


def turning(
    centre: FloatArray, axis: FloatArray, radius: float, thickness: float, colour: str
) -> Mesh:
    """An open ring about an axis with a head at either end: it turns to and fro."""
    angle = np.radians(np.linspace(-142.0, 142.0, 60))
    own = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(60)])
    head = 6.0 * thickness
    parts = [tube(own, thickness, colour)]
    for point, before in ((own[0], own[1]), (own[-1], own[-2])):
        parts.append(_head(point, point - before, head, colour))
    return moved(merged(parts), turned_to(axis, centre))


def sliding(
    centre: FloatArray, axis: FloatArray, length: float, thickness: float, colour: str
) -> Mesh:
    """A bar along an axis with a head at either end: it slides to and fro."""
    half = 0.5 * length * axis / np.linalg.norm(axis)
    parts = [rod(centre - half, centre + half, thickness, colour)]
    parts += [_head(centre + side, side, 6.0 * thickness, colour) for side in (half, -half)]
    return merged(parts)


def _head(base: FloatArray, along: FloatArray, length: float, colour: str) -> Mesh:
    """A cone from `base` on."""
    cone = arrow(length, 0.1 * length, colour, head=0.99 * length)
    return moved(cone, turned_to(along, base))


def pointing(start: FloatArray, end: FloatArray, thickness: float, colour: str) -> Mesh:
    """An arrow from one point to another."""
    along = end - start
    length = float(np.linalg.norm(along))
    shape = arrow(length, thickness, colour, head=min(6.0 * thickness, 0.5 * length))
    return moved(shape, turned_to(along, start))


def hose(start: FloatArray, end: FloatArray, thickness: float, colour: str) -> Mesh:
    """A hose that hangs from one point and ends on the ground at another, with its clamps."""
    s = np.linspace(0.0, 1.0, 40)[:, None]
    sag = 0.25 * float(np.linalg.norm(end[:2] - start[:2]))
    points = start + s * (end - start) - sag * 4.0 * s * (1.0 - s) * np.array([0.0, 0.0, 1.0])
    points[:, 2] = np.maximum(points[:, 2], min(start[2], end[2]))
    foot = end + np.array([0.0, 0.0, 1.5 * thickness])
    return merged([
        tube(points, thickness, colour),
        ball(start, 2.2 * thickness, colour),
        rod(end, foot, 4.0 * thickness, colour),
    ])  # fmt: skip


def ball(centre: FloatArray, radius: float, colour: str, opacity: float = 1.0) -> Mesh:
    """A sphere."""
    shape = sphere(radius, colour)
    return replace(shape, vertices=shape.vertices + centre, opacity=opacity)
