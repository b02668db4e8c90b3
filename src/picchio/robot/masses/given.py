"""The links' masses as they are used: the URDF's, or what a sidecar or annotation gives instead."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from lxml import etree

from picchio.core.errors import InputError
from picchio.robot.annotations.flexibility import Source, strongest
from picchio.robot.annotations.sidecar import given
from picchio.robot.link import LinkEntry, LinkMasses
from picchio.robot.masses.by_volume import Body, bodies
from picchio.robot.spread import Spread, overlaid, spreads_in
from picchio.robot.urdf.check import bad_inertia
from picchio.robot.urdf.tree import ZERO, Inertial, UrdfTree


def give_masses(
    tree: UrdfTree, sources: Sequence[Source], root: etree._Element
) -> tuple[UrdfTree, dict[str, str], list[Spread]]:
    """The tree with the masses that the sources give, where these are from, how well known.

    Args:
        tree: the robot.
        sources: the strongest first.
        root: of the URDF, for the links' shapes.

    Returns:
        the tree, the origin of each value by its name ("link.forearm.mass"), and the spreads of
        the masses.

    Raises:
        InputError: a mass without a centre of mass, an impossible inertia, a total
            below the masses given one by one, shapes that are missing or cannot be read.
    """
    values: dict[str, dict[str, Any]] = {}
    origins: dict[str, str] = {}
    spreads: list[Spread] = []
    for source in reversed(sources):
        for name, entry in source.content.link.items():
            stated = given(entry)
            note = stated.pop("source", None)
            values[name] = overlaid(LinkEntry, values.get(name, {}), stated)
            origins |= {f"link.{name}.{key}": source.origin(note) for key in stated}
    links = dict(tree.links)
    spread, where = strongest(sources, "links")
    if spread:
        weighed = {name for name, stated in values.items() if "mass" in stated}
        total = LinkMasses.model_validate(spread)
        how = f"{total.total_mass:g} kg over the {total.shapes} shapes by volume"
        origin = f"{where['links.total_mass']}, {how}"
        for name, inertial in _spread(tree, total, weighed, values, root).items():
            links[name] = inertial
            for key in ("mass", "com", "inertia"):
                origins.setdefault(f"link.{name}.{key}", origin)
    for name, stated in values.items():
        links[name] = made = _given(links[name], stated, f"link.{name}")
        # A spread may stand alone: the value is then the URDF's.
        known = {"mass": made.mass, "com": made.xyz, "inertia": made.inertia} | stated
        guessed = stated if stated.get("estimated") else ()
        for each in spreads_in(LinkEntry, known, guessed, table="link", owner=name):
            keys = (f"link.{name}.{each.path[0]}{end}" for end in ("", "_spread", "_std"))
            where_from = next((origins[key] for key in keys if key in origins), "")
            spreads.append(replace(each, source=where_from))
    return replace(tree, links=links), origins, spreads


def _spread(
    tree: UrdfTree,
    total: LinkMasses,
    weighed: set[str],
    values: dict[str, dict[str, Any]],
    root: etree._Element,
) -> dict[str, Inertial]:
    """Of every link with a shape and no mass of its own in the sidecar: its part of the total."""
    found: dict[str, Body] = {
        name: body
        for name, body in bodies(root, total.shapes, tree.path.parent).items()
        if name not in weighed
    }
    key = "links.total_mass"
    if not found:
        raise InputError(f"no link has a {total.shapes} shape to spread it over", key=key,
                         file=tree.path)  # fmt: skip
    fixed = sum(values[name]["mass"] for name in weighed)
    fixed += sum(
        inertial.mass
        for name, inertial in tree.links.items()
        if inertial is not None and name not in weighed and name not in found
    )
    if total.total_mass <= fixed:
        raise InputError(f"must be above {fixed:g} kg, what the links given one by one and those "
                         "without a shape have", key=key, value=total.total_mass)  # fmt: skip
    density = (total.total_mass - fixed) / sum(body.volume for body in found.values())
    return {
        name: Inertial(density * body.volume, body.com, ZERO,
                       tuple(density * moment for moment in body.moments))
        for name, body in found.items()
    }  # fmt: skip


def _given(before: Inertial | None, stated: dict[str, Any], key: str) -> Inertial:
    """A link's inertial with what is stated in place of what was there."""
    has_mass = before is not None and before.mass > 0
    missing = [name for name in ("mass", "com") if name not in stated]
    if not has_mass and missing:
        raise InputError(f"the URDF gives this link no mass: {' and '.join(missing)} must be given",
                         key=key)  # fmt: skip
    old = before if before is not None else Inertial(0.0, ZERO, ZERO, (0.0,) * 6)
    mass: float = stated.get("mass", old.mass)
    factor = mass / old.mass if has_mass else 0.0
    made = replace(old, mass=mass, inertia=tuple(factor * moment for moment in old.inertia))
    if "com" in stated:
        made = replace(made, xyz=stated["com"])
    if "inertia" in stated:
        made = replace(made, inertia=stated["inertia"], rpy=ZERO)
    if mass == 0 and any(made.inertia):
        raise InputError("an inertia needs a mass", key=key)
    if (reason := bad_inertia(made)) is not None:
        raise InputError(reason, key=key)
    return made
