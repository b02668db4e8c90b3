"""A campaign diagnosed by another checkout of the project, in its own process."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

_SCRIPT = """
import json, sys
import picchio
from picchio.campaign.campaign import load_campaign
from picchio.campaign.tables import Tolerance
from picchio.diagnosis.percussion.diagnosis import diagnose_percussion

robot, path, without = sys.argv[1], sys.argv[2], json.loads(sys.argv[3])
if not picchio.__file__.startswith(sys.argv[4]):
    raise SystemExit(f"the code that runs is {picchio.__file__}, not of {sys.argv[4]}")
# A tolerance that the other code does not know of is none to it.
kept, table = [], ""
for line in open(path, encoding="utf-8"):
    table = line.strip() if line.startswith("[") else table
    key = line.split("=")[0].strip()
    if table != "[tolerance]" or "=" not in line or key in Tolerance.model_fields:
        kept.append(line)
open(path, "w", encoding="utf-8").writelines(kept)
said = diagnose_percussion(
    picchio.load_robot(robot), load_campaign(path), without=without, workers=1
).diagnosis
print(json.dumps({
    "verdict": said.verdict,
    "claimed": sorted([c.effect, c.target] for c in said.causes),
    "alternatives": [sorted(map(list, each)) for each in said.alternatives],
}))
"""


def diagnose(checkout: Path, robot: str, campaign, without=()) -> dict:
    """Verdict, claimed and alternatives of the code of a checkout.

    Args:
        checkout: its root, which holds src/picchio.
        robot: a shipped robot's name.
        campaign: handed over as files.
        without: effects that its catalogue lacks.
    """
    source = Path(checkout).resolve() / "src"
    with tempfile.TemporaryDirectory() as folder:
        campaign.save(Path(folder) / "campaign")
        path = str(Path(folder) / "campaign" / "campaign.toml")
        done = subprocess.run(
            [sys.executable, "-c", _SCRIPT, robot, path, json.dumps(sorted(without)), str(source)],
            env={**os.environ, "PYTHONPATH": str(source)},
            capture_output=True,
            text=True,
        )
    if done.returncode:
        raise RuntimeError(done.stderr.strip().splitlines()[-1])
    return json.loads(done.stdout.splitlines()[-1])
