"""How each kind of cause is drawn: one table from the mark that an effect declares to a shape."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pinocchio as pin

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.model.effects.registry import effect_class
from picchio.visuals.kinematics import Frame
from picchio.visuals.plots.style import BLUE
from picchio.visuals.scene.causes.site import Drawn, Site, check_place
from picchio.visuals.scene.causes.symbols import ball, coil, hose, pointing, sliding, turning
from picchio.visuals.scene.overlay import ring_radius
from picchio.visuals.scene.robot.mesh import Mesh, box, moved, ring, turned_to

_STEEL = 7850.0
"""kg/m^3."""


def draw(site: Site) -> list[Drawn]:
    """A cause's drawing: the mark that its effect declares, else that of its target's kind.

    Raises:
        InputError: an effect or a mark that is not known, or a target that this robot does not
            have.
    """
    check_place(site.robot, site.effect, site.target)
    kind = effect_class(site.effect)
    mark = kind.mark or ("arrow" if kind.where == "blows" else kind.target_kind)
    if mark not in MARKS:
        raise InputError("no such mark", key=f"{kind.name}.mark", value=mark, choices=MARKS)
    return MARKS[mark](site)


def _ring(site: Site) -> list[Drawn]:
    return [_ring_about(site, site.target, 0.011)]


def _whole(site: Site) -> list[Drawn]:
    """A thin ring at every flexible joint; the first has the label."""
    first, *others = (_ring_about(site, name, 0.006) for name in site.robot.flexible_names)
    return [first, *(replace(other, at=None) for other in others)]


def _ring_about(site: Site, joint: str, thickness: float) -> Drawn:
    frame, axis, at, radius = _around(site, joint)
    shape = ring(radius, thickness * site.reach, site.colour)
    return Drawn(frame.link, [moved(shape, turned_to(axis, at))], at + _above(radius))


def _around(
    site: Site, joint: str, wider: float = 1.12
) -> tuple[Frame, FloatArray, FloatArray, float]:
    """A joint's frame, its axis (3,) and place (3,) in the world, and a radius about its link."""
    frame, axis = site.joint(joint)
    return frame, axis, site.position(frame.link), wider * ring_radius(frame, site.body)


def _spring(site: Site) -> list[Drawn]:
    frame, axis, at, radius = _around(site, site.target)
    radius, length = (0.035 * site.reach, 0.2) if frame.prismatic else (radius, 0.1)
    shape = coil(at, axis, radius, length * site.reach, 0.006 * site.reach, site.colour)
    return [Drawn(frame.link, [shape], at + _above(radius))]


def _above(distance: float) -> FloatArray:
    """(3,) up by so much: the label of something round shall not cover it."""
    return np.array([0.0, 0.0, distance])


def _bending(site: Site) -> list[Drawn]:
    """Turning about the two axes across the joint's own; of a link, about those of its frame."""
    if site.target not in site.robot.joint_names:
        return _link(site)
    frame, axis, at, radius = _around(site, site.target, 1.25)
    across = turned_to(axis, at)[:3, :2].T
    shapes = [turning(at, side, radius, 0.006 * site.reach, site.colour) for side in across]
    return [Drawn(frame.link, shapes, at + _above(radius))]


def _joint_or_link(site: Site) -> list[Drawn]:
    return (_ring if site.target in site.robot.joint_names else _link)(site)


def _centre(site: Site) -> FloatArray:
    """(3,) m, the target link's centre of mass, or its origin where it has no mass."""
    place = site.places[site.target]
    inertial = site.robot.tree.links.get(site.target)
    return (place @ [*(inertial.xyz if inertial else (0.0, 0.0, 0.0)), 1.0])[:3]


def _link(site: Site) -> list[Drawn]:
    at = _centre(site)
    return [Drawn(site.target, [ball(at, 0.045 * site.reach, site.colour, 0.75)], at)]


def _link_mass(site: Site) -> list[Drawn]:
    inertial = site.robot.tree.links.get(site.target)
    more = (site.values.get("scale", 1.0) - 1.0) * (inertial.mass if inertial else 0.0)
    at = _centre(site)
    return [Drawn(site.target, [_mass(site, at, more)], at)]


def _payload(site: Site) -> list[Drawn]:
    at = site.position(site.tool_link)
    return [Drawn(site.tool_link, [_mass(site, at, site.values.get("mass", 0.0))], at)]


def _mass(site: Site, at: FloatArray, mass: float) -> Mesh:
    """As large as of steel, within what can be seen; what is missing is a mere shade."""
    steel = (3.0 * abs(mass) / (4.0 * np.pi * _STEEL)) ** (1.0 / 3.0)
    radius = float(np.clip(steel, 0.025 * site.reach, 0.12 * site.reach))
    return ball(at, radius, site.colour, 0.4 if mass < 0.0 else 0.85)


def _cable(site: Site) -> list[Drawn]:
    start = site.position(site.target)
    foot = site.position(site.frames[0].link)
    # Beside the arm, on the ground.
    out = start[:2] - foot[:2]
    out = out / np.linalg.norm(out) if np.linalg.norm(out) > 1e-6 else np.array([1.0, 0.0])
    end = np.array([*(start[:2] + 0.3 * site.reach * np.array([out[1], -out[0]])), foot[2]])
    return [Drawn(None, [hose(start, end, 0.008 * site.reach, site.colour)], 0.5 * (start + end))]


def _tool(site: Site) -> list[Drawn]:
    at = site.tool_position
    return [Drawn(site.tool_link, [ball(at, 0.035 * site.reach, site.colour, 0.6)], at)]


def _blow(site: Site) -> list[Drawn]:
    start, end = _force(site, site.direction)
    return [Drawn(site.tool_link, [pointing(start, end, 0.011 * site.reach, site.colour)], start)]


def _force_direction(site: Site) -> list[Drawn]:
    """The stated direction in blue, the found one in the cause's colour."""
    axes = site.robot.state(site.pose).tool_rotation
    turn = pin.exp3(np.array([site.values.get(f"r{axis}", 0.0) for axis in "xyz"]))
    start, end = _force(site, axes @ turn @ axes.T @ site.direction)
    stated = _force(site, site.direction)
    thick = 0.011 * site.reach
    shapes = [pointing(*stated, 0.9 * thick, BLUE), pointing(start, end, thick, site.colour)]
    return [Drawn(site.tool_link, shapes if site.values else shapes[:1], start)]


def _force(site: Site, direction: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Where an arrow of the force starts and where it ends, at the tool."""
    end = site.tool_position - 0.02 * site.reach * direction
    return end - 0.28 * site.reach * direction, end


def _tool_offset(site: Site) -> list[Drawn]:
    start = site.tool_position
    offset = np.array([site.values.get(axis, 0.0) for axis in "xyz"])
    if not offset.any():
        return _tool(site)
    end = start + _offset_scale(site) * site.robot.state(site.pose).tool_rotation @ offset
    thick = 0.006 * site.reach
    shapes = [pointing(start, end, thick, site.colour), ball(end, 2.2 * thick, site.colour)]
    return [Drawn(site.tool_link, shapes, end)]


def _offset_scale(site: Site) -> float:
    """How many times its length an offset is drawn, so that it can be seen."""
    length = float(np.linalg.norm([site.values.get(axis, 0.0) for axis in "xyz"]))
    least = 0.12 * site.reach
    return float(np.ceil(least / length)) if 0.0 < length < least else 1.0


def note(site: Site) -> str:
    """What must be said of a drawing beside the cause's name."""
    mark = effect_class(site.effect).mark
    if mark == "offset" and (scale := _offset_scale(site)) > 1.0:
        return f" (drawn {scale:g} times as long)"
    return " (blue: as stated)" if mark == "turned arrow" else ""


def _workpiece(site: Site) -> list[Drawn]:
    """A plate that the tool leans on."""
    at = site.tool_position - 0.02 * site.reach * site.direction
    plate = moved(
        box(np.array([0.15, 0.15, 0.01]) * site.reach, site.colour), turned_to(site.direction, at)
    )
    return [Drawn(None, [plate], at)]


def _base(site: Site) -> list[Drawn]:
    at = site.position(site.frames[0].link)
    axis = np.eye(3)["xyz".index(site.target[-1])]
    thick = 0.01 * site.reach
    if site.target.startswith("r"):
        shape = turning(at, axis, 0.2 * site.reach, thick, site.colour)
    else:
        shape = sliding(at, axis, 0.5 * site.reach, thick, site.colour)
    return [Drawn(None, [shape], at)]


def _sensor(site: Site) -> list[Drawn]:
    """A cube where the channels' sensor sits; on every joint where they are the joints'."""
    kind, _, name = site.target.partition(".")
    links = {frame.link: frame.link for frame in site.frames}
    links |= {frame.joint: frame.link for frame in site.frames if frame.joint}
    if name in links:
        at = [links[name]]
    elif kind == "force" or name:
        at = [site.tool_link]
    else:
        at = [links[joint] for joint in site.robot.flexible_names]
    found: list[Drawn] = []
    for link in at:
        cube = box(np.full(3, 0.05 * site.reach), site.colour)
        label = site.position(link) if not found else None
        found.append(Drawn(link, [moved(cube, site.places[link])], label))
    return found


# What an effect may declare as its mark; one that declares none is drawn by its target's kind.
MARKS: Mapping[str, Callable[[Site], list[Drawn]]] = {
    "joint": _ring,
    "link": _link,
    "joint or link": _joint_or_link,
    "joint pair": _ring,
    "tool": _tool,
    "robot": _whole,
    "axis": _base,
    "channel group": _sensor,
    "arrow": _blow,
    "turned arrow": _force_direction,
    "spring": _spring,
    "bending": _bending,
    "link mass": _link_mass,
    "added mass": _payload,
    "hose": _cable,
    "offset": _tool_offset,
    "plate": _workpiece,
}
