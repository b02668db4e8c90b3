"""Masses that can hardly be: missing ones, placeholders, inertias that do not fit the link's size.

Nothing here is refused: arms with such masses are published. It is told, link by link, because
natural frequencies, and with them lives, follow from the masses.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from lxml import etree

from picchio.core.arrays import symmetric
from picchio.core.errors import InputError
from picchio.robot.annotations.flexibility import is_estimate
from picchio.robot.finding import Finding
from picchio.robot.masses.by_volume import Body, bodies
from picchio.robot.masses.check import general_pose, moving_links
from picchio.robot.units import TURNING
from picchio.robot.urdf.check import bad_inertia
from picchio.robot.urdf.tree import MOVABLE, Inertial, UrdfTree
from picchio.robot.urdf.xml import children

if TYPE_CHECKING:
    from picchio.robot.flexible_robot import FlexibleRobot

# Real arms have two equal links, seldom three: so many of at least half the links are no accident.
_LEAST_EQUAL = 3
# A body's radius of gyration is below its distance from its joints, give or take a bulge; above
# twice that its shape is looked at, and above the diagonal of the box around it, it cannot be.
_SUSPECT = 2.0
# As small as a point's: real links have 0.1 of their size and more.
_POINT = 0.03
# Hz, joint modes of arms with known stiffness lie between 4 and 850.
_LOWEST, _HIGHEST = 0.5, 2000.0


def findings_of(robot: FlexibleRobot, root: etree._Element) -> Iterator[Finding]:
    """What is impossible or doubtful about a robot's masses.

    Args:
        robot: with all its masses.
        root: of its URDF, for the links' shapes.
    """
    tree = robot.tree
    arm = [joint for joint in tree.chain(robot.tool_frame) if joint.type in MOVABLE]
    for joint in arm[:1]:
        for link in tree.beyond(joint.name):
            body = tree.links[link]
            if body is not None and (reason := bad_inertia(body)):
                yield Finding(f"link {link!r}", reason, severity="impossible")
    moving = moving_links(robot)
    if massless := [link for link in moving if _is_bare(tree, link, root)]:
        yield Finding(_links(massless), "no mass is given, nor for what is fixed to it")
    # What a sidecar states, it answers for. Hands have many equal fingers, so only the links that
    # carry the tool are compared.
    chain = {
        joint.child: body
        for joint in tree.chain(robot.tool.frame)
        if joint.child in moving
        and f"link.{joint.child}.mass" not in robot.origins
        and f"link.{joint.child}.inertia" not in robot.origins
        and (body := tree.links[joint.child])
        and body.mass
    }
    yield from _equal(chain, "mass", lambda body: body.mass)
    if any(joint.units is TURNING for joint in robot.flexible_joints):
        yield from _equal(chain, "inertia", lambda body: body.inertia if any(body.inertia) else 0)
        alike = [link for link, body in chain.items() if _is_round(body)]
        if len(alike) > 1:
            yield Finding(_links(alike), "inertias of a round number, alike about every axis",
                          "placeholders?")  # fmt: skip
        yield from _sizes(tree, chain, root)
    yield from _frequencies(robot)


def _is_bare(tree: UrdfTree, link: str, root: etree._Element) -> bool:
    """Whether a joint moves a link that has a shape, and neither it nor what is fixed to it mass.

    Exporters often leave the mass of a link's parts with one of them.
    """
    carrier = next(joint for joint in tree.joints.values() if joint.child == link)
    if carrier.type == "fixed":
        return False
    rigid = [link]
    for name in rigid:
        rigid += [j.child for j in tree.joints.values() if j.parent == name and j.type == "fixed"]
    if any((body := tree.links[name]) is not None and body.mass for name in rigid):
        return False
    elements = [element for element in children(root, "link") if element.get("name") in rigid]
    return any(children(element, tag) for element in elements for tag in ("visual", "collision"))


def _links(links: Sequence[str]) -> str:
    some = ", ".join(map(repr, links[:8])) + (
        f" and {len(links) - 8} more" if len(links) > 8 else ""
    )
    return f"link{'s' * (len(links) > 1)} {some}"


def _equal(
    chain: dict[str, Inertial], what: str, key: Callable[[Inertial], object]
) -> Iterator[Finding]:
    """Links that share one value: a placeholder."""
    count = Counter(value for body in chain.values() if (value := key(body)))
    for value, times in count.most_common(1):
        if times >= max(_LEAST_EQUAL, 0.5 * len(chain)):
            same = [link for link, body in chain.items() if key(body) == value]
            each = f" of {value:g} kg" if isinstance(value, float) else ""
            yield Finding(_links(same), f"the same {what}{each}", "placeholders?")


def _is_round(body: Inertial) -> bool:
    """Whether an inertia is a power of ten about every axis, as 1 or 0.001."""
    xx, xy, xz, yy, yz, zz = body.inertia
    if not xx == yy == zz > 0 or any((xy, xz, yz)):
        return False
    power = math.log10(xx)
    return abs(power - round(power)) < 1e-9


def _sizes(tree: UrdfTree, chain: dict[str, Inertial], root: etree._Element) -> Iterator[Finding]:
    carried_by = {joint.child: joint for joint in tree.joints.values()}
    for link, body in chain.items():
        ends = [np.zeros(3), *(np.array(j.xyz) for j in tree.joints.values() if j.parent == link)]
        near = max(float(np.linalg.norm(end - np.array(body.xyz))) for end in ends)
        gyration = math.sqrt(max(np.linalg.eigvalsh(symmetric(body.inertia))[-1], 0.0) / body.mass)
        small = gyration < _POINT * near and carried_by[link].type != "fixed"
        if not small and not gyration > _SUSPECT * near > 0.0:
            continue
        if (shape := _shape(root, tree, link)) is None:
            continue
        solid = body.mass * max(np.linalg.eigvalsh(symmetric(shape.moments))) / shape.volume
        if gyration > shape.size:
            what = "more than any body of its size can have"
        elif gyration < _POINT * shape.size:
            what = "as little as a point's"
        else:
            continue
        yield Finding(
            f"link {link!r}",
            f"an inertia of {body.mass * gyration**2:.3g} kg m^2 for {body.mass:.3g} kg is "
            f"{what}; as a solid of its shape it would have {solid:.3g}",
            f"correct it, or state it with a source in [link.{link}]",
        )


def _shape(root: etree._Element, tree: UrdfTree, link: str) -> Body | None:
    for tag in ("visual", "collision"):
        try:
            found = bodies(root, tag, tree.path.parent, [link])
        except InputError:  # such as a mesh that is not here
            continue
        if link in found:
            return found[link]
    return None


def _frequencies(robot: FlexibleRobot) -> Iterator[Finding]:
    """Modes that no arm's joint has."""
    rows = [k for k, name in enumerate(robot.flexible_names) if name in robot.tree.joints]
    if not rows:
        return
    index = robot.flexible_index[rows]
    mass = robot.rigid.mass_matrix(general_pose(robot))[np.ix_(index, index)]
    root_stiffness = np.sqrt(robot.stiffness[rows])
    # Of the flexibility, whose largest eigenvalues are exact where frequencies lie far apart.
    inverse, shapes = np.linalg.eigh(mass / np.outer(root_stiffness, root_stiffness))
    for value, shape in zip(inverse, shapes.T, strict=True):
        frequency = 1.0 / (2.0 * math.pi * math.sqrt(value)) if value > 0 else math.inf
        if _LOWEST <= frequency <= _HIGHEST:
            continue
        k = int(np.abs(shape).argmax())
        joint = robot.flexible_joints[rows[k]]
        if is_estimate(robot.origins.get(f"{joint.name}.stiffness", "")):
            continue  # of an estimate it tells nothing
        inertia, stiffness = joint.units.of("kg*m^2"), joint.units.of("N*m/rad")
        link = robot.tree.joints[joint.name].child
        yield Finding(
            f"joint {joint.name!r}",
            f"would vibrate at {frequency:,.3g} Hz (joints of arms: 4 to 850 Hz)",
            f"its stiffness of {joint.stiffness:.3g} {stiffness}, or the inertia of "
            f"{mass[k, k]:.3g} {inertia} that link {link!r} and those beyond it have, is wrong",
        )
