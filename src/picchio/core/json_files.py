"""JSON files of picchio: read whole, errors in one line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from picchio.core.errors import InputError
from picchio.core.files import read_text


def read_json(path: str | Path, what: str, choices: list[str]) -> dict[str, Any]:
    """The content of a file that `--json` wrote.

    Args:
        path: the file.
        what: it should hold, for the message.
        choices: formats that will do.

    Returns:
        the object, whose `format` is not checked yet.

    Raises:
        InputError: missing, no JSON, no object, or without a format.
    """
    try:
        content = json.loads(read_text(path))
    except ValueError as error:
        raise InputError(f"is not valid JSON: {error}", file=path) from None
    except RecursionError:
        raise InputError("is nested too deeply", file=path) from None
    if not isinstance(content, dict):
        raise InputError(f"is no {what}: an object is wanted", file=path)
    if "format" not in content:
        raise InputError(f"the key is missing; `--json` writes it in every {what}", file=path,
                         key="format", choices=choices)  # fmt: skip
    return content
