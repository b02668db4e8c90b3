"""The checks, in the order in which they report. To add one, add it here."""

from __future__ import annotations

from picchio.measurement.quality.check import Check
from picchio.measurement.quality.checks.aliasing import AliasingCheck
from picchio.measurement.quality.checks.axes_motion import MotionAxesCheck
from picchio.measurement.quality.checks.axes_percussion import PercussionAxesCheck
from picchio.measurement.quality.checks.blows import BlowsCheck
from picchio.measurement.quality.checks.channels import ChannelsCheck
from picchio.measurement.quality.checks.clipping import ClippingCheck
from picchio.measurement.quality.checks.clock import ClockCheck
from picchio.measurement.quality.checks.copies import CopiesCheck
from picchio.measurement.quality.checks.drift import DriftCheck
from picchio.measurement.quality.checks.dropouts import DropoutsCheck
from picchio.measurement.quality.checks.hum import HumCheck
from picchio.measurement.quality.checks.length import LengthCheck
from picchio.measurement.quality.checks.noise_level import NoiseLevelCheck
from picchio.measurement.quality.checks.phase import PhaseCheck
from picchio.measurement.quality.checks.poses import PosesCheck
from picchio.measurement.quality.checks.repeats import RepeatsCheck
from picchio.measurement.quality.checks.spikes import SpikesCheck
from picchio.measurement.quality.checks.units import UnitsCheck

CHECKS: list[type[Check]] = [
    ChannelsCheck,
    PosesCheck,
    ClockCheck,
    LengthCheck,
    BlowsCheck,
    UnitsCheck,
    DropoutsCheck,
    ClippingCheck,
    SpikesCheck,
    DriftCheck,
    PercussionAxesCheck,
    MotionAxesCheck,
    PhaseCheck,
    HumCheck,
    AliasingCheck,
    NoiseLevelCheck,
    RepeatsCheck,
    CopiesCheck,
]
