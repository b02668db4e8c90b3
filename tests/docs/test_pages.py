"""README and guides: what they show is what happens, and links lead somewhere."""

from __future__ import annotations

import re
import runpy
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

import picchio
from picchio.cli.main import run

pytestmark = pytest.mark.filterwarnings("ignore::picchio.PicchioWarning")
ROOT = Path(__file__).resolve().parents[2]
README = ROOT / "README.md"
PAGES = [README, *(path for path in (ROOT / "docs").rglob("*.md") if "_build" not in path.parts)]
NAMED = re.compile(r"(?:#|<!--) ([\w./-]+\.\w+)(?: -->)?$")


def blocks(page: Path) -> Iterator[tuple[str, str]]:
    """The page's code, (language, text) each."""
    yield from re.findall(r"^```(\w+)\n(.*?)^```", page.read_text("utf-8"), re.S | re.M)


def follow(page: Path) -> None:
    """Do what a page says: write its named files, run its commands and its Python."""
    for language, text in blocks(page):
        first, _, rest = text.partition("\n")
        if named := NAMED.match(first):
            path = Path(named[1])
            path.parent.mkdir(exist_ok=True)
            path.write_text(rest if language == "xml" else text)
        elif language == "python":
            exec(compile(text, str(page), "exec"), {"__name__": "page"})
        elif language == "sh":
            for line in text.splitlines():
                program, *words = shlex.split(line, comments=True) or [""]
                if program == "picchio":
                    assert run(words) == 0, line
                elif program == "python":
                    runpy.run_path(words[0])


@pytest.mark.parametrize(
    ("name", "made"),
    [
        pytest.param("tutorial/assess", ("life.html", "scene.html"), marks=pytest.mark.slow),
        pytest.param("tutorial/own_robot", ("loads/sheet.html",), marks=pytest.mark.slow),
        pytest.param(
            "tutorial/diagnose",
            ("why.html", "flex.toml"),
            marks=(pytest.mark.slow, pytest.mark.timeout(1500)),
        ),
        ("how_to/count", ("life.html", "cell.ledger")),
        ("how_to/python", ()),
        pytest.param("how_to/report", ("report.html", "life.csv"), marks=pytest.mark.slow),
    ],
)
def test_a_guide_can_be_followed(name, made, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    follow(ROOT / "docs" / f"{name}.md")
    assert all((tmp_path / each).is_file() for each in made)
    told = capsys.readouterr().out
    if name == "how_to/count":
        assert "1440 blows" in told
    if name == "tutorial/diagnose":
        assert "joint_stiffness" in told
        robot = picchio.load_robot("fanuc_like_3dof", flex=tmp_path / "flex.toml")
        assert robot.stiffness[1] == pytest.approx(7e4, rel=0.02)


@pytest.mark.slow
def test_the_readme_shows_what_is_printed(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["assess", "fanuc_like_3dof"]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    (shown,) = (text for language, text in blocks(README) if language == "text")
    assert 5 <= len(shown.splitlines()) <= 7
    assert [line for line in shown.splitlines() if " ".join(line.split()) not in printed] == []
    (code,) = (text for language, text in blocks(README) if language == "python")
    assert len([line for line in code.splitlines() if line]) <= 10
    exec(code, {})
    assert (tmp_path / "life.html").is_file() and (tmp_path / "scene.html").is_file()


def test_the_readme_is_short_and_in_order() -> None:
    text = README.read_text("utf-8")
    assert len(text.encode()) <= 5000
    order = ("?**", "![", "main-job", "| I want to", "## Your own robot", "## Can I trust it?",
             "## In Python", "## Limits", "## Links", "## Citation")  # fmt: skip
    places = [text.index(part) for part in order]
    assert places == sorted(places)


@pytest.mark.parametrize("figure", ["145 of 156", "370 of 376"])
def test_figures_of_the_readme_are_printed_ones(figure) -> None:
    assert figure in README.read_text("utf-8")
    kind = {"145 of 156": "single", "370 of 376": "null"}[figure]
    page = (ROOT / "docs" / "validation" / "blind_trial.md").read_text("utf-8")
    assert f"\n{kind}: {figure} right" in page


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    text = re.sub(r"^```.*?^```", "", page.read_text("utf-8"), flags=re.S | re.M)
    for target in re.findall(r"\]\(([^)#\s:]+)(?:#[^)\s]*)?\)", text):
        assert (page.parent / target).exists(), target


OLD = (
    "no end", "from memory", "stands still while", "out of the doubt", "doubt is from",
    "hang together", "foretold", "foretell", "are seen, the others", "it is not assessed",
)  # fmt: skip


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_page_says_it_in_textbook_words(page: Path) -> None:
    text = " ".join(page.read_text("utf-8").split())
    assert [words for words in OLD if words in text] == []
