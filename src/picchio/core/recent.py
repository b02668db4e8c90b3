"""A small cache of recent results, by key."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

T = TypeVar("T")


class Recent(Generic[T]):
    """The last few results of an expensive computation; what was not asked for longest goes first.

    Args:
        most: how many results are kept.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._made: dict[Hashable, T] = {}

    def get(self, key: Hashable, make: Callable[[], T]) -> T:
        """The result under a key, computed by `make` if it is not there.

        Args:
            key: what tells one result from another.
            make: computes it.
        """
        try:
            made = self._made.pop(key)
        except KeyError:
            made = make()
        while len(self._made) >= self._most:
            self._made.pop(next(iter(self._made)), None)
        self._made[key] = made
        return made
