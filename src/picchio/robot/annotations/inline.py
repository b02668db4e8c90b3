"""The `picchio:` annotations of a URDF, read into the same records as a sidecar.

In a `<joint>`: `<picchio:flexibility>`, `<picchio:shaft>`, `<picchio:stiffness_curve>`,
`<picchio:balancer>`. In `<robot>`: `<picchio:tool>`, `<picchio:gun>`, `<picchio:base>`.
The prefix is bound to `urn:picchio:1`; another version is refused by name.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from lxml import etree

from picchio.core.errors import InputError
from picchio.core.toml import validate
from picchio.robot.annotations.sidecar import FORMAT, Sidecar
from picchio.robot.urdf.tree import to_number
from picchio.robot.urdf.xml import NAMESPACE, local_name

_TEXT, _FLAG, _NUMBER, _NUMBERS = "text", "flag", "number", "numbers"

# element: (the sidecar's key, None for the joint itself; attributes and how they read)
IN_JOINT: dict[str, tuple[str | None, dict[str, str]]] = {
    "flexibility": (
        None,
        {
            "stiffness": _NUMBER,
            "damping_ratio": _NUMBER,
            "reducer": _TEXT,
            "rotor_inertia": _NUMBER,
            "gear_ratio": _NUMBER,
            "source": _TEXT,
            "estimated": _FLAG,
        },
    ),
    "shaft": (
        "shaft",
        {"radius": _NUMBER, "length": _NUMBER, "shear_modulus": _NUMBER, "sn_curve": _TEXT},
    ),
    "stiffness_curve": (
        "stiffness_curve",
        dict.fromkeys(("k1", "k2", "k3", "t1", "t2"), _NUMBER),
    ),
    "balancer": (
        "balancer",
        {
            "parent_point": _NUMBERS,
            "child_point": _NUMBERS,
            "stiffness": _NUMBER,
            "free_length": _NUMBER,
            "force": _NUMBER,
        },
    ),
}
IN_ROBOT: dict[str, dict[str, str]] = {
    "tool": {
        "frame": _TEXT,
        "xyz": _NUMBERS,
        "axis": _NUMBERS,
        "mass": _NUMBER,
        "com": _NUMBERS,
        "inertia": _NUMBERS,
        "source": _TEXT,
    },
    "gun": {
        "mass": _NUMBER,
        "recoil_stiffness": _NUMBER,
        "damping_ratio": _NUMBER,
        "feed_force": _NUMBER,
        "source": _TEXT,
    },
    "base": {"xyz": _NUMBERS, "rpy": _NUMBERS, "gravity": _NUMBERS, "source": _TEXT},
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
    _check_prefix(root, path)
    found: dict[str, Any] = {"joint": {}}
    for element in root.iter(f"{{{NAMESPACE}}}*"):
        parent = element.getparent()
        name = local_name(element)
        # Not the <joint> of a <transmission>, which only refers to one.
        if parent is not None and parent.tag == "joint" and parent.getparent() is root:
            _read_in_joint(element, found["joint"].setdefault(parent.get("name"), {}), path)
        elif parent is root and name in IN_ROBOT:
            if name in found:
                raise InputError(f"<picchio:{name}> occurs twice", file=path)
            found[name] = _attributes(element, IN_ROBOT[name], path, f"picchio:{name}")
        else:
            _refuse(element, path)
    if found == {"joint": {}}:
        return None
    return validate({"format": FORMAT, **found}, Sidecar, format=FORMAT, file=path)


def _check_prefix(root: etree._Element, path: Path) -> None:
    for element in root.iter(etree.Element):
        for prefix, address in element.nsmap.items():
            mine = str(address).startswith("urn:picchio")
            if (prefix == "picchio" or mine) and address != NAMESPACE:
                raise InputError(
                    "the picchio prefix is bound to an unknown namespace",
                    file=path,
                    key=f"xmlns:{prefix}",
                    value=address,
                    choices=[NAMESPACE],
                )


def _read_in_joint(element: etree._Element, entry: dict[str, Any], path: Path) -> None:
    name = local_name(element)
    if name not in IN_JOINT:
        _refuse(element, path)
    parent = element.getparent()
    place = f"joint {parent.get('name') if parent is not None else ''}"
    target, attributes = IN_JOINT[name]
    values = _attributes(element, attributes, path, f"{place}: picchio:{name}")
    if parent is not None and len(parent.findall(str(element.tag))) > 1:
        raise InputError(f"<picchio:{name}> occurs twice", file=path, key=place)
    if target is None:
        entry.update(values)
    else:
        entry[target] = values


def _attributes(
    element: etree._Element, known: dict[str, str], path: Path, key: str
) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for attribute, text in element.attrib.items():
        name = str(attribute)
        if name not in known:
            raise InputError("unknown attribute", file=path, key=key, value=name, choices=known)
        values[name] = _convert(str(text), known[name], path, f"{key} {name}")
    return values


def _convert(text: str, kind: str, path: Path, key: str) -> Any:
    if kind == _TEXT:
        return text
    if kind == _FLAG:
        if text not in ("true", "false"):
            raise InputError("is neither true nor false", file=path, key=key, value=text)
        return text == "true"
    try:
        return to_number(text) if kind == _NUMBER else [to_number(part) for part in text.split()]
    except ValueError as error:
        raise InputError(str(error), file=path, key=key, value=text) from None


def _refuse(element: etree._Element, path: Path) -> None:
    name = local_name(element)
    line = f"line {element.sourceline}"
    if name in IN_JOINT:
        raise InputError(
            f"<picchio:{name}> belongs directly in a <joint> of <robot> ({line})", file=path
        )
    if name in IN_ROBOT:
        raise InputError(f"<picchio:{name}> belongs directly in <robot> ({line})", file=path)
    raise InputError(f"unknown picchio element ({line})", file=path, value=name,
                     choices=[*IN_JOINT, *IN_ROBOT])  # fmt: skip
