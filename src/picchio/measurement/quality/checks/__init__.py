"""The checks, in the order in which they report. To add one, add it here."""

from __future__ import annotations

from picchio.measurement.quality.check import Check
from picchio.measurement.quality.checks.axes_motion import MotionAxesCheck
from picchio.measurement.quality.checks.axes_percussion import PercussionAxesCheck
from picchio.measurement.quality.checks.blows import BlowsCheck, LengthCheck
from picchio.measurement.quality.checks.channels import ChannelsCheck, PosesCheck, UnitsCheck
from picchio.measurement.quality.checks.drift import DriftCheck
from picchio.measurement.quality.checks.noise import HumCheck, NoiseLevelCheck
from picchio.measurement.quality.checks.phase import PhaseCheck
from picchio.measurement.quality.checks.repeats import CopiesCheck, RepeatsCheck
from picchio.measurement.quality.checks.samples import ClippingCheck, DropoutsCheck, SpikesCheck
from picchio.measurement.quality.checks.sampling import AliasingCheck, ClockCheck

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
