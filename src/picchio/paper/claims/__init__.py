"""The paper's claims, by subject. To add one: its sentence in `data/paper.toml`, its test here."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

# Importing the subjects registers their claims.
from picchio.paper.claims import envelope, life, model, reach, stress  # noqa: F401
from picchio.paper.printed import Sentence
from picchio.paper.study import Study
from picchio.paper.verdict import CLAIMS, Claim, Finding


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
            "verdict": str(self.finding.verdict),
            "condition": self.finding.condition or None,
            "test": self.finding.test,
            "decides": self.finding.decides,
            "number": self.finding.number,
        }


def try_claims(study: Study) -> tuple[Tried, ...]:
    """Every claim, in the order in which the paper makes them."""
    return tuple(
        Tried(CLAIMS[name], sentence, CLAIMS[name].test(study))
        for name, sentence in study.printed.claims.items()
        if name in CLAIMS
    )
