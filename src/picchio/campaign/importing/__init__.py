"""Records from other formats: UFF 58, MCAP, MATLAB, CSV, each with a mapping."""

from __future__ import annotations

from picchio.campaign.importing.importer import import_record, read_raw
from picchio.campaign.importing.mapping import Mapping, read_mapping
from picchio.campaign.importing.template import mapping_template

__all__ = ["Mapping", "import_record", "mapping_template", "read_mapping", "read_raw"]
