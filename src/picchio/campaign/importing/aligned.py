"""Blocks of series with clocks of their own, of one file or several, in the order of time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from picchio.campaign.importing.raw import RawChannel, RawFile
from picchio.core.arrays import FloatArray, IndexArray

_MOST = 8  # blocks that are held: what begins later is not waited for
_NEVER = 2**63 - 1  # ns
Held = dict[str, list[tuple[IndexArray, RawChannel]]]


class _Source:
    """A file's blocks; `until`, ns, is up to when all its samples have been taken."""

    def __init__(self, blocks: Iterator[RawFile]) -> None:
        self._blocks = blocks
        self.first = next(blocks, None)
        self._go_on(self.first)

    def take(self, held: Held) -> None:
        """Add the next block to what is held."""
        block = self._next
        assert block is not None
        assert block.epoch is not None
        stamps: dict[int, IndexArray] = {}  # a topic's series share their times
        for name, channel in block.channels.items():
            if channel.time is not None:
                if id(channel.time) not in stamps:
                    stamps[id(channel.time)] = block.epoch + _ns(channel.time)
                held.setdefault(name, []).append((stamps[id(channel.time)], channel))
        self._go_on(next(self._blocks, None))

    def _go_on(self, block: RawFile | None) -> None:
        self._next, self.until = block, _NEVER
        if block is not None and block.epoch is not None:
            times = [c.time for c in block.channels.values() if c.time is not None]
            begins = np.array([time.min() for time in times if time.size])
            self.until = block.epoch + int(_ns(begins).min(initial=_NEVER - block.epoch))


def _ns(time: FloatArray) -> IndexArray:
    return np.rint(time * 1e9).astype(np.int64)


def aligned(sources: Sequence[Iterator[RawFile]], needed: Mapping[str, int]) -> Iterator[RawFile]:
    """Blocks each of which has all samples of its time, so that it does not matter where they end.

    The messages of several topics, or of several files, do not stand in the order of their stamps.
    What a file holds is known up to where its next block begins.

    Args:
        sources: the blocks of each file; what matters has a time, and all blocks an epoch.
        needed: {series: samples that the first block is to have of it}, where they come soon.

    Returns:
        blocks by time, the first with the epoch of the first file; a series without a sample in a
        block is not in it.
    """
    files = [_Source(blocks) for blocks in sources]
    head = files[0].first
    if head is None:
        return
    lines = tuple(line for file in files if file.first for line in file.first.detected)
    head = replace(head, detected=lines, taken=None)
    held: Held = {}
    lacking, blocks, edge = dict(needed), 0, -_NEVER
    while edge < _NEVER:
        min(files, key=lambda file: file.until).take(held)
        blocks, edge = blocks + 1, min(file.until for file in files)
        few = any(
            sum(int((stamps < edge).sum()) for stamps, _ in held.get(name, ())) < least
            for name, least in lacking.items()
        )
        if few and blocks < _MOST and edge < _NEVER:
            continue
        made = _taken(head, held, edge)
        if not made.channels and blocks >= _MOST:  # stamps that no clock can have
            made = _taken(head, held, _NEVER)
        if made.channels:
            yield made
            head, lacking, blocks = replace(head, epoch=None), {}, 0


def _taken(head: RawFile, held: Held, edge: int) -> RawFile:
    """What is held from before an edge, ns; it is held no longer."""
    clocks: dict[tuple[int, ...], tuple[IndexArray, IndexArray, IndexArray]] = {}
    for parts in held.values():
        key = tuple(id(stamps) for stamps, _ in parts)
        if key not in clocks:
            stamps = np.concatenate([part[0] for part in parts])
            order = np.argsort(stamps, kind="stable")
            at = int(np.searchsorted(stamps[order], edge))
            clocks[key] = order, stamps[order][:at], stamps[order][at:]
    begin = min((int(own[0]) for _, own, _ in clocks.values() if own.size), default=0)
    epoch = begin if head.epoch is None else head.epoch
    times = {key: (own - epoch) * 1e-9 for key, (_, own, _) in clocks.items()}
    channels = {}
    for name, parts in held.items():
        key = tuple(id(stamps) for stamps, _ in parts)
        order, own, later = clocks[key]
        values = np.concatenate([channel.values for _, channel in parts])[order]
        if own.size:
            channels[name] = replace(parts[0][1], values=values[: own.size], time=times[key])
        rest = replace(parts[0][1], values=values[own.size :].copy(), time=None)
        held[name] = [(later, rest)]
    return replace(head, channels=channels, epoch=epoch)
