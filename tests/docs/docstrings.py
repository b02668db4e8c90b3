"""Which public functions lack part of their docstring: Args, Returns or Raises.

A function is public if neither its name nor that of its class or module begins with "_". Then
- every parameter (but self, cls and those that begin with "_") is named under "Args:";
- there is a "Returns:" (or "Yields:"), unless nothing is returned or the summary line says what is:
  it begins with a word that introduces a thing ("The", "A", "Whether", ...), not with a verb, or
  it gives the thing's shape: "Torque (nv,) that ...";
- there is a "Raises:" where the function itself raises an error that it makes.
Of a class, "Args:" or "Attributes:" may name the parameters of `__init__`. Methods that implement
one of a base class in this package need not repeat what is said there, and properties return what
their summary names.

    python tests/docs/docstrings.py            # print what is missing
    python tests/docs/docstrings.py --write    # bring the list of modules still to do up to date
"""

from __future__ import annotations

import ast
import json
import re
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SOURCE = ROOT / "src" / "picchio"
TO_DO = Path(__file__).with_name("to_do.json")

# Words with which a summary names a thing, rather than telling to do something.
THINGS = set(
    """
    a all an and any as at both by each every everything for from half how if in its largest least
    most no none nothing number numbers of on one only other others same several so some such that
    the these this those two three what when where whether which who whose why with
    """.split()  # noqa: SIM905
)
_ENTRY = re.compile(r"^ {4}((?:\*{0,2}\w+(?:, )?)+)(?: \([^)]*\))?:", re.MULTILINE)
_SHAPE = re.compile(r"^(\w+(, \w+)*,? )?\(\w+( \+ 1)?(,|(, \w+)+)\)")
_SECTION = re.compile(r"^(Args|Attributes|Returns|Yields|Raises):\s*$", re.MULTILINE)


def _modules(source: Path) -> dict[str, ast.Module]:
    return {
        ".".join(("picchio", *path.relative_to(source).with_suffix("").parts)): ast.parse(
            path.read_text(encoding="utf-8")
        )
        for path in sorted(source.rglob("*.py"))
    }


def reached(start: Iterable[tuple[str, str]], source: Path = SOURCE) -> set[tuple[str, str]]:
    """(module, name) of all functions and classes that somebody meets who calls these.

    That is what they return, and what the attributes and methods of those classes return in turn.
    """
    every = {
        (module, node.name): node
        for module, tree in _modules(source).items()
        for node in tree.body
        if isinstance(node, ast.FunctionDef | ast.ClassDef)
    }
    classes: dict[str, list[tuple[str, str]]] = {}
    for key, node in every.items():
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            classes.setdefault(node.name, []).append(key)
    found: set[tuple[str, str]] = set()
    waiting = [key for key in start if key in every]
    while waiting:
        key = waiting.pop()
        if key in found:
            continue
        found.add(key)
        node = every[key]
        inner = [node] if isinstance(node, ast.FunctionDef) else node.body
        types = [n.annotation for n in inner if isinstance(n, ast.AnnAssign)]
        types += [n.returns for n in inner
                  if isinstance(n, ast.FunctionDef) and n.returns
                  and (n is node or not n.name.startswith("_"))]  # fmt: skip
        for name in {word for t in types for word in re.findall(r"\w+", ast.unparse(t))}:
            waiting += classes.get(name, [])
    return found


def missing(source: Path = SOURCE) -> dict[str, list[str]]:
    """What is missing, by module: lines such as "load_task: Args task, Returns"."""
    modules = _modules(source)
    bases = _bases(modules.values())
    found = {}
    for name, tree in modules.items():
        lines = [line for line in _module(tree, bases) if line]
        if lines and not any(part.startswith("_") for part in name.split(".")):
            found[name] = lines
    # A command's options carry their help; nobody calls it from Python.
    return {name: lines for name, lines in found.items() if not name.startswith("picchio.cli.")}


def _bases(trees) -> dict[str, tuple[set[str], set[str]]]:
    """Class name -> (names of its bases, names of its methods)."""
    found: dict[str, tuple[set[str], set[str]]] = {}
    for tree in trees:
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                names = {ast.unparse(base).split("[")[0].split(".")[-1] for base in node.bases}
                methods = {n.name for n in node.body if isinstance(n, ast.FunctionDef)}
                known = found.setdefault(node.name, (set(), set()))
                known[0].update(names)
                known[1].update(methods)
    return found


def _inherited(name: str, bases: dict[str, tuple[set[str], set[str]]]) -> set[str]:
    found: set[str] = set()
    waiting, seen = list(bases.get(name, (set(),))[0]), {name}
    while waiting:
        base = waiting.pop()
        if base not in seen and base in bases:
            seen.add(base)
            found |= bases[base][1]
            waiting += bases[base][0]
    return found


def _module(tree: ast.Module, bases) -> Iterator[str]:
    for node in tree.body:
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
            yield _function(node, node.name)
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            known = _inherited(node.name, bases)
            for inner in node.body:
                if not isinstance(inner, ast.FunctionDef) or inner.name in known:
                    continue
                if inner.name == "__init__":
                    yield _function(inner, node.name, ast.get_docstring(node) or "")
                elif not inner.name.startswith("_"):
                    yield _function(inner, f"{node.name}.{inner.name}")


def _function(node: ast.FunctionDef, label: str, of_class: str = "") -> str:
    """A line that says what is missing; empty where nothing is."""
    decorators = {ast.unparse(d).split(".")[-1] for d in node.decorator_list}
    if "overload" in decorators or "setter" in decorators:
        return ""
    text = ast.get_docstring(node) or ""
    sections = _sections(f"{of_class}\n\n{text}")
    lacking = []
    named = _names(sections.get("Args", "")) | _names(sections.get("Attributes", ""))
    arguments = node.args
    parameters = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]
    parameters += [a for a in (arguments.vararg, arguments.kwarg) if a]
    absent = [p.arg for p in parameters
              if p.arg not in ("self", "cls") and not p.arg.startswith("_")
              and p.arg not in named]  # fmt: skip
    if absent:
        lacking.append(f"Args {', '.join(absent)}")
    properties = {"property", "cached_property", "validator", "field_validator", "model_validator"}
    returned = ast.unparse(node.returns) if node.returns else "None"
    if (
        returned not in ("None", "NoReturn", "Never")
        and not decorators & properties
        and not sections.keys() & {"Returns", "Yields"}
        and re.split(r"\W", text.lower(), maxsplit=1)[0] not in THINGS
        and not _SHAPE.match(text)
    ):
        lacking.append("Returns")
    if "Raises" not in sections and any(_raises(node)):
        lacking.append("Raises")
    return f"{label}: {', '.join(lacking)}" if lacking else ""


def _sections(text: str) -> dict[str, str]:
    parts = _SECTION.split(text)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def _names(section: str) -> set[str]:
    return {name.strip().lstrip("*") for entry in _ENTRY.findall(section)
            for name in entry.split(",")}  # fmt: skip


def _raises(node: ast.AST) -> Iterator[bool]:
    """Errors that the function makes and raises, those of functions within it left out."""
    for inner in ast.iter_child_nodes(node):
        if isinstance(inner, ast.FunctionDef | ast.Lambda | ast.ClassDef):
            continue
        if isinstance(inner, ast.Raise) and isinstance(inner.exc, ast.Call):
            yield ast.unparse(inner.exc.func) != "NotImplementedError"
        yield from _raises(inner)


def main() -> None:
    """Print what is missing, or bring the list up to date."""
    found = missing()
    if "--write" in sys.argv:
        counts = {name: len(lines) for name, lines in found.items()}
        TO_DO.write_text(json.dumps(counts, indent=2) + "\n", encoding="utf-8")
    for name, lines in found.items():
        print(name, *lines, sep="\n  ")
    print(f"{sum(map(len, found.values()))} functions in {len(found)} modules", file=sys.stderr)


if __name__ == "__main__":
    main()
