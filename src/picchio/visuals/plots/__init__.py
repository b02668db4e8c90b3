"""Plots of results. Each function takes a result and an optional Axes, and returns the Axes."""

from __future__ import annotations

from picchio.visuals.plots.force import plot_force_spectrum, plot_force_train
from picchio.visuals.plots.frequency import (
    plot_frequency_response,
    plot_mode_shapes,
)
from picchio.visuals.plots.life import plot_damage, plot_life_spread, plot_utilisation
from picchio.visuals.plots.polar import plot_polar_envelope
from picchio.visuals.plots.response import plot_response
from picchio.visuals.plots.sn import plot_sn_curve, plot_sn_fit
from picchio.visuals.plots.stress import plot_counted_cycles, plot_stress_history
from picchio.visuals.plots.workspace import plot_workspace_map

__all__ = [
    "plot_counted_cycles",
    "plot_damage",
    "plot_force_spectrum",
    "plot_force_train",
    "plot_frequency_response",
    "plot_life_spread",
    "plot_mode_shapes",
    "plot_polar_envelope",
    "plot_response",
    "plot_sn_curve",
    "plot_sn_fit",
    "plot_stress_history",
    "plot_utilisation",
    "plot_workspace_map",
]
