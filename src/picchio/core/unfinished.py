"""Files and folders that are not whole yet: they go, however the work or the process ends."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

_unfinished: dict[Path, Callable[[Path], None]] = {}
_making = threading.RLock()  # one may be made while another is


def remove(path: Path) -> None:
    """Delete a file or a folder with all that is in it, if it is there.

    Args:
        path: of either.
    """
    if path.is_dir() and not path.is_symlink():
        import shutil

        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


@contextmanager
def unfinished(make: Callable[[], Path], clean: Callable[[Path], None] = remove) -> Iterator[Path]:
    """Within the block a file or folder is not whole; what is still there at its end is deleted.

    So it is where the process is ended from outside, by `clear`.

    Args:
        make: creates it, under a name of its own.
        clean: deletes what is of no use of it; all of it if not given.

    Returns:
        a context manager whose value is its path.
    """
    with _making:
        path = make().absolute()
        _unfinished[path] = clean
    try:
        yield path
    finally:
        clean(path)
        _unfinished.pop(path, None)


def clear() -> None:
    """Delete whatever is unfinished; the process ends, and its other threads begin nothing new."""
    _making.acquire(timeout=0.1)  # never released
    for path, clean in list(_unfinished.items()):
        try:
            clean(path)
        except OSError:
            continue
