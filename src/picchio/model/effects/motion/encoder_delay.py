"""Encoders, or the drives' torques, that answer late."""

from __future__ import annotations

from picchio.model.effects.effect import Effect, Parameter
from picchio.model.motion import Motion


class EncoderDelay(Effect):
    """The readings of a channel group are stamped later than they were measured.

    "position" (link side), "motor_position", or "torque". Angles are late against the other
    encoder, or, where a joint has one encoder only, against the torque: a drive that turns its
    command into torque late looks the same.
    """

    name = "encoder_delay"
    where = "motion"
    target_kind = "channel group"
    parameters = (Parameter("delay", "s", lower=0.0, upper=0.2, meaning="late by this"),)
    meaning = "readings arrive late: sampling, filtering or the bus takes its time"
    told_by = "slowly under load, then fast: a delay grows with speed, a spring does not"
    late = True
    usual = 0

    def motion(self, motion: Motion) -> None:
        """Delay the group."""
        motion.delay(self.target, self.values["delay"])
