"""The blows of the tool: F(t), in pieces that have a closed form."""

from __future__ import annotations

from picchio.excitation.piecewise import PiecewiseForce
from picchio.excitation.table import ExcitationTable
from picchio.excitation.trains import Excitation, HalfSineTrain, MeasuredForce, PulseTrain

__all__ = [
    "Excitation",
    "ExcitationTable",
    "HalfSineTrain",
    "MeasuredForce",
    "PiecewiseForce",
    "PulseTrain",
]
