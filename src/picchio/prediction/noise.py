"""The noise of every channel of a campaign: level, spectrum, hum, and a filter that whitens it."""

from __future__ import annotations

from picchio.campaign import Campaign
from picchio.prediction.noise_collect import NoiseCollector
from picchio.prediction.noise_hum import Line
from picchio.prediction.noise_level import Noise, NoiseSource
from picchio.prediction.noise_window import read_window

__all__ = ["Line", "Noise", "NoiseSource", "noise_levels"]


def noise_levels(campaign: Campaign) -> dict[str, Noise]:
    """The noise of every channel, estimated from the records themselves.

    From the quiet time before the first blow and after the robot has rung down, from what is not
    periodic in steady records, from repeats, and, where these give too little, from what damped
    waves leave of the ring-down. Motion records have repeats at best, and else a rough floor.
    Only the leading part of a long record is read.

    Args:
        campaign: read record by record.

    Returns:
        {channel: noise}; a channel without any stretch to judge by is missing.

    Raises:
        InputError: a sample that cannot be read.
    """
    collector = NoiseCollector(campaign)
    for record in campaign:
        collector.add(read_window(record))
    return collector.finish()
