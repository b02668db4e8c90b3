"""Masses that can hardly be: missing ones, placeholders, inertias that do not fit the link's size.

Nothing here is refused: arms with such masses are published. It is told, link by link, because
natural frequencies, and with them lives, follow from the masses.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise, product
from typing import TYPE_CHECKING

import numpy as np
from lxml import etree

from picchio.core import spoken
from picchio.core.arrays import FloatArray, symmetric
from picchio.core.errors import InputError
from picchio.robot.finding import Finding, Severity
from picchio.robot.masses.by_volume import Body, bodies
from picchio.robot.masses.check import general_pose, moving_links
from picchio.robot.masses.proportions import extent, gyration, out_of_proportion
from picchio.robot.spread import is_estimate
from picchio.robot.units import TURNING
from picchio.robot.urdf.check import LEAST_MOMENT, bad_inertia
from picchio.robot.urdf.shapes import link_ends, placement
from picchio.robot.urdf.tree import INERTIA, MOVABLE, ZERO, Inertial, UrdfTree
from picchio.robot.urdf.xml import children

if TYPE_CHECKING:
    from picchio.robot.flexible_robot import FlexibleRobot

# Real arms have two equal links, seldom three: so many of at least half the links are no accident.
_LEAST_EQUAL = 3
# A body's radius of gyration is below its distance from its joints, give or take a bulge; above
# twice that its shape is looked at, and above the diagonal of the box around it, it cannot be.
_SUSPECT = 2.0
# Without a shape, links of 167 public arms have 0.03 to 3 of their distance from joint to joint, or
# of the mean of all, in 95 of 100 cases 0.1 to 2; half of them near 0.5.
_LARGE, _TYPICAL = 5.0, 0.5
# In 289 public URDFs at most 24 times, of torsos; a hundred and more only of broken ones.
_HEAVIER, _BROKEN = 30.0, 100.0
# Of the largest moment: so much the digits that files have may leave above the others' sum.
_PRINTED = 1e-3
# Of a joint's inertia: less of it than links are known to (3 %) changes no answer.
_FELT = 0.03
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
    whole = [*out_of_proportion(tree, robot.tool_frame)]
    yield from whole
    yield from _tensors(robot)
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
    yield from _heavy(robot)
    if any(joint.units is TURNING for joint in robot.flexible_joints):
        yield from _equal(chain, "inertia", lambda body: body.inertia if any(body.inertia) else 0)
        alike = [link for link, body in chain.items() if _is_round(body)]
        if len(alike) > 1:
            yield Finding(_links(alike), "inertias of a round number, alike about every axis",
                          "placeholders?")  # fmt: skip
        if not whole:  # else every link says so once more
            yield from _sizes(robot, chain, root)
    yield from _frequencies(robot)


def _tensors(robot: FlexibleRobot) -> Iterator[Finding]:
    """Inertias that no body has: not positive, or one moment above the other two's sum."""
    tree = robot.tree
    arm = [joint for joint in tree.chain(robot.tool_frame) if joint.type in MOVABLE]
    for link in tree.beyond(arm[0].name) if arm else ():
        if (body := tree.links[link]) is None:
            continue
        if reason := bad_inertia(body):
            yield Finding(f"link {link!r}", reason, _slip_of(body.tensor), "impossible")
            continue
        moments, axes = np.linalg.eigh(body.tensor)
        excess = moments[2] - moments[0] - moments[1]
        if excess > max(_PRINTED * moments[2], LEAST_MOMENT):
            told = ", ".join(f"{moment:.3g}" for moment in moments)
            yield Finding(
                f"link {link!r}",
                f"its principal moments of inertia are {told} kg m^2, and in no body is one above "
                "the sum of the others",
                _slip_of(body.tensor),
                _severity(robot, link, excess * np.outer(axes[:, 2], axes[:, 2])),
            )


def _slip_of(tensor: FloatArray) -> str:
    """The slip without which an inertia could be: of a sign, or of one decimal point."""
    diagonal = np.diag(np.diag(tensor))
    slips = [
        ("a moment of inertia is never negative: a wrong sign?", np.abs(diagonal) + tensor
         - diagonal),
        ("the products of inertia look turned in sign", 2.0 * diagonal - tensor),
    ]  # fmt: skip
    found = [(text, fixed) for text, fixed in slips if _can_be(fixed) and (fixed != tensor).any()]
    if found:
        return found[0][0]
    points = []
    moments = np.linalg.eigvalsh(tensor)
    # A lost point leaves more than what rounding and guessing do.
    powers = (1, -1, 2, -2, 3, -3) if moments[2] > 1.5 * (moments[0] + moments[1]) else ()
    for power, k in product(powers, range(3)):
        fixed = tensor.copy()
        fixed[k, k] *= 10.0**-power
        if _can_be(fixed):
            moments = np.linalg.eigvalsh(fixed)
            size = f"{10 ** abs(power)} times too {'large' if power > 0 else 'small'}"
            text = f"{INERTIA[(0, 3, 5)[k]]} looks {size}: a decimal point?"
            points.append((abs(power), moments[2] / moments[0], text))
    return min(points)[2] if points else ""


def _can_be(tensor: FloatArray) -> bool:
    moments = np.linalg.eigvalsh(tensor)
    return bool(moments[0] > 0.0 and moments[2] <= moments[0] + moments[1])


def _severity(robot: FlexibleRobot, link: str, excess: FloatArray) -> Severity:
    """Impossible where a joint that moves the tool feels what is too much of a link's inertia."""
    body = robot.tree.links[link]
    pose = general_pose(robot)
    frame = robot.rigid.frame(link)
    turned = placement(ZERO, body.rpy if body else ZERO)[:3, :3]
    axes = (robot.rigid.placement(pose, frame)[1] @ turned).T @ robot.rigid.jacobian(pose, frame)[
        3:
    ]
    felt = np.einsum("in,ij,jn->n", axes, excess, axes)
    arm = {joint.name for joint in robot.tree.chain(robot.tool_frame)}
    own = np.array([name in arm for name in robot.joint_names])
    inertia = np.diag(robot.rigid.mass_matrix(pose))
    return "impossible" if (felt > _FELT * np.abs(inertia))[own].any() else "doubtful"


def _is_bare(tree: UrdfTree, link: str, root: etree._Element) -> bool:
    """Whether a joint moves a link that has a shape, and neither it nor what is fixed to it mass.

    Exporters often leave the mass of a link's parts with one of them.
    """
    if tree.carriers[link].type == "fixed":
        return False
    rigid = [link]
    for name in rigid:
        rigid += [joint.child for joint in tree.carried.get(name, ()) if joint.type == "fixed"]
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


def _heavy(robot: FlexibleRobot) -> Iterator[Finding]:
    """Links with what is fixed to them, or hangs on them, far above both neighbours."""
    chain = [j for j in robot.tree.chain(robot.tool_frame) if j.name in robot.joint_names]
    beyond = [set(robot.tree.beyond(joint.name)) for joint in chain] + [set()]
    masses = [sum(body.mass for link in own - rest if (body := robot.tree.links[link]) is not None)
              for own, rest in pairwise(beyond)]  # fmt: skip
    for k, (joint, mass) in enumerate(zip(chain, masses, strict=True)):
        others = masses[max(k - 1, 0) : k] + masses[k + 1 : k + 2]
        if mass > _HEAVIER * max(others, default=mass) > 0.0:
            times = mass / max(others)
            # A carriage or a gun may be heavy, too; a link between two others is not.
            broken = times > _BROKEN and 0 < k < len(masses) - 1
            yield Finding(
                f"link {joint.child!r}",
                f"{spoken.number(mass)} kg with what is fixed to it, {spoken.number(times)} times "
                "the heavier of its neighbours",
                "a decimal point, or grams?",
                "impossible" if broken else "doubtful",
            )


def _is_round(body: Inertial) -> bool:
    """Whether an inertia is a power of ten about every axis, as 1 or 0.001."""
    xx, xy, xz, yy, yz, zz = body.inertia
    if not xx == yy == zz > 0 or any((xy, xz, yz)):
        return False
    power = math.log10(xx)
    return abs(power - round(power)) < 1e-9


def _sizes(
    robot: FlexibleRobot, chain: dict[str, Inertial], root: etree._Element
) -> Iterator[Finding]:
    """Inertias that do not fit the link's size: its shape's, or else that between its joints."""
    tree = robot.tree
    lengths = np.linalg.norm(link_ends(tree, robot.tool_frame), axis=1)
    for link, body in chain.items():
        near, own = extent(tree, link), gyration(tree, link)
        small = own < _POINT * near and tree.carriers[link].type != "fixed"
        if not small and not own > _SUSPECT * near > 0.0:
            continue
        what = f"an inertia of {body.mass * own**2:.3g} kg m^2 for {body.mass:.3g} kg is "
        if (shape := _shape(root, tree, link)) is not None:
            size, most = shape.size, shape.size
            solid = body.mass * max(np.linalg.eigvalsh(symmetric(shape.moments))) / shape.volume
            known = f"; as a solid of its shape it would have {solid:.3g}"
        else:
            # A link's ends may meet where two axes do: then it is as long as others.
            size, most = max(near, float(lengths.mean())), float(lengths.sum())
            known, solid = "", body.mass * (_TYPICAL * size) ** 2
        if own > most:
            what += "more than any body of its size can have"
            severity = _severity(robot, link, body.tensor * (1.0 - (most / own) ** 2))
        elif small and own < _POINT * size and (own or known):
            what, severity = what + "as little as a point's", "doubtful"
        elif own > _LARGE * size:
            what, severity = what + "much for the size of its link", "doubtful"
        else:
            continue
        remedy = f"correct it, or state it with a source in [link.{link}]"
        if own > 0.0:
            factor = body.mass * own**2 / solid
            times = f"{float(f'{max(factor, 1.0 / factor):.1g}'):,g} times"
            wrong = f"{times} too {'large' if factor > 1.0 else 'small'}"
            remedy = f"it looks some {wrong}: a decimal point, or another unit? {remedy}"
        yield Finding(f"link {link!r}", what + known, remedy, severity)


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
