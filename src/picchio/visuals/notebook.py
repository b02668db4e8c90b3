"""Progress in a notebook: a bar below the cell while a study runs, gone when it is done."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from html import escape
from typing import Any

_PATIENCE = 1.0
_EVERY = 0.2


@contextmanager
def progress(what: str = "") -> Iterator[Callable[[int, int], None]]:
    """A bar for the `progress` argument of `assess`, `workspace_map`, `uncertain_life`, ...

        with progress("poses") as report:
            assess(robot, task, progress=report)

    Shown once the work takes over a second; outside a notebook nothing is shown.

    Args:
        what: is counted.

    Yields:
        a function to call with (done, total).
    """
    handle: Any = None
    began = shown = time.monotonic()
    inside = in_notebook()

    def report(done: int, total: int) -> None:
        nonlocal handle, shown
        now = time.monotonic()
        if not inside or now - began < _PATIENCE or (now - shown < _EVERY and done < total):
            return
        from IPython.display import HTML, display

        shown = now
        page = HTML(bar(done, total, what, now - began))
        if handle is None:
            handle = display(page, display_id=True)
        else:
            handle.update(page)

    try:
        yield report
    finally:
        if handle is not None:
            from IPython.display import HTML

            handle.update(HTML(""))


def bar(done: int, total: int, what: str, elapsed: float) -> str:
    """The bar as HTML: how many of how many, and the seconds that are left (none known: a dash)."""
    left = f"{elapsed * (total - done) / done:.0f} s left" if done else "–"
    return (
        f'<label>{escape(what)} <progress value="{done}" max="{total}"></progress> '
        f"{done}/{total}, {left}</label>"
    )


def in_notebook() -> bool:
    """Whether a notebook's kernel runs this."""
    # IPython is asked only where it already runs: importing it takes half a second.
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    return getattr(shell, "kernel", None) is not None
