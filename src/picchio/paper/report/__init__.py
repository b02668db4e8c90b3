"""The page of a reproduction: one HTML file."""

from __future__ import annotations

from picchio.paper.report.page import reproduction_report

__all__ = ["reproduction_report"]
