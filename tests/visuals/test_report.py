"""The report says what was found, escapes every name, and needs nothing from outside."""

from __future__ import annotations

import re
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from types import SimpleNamespace

import pytest
from lxml import html as lxml_html

import picchio
from picchio.robot.ratings import TorqueLimit
from picchio.visuals.report.assessment import assessment_report

from .pages import without_traces

OUTSIDE = re.compile(
    r"""(?:src|href|action|data)\s*=\s*["']\s*(?:https?:)?//|url\(\s*["']?https?:|@import"""
)


@pytest.fixture(scope="module")
def page(arm: SimpleNamespace) -> str:
    return assessment_report(arm.assessment, arm.robot, arm.task, command="picchio assess x")


def text_of(tree, selector: str) -> str:
    return " ".join(" ".join(element.itertext()) for element in tree.xpath(selector))


def test_verdict_table_and_reproduction(arm: SimpleNamespace, page: str) -> None:
    tree = lxml_html.fromstring(page)
    verdict = text_of(tree, "//*[@id='verdict']")
    assert "joint_2" in verdict
    assert "8.68 %" in verdict
    rows = tree.xpath("//table[1]/tbody/tr")[:3]
    for row, joint in zip(rows, arm.assessment.joints, strict=True):
        cells = [cell.text_content().strip() for cell in row.xpath("./th|./td")]
        assert cells[0] == joint.name
        assert float(cells[1]) == float(f"{1e3 * joint.peak_deflection:.3g}")
        assert float(cells[4]) == float(f"{joint.peak_shear_stress / 1e6:.3g}")
        assert float(cells[6]) == pytest.approx(100 * joint.utilisation, rel=1e-2)
    everything = text_of(tree, "//body")
    for line in arm.assessment.assumptions:
        assert line in everything
    for key, origin in arm.assessment.origins.items():
        assert key in everything
        assert origin in everything
    for entry in arm.assessment.provenance["inputs"]:
        assert entry["sha256"] in everything
    assert "picchio assess x" in everything


def test_nothing_comes_from_outside(page: str) -> None:
    assert OUTSIDE.search(page) is None
    assert "default-src 'none'" in page
    assert "<script" not in without_traces(page)


def test_it_can_be_read_without_eyes_or_mouse(page: str) -> None:
    tree = lxml_html.fromstring(page)
    assert tree.get("lang") == "en"
    levels = [int(h.tag[1]) for h in tree.xpath("//h1|//h2|//h3")]
    assert levels[0] == 1
    assert levels.count(1) == 1
    pictures = tree.xpath("//*[local-name()='svg']")
    assert len(pictures) >= 6
    for picture in pictures:
        assert picture.get("role") == "img"
        assert len(picture.get("aria-label")) > 20
    ids = tree.xpath("//@id")
    assert len(ids) == len(set(ids))
    for target in tree.xpath("//a/@href"):
        assert target.startswith("#")
        assert target[1:] in ids
    for reference in re.findall(r"""(?:href="#|url\(#)([^")]+)""", page):
        assert reference in ids


def luminance(colour: str) -> float:
    parts = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    linear = [p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]
    return sum(w * p for w, p in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


@pytest.mark.parametrize("theme", [0, 1])
def test_contrast_of_both_themes(theme: int) -> None:
    css = (files("picchio.visuals.report") / "page_files/style.css").read_text("utf-8")
    block = css.split(":root {")[1 + theme].split("}")[0]
    colours = dict(re.findall(r"--(\w+): (#[0-9a-f]{6})", block))
    for ground in ("paper", "soft"):
        for ink in ("ink", "muted", "accent", "bad", "good"):
            light, dark = sorted((luminance(colours[ground]), luminance(colours[ink])))[::-1]
            # WCAG 2.2, 1.4.3: normal text
            assert (light + 0.05) / (dark + 0.05) >= 4.5, (ground, ink)


def test_the_same_result_gives_the_same_file(arm: SimpleNamespace, page: str) -> None:
    again = assessment_report(arm.assessment, arm.robot, arm.task, command="picchio assess x")
    assert again == page


def test_without_shafts_no_life_is_told(ur10: SimpleNamespace) -> None:
    page = assessment_report(
        ur10.assessment, ur10.robot, ur10.task, warnings=[*ur10.warnings, "<b>bold</b>"]
    )
    tree = lxml_html.fromstring(page)
    assert "no life can be given" in text_of(tree, "//*[@id='verdict']")
    warned = text_of(tree, "//section[@class='warnings']")
    assert "no shaft is given for" in warned
    assert "estimates, not measurements" in warned
    assert "<b>bold</b>" in warned
    assert not tree.xpath("//b[text()='bold']")


def test_a_life_that_turns_along_a_stiffness_is_drawn(arm: SimpleNamespace) -> None:
    robot = picchio.load_robot(
        "fanuc_like_3dof", values={"joint_3": {"stiffness": 1e5, "estimated": True}}
    )
    work = [
        replace(op, excitation=op.excitation.scaled(force=8.0), poses=op.poses[:2])
        for op in arm.task.operations
    ]
    task = replace(arm.task, operations=tuple(work))
    # As `assess` draws it by itself: without total shares.
    doubt = picchio.uncertain_life(robot, task, samples=256, totals=False)
    assert list(doubt.scans) == ["stiffness.joint_3"]
    page = assessment_report(arm.assessment, arm.robot, arm.task, spread=doubt)
    tree = lxml_html.fromstring(page)
    assert "against a factor on stiffness.joint_3" in page
    said = text_of(tree, "//section[.//*[@id='doubt']]")
    assert "stiffness.joint_3" in said and "a factor of 2 (estimate)" in said


def test_the_papers_method_has_an_end(arm: SimpleNamespace) -> None:
    found = picchio.assess(arm.robot, arm.task, method="paper")
    page = assessment_report(found, arm.robot, arm.task)
    verdict = text_of(lxml_html.fromstring(page), "//*[@id='verdict']")
    assert "234,000,000 rivets" in verdict
    assert "Where the life goes" not in verdict
    assert "Damage a rivet does" in page


def test_names_are_text_never_markup(hostile_urdf: Path, arm: SimpleNamespace) -> None:
    robot = picchio.load_robot(hostile_urdf)
    joints = list(robot.joint_names)
    task = picchio.task_from_dict(
        {
            "excitation": {"kind": "pulse_train", "force": 300.0, "period": 0.04, "width": 0.004},
            "operation": [
                {"name": "<script>alert(1)</script>", "direction": [0, 0, 1],
                 "poses": [dict.fromkeys(joints, 0.4)]}
            ],
        },
        robot,
    )  # fmt: skip
    found = picchio.assess(robot, task)
    page = assessment_report(found, robot, task, command='picchio "<script>"')
    tree = lxml_html.fromstring(without_traces(page))
    assert not tree.xpath("//script")
    assert not [name for e in tree.iter() if isinstance(e.tag, str)
                for name in e.attrib if name.startswith("on")]  # fmt: skip
    assert '<script>alert("x")</script>' in text_of(tree, "//h1")
    assert joints[0] in text_of(tree, "//tbody")


def test_a_scene_is_folded_in(arm: SimpleNamespace) -> None:
    page = assessment_report(
        arm.assessment, arm.robot, arm.task, scene='<p title="x">scene & all</p>'
    )
    frame = lxml_html.fromstring(page).xpath("//details//iframe")[0]
    assert frame.get("srcdoc") == '<p title="x">scene & all</p>'
    assert frame.get("title")


def test_backwards_doubt_and_terms_have_their_place(arm: SimpleNamespace) -> None:
    from picchio.fatigue.uncertain_lives import LifeSpread, Uncertain
    from picchio.studies.assessment.backwards import Allowable
    from picchio.studies.assessment.method_comparison import Term
    from picchio.studies.uncertainty.result import UncertainLife

    spread = LifeSpread(
        p10=1.5e5, p50=2.5e6, p90=float("inf"), endless=0.25, shares={"stiffness": 0.5},
        totals={"stiffness": 0.61}, samples=640,
        sampling=dict.fromkeys(("p10", "p50", "p90"), (1.2e5, 1.2e5)),
    )  # fmt: skip
    doubt = UncertainLife({"joint_2": spread}, spread, {"stiffness": Uncertain(1.0, 0.05)}, {}, (),
                          {}, ("drawn so",), 7)  # fmt: skip
    page = assessment_report(
        arm.assessment, arm.robot, arm.task, spread=doubt,
        allowed=[Allowable("joint_2", 1e6, 0.99, 3.25, 0.0123, None, float("inf"))],
        terms=[Term("<mean>", "none to fkm", 2e8, "joint_2", None, 1.25)],
    )  # fmt: skip
    tree = lxml_html.fromstring(page)
    everything = " ".join(text_of(tree, "//main").split())
    for told in ("1,000,000 rivets allows", "survival 0.99", "3.25", "12.3", "150,000", "2,500,000",
                 "61", "drawn so", "<mean>", "200,000,000", "1.25"):  # fmt: skip
        assert told in everything, told
    ids = tree.xpath("//@id")
    assert len(ids) == len(set(ids))


def test_reducers_are_shown_beside_the_shafts(arm: SimpleNamespace) -> None:
    import dataclasses

    worn = [dataclasses.replace(joint, reducer="RV-80E-121", reducer_utilisation=1.37,
                                reducer_governed_by="repeated peak torque",
                                reducer_limits=(TorqueLimit("repeated peak torque", 2685, 1960),),
                                reducer_warnings=("RV-80E-121: <too> much",))
            for joint in arm.assessment.joints]  # fmt: skip
    found = dataclasses.replace(arm.assessment, joints=tuple(worn))
    tree = lxml_html.fromstring(assessment_report(found, arm.robot, arm.task))
    assert "fails" in tree.xpath("//*[@id='verdict']")[0].get("class")
    assert "137" in text_of(tree, "(//table)[1]/tbody/tr[1]")
    row = text_of(tree, "//table[@id='reducers']/tbody/tr[1]")
    assert "RV-80E-121" in row
    assert "137" in row and "2,685" in row and "1,960" in row
    assert "repeated peak torque" in row
    (line,) = tree.xpath("//*[@aria-label='Reducers']/li")
    assert line.text_content() == "joint_1, joint_2, joint_3: <too> much"


def test_the_answer_to_a_wanted_life_stands_at_the_top(arm: SimpleNamespace) -> None:
    allowed = picchio.allowable(arm.robot, arm.task, 1e6)
    tree = lxml_html.fromstring(
        assessment_report(arm.assessment, arm.robot, arm.task, allowed=allowed)
    )
    (answer,) = tree.xpath("//header//*[@id='answer']")
    assert answer.text_content() == allowed.answer and "safe" in answer.get("class")
    assert allowed[1].reducer in text_of(tree, "//section[.//*[@id='backwards']]")
