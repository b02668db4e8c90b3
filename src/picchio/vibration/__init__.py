"""From the equations of motion to x(t): modes, steady state, response from rest."""

from __future__ import annotations

from picchio.vibration.fourier import truncated_fourier_response
from picchio.vibration.modes import Modes, modal_analysis
from picchio.vibration.response import Peak, Response, WorstDirection
from picchio.vibration.solve import response_from_rest, steady_state

__all__ = [
    "Modes",
    "Peak",
    "Response",
    "WorstDirection",
    "modal_analysis",
    "response_from_rest",
    "steady_state",
    "truncated_fourier_response",
]
