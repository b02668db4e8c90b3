"""Numbers in a URDF's attributes: finite, of sane size, nothing else beside them."""

from __future__ import annotations

import math
import re
from pathlib import Path

from lxml import etree

from picchio.core.errors import InputError

# Above this a sum of squares in the dynamics is on its way to overflow.
LARGEST = 1e12
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?\Z")
_INFINITE = re.compile(r"[+-]?inf(inity)?\Z", re.IGNORECASE)
Vector = tuple[float, float, float]


def to_number(text: str, *, infinite: bool = False) -> float:
    """A decimal number.

    Args:
        text: what the file has.
        infinite: let "inf" and magnitudes above 1e12 stand, as limits may have them.

    Raises:
        ValueError: not a number, not finite, or above 1e12; the message says which.
    """
    stripped = text.strip()
    if infinite and _INFINITE.match(stripped):
        return float(stripped)
    if not _NUMBER.match(stripped):
        raise ValueError("is not a finite number")
    value = float(stripped)
    if infinite:
        return value
    if not math.isfinite(value) or abs(value) > LARGEST:
        raise ValueError(f"is larger than {LARGEST:g}")
    return value


def number(
    element: etree._Element,
    attribute: str,
    path: Path,
    key: str,
    *,
    default: float | None = None,
    infinite: bool = False,
) -> float:
    """A number from an attribute.

    Raises:
        InputError: missing without a default, or `to_number` refuses it.
    """
    text = element.get(attribute)
    tag = etree.QName(element).localname
    if text is None:
        if default is None:
            raise InputError(f"<{tag}> has no {attribute}", file=path, key=key)
        return default
    try:
        return to_number(text, infinite=infinite)
    except ValueError as error:
        raise InputError(f"<{tag} {attribute}> {error}", file=path, key=key, value=text) from None


def three_numbers(
    element: etree._Element, attribute: str, path: Path, key: str, *, default: Vector
) -> Vector:
    """Three numbers from an attribute, such as xyz or rpy.

    Raises:
        InputError: not three, or `to_number` refuses one.
    """
    text = element.get(attribute)
    if text is None:
        return default
    tag = etree.QName(element).localname
    parts = text.split()
    if len(parts) != 3:
        raise InputError(f"<{tag} {attribute}> needs three numbers", file=path, key=key, value=text)
    try:
        x, y, z = (to_number(part) for part in parts)
    except ValueError as error:
        raise InputError(f"<{tag} {attribute}> {error}", file=path, key=key, value=text) from None
    return x, y, z
