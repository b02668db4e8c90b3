"""A campaign larger than memory: what a check takes does not grow with the file."""

import subprocess
import sys

import numpy as np
import pytest

from picchio.campaign.campaign import Campaign
from picchio.campaign.record import Record

CHECK = r"""
import re, resource, sys
from pathlib import Path
from picchio.campaign.campaign import load_campaign
campaign = load_campaign(sys.argv[1])
campaign.check_samples()
total = 0.0
for chunk in campaign.records[0].chunks(["force"], 20000):
    total += chunk["force"].sum()
status = Path("/proc/self/status")
# ru_maxrss survives exec on Linux: it would tell of the parent.
peak = (int(re.search(r"VmHWM:\s*(\d+)", status.read_text())[1]) if status.exists()
        else resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024)
print(campaign.records[0].clock.samples, total, peak)
"""


def footprint(folder):
    done = subprocess.run(
        [sys.executable, "-c", CHECK, str(folder)], capture_output=True, text=True, check=True
    )
    samples, total, memory = done.stdout.split()
    return int(samples), float(total), int(memory) / 1024


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_memory_does_not_grow_with_the_record(tmp_path, suffix):
    rng = np.random.default_rng(0)
    memory = {}
    for samples in (100_000, 1_000_000):
        channels = {
            name: rng.normal(size=samples) for name in ("force", "deflection.a", "deflection.b")
        }
        record = Record.from_arrays("r.csv", np.arange(samples) / 8192.0, channels, kind="motion")
        saved = Campaign.from_records([record]).save(tmp_path / str(samples), suffix=suffix)
        found, total, memory[samples] = footprint(saved.folder)
        assert found == samples
        assert total == pytest.approx(channels["force"].sum(), rel=1e-9)
    # The larger one holds 27 MiB more of numbers, and 65 MiB more of CSV.
    assert memory[1_000_000] - memory[100_000] < 15.0
