"""The Typer application, which every file of a command adds itself to."""

from __future__ import annotations

import functools
import inspect
import re
import textwrap
import tomllib
from collections.abc import Callable
from copy import copy
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Annotated, Any, get_origin

import typer
from typer.core import TyperCommand

from picchio.cli.output import show_all
from picchio.core.guard import guard

# Groups of options in a command's help.
ROBOT, BLOWS, OUTPUT = "The robot", "The blows", "What is written and printed"


@functools.cache
def _examples() -> dict[str, list[str]]:
    """By command, what may be typed, without the program's name."""
    return tomllib.loads((Path(__file__).parent / "examples.toml").read_text())


class _Command(TyperCommand):
    """A subcommand: its outputs are compared with what it is told to read, before any work.

    Its help tells the options that the examples use first, the others by what they are about.
    """

    @property
    def examples(self) -> list[str]:
        """What may be typed, without the program's name."""
        return _examples()[self.name or ""]

    def format_options(self, context: Any, formatter: Any) -> None:
        """Arguments, the options of the examples, then the others in groups."""
        used = set(re.findall(r"(?<= )--?[a-z][a-z-]*", " ".join(self.examples)))
        titles = ("Arguments", "Options used most", BLOWS, ROBOT, OUTPUT, "More options")
        groups: dict[str, list[Any]] = {title: [] for title in titles}
        for param in self.get_params(context):
            record = param.get_help_record(context)
            if record is None:
                continue
            named = getattr(param, "rich_help_panel", None) or "More options"
            first = "Options used most" if used & {*param.opts} or param.required else named
            title = "Arguments" if param.param_type_name == "argument" else first
            groups.setdefault(title, []).append(record)
        for title, records in groups.items():
            if records:
                with formatter.section(title):
                    formatter.write_dl(records)

    def format_epilog(self, context: Any, formatter: Any) -> None:
        """The examples, a line each."""
        with formatter.section("Examples"):
            for line in self.examples:
                told = textwrap.wrap(f"picchio {line}", formatter.width - 6, break_on_hyphens=False)
                formatter.write("  " + "\n      ".join(told) + "\n")

    def make_context(self, *arguments: Any, **options: Any) -> Any:
        guard.begin()
        return super().make_context(*arguments, **options)

    def invoke(self, context: Any) -> Any:
        for param in self.params:
            given = context.params.get(param.name)
            if given and not guard.keys.intersection(param.opts):
                every = given if isinstance(given, (list, tuple)) else [given]
                named = str if param.param_type_name == "argument" else Path
                guard.reading(each for each in every if isinstance(each, (named, Path)))
        guard.check()
        return super().invoke(context)


_VERBOSE = Annotated[
    bool,
    typer.Option("-v", "--verbose", help="Print all there is to say, not what fits 25 lines.",
                 rich_help_panel=OUTPUT),
]  # fmt: skip


_ENTRY = re.compile(r"^    (\w+)(?: \(([^)]*)\))?: ", re.MULTILINE)


def _described(function: Callable[..., Any]) -> tuple[str, dict[str, tuple[str | None, str]]]:
    """What a command does; {parameter: (what stands for its value, help)}, from its docstring."""
    doc, _, listed = (inspect.getdoc(function) or "").partition("\n\nOptions:\n")
    _, *parts = _ENTRY.split(listed)
    entries = zip(parts[::3], parts[1::3], parts[2::3], strict=True)
    return doc, {name: (metavar, " ".join(text.split())) for name, metavar, text in entries}


def _declared(
    given: inspect.Parameter, metavar: str | None = None, text: str | None = None
) -> inspect.Parameter:
    """A parameter as Typer takes it: an argument, or, after the `*`, an option."""
    kind, flag = given.annotation, "--" + given.name.replace("_", "-")
    if get_origin(kind) is Annotated:
        kind, made = kind.__origin__, copy(kind.__metadata__[0])
    elif given.kind is not given.KEYWORD_ONLY:
        made = typer.Argument()
    else:  # a flag has no opposite unless it is set at first
        made = typer.Option(*[flag] * (kind is bool and not given.default))
    made.metavar, made.help = made.metavar or metavar, made.help or text
    return given.replace(annotation=Annotated[kind, made])


class _App(typer.Typer):
    def command(self, name: str | None = None, **options: Any) -> Any:
        """Every command takes `-v`; its docstring says what its other options are.

        A parameter that is a dataclass stands for its fields, options that go together.
        """
        register = super().command(name, **{"cls": _Command} | options)

        def added(function: Callable[..., Any]) -> Callable[..., Any]:
            @functools.wraps(function)
            def told(*, verbose: bool, **given: Any) -> Any:
                show_all(verbose)
                for name, kind in groups.items():
                    made = kind(**{each.name: given.pop(each.name) for each in fields(kind)})
                    given[name] = made
                return function(**given)

            own = inspect.signature(function, eval_str=True)
            groups: dict[str, Any] = {
                name: each.annotation
                for name, each in own.parameters.items()
                if is_dataclass(each.annotation)
            }
            told.__doc__, listed = _described(function)
            every = []
            for name, each in own.parameters.items():
                parts = [each]
                if name in groups:
                    parts = [*inspect.signature(groups[name], eval_str=True).parameters.values()]
                every += [_declared(part, *listed.get(part.name, ())) for part in parts]
            every.append(inspect.Parameter("verbose", inspect.Parameter.KEYWORD_ONLY, default=False,
                                           annotation=_VERBOSE))  # fmt: skip
            every.sort(key=lambda each: (each.kind, each.default is not each.empty))
            told.__annotations__ = {each.name: each.annotation for each in every}
            vars(told)["__signature__"] = own.replace(parameters=every)
            register(told)
            return function

        return added


app = _App(
    name="picchio",
    add_completion=True,
    rich_markup_mode=None,  # boxes leave no room for words in 80 columns
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        from picchio.core.provenance import package_version

        typer.echo(f"picchio {package_version()}")
        raise typer.Exit


@app.callback(epilog="Example: picchio assess fanuc_like_3dof")
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Fatigue life of flexible-joint robots under percussive tools."""
