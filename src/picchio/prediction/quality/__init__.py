"""How good measured data are: what is in a campaign, and what is wrong with it."""

from __future__ import annotations

from picchio.prediction.quality.check import Check, Context
from picchio.prediction.quality.finding import SEVERITIES, Finding
from picchio.prediction.quality.registry import CHECKS
from picchio.prediction.quality.report import FORMAT, QualityReport, check_campaign

__all__ = [
    "CHECKS",
    "FORMAT",
    "SEVERITIES",
    "Check",
    "Context",
    "Finding",
    "QualityReport",
    "check_campaign",
]
