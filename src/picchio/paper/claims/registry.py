"""The list of claims: each a small function that anyone can add."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from picchio.paper.verdict import Finding

if TYPE_CHECKING:
    from picchio.paper.study import Study

Test = Callable[["Study"], Finding]


@dataclass(frozen=True)
class Claim:
    """A sentence of the paper and how it is tried.

    Attributes:
        name: its key in `data/paper.toml`, where the sentence and its page stand.
        figure: of the page that shows it, such as "fig-10"; empty for none.
        test: from a study to a finding.
    """

    name: str
    figure: str
    test: Test


CLAIMS: dict[str, Claim] = {}


def claim(name: str, figure: str = "") -> Callable[[Test], Test]:
    """Register a test under the key of its sentence in `data/paper.toml`."""

    def register(test: Test) -> Test:
        if name in CLAIMS:
            raise ValueError(f"the claim {name!r} is tried twice")
        CLAIMS[name] = Claim(name, figure, test)
        return test

    return register
