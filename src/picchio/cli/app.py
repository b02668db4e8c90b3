"""The Typer application, which every file of a command adds itself to."""

from __future__ import annotations

from typing import Annotated

import typer

app = typer.Typer(
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
