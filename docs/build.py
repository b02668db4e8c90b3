"""Build the site: `python docs/build.py` writes docs/_build/html; every warning is an error.

The pages beside this file are taken as they stand. The reference is made here: commands, effects,
file formats and Python, from the code and its docstrings. So is the gallery: each example is run
for its picture. Nothing is loaded from a network, neither now nor when the pages are read.
"""

from __future__ import annotations

import ast
import os
import pkgutil
import re
import shutil
import subprocess
import sys
from pathlib import Path

from examples import EXAMPLES, draw

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
SOURCE = HERE / "_build" / "source"
HTML = HERE / "_build" / "html"

# Pages of the repository that lie elsewhere, and folders that have a page of their own.
ELSEWHERE = {
    ROOT / "README.md": "readme.md",
    ROOT / "CONTRIBUTING.md": "contributing.md",
    ROOT / "CHANGELOG.md": "changelog.md",
    ROOT / "notebooks": "notebooks/index.md",
    EXAMPLES: "gallery.md",
}
# What is made here, and what the first page says of it where the site is not built.
REFERENCE = {
    "commands": "reference/commands",
    "file formats": "reference/formats",
    "effects": "reference/effects",
    "Python": "api/index",
}
NOT_BUILT = "commands, file formats, effects, Python: in the site that `python docs/build.py` makes"
PARTS = {
    "Start": ("Install and run <readme>", "gallery"),
    "Tutorials": ("tutorial/assess", "tutorial/own_robot", "tutorial/diagnose"),
    "How to": tuple(
        f"how_to/{name}"
        for name in (
            "import_logs",
            "plan_tests",
            "identify",
            "diagnose",
            "count",
            "place",
            "report",
            "explore",
            "python",
            "planner_cost",
        )
    ),
    "Reference": tuple(REFERENCE.values()),
    "Explanation": tuple(
        f"explanation/{name}"
        for name in (
            "theory",
            "priors",
            "stiffness",
            "diagnosis",
            "motion_records",
            "counting",
            "paper",
            "limits",
        )
    ),
    "Validation": tuple(
        f"validation/{name}"
        for name in (
            "index",
            "vibration",
            "blind_trial",
            "priors",
            "stiffness",
            "test_plans",
            "motion_records",
            "counting",
            "placement",
            "performance",
            "first_minutes",
        )
    ),
    "Notebooks": ("notebooks/index",),
    "Project": ("contributing", "changelog"),
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
    for folder in ("notebooks", "api", "reference"):
        (SOURCE / folder).mkdir(parents=True)
    shutil.copytree(HERE / "images", SOURCE / "images")
    pages = {path: path.relative_to(HERE) for path in HERE.rglob("*.md")}
    pages = {path: SOURCE / page for path, page in pages.items() if "_build" not in page.parts}
    pages |= {path: SOURCE / name for path, name in ELSEWHERE.items()}
    for path, page in pages.items():
        if path.is_file():
            page.parent.mkdir(parents=True, exist_ok=True)
            page.write_text(relink(path, pages), encoding="utf-8")
    first = SOURCE / "index.md"
    before, mark, rest = first.read_text(encoding="utf-8").partition(NOT_BUILT)
    if not mark:
        raise SystemExit(f"docs: index.md does not say: {NOT_BUILT}")
    made = ", ".join(f"[{name}]({page}.md)" for name, page in REFERENCE.items())
    trees = "".join(toctree(caption, entries) for caption, entries in PARTS.items())
    first.write_text(before + made + rest + trees, encoding="utf-8")
    notebooks = sorted((ROOT / "notebooks").glob("*.ipynb"))
    for path in notebooks:
        shutil.copy(path, SOURCE / "notebooks")
    write("notebooks/index.md", notebook_page(notebooks))
    write("gallery.md", gallery_page())
    write("reference/commands.md", commands_page())
    write("reference/effects.md", effects_page())
    write("reference/formats.md", formats_page())
    api_pages()
    # Compiled functions are documented as the functions they are.
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    options = ("-W", "--keep-going", "-q", "-j", "auto", "-c", HERE, SOURCE, HTML)
    done = subprocess.run([sys.executable, "-m", "sphinx", *map(str, options)], env=environment)
    if done.returncode == 0:
        offline(HTML)
        print(f"built {HTML.relative_to(ROOT)}")
    return done.returncode


def write(name: str, text: str) -> None:
    """Write a page."""
    (SOURCE / name).write_text(text, encoding="utf-8")


def relink(path: Path, pages: dict[Path, Path]) -> str:
    """A page with its links between files of the repository as links in the site, or downloads."""

    def change(match: re.Match[str]) -> str:
        label, target = match[1], (path.parent / match[2]).resolve()
        if not target.exists():
            raise SystemExit(f"docs: {path}: a link to {match[2]}, which is not there")
        if target.is_relative_to(HERE / "images"):
            to = SOURCE / "images" / target.name
        elif target in pages:
            to = pages[target]
        elif target.suffix == ".md":
            return label  # a page of the repository alone
        else:
            to = target
        return f"[{label}]({os.path.relpath(to, pages[path].parent)}{match[3] or ''})"

    return _LINK.sub(change, path.read_text(encoding="utf-8"))


def toctree(caption: str, entries: tuple[str, ...]) -> str:
    """A table of contents that only the sidebar shows."""
    head = "\n```{toctree}\n:hidden:\n:maxdepth: 1\n"
    return head + (f":caption: {caption}\n" if caption else "") + "\n".join(entries) + "\n```\n"


def gallery_page() -> str:
    """Every example with its picture, which is made by running it."""
    (SOURCE / "images" / "gallery").mkdir()
    cells, sections = [], []
    for path in sorted(EXAMPLES.glob("*.py")):
        code = path.read_text(encoding="utf-8")
        title, _, detail = ast.get_docstring(ast.parse(code)).partition("\n")
        title = title.removesuffix(".")
        picture = f"images/gallery/{path.stem}.png"
        draw(path, SOURCE / picture)
        cells.append(f'[![{title}]({picture}){{width="32%"}}](#{path.stem})')
        code = code.partition('"""\n')[2].strip()
        sections += [f"({path.stem})=", f"## {title}\n", f"{detail.strip()}\n"]
        sections += [f"![{title}]({picture})\n", f"```python\n{code}\n```\n"]
    lines = ["# Gallery\n", "Each example is complete: copy it and run it.\n"]
    return "\n".join([*lines, *cells, "", *sections])


def commands_page() -> str:
    """Every command with its options, as `picchio COMMAND --help` has them."""
    import click
    from typer.main import get_command

    from picchio.cli.main import app

    root = get_command(app)
    lines = ["# Commands\n", "`picchio COMMAND --help` prints the same.\n"]
    for name, command in root.commands.items():
        context = click.Context(command, info_name=f"picchio {name}")
        lines += [f"## picchio {name}\n", f"{_plain(command.help or '')}\n"]
        lines += [
            "```sh",
            context.command_path + " " + " ".join(command.collect_usage_pieces(context)),
        ]
        lines += [f"picchio {line}" for line in command.examples]
        lines += ["```", ""]
        rows = []
        for option in command.params:
            if isinstance(option, click.Argument):
                rows.append((f"`{option.make_metavar(context)}`", option.help or ""))
            elif record := option.get_help_record(context):
                rows.append((f"`{record[0]}`", record[1]))
        lines += table(("option", "meaning"), rows)
    return "\n".join(lines)


def notebook_page(notebooks: list[Path]) -> str:
    """The list of the notebooks."""
    import json

    lines = ["# Notebooks\n", "As they stand in `notebooks/`; run them to see their output.\n"]
    for path in notebooks:
        first = json.loads(path.read_text(encoding="utf-8"))["cells"][0]["source"]
        title = "".join(first).splitlines()[0].lstrip("# ")
        lines.append(f"- [{title}]({path.name})")
    return "\n".join(lines) + "\n" + toctree("", tuple(path.stem for path in notebooks))


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
    write("api/index.md", "\n".join(lines) + "\n" + toctree("", STAGES))
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
