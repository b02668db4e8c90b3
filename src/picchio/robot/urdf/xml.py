"""The bytes of a URDF as an XML tree; entities, document types and network access are refused.

No document type declaration, hence no entities; no network; no huge trees. What goes wrong
is said in one line. Everything that needs the XML itself (reading, annotating) starts here.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

from lxml import etree

from picchio.core.errors import InputError
from picchio.core.files import read_bytes

NAMESPACE = "urn:picchio:1"

EXPAND = "expand it first: xacro FILE > robot.urdf"
_COMMENT = re.compile(rb"<!--.*?-->", re.DOTALL)
_DOCTYPES = tuple(
    text.encode(code) for text in ("<!DOCTYPE", "<!ENTITY") for code in ("ascii", "utf-16-le")
)


def read_urdf_bytes(path: Path) -> bytes:
    """The file's bytes.

    Raises:
        InputError: missing, a folder, unreadable, or above 32 MiB.
    """
    return read_bytes(path)


def parse_urdf(content: bytes, path: Path) -> etree._Element:
    """The root element of a URDF.

    Args:
        content: the file's bytes.
        path: named in errors.

    Raises:
        InputError: not XML, a document type declaration, an undeclared prefix, wrong encoding, a
            TOML or xacro file.
    """
    if not content.strip():
        raise InputError("is empty", file=path)
    if any(mark in content for mark in _DOCTYPES):
        raise InputError(
            "has a document type declaration or entities, which are not accepted", file=path
        )
    parser = etree.XMLParser(
        resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False, recover=False
    )
    try:
        root = etree.fromstring(content, parser)
    except etree.XMLSyntaxError as error:
        if _is_toml(content, path):
            raise InputError("is a TOML file, not a URDF", file=path,
                             hint="a sidecar belongs to --flex, a task to --task"
                             ) from None  # fmt: skip
        raise _told(error, path) from None
    except (ValueError, LookupError) as error:
        raise InputError(f"is not readable as XML: {error}", file=path) from None
    # The prefix alone is left by xacro.
    if path.suffix == ".xacro" or b"<xacro:" in _COMMENT.sub(b"", content):
        raise InputError("is a xacro file, not a URDF", file=path, hint=EXPAND)
    if root.getroottree().docinfo.doctype:
        raise InputError("has a document type declaration, which is not accepted", file=path)
    return root


def _is_toml(content: bytes, path: Path) -> bool:
    if path.suffix.lower() == ".toml":
        return True
    if len(content) > 1 << 20:
        return False
    try:
        return bool(tomllib.loads(content.decode("utf-8")))
    except (ValueError, RecursionError):
        return False


def _told(error: etree.XMLSyntaxError, path: Path) -> InputError:
    text = str(error.msg).replace(f"{error.filename}, ", "")
    if "Namespace prefix" not in text:
        return InputError(f"is not valid XML: {text}", file=path)
    hint = 'declare it: <robot name="..." xmlns:PREFIX="...">'
    if "Namespace prefix xacro" in text:
        hint = EXPAND
    if "Namespace prefix picchio" in text:
        hint = f'write <robot name="..." xmlns:picchio="{NAMESPACE}">'
    return InputError(f"uses an XML prefix that is not declared: {text}", file=path, hint=hint)


def local_name(element: etree._Element) -> str:
    """The tag without its namespace; "" for comments and processing instructions."""
    return etree.QName(element).localname if isinstance(element.tag, str) else ""


def children(element: etree._Element, name: str) -> list[etree._Element]:
    """The direct children with this tag and no namespace."""
    return [child for child in element if child.tag == name]
