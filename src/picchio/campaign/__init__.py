"""Measured records in and out: campaigns, their channels and units, imports."""

from __future__ import annotations

from picchio.campaign.campaign import Campaign, load_campaign
from picchio.campaign.channels import (
    Channel,
    ChannelKind,
    parse_channel,
    parse_header,
    register_channel_kind,
)
from picchio.campaign.clock import Clock
from picchio.campaign.record import Record
from picchio.campaign.tables import CampaignExcitation, Tolerance
from picchio.campaign.write import write_campaign

__all__ = [
    "Campaign",
    "CampaignExcitation",
    "Channel",
    "ChannelKind",
    "Clock",
    "Record",
    "Tolerance",
    "load_campaign",
    "parse_channel",
    "parse_header",
    "register_channel_kind",
    "write_campaign",
]
