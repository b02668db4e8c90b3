"""Work that is spread over processes: our own, or those of somebody's dask scheduler."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from typing import Any, TypeVar

from picchio.core.errors import InputError
from picchio.core.extras import need
from picchio.core.workers import as_done

Part = TypeVar("Part")
Done = TypeVar("Done")
_PATIENCE = 5.0  # s that a scheduler has to answer
_RETRIES = 3  # of a part whose worker died


def spread(
    work: Callable[[Any, Part], Done],
    job: Any,
    parts: Sequence[Part],
    *,
    workers: int | None,
    scheduler: str | None,
) -> Iterator[Done]:
    """Do parts of a job in other processes.

    Args:
        work: of a module, called with the job and a part.
        job: what all parts share; it is sent once to each worker of a scheduler.
        parts: any number.
        workers: processes of our own; as many as cores where None, eight at most.
        scheduler: address of a dask scheduler to use instead, as of `require_scheduler`.

    Returns:
        what each part gave, in any order.
    """
    if scheduler is None:
        yield from as_done(partial(work, job), parts, workers)
        return
    from distributed import Client, as_completed

    try:
        with Client(scheduler) as client:
            shared = _sent(client, job)
            futures = client.map(
                work, [shared] * len(parts), list(parts), pure=False, retries=_RETRIES
            )  # fmt: skip
            try:
                for future in as_completed(futures):
                    yield future.result()
            finally:  # what its tasks say of being stopped is of no use to anybody
                logging.disable()
    finally:
        logging.disable(logging.NOTSET)


def _sent(client: Any, job: Any) -> Any:
    """The job on all workers; one may die just as it is sent there."""
    for _ in range(_RETRIES):
        with suppress(OSError):  # what dask says of a connection that breaks is one
            return client.scatter(job, broadcast=True)
        time.sleep(0.5)
    return client.scatter(job, broadcast=True)


def require_scheduler(address: str) -> None:
    """Raise where no dask scheduler answers, which a client would wait long for.

    Args:
        address: such as "tcp://host:8786".

    Raises:
        InputError: none does, or dask is not installed.
    """
    need("distributed", "dask schedulers", "cluster")
    from distributed.comm.core import connect
    from distributed.security import Security

    async def greet() -> None:
        arguments = Security().get_connection_args("client")
        comm = await asyncio.wait_for(connect(address, timeout=_PATIENCE, **arguments), _PATIENCE)
        comm.abort()

    try:
        asyncio.run(greet())
    except (OSError, ValueError, TypeError) as error:  # what dask makes of an address
        reason = "" if isinstance(error, OSError) else f": {error}"
        raise InputError(f"no dask scheduler answers there within {_PATIENCE:g} s{reason}",
                         key="scheduler", value=address) from None  # fmt: skip
