"""The checks, in the order in which they report. To add one, add it here."""

from __future__ import annotations

from picchio.prediction.quality.aliasing import AliasingCheck
from picchio.prediction.quality.axes_motion import MotionAxesCheck
from picchio.prediction.quality.axes_percussion import PercussionAxesCheck
from picchio.prediction.quality.blows import BlowsCheck
from picchio.prediction.quality.channels import ChannelsCheck
from picchio.prediction.quality.check import Check
from picchio.prediction.quality.clipping import ClippingCheck
from picchio.prediction.quality.clock import ClockCheck
from picchio.prediction.quality.copies import CopiesCheck
from picchio.prediction.quality.drift import DriftCheck
from picchio.prediction.quality.dropouts import DropoutsCheck
from picchio.prediction.quality.hum import HumCheck
from picchio.prediction.quality.length import LengthCheck
from picchio.prediction.quality.noise_level import NoiseLevelCheck
from picchio.prediction.quality.phase import PhaseCheck
from picchio.prediction.quality.poses import PosesCheck
from picchio.prediction.quality.repeats import RepeatsCheck
from picchio.prediction.quality.spikes import SpikesCheck
from picchio.prediction.quality.units import UnitsCheck

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
