"""`picchio identify`: the joints' numbers from measured records, written as a sidecar."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from picchio.cli import options as typed
from picchio.cli import output
from picchio.cli.app import app
from picchio.core.files import write_text

if TYPE_CHECKING:
    from picchio.diagnosis.identified import Identification


@app.command()
def identify(
    given: typed.RobotGiven,
    *,
    data: typed.DataOption,
    out: Annotated[Path, typed.output("--out")],
    report: typed.ReportOption = None,
    json: typed.JsonOption = None,
) -> None:
    """Stiffness and damping from measured data, as a sidecar.

    Static loadings (a weight or a pull, and what moved) tell the stiffness from nothing, with its
    spread and why it is no better known. Of percussion and motion records the values are those of
    the extended model that `picchio diagnose` finds.

    Options:
        out (SIDECAR.toml): Where the sidecar goes.
    """
    import picchio
    from picchio.diagnosis.identify import needs_springs

    campaign = picchio.load_campaign(data)
    loaded = given.load(allow_rigid=not needs_springs(campaign))
    with output.telling("reading the data") as say:
        found = picchio.identify(loaded, campaign, progress=say)
    write_text(out, found.sidecar_text())
    if found.doubt:
        output.say_warning(found.doubt)
    output.write_report(found, report)
    output.deliver(found.to_dict(), json, lambda: show_identified(found))


def show_identified(found: Identification) -> None:
    """Print every joint's stiffness with its interval, why, and what else the answer says."""
    out = output.console()
    shown = found._listing().only("joint", "stiffness", "90 % interval", "determined by the data")
    out.print(output.listed(shown, ""))
    for joint in found.joints:
        out.print(f"  {joint.name}: {joint.stiffness.why}")
    for line in found.remarks:
        out.print(line)
