"""The Typer application, which every file of a command adds itself to."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from picchio.core.guard import guard


class _Command(TyperCommand):
    """A subcommand: its outputs are compared with what it is told to read, before any work."""

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


class _App(typer.Typer):
    def command(self, name: str | None = None, **options: Any) -> Any:
        return super().command(name, **{"cls": _Command} | options)


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
