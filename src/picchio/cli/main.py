"""The `picchio` command: its subcommands, and how errors and warnings reach the user."""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Sequence
from typing import Annotated, Any

import typer

import picchio.cli.annotate
import picchio.cli.assess
import picchio.cli.check
import picchio.cli.diagnose
import picchio.cli.effects
import picchio.cli.envelope
import picchio.cli.fit_sn
import picchio.cli.formats
import picchio.cli.identify
import picchio.cli.import_
import picchio.cli.map
import picchio.cli.place
import picchio.cli.reproduce
import picchio.cli.robots
import picchio.cli.simulate
import picchio.cli.view
from picchio.core.errors import InputError, PicchioError

app = typer.Typer(
    name="picchio",
    help="Fatigue life of flexible-joint robots under percussive tools.",
    add_completion=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for register in (
    picchio.cli.annotate.register,
    picchio.cli.assess.register,
    picchio.cli.check.register,
    picchio.cli.diagnose.register,
    picchio.cli.effects.register,
    picchio.cli.envelope.register,
    picchio.cli.fit_sn.register,
    picchio.cli.formats.register,
    picchio.cli.identify.register,
    picchio.cli.import_.register,
    picchio.cli.map.register,
    picchio.cli.place.register,
    picchio.cli.reproduce.register,
    picchio.cli.robots.register,
    picchio.cli.simulate.register,
    picchio.cli.view.register,
):
    register(app)

# Typer carries its own copy of click since 0.20: this is whichever it uses.
_UsageError: Any = typer.BadParameter.__mro__[1]


def _version(wanted: bool) -> None:
    if wanted:
        from picchio.core.provenance import package_version

        typer.echo(f"picchio {package_version()}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_version, is_eager=True, help="Print the version."),
    ] = False,
) -> None:
    """Fatigue life of flexible-joint robots under percussive tools.

    Example: picchio assess fanuc_like_3dof
    """


def main(arguments: list[str] | None = None) -> None:
    """Run the command line; exit 0 on success, 2 on bad input with one line on stderr."""
    warnings.showwarning = _show_warning
    warnings.simplefilter("default")
    sys.exit(run(arguments))


def run(arguments: list[str] | None = None) -> int:
    """Run the command line and return the exit code."""
    given = sys.argv[1:] if arguments is None else arguments
    if given and given[-1] == "--version":  # of every subcommand, too
        given = ["--version"]
    try:
        code = app(args=given or ["--help"], prog_name="picchio", standalone_mode=False)
        sys.stdout.flush()
    except PicchioError as error:
        return _fail(str(_as_typed(error, given)))
    except _UsageError as error:
        where = error.ctx.command_path if error.ctx else "picchio"
        return _fail(f"{error.format_message()} See {where} --help")
    except (typer.Abort, KeyboardInterrupt):
        _fail("interrupted")
        return 130
    except MemoryError:
        return _fail("there is not enough memory for this: ask for less at a time")
    except BrokenPipeError:
        # The reader has gone: keep Python from complaining at exit, too.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    return code if isinstance(code, int) else 0


def _as_typed(error: PicchioError, given: Sequence[str]) -> PicchioError:
    """The error of a function's argument, told of the option that set it."""
    if not isinstance(error, InputError) or error.file is not None or error.key is None:
        return error
    option = f"--{error.key.replace('_', '-')}"
    commands: Any = typer.main.get_command(app)
    options = {name for p in commands.commands[given[0]].params for name in p.opts}
    return error.placed(key=option) if option in options else error


def _fail(problem: str) -> int:
    print(f"picchio: error: {' '.join(problem.split())}", file=sys.stderr)
    return 2


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    from picchio.cli.output import say_warning

    say_warning(str(message))
