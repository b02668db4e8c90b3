"""What an effect draws anew in every record, and how a fit finds it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Latent:
    """Numbers of an effect that are others in every record (`Effect.hidden`).

    A fit moves them together with what all records share, by differences; where the numbers
    have a structure that makes more possible, it is declared here.

    Attributes:
        what: the numbers, for people.
        spread: the effect's parameter that says how large they are; it follows from them.
        step: by which a number is moved to see what it changes.
        lower, upper: bounds of a number.
        count: how many a record has; None: one for each blow, that of the first being 0.
        whole: a number is 0 or 1.
        times: the numbers are by how many s blows come late, at most half an interval: blows are
            looked for one after the other.
        linear: readings change in proportion to the numbers: they are solved for in the
            residual (`Effect.take_out`), not fitted.
    """

    what: str
    spread: str
    step: float = 1e-3
    lower: float = -1e6
    upper: float = 1e6
    count: int | None = None
    whole: bool = False
    times: bool = False
    linear: bool = False

    @property
    def first(self) -> int:
        """The index of the first number that is free."""
        return 1 if self.count is None else 0

    def size(self, hits: int) -> int:
        """How many numbers a record of so many blows has.

        Args:
            hits: blows of the record.
        """
        return hits if self.count is None else self.count
