"""Write a sidecar's values into a URDF as `picchio:` annotations, touching nothing else.

The file is not parsed and written back: the new elements are cut into its bytes, so comments,
order, other tools' tags and even odd spacing stay as they are. What comes out is read back
before it is handed over.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

from lxml import etree
from pydantic import BaseModel

from picchio.core.errors import InputError
from picchio.robot.annotation import IN_JOINT, IN_ROBOT, read_annotations
from picchio.robot.flexibility import Source, check_names
from picchio.robot.sidecar import JointEntry, Sidecar, given
from picchio.robot.urdf_check import read_tree
from picchio.robot.urdf_places import Edit, Places, find_places
from picchio.robot.urdf_xml import NAMESPACE, parse_urdf, read_urdf_bytes


def annotate(urdf: str | Path, sidecar: Sidecar) -> bytes:
    """The URDF's bytes with the sidecar's values in them.

    What the URDF's own annotations say beside the sidecar's values is kept.

    Args:
        urdf: the file; it is not changed.
        sidecar: the values to write.

    Raises:
        InputError: the URDF or the sidecar cannot be used together, the URDF's encoding is
            not a superset of ASCII, or the result would not read back as the same values.
    """
    path = Path(urdf)
    content = read_urdf_bytes(path)
    root = parse_urdf(content, path)
    tree = read_tree(root, path)
    check_names(tree, Source("sidecar", sidecar))
    before = read_annotations(root, path) or Sidecar()
    if b"\0" in content:
        raise InputError("only URDFs in UTF-8 or another superset of ASCII can be annotated",
                         file=path)  # fmt: skip
    prefix = next((key for key, address in root.nsmap.items() if address == NAMESPACE and key), "")
    try:
        places = find_places(content, NAMESPACE)
    except ValueError as error:
        raise InputError(f"cannot be annotated in this encoding: {error}", file=path) from None
    expected: dict[tuple[str, str], dict[str, Any]] = {}
    edits = []
    if not prefix:
        prefix = "picchio"
        edits.append(Edit(places.root_name_end, 0, f' xmlns:{prefix}="{NAMESPACE}"'))
    for name, entry in sidecar.joint.items():
        merged = {**given(before.joint.get(name)), **given(entry)}
        if "stiffness" in given(entry):
            merged.pop("stiffness_curve", None)
        if "stiffness_curve" in given(entry):
            merged.pop("stiffness", None)
        JointEntry.model_validate({key: _plain(value) for key, value in merged.items()})
        expected["joint", name] = merged
        edits += _replace(places, ("joint", name), _joint_elements(prefix, merged))
    for tag in IN_ROBOT:
        values = {**given(getattr(before, tag)), **given(getattr(sidecar, tag))}
        if given(getattr(sidecar, tag)):
            expected["robot", tag] = values
            edits += _replace(places, ("robot", tag), [_element(prefix, tag, values, {})])
    result = _apply(content, edits, places.newline)
    _read_back(result, path, root, expected)
    return result


def _read_back(
    result: bytes,
    path: Path,
    before: etree._Element,
    expected: Mapping[tuple[str, str], Mapping[str, Any]],
) -> None:
    """Refuse a result that picchio's own reader would refuse, or read as something else."""
    try:
        root = parse_urdf(result, path)
        read_tree(root, path)
        found = read_annotations(root, path) or Sidecar()
    except InputError as error:
        raise InputError(f"cannot be annotated, the result would not read back: {error.problem}",
                         file=path, key=error.key) from None  # fmt: skip
    for (kind, name), values in expected.items():
        entry = found.joint.get(name) if kind == "joint" else getattr(found, name)
        if given(entry) != values:
            raise InputError("cannot be annotated, the result would not read back as the values "
                             "given", file=path, key=f"{kind}.{name}")  # fmt: skip
    if _outline(root) != _outline(before):
        raise InputError("cannot be annotated without a change to its own elements", file=path)


def _outline(root: etree._Element) -> list[tuple[str, dict[str, str]]]:
    """Everything but the annotations, in the file's order."""
    return [(str(element.tag), {str(key): str(text) for key, text in element.attrib.items()})
            for element in root.iter(etree.Element)
            if not str(element.tag).startswith(f"{{{NAMESPACE}}}")]  # fmt: skip


def _joint_elements(prefix: str, values: Mapping[str, Any]) -> list[str]:
    elements = []
    for tag, (target, attributes) in IN_JOINT.items():
        if target is None:
            own = {key: value for key, value in values.items() if key in attributes}
        else:
            own = values[target].model_dump(exclude_none=True) if target in values else {}
        if own:
            elements.append(_element(prefix, tag, own, attributes))
    return elements


def _element(prefix: str, tag: str, values: Mapping[str, Any], order: Mapping[str, str]) -> str:
    names = [name for name in order if name in values] or list(values)
    text = " ".join(f"{name}={quoteattr(_text(values[name]))}" for name in names)
    return f"<{prefix}:{tag} {text}/>"


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, tuple):
        return " ".join(_text(part) for part in value)
    return repr(value) if isinstance(value, float) else str(value)


def _plain(value: Any) -> Any:
    return value.model_dump() if isinstance(value, BaseModel) else value


def _replace(places: Places, where: tuple[str, str], elements: list[str]) -> list[Edit]:
    """Take the old annotations at a place out and put new ones in."""
    place = places.at[where]
    edits = [Edit(start, end - start, "") for start, end in place.old]
    lines = "".join(f"{place.lead or ''}{element}" for element in elements)
    return [*edits, Edit(place.insert, 0, lines)]


def _apply(content: bytes, edits: list[Edit], newline: str) -> bytes:
    # From the end, so that earlier places stay where they are; of two at one place the
    # insertion goes in last and stands first.
    for edit in sorted(edits, key=lambda e: (e.start, e.length), reverse=True):
        text = edit.text.replace("\n", newline).encode("ascii", "xmlcharrefreplace")
        content = content[: edit.start] + text + content[edit.start + edit.length :]
    return content
