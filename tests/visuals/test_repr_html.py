"""What objects show in a notebook: the numbers they hold, and names that are only data."""

from __future__ import annotations

import warnings
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from lxml import html as lxml_html

import picchio
from picchio.core.html import MOST_ROWS, cell, sheet
from picchio.fatigue.sn.fit import fit_sn
from picchio.fatigue.sn.test_table import SNTests
from picchio.studies.envelopes import envelope as envelope_of
from picchio.studies.uncertainty.run import uncertain_life

BLOWS = picchio.PulseTrain(300.0, 0.040, 0.004)


def tables(shown: object) -> list[list[list[str]]]:
    """The text of every cell of every table."""
    page = lxml_html.fromstring(shown._repr_html_())
    return [
        [[c.text_content() for c in row.xpath("./th|./td")] for row in table.xpath(".//tr")]
        for table in page.xpath(".//table")
    ]


def seen(shown: object) -> str:
    """What stands there once all is folded."""
    page = lxml_html.fromstring(f"<div>{shown._repr_html_()}</div>")
    for details in page.iter("details"):
        assert "open" in details.attrib and details[0].tag == "summary"
        for folded in details[1:]:
            details.remove(folded)
    return page.text_content()


def column(table: list[list[str]], start: str) -> list[str]:
    at = next(k for k, name in enumerate(table[0]) if name.startswith(start))
    return [row[at] for row in table[1:]]


def test_a_robot_shows_its_joints(arm: SimpleNamespace) -> None:
    *_, joints = tables(arm.robot)
    assert column(joints, "joint") == list(arm.robot.flexible_names)
    np.testing.assert_allclose([float(c) for c in column(joints, "stiffness")], [2.4e5, 1e5, 1e5])


def test_an_assessment_shows_verdict_and_lives(arm: SimpleNamespace) -> None:
    *_, joints = tables(arm.assessment)
    assert column(joints, "rivets") == ["unlimited"] * 3
    told = [float(c) for c in column(joints, "peak deflection")]
    np.testing.assert_allclose(told, [1e3 * j.peak_deflection for j in arm.assessment.joints], 1e-3)
    assert "joint_2" in seen(arm.assessment)


def test_without_shafts_there_are_torques_only(ur10: SimpleNamespace) -> None:
    *_, joints = tables(ur10.assessment)
    assert joints[0] == ["joint", "peak deflection [mrad]", "peak torque [N m]"]
    told = [float(c) for c in column(joints, "peak torque")]
    np.testing.assert_allclose(told, [j.peak_torque for j in ur10.assessment.joints], rtol=1e-3)


def test_an_envelope_shows_peaks_and_directions(arm: SimpleNamespace) -> None:
    envelope = envelope_of(picchio.Model(arm.robot), arm.worst.pose, BLOWS)
    facts, joints = tables(envelope)
    assert [name for name, _ in facts][:2] == ["pose [rad, m]", "blows"]
    told = [float(c) for c in column(joints, "peak deflection")]
    np.testing.assert_allclose(told, 1e3 * envelope.peak_deflection, rtol=1e-3)


def test_curves_fits_modes_tasks_and_models(arm: SimpleNamespace) -> None:
    curve = picchio.load_sn_curve("42CrMo4-QT-shaft")
    facts = dict(map(tuple, tables(curve)[0]))
    assert float(facts["endurance limit [MPa]"]) == pytest.approx(curve.endurance_limit / 1e6, 1e-3)
    stress = np.repeat([300e6, 350e6, 400e6, 260e6], 4)
    cycles = 1e5 * (stress / 350e6) ** -6 * np.tile([0.8, 0.9, 1.1, 1.2], 4)
    fit = fit_sn(SNTests(stress, cycles, np.ones(16, bool)), knee=False)
    assert float(tables(fit)[0][1][1]) == pytest.approx(fit.slope.value, rel=1e-3)
    modes = tables(picchio.modal_analysis(picchio.Model(arm.robot).linear_system(arm.worst.pose)))
    frequencies = [float(c) for c in column(modes[0], "natural")]
    np.testing.assert_allclose(frequencies, arm.worst.modes.natural_frequencies, rtol=1e-3)
    assert column(tables(arm.task)[0], "operation") == ["forward", "left", "upward"]
    assert ["gravity stiffness", "yes"] in tables(picchio.Model(arm.robot, True))[0]


def test_an_uncertain_life_shows_its_quantiles(arm: SimpleNamespace) -> None:
    curve = picchio.load_sn_curve("nie-2016", quiet=True)
    life = uncertain_life(arm.robot, arm.task, sn_curve=curve, samples=256)
    *_, rows = tables(life)
    assert [row[0] for row in rows[1:]] == [*arm.robot.flexible_names, "robot"]
    assert float(rows[-1][2].replace(",", "")) == pytest.approx(life.robot.p50, rel=1e-3)


def test_a_campaign_shows_its_records() -> None:
    time = np.arange(4) * 1e-3
    record = picchio.Record.from_arrays(
        "<b>r01.csv", time, {"force": np.zeros(4)}, kind="percussion", pose=[0.0], hits=2,
        direction=[1.0, 0.0, 0.0],
    )  # fmt: skip
    campaign = picchio.Campaign.from_records([record], robot="<i>arm")
    assert column(tables(campaign)[-1], "record") == ["<b>r01.csv"]
    assert tables(record)[-1][1] == ["force", "N"]


def test_reprs_fit_on_a_line_or_two(arm: SimpleNamespace) -> None:
    envelope = envelope_of(picchio.Model(arm.robot), arm.worst.pose, BLOWS)
    told = [repr(x) for x in (arm.assessment, arm.task, envelope, arm.worst.modes, arm.robot)]
    assert all(len(text) < 260 for text in told)
    assert "joint_2" in told[0] and "45" in told[1] and "joint_3" in told[2] and "Hz" in told[3]


def test_the_line_that_is_seen_holds_what_matters(arm: SimpleNamespace) -> None:
    envelope = envelope_of(picchio.Model(arm.robot), arm.worst.pose, BLOWS)
    told = (
        (arm.assessment, arm.assessment.verdict.headline),
        (envelope, f"joint_3 most, {1e3 * envelope.peak_deflection[2]:.4g} mrad"),
        (arm.robot, "3 flexible"),
        (arm.task, "45 rivets a pass"),
        (picchio.Model(arm.robot), "no effects"),
        (picchio.load_sn_curve("42CrMo4-QT-shaft"), "endurance limit"),
        (picchio.allowable(arm.robot, arm.task, 1e6), "The force may be"),
    )
    for shown, words in told:
        line = seen(shown)
        assert words in line and len(line) < 400
        assert len(line) < len(lxml_html.fromstring(shown._repr_html_()).text_content())


def test_an_estimate_says_so_in_the_line_that_stays() -> None:
    robot = picchio.load_robot("kinova_gen3")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        life = picchio.assess(robot)
    assert life.notice and life.notice in seen(life)
    assert "estimates" in seen(picchio.load_robot("ur10"))
    assert f"Doubts: {len(life.verdict.reasons)}." in seen(life)


def test_a_page_to_print_stands_open(arm: SimpleNamespace) -> None:
    page = picchio.report(picchio.allowable(arm.robot, arm.task, 1e6)).html()
    assert "<details open>" in page and "<details>" not in page


def test_names_are_data(hostile_urdf: Path) -> None:
    robot = picchio.load_robot(hostile_urdf)
    for shown in (robot, picchio.Model(robot)):
        page = lxml_html.fromstring(shown._repr_html_())
        assert not page.xpath("//script")
    assert column(tables(robot)[-1], "joint") == list(robot.flexible_names)


def test_cells_and_long_tables() -> None:
    assert cell(float("nan")) == "–"
    assert cell(float("inf")) == "∞"
    assert cell(1.23456e-7) == "1.235e-07"
    assert cell((1.0, "<")) == "(1, &lt;)"
    assert cell(np.array([True, False])) == "(yes, no)"
    page = lxml_html.fromstring(
        sheet("<x>", {"a": None}, ["n"], [[k] for k in range(MOST_ROWS + 7)])
    )
    assert len(page.xpath(".//tr")) == MOST_ROWS + 1
    assert page.xpath(".//p")[0].text == "and 7 more"
    assert page.xpath("./summary/strong")[0].text == "<x>"


def test_nothing_in_a_sheet_is_markup() -> None:
    bad = "<details open><script>alert(1)</script>&\"'"
    page = lxml_html.fromstring(sheet(bad, {bad: bad}, [bad], [[bad]], bad, bad))
    assert [e.tag for e in page.iter("details", "script")] == ["details"]
    for where in (".//strong", ".//tr/th", ".//tr/td", ".//thead//th", ".//tbody//td", ".//p"):
        assert page.xpath(where)[0].text_content() == bad
    assert page.xpath("./summary")[0].text_content() == f"{bad}: {bad}"
    assert sheet(bad, note=bad).count("<details open>") == 1
    assert sheet("x", head="<y>") == "<div><strong>x</strong>: &lt;y&gt;</div>"
