"""The `picchio:` annotations of a URDF, read into the same records as a sidecar.

In a `<joint>`: `<picchio:flexibility>`, `<picchio:shaft>`, `<picchio:stiffness_curve>`,
`<picchio:balancer>`, `<picchio:strength>`. In a `<link>`: `<picchio:inertial>`. In `<robot>`:
`<picchio:tool>`, `<picchio:gun>`, `<picchio:links>`, `<picchio:base>`, `<picchio:posterior>` (the
correlation's rows one after another).
The prefix is bound to `urn:picchio:1`; another version is refused by name.
"""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lxml import etree

from picchio.core.errors import InputError
from picchio.core.toml import StrictModel, leaf_types, validate
from picchio.robot.annotations.sidecar import FORMAT, JointEntry, Sidecar
from picchio.robot.joint import Balancer, Shaft, StiffnessCurve, Strength
from picchio.robot.link import LinkEntry, LinkMasses
from picchio.robot.spread import Posterior
from picchio.robot.tool import Gun, Mounting, Tool
from picchio.robot.urdf.tree import to_number
from picchio.robot.urdf.xml import NAMESPACE, local_name


def _attributes_of(table: type[StrictModel]) -> dict[str, Any]:
    """The attributes of a table's element and their types: what is a table itself is an element."""
    kinds = {name: leaf_types(field.annotation)[0] for name, field in table.model_fields.items()}
    return {name: kind for name, kind in kinds.items() if kind not in _WITHIN_A_JOINT}


# element: (the sidecar's key, None for the joint itself; its attributes)
_WITHIN_A_JOINT = (Shaft, StiffnessCurve, Balancer, Strength)
IN_JOINT: dict[str, tuple[str | None, dict[str, Any]]] = {
    "flexibility": (None, _attributes_of(JointEntry)),
    "shaft": ("shaft", _attributes_of(Shaft)),
    "stiffness_curve": ("stiffness_curve", _attributes_of(StiffnessCurve)),
    "balancer": ("balancer", _attributes_of(Balancer)),
    "strength": ("strength", _attributes_of(Strength)),
}
IN_LINK: dict[str, tuple[str | None, dict[str, Any]]] = {
    "inertial": (None, _attributes_of(LinkEntry)),
}
# What a <joint> and a <link> may hold.
IN = {"joint": IN_JOINT, "link": IN_LINK}
IN_ROBOT = {
    "tool": _attributes_of(Tool),
    "gun": _attributes_of(Gun),
    "links": _attributes_of(LinkMasses),
    "base": _attributes_of(Mounting),
    "posterior": _attributes_of(Posterior),
}


def read_annotations(root: etree._Element, path: Path) -> Sidecar | None:
    """What the URDF says under `urn:picchio:1`, or None if it says nothing.

    Args:
        root: the URDF's root element.
        path: named in errors.

    Raises:
        InputError: the prefix bound to something else, an unknown element or attribute, an
            element in the wrong place, a value that cannot be.
    """
    try:
        found = _read(root)
    except InputError as error:
        raise error.placed(file=path) from None
    if not any(found.values()):
        return None
    return validate({"format": FORMAT, **found}, Sidecar, format=FORMAT, file=path)


def _read(root: etree._Element) -> dict[str, Any]:
    """The annotations as a sidecar has them."""
    _check_prefix(root)
    found: dict[str, Any] = {"joint": {}, "link": {}}
    for element in root.iter(f"{{{NAMESPACE}}}*"):
        parent = element.getparent()
        name = local_name(element)
        # Not the <joint> of a <transmission>, which only refers to one.
        kind = str(parent.tag) if parent is not None else ""
        if parent is not None and kind in IN and parent.getparent() is root:
            holder = parent.get("name", "")
            _read_in(IN[kind], element, parent, found[kind].setdefault(holder, {}),
                     f"{kind} {holder}")  # fmt: skip
        elif parent is root and name in IN_ROBOT:
            if name in found:
                raise InputError(f"<picchio:{name}> occurs twice")
            found[name] = _attributes(element, IN_ROBOT[name], f"picchio:{name}")
        else:
            _refuse(element)
    return found


def _check_prefix(root: etree._Element) -> None:
    for element in root.iter(etree.Element):
        for prefix, address in element.nsmap.items():
            mine = str(address).startswith("urn:picchio")
            if (prefix == "picchio" or mine) and address != NAMESPACE:
                raise InputError("the picchio prefix is bound to an unknown namespace",
                                 key=f"xmlns:{prefix}", value=address,
                                 choices=[NAMESPACE])  # fmt: skip


def _read_in(
    known: Mapping[str, tuple[str | None, dict[str, Any]]],
    element: etree._Element,
    holder: etree._Element,
    entry: dict[str, Any],
    place: str,
) -> None:
    name = local_name(element)
    if name not in known:
        _refuse(element)
    target, attributes = known[name]
    values = _attributes(element, attributes, f"{place}: picchio:{name}")
    if len(holder.findall(str(element.tag))) > 1:
        raise InputError(f"<picchio:{name}> occurs twice", key=place)
    if target is None:
        entry.update(values)
    else:
        entry[target] = values


def _attributes(element: etree._Element, known: dict[str, Any], key: str) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for attribute, text in element.attrib.items():
        name = str(attribute)
        if name not in known:
            raise InputError("unknown attribute", key=key, value=name, choices=known)
        values[name] = _convert(str(text), known[name], f"{key} {name}")
    return values


def _convert(text: str, kind: Any, key: str) -> Any:
    if kind is str:
        return text
    if kind is bool:
        if text not in ("true", "false"):
            raise InputError("is neither true nor false", key=key, value=text)
        return text == "true"
    try:
        if kind == tuple[str, ...]:
            return shlex.split(text)  # a name with a blank stands in quotes
        return to_number(text) if kind is float else [to_number(part) for part in text.split()]
    except ValueError as error:
        raise InputError(str(error), key=key, value=text) from None


def _refuse(element: etree._Element) -> None:
    name = local_name(element)
    line = f"line {element.sourceline}"
    for kind, elements in IN.items():
        if name in elements:
            raise InputError(f"<picchio:{name}> belongs directly in a <{kind}> of <robot> ({line})")
    if name in IN_ROBOT:
        raise InputError(f"<picchio:{name}> belongs directly in <robot> ({line})")
    raise InputError(f"unknown picchio element ({line})", value=name,
                     choices=[*IN_JOINT, *IN_LINK, *IN_ROBOT])  # fmt: skip
