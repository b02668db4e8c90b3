"""Plots that zoom: they hold what was computed, and obey in a browser."""

from __future__ import annotations

import csv
import io
import json
import re
from html import unescape
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image
from scipy.integrate import solve_ivp

import picchio
from picchio.visuals.plots.diagnosis import AFTER, BEFORE
from picchio.visuals.report.assessment import assessment_report
from picchio.visuals.report.trace import Trace, traces_html

from .pages import photograph, traces_in, without_traces


def test_what_a_page_holds_is_what_was_given_and_what_did_not_fit_is_told() -> None:
    rng = np.random.default_rng(1)
    time = np.linspace(-0.1, 2.0, 3000)
    made = []
    for k in range(4):
        values = rng.standard_normal(time.size).cumsum() * 10.0 ** (k - 3)
        values[5:9] = np.nan
        made.append(Trace(f"r{k}.csv </script>", "force", "N", time, {"measured": values}))
    page = str(traces_html(made, "a <b>", most=9500))
    assert "a &lt;b&gt;" in page and "The last 1 of 4 channels" in page
    found = traces_in(page)
    assert [one["record"] for one in found] == [t.record for t in made[:3]]
    for one, trace in zip(found, made, strict=False):
        given = trace.lines["measured"]
        np.testing.assert_allclose(one["time"], time, atol=1e-6)
        reach = np.nanmax(given) - np.nanmin(given)
        np.testing.assert_allclose(one["lines"]["measured"], given, atol=reach / 65000)
    assert str(traces_html([], "nothing")) == ""


def test_before_and_after_have_the_colours_of_the_plots() -> None:
    values = {name: np.zeros(3) for name in ("measured", "before", "after")}
    page = str(traces_html([Trace("r", "force", "N", np.arange(3.0), values)], "title"))
    text = page.partition('<script type="application/json">')[2].partition("</script>")[0]
    ink, *rest = json.loads(text)["colours"]
    assert (ink, *rest[:2]) == ("currentColor", BEFORE["color"], AFTER["color"])


def test_the_reports_trace_is_the_motion_of_the_arm(arm: SimpleNamespace) -> None:
    """Against Runge-Kutta on the equations of motion."""
    page = assessment_report(arm.assessment, arm.robot, arm.task)
    assert "<script" not in without_traces(page)
    assert "script-src 'unsafe-inline'" in unescape(page[:1000])
    found = {one["channel"]: one for one in traces_in(page)}
    op, pose = arm.worst.operation, arm.worst.pose
    system = picchio.Model(arm.robot).linear_system(pose)
    inverse = np.linalg.inv(system.mass_matrix)
    push = system.input_matrix @ op.direction
    n, blows = len(push), op.excitation

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        hit = t % blows.period < blows.width and t < op.hits_per_rivet * blows.period
        load = push * (blows.force if hit else 0.0)
        moved = inverse @ (load - system.damping_matrix @ y[n:] - system.stiffness_matrix @ y[:n])
        return np.concatenate([y[n:], moved])

    for j, joint in enumerate(arm.robot.flexible_joints):
        one = found[f"deflection of {joint.name}"]
        time, values = one["time"], one["lines"]["from rest"]
        assert one["unit"] == "mrad" and "steady state" in one["lines"]
        if j == 0:
            early = time < 0.25
            solved = solve_ivp(rate, (0.0, 0.25), np.zeros(2 * n), t_eval=time[early],
                               max_step=2e-4, rtol=1e-7, atol=1e-12)  # fmt: skip
        exact = 1e3 * solved.y[j]
        assert np.abs(values[early] - exact).max() <= 2e-3 * np.ptp(values)
        assert f"stress in the shaft of {joint.name}" in found


@pytest.mark.slow
def test_zoom_hover_choice_and_download(open_page, arm, tmp_path: Path, pictures) -> None:
    path = tmp_path / "report.html"
    page_text = assessment_report(arm.assessment, arm.robot, arm.task)
    path.write_text(page_text)
    page = open_page(path, accept_downloads=True)
    page.wait_for_selector(".trace[data-ready]", timeout=60_000)
    plot = page.locator(".trace .drawn > svg")
    plot.scroll_into_view_if_needed()
    photograph(page, path=str(pictures / "trace.png"))
    label = plot.get_attribute("aria-label")
    box = plot.bounding_box()
    page.mouse.move(box["x"] + 0.3 * box["width"], box["y"] + 100)
    told = page.locator(".trace output").inner_text()
    assert re.match(r"0?\.?\d+.* s: from rest \S+, steady state \S+ mrad", told)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 110, steps=4)
    page.mouse.up()
    zoomed = plot.get_attribute("aria-label")
    assert zoomed != label
    start, end = map(float, re.search(r", (\S+) to (\S+) s", zoomed).groups())
    with page.expect_download() as download:
        page.get_by_role("button", name="CSV").click()
    rows = list(csv.DictReader(io.StringIO(Path(download.value.path()).read_text())))
    first = traces_in(page_text)[0]
    inside = (first["time"] >= start * (1 - 1e-3)) & (first["time"] <= end * (1 + 1e-3))
    assert abs(len(rows) - inside.sum()) <= 4 and len(rows) > 10
    at = np.array([float(row["time [s]"]) for row in rows])
    mine = np.array([float(row["from rest [mrad]"]) for row in rows])
    stated = np.interp(at, first["time"], first["lines"]["from rest"])
    np.testing.assert_allclose(mine, stated, atol=1e-3 * np.ptp(first["lines"]["from rest"]))
    page.locator(".trace .lines input").nth(1).uncheck()
    assert page.locator(".trace path.line").count() == 1
    page.locator(".trace select").nth(1).select_option("stress in the shaft of joint_1")
    assert "[MPa]" in plot.text_content()
    plot.dblclick()
    with page.expect_download() as download:
        page.get_by_role("button", name="PNG").click()
    image = np.asarray(Image.open(Path(download.value.path())).convert("L"))
    assert image.shape == (600, 1800) and (image < 128).sum() > 500
    with page.expect_download() as download:
        page.get_by_role("button", name="SVG").click()
    assert Path(download.value.path()).read_text().startswith("<svg")
