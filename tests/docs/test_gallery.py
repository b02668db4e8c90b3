"""The gallery: short, on public names alone, and each example draws its picture."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import picchio

DOCS = Path(__file__).resolve().parents[2] / "docs"
EXAMPLES = sorted((DOCS / "gallery").glob("*.py"))
MAY_IMPORT = {"picchio", "numpy", "pandas", "matplotlib"}
every = pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)


def test_there_are_twenty() -> None:
    assert len(EXAMPLES) >= 20


@every
def test_an_example_is_short_and_uses_public_names(example: Path) -> None:
    text = example.read_text("utf-8")
    assert len(text.splitlines()) <= 25
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            modules = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            modules = [node.module or ""]
            assert not modules[0].startswith("picchio"), modules
        else:
            if isinstance(node, ast.Attribute) and ast.unparse(node.value) == "picchio":
                assert node.attr in picchio.__all__
            continue
        assert {name.partition(".")[0] for name in modules} <= MAY_IMPORT
        assert all(not name.startswith("picchio.") for name in modules)


def test_an_empty_picture_is_told(tmp_path: Path, monkeypatch) -> None:
    """Each example is drawn, and its picture looked at, where the documentation is built."""
    monkeypatch.syspath_prepend(str(DOCS))
    from examples import draw, empty

    example, picture = tmp_path / "blank.py", tmp_path / "picture.png"
    example.write_text("import matplotlib.pyplot as plt; plt.figure()")
    with pytest.raises(SystemExit, match="draws an empty picture"):
        draw(example, picture)
    assert empty(picture)
    Image.fromarray(np.tile(np.arange(400, dtype=np.uint16) % 256, (400, 1)).astype("uint8")).save(
        picture
    )
    assert not empty(picture)
