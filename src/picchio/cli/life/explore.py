"""`picchio explore`: drag the tool in the browser, see envelopes and life change."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from picchio.cli import options as typed
from picchio.cli.app import app
from picchio.cli.ending import ending
from picchio.cli.output import deliver, telling


@app.command()
def explore(
    given: typed.RobotGiven,
    *,
    task: typed.TaskOption = None,
    model: Path | None = None,
    save: Annotated[Path | None, typed.output("--save", added_to=True)] = None,
    browser: Annotated[bool, typer.Option("--open")] = False,
    json: typed.JsonOption = None,
) -> None:
    """Live: drag the tool and see envelopes and life change.

    A page on this machine alone; its address is printed. Ctrl-C ends it. With --json what was on
    the screen last is written then.

    Options:
        model (FILE): An extended model, of `picchio diagnose --model`, to stand beside the nominal.
        save (FILE): The task that a click puts the pose into; ROBOT-explored.toml if not given.
        browser: Open the page in the browser.
    """
    import picchio

    loaded = given.load()
    with telling("loading the robot"):
        live = picchio.explore(loaded, task=task, model=model, save=save)
    try:
        typer.echo(f"{live.url}\nCtrl-C ends it", err=True)
        if browser:
            import webbrowser

            webbrowser.open(live.url)
        while live.alive:
            time.sleep(0.2)
    except KeyboardInterrupt:
        ending.heard()
    finally:
        live.close()
    deliver(live.to_dict(), json)
