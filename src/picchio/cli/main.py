"""The `picchio` command: what holds before anything is imported that takes time."""

from __future__ import annotations

import sys
from typing import Any

from picchio.cli.ending import STATUSES, Terminated, drop, end_at_once, ending, shown


def main(arguments: list[str] | None = None) -> None:
    """Run the command line; exit 0 on success, else as `run` says, with one line on stderr.

    Args:
        arguments: as typed; those of the process, which is then ended, if None.
    """
    sys.unraisablehook, sys.excepthook = drop, shown
    try:
        with ending.obeyed(at_last=arguments is None):
            from picchio.cli.running import run, say_warnings

            say_warnings()
            code = run(arguments)
    except (KeyboardInterrupt, Terminated) as error:
        code = ending.told(error)
    if arguments is None and code in STATUSES:
        end_at_once(code)
    sys.exit(code)


def __getattr__(name: str) -> Any:
    """`app` and `run`, which are imported when they are asked for."""
    if name not in ("app", "run"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from picchio.cli import running

    return getattr(running, name)
