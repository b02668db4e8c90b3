"""The paper's claims, by subject. To add one: its sentence in `data/paper.toml`, its test here."""

from __future__ import annotations

from picchio.paper.claims import envelope, life, model, reach, robot, stress
from picchio.paper.claims.registry import CLAIMS, Claim, Tried, claim, try_claims

__all__ = [
    "CLAIMS", "Claim", "Tried", "claim", "envelope", "life", "model", "reach", "robot", "stress",
    "try_claims",
]  # fmt: skip
