"""The notebooks: stripped in git, run top to bottom in a fresh kernel, and show what they say."""

from __future__ import annotations

import ast
import re
import resource
import time
from pathlib import Path
from typing import Any

import nbformat
import pytest

import picchio

FOLDER = Path(__file__).resolve().parents[2] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
MOST_SECONDS = 90.0
FIRST_SECONDS = 60.0
"""Of the notebook that one opens first."""
MOST_LINES = 16
"""Of a code cell."""
MACHINE = re.compile(r"(?<![\w.])/(?:work|home|root|tmp|Users|opt|mnt)/|[A-Z]:\\\\|file://")

MAY_IMPORT = {"picchio", "numpy", "pandas", "matplotlib.pyplot"}

every_notebook = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)


def test_the_first_one_ends_live() -> None:
    cells = nbformat.read(NOTEBOOKS[0], as_version=4).cells
    assert "picchio.explore(" in [c.source for c in cells if c.cell_type == "code"][-1]


def test_the_subjects_are_there() -> None:
    assert [path.stem[3:] for path in NOTEBOOKS][:5] == [
        "quick_start", "the_papers_method", "any_robot", "envelopes_and_maps", "fatigue",
    ]  # fmt: skip


@every_notebook
def test_outputs_are_stripped_and_nothing_tells_of_a_machine(path: Path) -> None:
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    for cell in notebook.cells:
        assert not cell.metadata
        if cell.cell_type == "code":
            assert cell.outputs == []
            assert cell.execution_count is None
    assert set(notebook.metadata) == {"kernelspec", "language_info"}
    assert not MACHINE.search(path.read_text("utf-8"))


@every_notebook
def test_it_teaches_in_small_steps(path: Path) -> None:
    cells = nbformat.read(path, as_version=4).cells
    code = [cell.source for cell in cells if cell.cell_type == "code"]
    text = [cell.source for cell in cells if cell.cell_type == "markdown"]
    assert cells[0].cell_type == "markdown" and cells[0].source.startswith("# ")
    assert len(text) >= 0.6 * len(code)
    assert sum(map(len, text)) > 0.6 * sum(map(len, code))
    assert max(source.count("\n") + 1 for source in code if '"""' not in source) <= MOST_LINES
    for other in re.findall(r"`(\d\d_\w+)`", "\n".join(text)):
        assert (FOLDER / f"{other}.ipynb").is_file(), other


@every_notebook
def test_it_uses_the_public_surface(path: Path) -> None:
    """Imports are of four packages, and of picchio only what it offers itself."""
    for cell in nbformat.read(path, as_version=4).cells:
        if cell.cell_type != "code":
            continue
        for node in ast.walk(ast.parse(cell.source)):
            if isinstance(node, ast.Attribute):
                assert not node.attr.startswith("_"), node.attr
                if ast.unparse(node.value) == "picchio":
                    assert node.attr in picchio.__all__, node.attr
            elif isinstance(node, ast.Import):
                assert {a.name for a in node.names} <= MAY_IMPORT, ast.unparse(node)
            else:
                assert not isinstance(node, ast.ImportFrom), ast.unparse(node)


def plots(source: str) -> bool:
    """Whether a cell draws with matplotlib."""
    return ".plot(" in source or "plt.subplots" in source


@pytest.mark.slow
@every_notebook
def test_it_runs_in_a_fresh_kernel(
    path: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    request: pytest.FixtureRequest,
) -> None:
    from nbclient import NotebookClient

    notebook = nbformat.read(path, as_version=4)
    if "datasets.load" in "".join(cell.source for cell in notebook.cells):
        folder = request.getfixturevalue("measured_data")  # skips where there is none
        monkeypatch.setenv("PICCHIO_DATA", str(folder))
    began, used = time.monotonic(), cpu_of_children()
    NotebookClient(
        notebook,
        timeout=5 * int(MOST_SECONDS),
        kernel_name="python3",
        resources={"metadata": {"path": str(tmp_path)}},
    ).execute()
    # On a machine that others use, too, the kernel's own seconds count.
    took = min(time.monotonic() - began, cpu_of_children() - used)
    assert took < (FIRST_SECONDS if path is NOTEBOOKS[0] else MOST_SECONDS)
    for cell in notebook.cells:
        if cell.cell_type != "code":
            continue
        kinds = {kind for output in cell.outputs for kind in output.get("data", {})}
        if plots(cell.source):
            assert "image/png" in kinds, cell.source
        if re.search(r"^picchio\.view\(", cell.source, re.MULTILINE):
            assert "<iframe" in html_of(cell), cell.source
        if "picchio.explore(" in cell.source:  # live, and a picture where its kernel has ended
            assert re.search(r'<object .*data="http://127\.0\.0\.1:.*<img ', html_of(cell))
        if re.fullmatch(r"[a-z_0-9]+", cell.source.rstrip().splitlines()[-1]):
            assert kinds, cell.source  # a name as the last line shows something
    assert list(tmp_path.iterdir()) == []


def cpu_of_children() -> float:
    """Seconds that processes started from here, and ended, have computed."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def html_of(cell: Any) -> str:
    return "".join(output.get("data", {}).get("text/html", "") for output in cell.outputs)
