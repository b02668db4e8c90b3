"""The blind trial, the makers of records and the worlds stand beside the tests."""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
for folder in (HERE / "blind", HERE / "motion", HERE / "stiffness", HERE.parent):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))
