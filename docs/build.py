"""Build the site: `python docs/build.py` writes docs/_build/html; every warning is an error.

Pages are assembled from what is there already: README, CHANGELOG, CONTRIBUTING, the guides beside
this file, the notebooks as they stand, the catalogue of effects, the tables of the file formats,
and the docstrings. Nothing is loaded from a network, neither now nor when the pages are read.
"""

from __future__ import annotations

import os
import pkgutil
import re
import shutil
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
SOURCE = HERE / "_build" / "source"
HTML = HERE / "_build" / "html"

GUIDES = {
    "first_minutes": "The first ten minutes",
    "diagnosis": "Diagnosis",
    "counting": "Counting from logs",
    "motion": "Motion records",
    "explore": "Explore",
    "path_cost": "A cost for planners",
    "placement": "Placement",
    "priors": "Drive priors",
    "stiffness": "Stiffness from nothing",
    "test_plans": "Planned tests",
    "paper": "The paper, reproduced",
    "performance": "Performance",
    "blind_trial": "The blind trial",
}
STAGES = (
    "robot",
    "excitation",
    "model",
    "vibration",
    "fatigue",
    "studies",
    "campaign",
    "measurement",
    "prediction",
    "diagnosis",
    "ledger",
    "visuals",
    "paper",
    "datasets",
    "reference",
    "core",
    "cli",
)
_CODE = re.compile(r"(`[^`]*`)")
_LINK = re.compile(r"\[([^\]]*)\]\(([^)#\s:]+)(#[^)\s]*)?\)")


def main() -> int:
    """Assemble the pages and run Sphinx."""
    shutil.rmtree(HERE / "_build", ignore_errors=True)
    for folder in ("notebooks", "api"):
        (SOURCE / folder).mkdir(parents=True)
    shutil.copytree(HERE / "images", SOURCE / "images")
    pages = {ROOT / "README.md": "index", ROOT / "CHANGELOG.md": "changelog"}
    if (ROOT / "CONTRIBUTING.md").exists():
        pages[ROOT / "CONTRIBUTING.md"] = "contributing"
    pages |= {HERE / f"{name}.md": name for name in GUIDES}
    notebooks = sorted((ROOT / "notebooks").glob("*.ipynb"))
    for path, name in pages.items():
        text = relink(path.read_text(encoding="utf-8"), path.parent, pages)
        (SOURCE / f"{name}.md").write_text(
            text + (contents(pages, notebooks) * (name == "index")), encoding="utf-8"
        )
    for path in notebooks:
        shutil.copy(path, SOURCE / "notebooks")
    write("notebooks/index.md", notebook_page(notebooks))
    write("effects.md", effects_page())
    write("formats.md", formats_page())
    api_pages()
    # Compiled functions are documented as the functions they are.
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    command = [
        sys.executable,
        "-m",
        "sphinx",
        "-W",
        "--keep-going",
        "-q",
        "-j",
        "auto",
        "-c",
        str(HERE),
        str(SOURCE),
        str(HTML),
    ]
    done = subprocess.run(command, env=environment)
    if done.returncode == 0:
        offline(HTML)
        print(f"built {HTML.relative_to(ROOT)}")
    return done.returncode


def write(name: str, text: str) -> None:
    """Write a page."""
    (SOURCE / name).write_text(text, encoding="utf-8")


def relink(text: str, folder: Path, pages: dict[Path, str]) -> str:
    """Links between files of the repository as links between pages, or as downloads."""

    def change(match: re.Match[str]) -> str:
        label, target = match[1], (folder / match[2]).resolve()
        if target in pages:
            path = f"{pages[target]}.md"
        elif target == ROOT / "notebooks":
            path = "notebooks/index.md"
        elif target.is_relative_to(HERE / "images"):
            path = f"images/{target.name}"
        elif not target.exists():
            raise SystemExit(f"docs: a link to {match[2]}, which is not there")
        elif target.suffix == ".md":
            return label  # a page of the repository alone
        else:
            path = os.path.relpath(target, SOURCE)
        return f"[{label}]({path}{match[3] or ''})"

    return _LINK.sub(change, text)


def contents(pages: dict[Path, str], notebooks: list[Path]) -> str:
    """The tables of contents, at the end of the first page."""
    guides = [f"{title} <{name}>" for name, title in GUIDES.items()]
    more = [name for name in ("contributing", "changelog") if name in pages.values()]
    return "".join(
        toctree(caption, entries)
        for caption, entries in (
            ("Guides", guides),
            ("Reference", ["Effects <effects>", "File formats <formats>", "Python <api/index>"]),
            ("Notebooks", ["Notebooks <notebooks/index>"]),
            ("Project", more),
        )
    )


def toctree(caption: str, entries: list[str], depth: int = 1) -> str:
    """A table of contents that only the sidebar shows."""
    head = f"\n```{{toctree}}\n:hidden:\n:maxdepth: {depth}\n"
    return head + (f":caption: {caption}\n" if caption else "") + "\n".join(entries) + "\n```\n"


def notebook_page(notebooks: list[Path]) -> str:
    """The list of the notebooks."""
    import json

    lines = ["# Notebooks\n", "As they stand in `notebooks/`; run them to see their output.\n"]
    for path in notebooks:
        first = json.loads(path.read_text(encoding="utf-8"))["cells"][0]["source"]
        title = "".join(first).splitlines()[0].lstrip("# ")
        lines.append(f"- [{title}]({path.name})")
    return "\n".join(lines) + "\n" + toctree("", [path.stem for path in notebooks])


def effects_page() -> str:
    """The catalogue of effects."""
    from picchio.reference.effects import (
        by_place,
        effects,
        shown_bounds,
        shown_unit,
        target_meaning,
    )

    found = effects().effects
    lines = [
        "# Effects\n",
        f"The {len(found)} effects that can be put into a model. `picchio effects` prints "
        "them, those of installed extensions included.\n",
    ]
    for heading, group in by_place(found).items():
        lines.append(f"## {heading}\n")
        for entry in group:
            lines += [
                f"### {entry.name}\n",
                f"{sentence(entry.meaning)} {entry.detail}\n",
                f"- Target: {target_meaning(entry.target)}",
            ]
            if entry.drawn:
                lines.append(f"- Drawn anew in every record: {entry.drawn}")
            if entry.source:
                lines.append(f"- Source: {entry.source}")
            lines.append("")
            rows = [
                (f"`{p.name}`", shown_unit(p.unit), shown_bounds(p), f"{p.neutral:g}", p.meaning)
                for p in entry.parameters
            ]
            lines += table(("parameter", "unit", "bounds", "no effect at", "meaning"), rows)
            lines += ["```toml", entry.example, "```", ""]
    return "\n".join(lines)


def formats_page() -> str:
    """Every file format with all keys."""
    from picchio.reference.formats import formats, sections

    lines = [
        "# File formats\n",
        "Every file that picchio reads or writes, with all its keys. `picchio formats NAME` "
        "prints the same.\n",
    ]
    for role, title in (("input", "Files that you write"), ("output", "Files that picchio writes")):
        lines.append(f"## {title}\n")
        for entry in (e for e in formats().formats if e.role == role):
            known = f"`{entry.format}`, " if entry.format else ""
            lines += [
                f"### {entry.name}\n",
                f"{sentence(entry.meaning)} {entry.kind}; {known}`{entry.command}`.\n",
            ]
            for name, keys in sections(entry).items():
                if name:
                    lines.append(f"`{name}`:\n")
                rows = []
                for key in keys:
                    own = key.path.rpartition(".")[2] if name else key.path
                    default = f"default {key.default}" if key.default else ""
                    needed = "required" if key.required and role == "input" else ""
                    facts = (
                        key.type,
                        "pure number" if key.unit == "1" else key.unit,
                        default,
                        needed,
                    )
                    kind = "; ".join(fact for fact in facts if fact)
                    rows.append((f"`{own}`", f"{sentence(key.meaning)} ({kind})"))
                lines += table(("key", "meaning (type; unit; default)"), rows)
    return "\n".join(lines)


def sentence(text: str) -> str:
    """A phrase as a sentence."""
    return f"{text[:1].upper()}{text[1:]}."


def table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> list[str]:
    """A Markdown table."""
    lines = [f"| {' | '.join(head)} |", f"|{'---|' * len(head)}"]
    for row in rows:
        cells = (_plain(" ".join(cell.split())) for cell in row)
        lines.append(f"| {' | '.join(cells)} |")
    return [*lines, ""]


def _plain(text: str) -> str:
    """Text for a cell of a table: only `code` means something."""
    parts = _CODE.split(text)
    parts[::2] = [re.sub(r"[*_<>\[\]]", r"\\\g<0>", part) for part in parts[::2]]
    return "".join(parts).replace("|", "\\|")


def api_pages() -> None:
    """The public surface first, then every module, a page a stage."""
    import picchio

    names = [name for name in picchio.__all__ if name != "datasets"]
    kinds = {name: getattr(picchio, name) for name in names}
    lines = ["# Python\n", "`import picchio` gives all of these.\n"]
    for title, wanted in (("Functions", False), ("Classes", True)):
        lines += [f"## {title}\n", "```{eval-rst}"]
        for name in (n for n in names if isinstance(kinds[n], type) is wanted):
            lines += [
                f".. autoclass:: picchio.{name}\n   :members:\n"
                if wanted
                else f".. autofunction:: picchio.{name}\n"
            ]
        lines += ["```", ""]
    lines += ["## By stage\n", "Every module, in the order in which data flow.\n"]
    lines += [f"- [{stage}]({stage}.md)" for stage in STAGES]
    write("api/index.md", "\n".join(lines) + "\n" + toctree("", list(STAGES)))
    for stage in STAGES:
        write(f"api/{stage}.md", stage_page(stage))


def stage_page(stage: str) -> str:
    """All modules of one stage."""
    folder = ROOT / "src" / "picchio" / stage
    found = [f"picchio.{stage}"]
    found += [info.name for info in pkgutil.walk_packages([str(folder)], f"picchio.{stage}.")]
    lines = [f"# picchio.{stage}\n"]
    for name in found:
        if name != found[0]:
            lines += [f"{'#' * min(name.count('.'), 3)} {name.removeprefix(f'picchio.{stage}.')}\n"]
        lines += ["```{eval-rst}", f".. automodule:: {name}\n   :members:\n", "```", ""]
    return "\n".join(lines)


def offline(html: Path) -> None:
    """Refuse pages that load something from a network."""
    loads = re.compile(
        rb"<(?:script|img|iframe|source)[^>]*\ssrc=[\"']?(?:https?:)?//"
        rb"|<link[^>]*rel=[\"']stylesheet[\"'][^>]*href=[\"']?(?:https?:)?//"
        rb"|@import[^;]*//|url\([\"']?https?://"
    )
    bad = [
        path
        for path in html.rglob("*")
        if path.suffix in (".html", ".css") and loads.search(path.read_bytes())
    ]
    if bad:
        raise SystemExit(f"docs: {bad[0]} loads something from a network")


if __name__ == "__main__":
    sys.exit(main())
