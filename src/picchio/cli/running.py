"""The subcommands, and how errors and warnings reach the user."""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import typer

from picchio.cli.app import app
from picchio.cli.ending import STATUSES, Terminated, ending

# Importing its file adds a command, in the order of `picchio --help`.
from picchio.cli.life import (  # noqa: F401
    assess,
    compare,
    envelope,
    explore,
    fit_sn,
    map,
    place,
    start,
    view,
)
from picchio.cli.measured import (  # noqa: F401
    check,
    count,
    diagnose,
    identify,
    import_,
    plan,
    simulate,
)
from picchio.cli.output import begin, printable, say_warning, say_written
from picchio.cli.reference import described, reproduce, robots  # noqa: F401
from picchio.cli.waiting import waiting
from picchio.core.errors import InputError, OutputError, PicchioError
from picchio.core.guard import guard

# Typer carries its own copy of click since 0.20: this is whichever it uses.
_UsageError: Any = typer.BadParameter.__mro__[1]


def say_warnings() -> None:
    """From now on a warning is one line on stderr."""
    warnings.showwarning = lambda message, *_, **__: say_warning(str(message))
    warnings.simplefilter("default")


def run(arguments: list[str] | None = None) -> int:
    """Run the command line.

    Args:
        arguments: as typed; those of the process if None.

    Returns:
        0, 3 by --strict, 2 on bad input, 1 where the machine failed, 130 interrupted, 143
        terminated.
    """
    given = sys.argv[1:] if arguments is None else arguments
    begin(given)
    for before, text in zip(["", *given], given, strict=False):
        if not text or (text.startswith("--") and text.endswith("=")):
            return _fail(f"{text.rstrip('=') or before or 'an argument'}: is empty")
    if given and given[-1] == "--version":  # of every subcommand, too
        given = ["--version"]
    try:
        code = _watched(given or ["--help"])
        sys.stdout.flush()
        if code in STATUSES:  # typer swallows it
            raise KeyboardInterrupt
    except OutputError as error:
        return _fail(str(error), 1)
    except PicchioError as error:
        return _fail(str(_as_typed(error, given)))
    except _UsageError as error:
        where = error.ctx.command_path if error.ctx else "picchio"
        return _fail(f"{error.format_message()} See {where} --help")
    except (typer.Abort, KeyboardInterrupt, Terminated) as error:
        return ending.told(error)
    except MemoryError:
        return _fail("there is not enough memory for this: ask for less at a time", 1)
    except BrokenPipeError:  # the reader has gone
        _drop_stdout()
        return 0
    except OSError as error:  # what is read or written knows its name; a full stdout has none
        _drop_stdout()
        return _fail(f"{error.filename or 'stdout'}: {error.strerror or error}", 1)
    return code if isinstance(code, int) else 0


def _watched(arguments: Sequence[str]) -> Any:
    """Run a command with a bar for long work; say what it wrote, even if it then failed."""
    try:
        with waiting.watched(), ending.meant():
            return app(args=arguments, prog_name="picchio", standalone_mode=False)
    finally:
        guard.begin(listen=False)  # what comes after the command is no matter of it
        say_written()


def _drop_stdout() -> None:
    """Keep Python from complaining, at exit, of what it could not write."""
    with suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _as_typed(error: PicchioError, given: Sequence[str]) -> PicchioError:
    """The error of a function's argument, told of the option that set it."""
    if not isinstance(error, InputError) or error.file is not None or error.key is None:
        return error
    commands: Any = typer.main.get_command(app)
    params = commands.commands[given[0]].params
    options = {p.name: p.opts[0] for p in params if p.opts[0].startswith("--")}
    options |= {name.lstrip("-").replace("-", "_"): name for p in params for name in p.opts}
    return error.placed(key=options.get(error.key, error.key))


def _fail(problem: str, code: int = 2) -> int:
    print(f"picchio: error: {printable(' '.join(problem.split()))}", file=sys.stderr)
    return code
