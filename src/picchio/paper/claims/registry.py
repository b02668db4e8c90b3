"""The list of claims: each a small function that anyone can add."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from picchio.paper.printed import Sentence
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


@dataclass(frozen=True)
class Tried:
    """A claim after it was tried."""

    claim: Claim
    sentence: Sentence
    finding: Finding

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "name": self.claim.name,
            "page": self.sentence.page,
            "quote": self.sentence.quote,
            "figure": self.claim.figure or None,
            **self.finding.to_dict(),
        }


CLAIMS: dict[str, Claim] = {}


def claim(name: str, figure: str = "") -> Callable[[Test], Test]:
    """Register a test under the key of its sentence in `data/paper.toml`."""

    def register(test: Test) -> Test:
        if name in CLAIMS:
            raise ValueError(f"the claim {name!r} is tried twice")
        CLAIMS[name] = Claim(name, figure, test)
        return test

    return register


def try_claims(study: Study) -> tuple[Tried, ...]:
    """Every claim, in the order in which the paper makes them."""
    import picchio.paper.claims  # noqa: F401 - registers them

    return tuple(
        Tried(CLAIMS[name], sentence, CLAIMS[name].test(study))
        for name, sentence in study.printed.claims.items()
        if name in CLAIMS
    )
