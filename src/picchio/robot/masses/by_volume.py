"""Volume, centre and moments of the links' shapes, as if they were solid and of one density."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from picchio.core.arrays import Vector
from picchio.core.errors import InputError
from picchio.robot.urdf.shapes import read_shape
from picchio.robot.urdf.xml import children

# A flat shape has no volume: below this, m^3, none (a cube of 0.1 mm).
_LEAST_VOLUME = 1e-12


@dataclass(frozen=True)
class Body:
    """One link's shapes together.

    Attributes:
        volume: m^3.
        com: m, their centre in the link's frame.
        moments: m^5, second moments of the volume about `com`, along the link's axes: xx, xy, xz,
            yy, yz, zz; times a density they are the inertia.
        size: m, the diagonal of the box around them.
    """

    volume: float
    com: Vector
    moments: tuple[float, ...]
    size: float


def bodies(
    root: etree._Element, tag: str, folder: Path, links: Iterable[str] | None = None
) -> dict[str, Body]:
    """The bodies of the links that have shapes with a volume.

    Of each shape the convex hull counts: meshes are seldom closed.

    Args:
        root: of the URDF.
        tag: "collision" or "visual".
        folder: the URDF's.
        links: only these; all if not given.

    Raises:
        InputError: a shape that cannot be read.
    """
    wanted = None if links is None else set(links)
    found = {}
    for link in children(root, "link"):
        name = link.get("name", "")
        if wanted is not None and name not in wanted:
            continue
        hulls = []
        for element in children(link, tag):
            try:
                hulls += _hulls(name, element, folder)
            except InputError as error:
                raise error.placed(key=f"link {name}: <{tag}>") from None
        if hulls:
            found[name] = _together(hulls)
    return found


def _hulls(link: str, element: etree._Element, folder: Path) -> list[Any]:
    """Each part's convex hull, in the link's frame."""
    from scipy.spatial import QhullError

    shape = read_shape(link, element, folder)
    hulls = []
    for part in shape.parts():
        part.apply_transform(shape.matrix)
        try:
            hull = part.convex_hull
        except (QhullError, ValueError):  # flat: without volume
            continue
        if hull.volume > _LEAST_VOLUME:
            hulls.append(hull)
    return hulls


def _together(hulls: list[Any]) -> Body:
    volumes = np.array([hull.volume for hull in hulls])
    centres = np.array([hull.center_mass for hull in hulls])
    com = volumes @ centres / volumes.sum()
    moments = np.zeros((3, 3))
    for hull, volume, centre in zip(hulls, volumes, centres, strict=True):
        off = centre - com
        moments += hull.moment_inertia / hull.density
        moments += volume * (off @ off * np.eye(3) - np.outer(off, off))
    corners = np.concatenate([hull.bounds for hull in hulls])
    return Body(
        float(volumes.sum()),
        (float(com[0]), float(com[1]), float(com[2])),
        tuple(float(moments[i, j]) for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))),
        float(np.linalg.norm(np.ptp(corners, axis=0))),
    )
