"""Plots of results. Each function takes a result and an optional Axes, and returns the Axes."""

from __future__ import annotations

from picchio.view.plots.force import plot_force_spectrum, plot_force_train
from picchio.view.plots.frequency_response import plot_frequency_response
from picchio.view.plots.life import plot_damage, plot_utilisation
from picchio.view.plots.life_spread import plot_life_spread
from picchio.view.plots.modes import plot_mode_shapes, plot_natural_frequencies
from picchio.view.plots.polar import plot_polar_envelope
from picchio.view.plots.response import plot_response
from picchio.view.plots.sn import plot_sn_curve, plot_sn_fit
from picchio.view.plots.stress import plot_counted_cycles, plot_stress_history
from picchio.view.plots.workspace import plot_workspace_map

__all__ = [
    "plot_counted_cycles",
    "plot_damage",
    "plot_force_spectrum",
    "plot_force_train",
    "plot_frequency_response",
    "plot_life_spread",
    "plot_mode_shapes",
    "plot_natural_frequencies",
    "plot_polar_envelope",
    "plot_response",
    "plot_sn_curve",
    "plot_sn_fit",
    "plot_stress_history",
    "plot_utilisation",
    "plot_workspace_map",
]
