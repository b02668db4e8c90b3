"""The report: one HTML file that can be read, printed and mailed."""

from __future__ import annotations

from picchio.view.report.assessment import assessment_report

__all__ = ["assessment_report"]
