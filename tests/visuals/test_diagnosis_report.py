"""The pages of a diagnosis and of a residual: whole, offline, escaped, and saying what was found.

The search for causes has tests of its own; here its outcome is put together from fits of the true
cause, which takes seconds instead of a minute.
"""

import re
import sys
from dataclasses import replace
from types import SimpleNamespace

import pytest
from lxml import html as lxml_html

import picchio
from picchio.campaign.campaign import Campaign
from picchio.cli.measured.diagnose import show_diagnosis
from picchio.core.errors import InputError
from picchio.diagnosis.percussion.conclude.holdout import holdout_gain
from picchio.diagnosis.percussion.criteria.equivalence import bic
from picchio.diagnosis.percussion.criteria.whiteness import whiteness_test
from picchio.diagnosis.percussion.data.problem import Problem, held_out
from picchio.diagnosis.percussion.diagnosis import PercussionDiagnosis
from picchio.diagnosis.percussion.fit.least_squares import fit, fit_growing
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.search.candidates import measure_scales
from picchio.diagnosis.percussion.search.state import Search, Trial
from picchio.diagnosis.result import Cause, Diagnosis, Value
from picchio.model.effects.registry import effect_class
from picchio.robot.loading.load import load_robot
from picchio.visuals.report.diagnosis import _ask, headline
from picchio.visuals.report.page import number, spread
from picchio.visuals.scene.build import diagnosis_scene

from .pages import without_traces

OUTSIDE = re.compile(
    r"""(?:src|href|action|data)\s*=\s*["']\s*(?:https?:)?//|url\(\s*["']?https?:|@import"""
)
HOSTILE = "<script>alert('$x_1$')</script>"
LIFE = {
    "baseline": {"rivets_to_failure": float("inf"), "utilisation": 0.1, "limiting_joint": None,
                 "joints": {"joint_1": {"rivets_to_failure": float("inf"), "utilisation": 0.1,
                                        "peak_deflection": 4e-4}}},
    "extended": {"rivets_to_failure": 2.1e6, "utilisation": 0.14, "limiting_joint": "joint_1",
                 "joints": {"joint_1": {"rivets_to_failure": 2.1e6, "utilisation": 0.14,
                                        "peak_deflection": 6e-4}}},
}  # fmt: skip


@pytest.fixture(scope="module")
def case(repository):
    sys.path.insert(0, str(repository / "tests"))
    try:
        from worlds import campaign as worlds
    finally:
        sys.path.pop(0)
    campaign, _ = worlds.make(
        seed=2, causes=[("payload", "tool", {"mass": 4.0})], records=6,
        sensors=("accelerometer.tool", "deflection", "force"),
    )  # fmt: skip
    robot = load_robot("fanuc_like_3dof")
    problem = Problem(robot, campaign)
    train, kept = held_out(problem)[0]
    start = Hypothesis.baseline(robot, campaign.tolerance)
    baseline = fit_growing(problem, start, train)
    best = fit(problem, baseline.hypothesis.plus(effect_class("payload")("tool", mass=3.0)), train)
    whole = fit(problem, best.hypothesis, with_jacobian=True, iterations=2)
    nominal = fit(problem, baseline.hypothesis, iterations=2)
    rows = [
        {"step": 1, "effect": "payload", "target": "tool", "bic": bic(best),
         "screened_gain": 1.0, "chi_square_per_sample": best.chi_square / best.samples},
        {"step": 1, "effect": "cable", "target": "link_3", "bic": float("inf"),
         "screened_gain": 1.0, "chi_square_per_sample": 40.0},
        {"step": 2, "effect": "backlash", "target": "joint_2", "bic": bic(best) + 3.0,
         "screened_gain": 1.0, "chi_square_per_sample": 1.0},
    ]  # fmt: skip
    mass = next(e for e in whole.hypothesis.effects if e.name == "payload").values["mass"]
    diagnosis = Diagnosis(
        "named",
        (Cause("payload", "tool", 0.99, {"mass": Value(mass, 0.004, "kg")}),),
        nuisances={"stiffness.joint_1": Value(2.4e5, 31.0, "N*m/rad")},
        gain=holdout_gain(problem, baseline.hypothesis, best.hypothesis, train, kept),
        scores=tuple(rows),
    )
    effects = nominal.hypothesis.effects
    search = Search(
        problem, (), measure_scales(problem, effects, problem.predictions(effects)), train, kept,
        baseline, best, steps=[[Trial("payload:tool", best, bic(best), 1.0)]],
    )  # fmt: skip
    found = PercussionDiagnosis(
        diagnosis, problem, nominal, whole, search,
        whiteness_test(problem, nominal), whiteness_test(problem, whole),
    )  # fmt: skip
    return SimpleNamespace(found=found, robot=robot, campaign=campaign, mass=mass)


def page_of(found, scene=False, **options):
    """The page of a diagnosis, with all that led to it."""
    details = {"percussion": found, "folder": None, "saved": {"robot": "x", "effects": []}}
    answer = replace(found.diagnosis, details=details)
    return picchio.report(answer, scene=scene, **options).text


def with_diagnosis(case, **changed):
    return replace(case.found, diagnosis=replace(case.found.diagnosis, **changed))


@pytest.fixture(scope="module")
def page(case):
    return page_of(with_diagnosis(case, life=LIFE), command="picchio diagnose x")


@pytest.fixture(scope="module")
def residual_page(case):
    checked = picchio.check(case.campaign, robot=case.robot)
    return picchio.report(checked, command="picchio check x").text


def text(page, xpath="//body"):
    return " ".join(" ".join(e.itertext()) for e in lxml_html.fromstring(page).xpath(xpath))


def test_it_says_what_was_found(case, page):
    verdict = text(page, "//*[@id='verdict']")
    assert "payload" in verdict
    assert f"{case.mass:.4f} ± 0.0040 kg" in verdict
    everything = text(page)
    for said in ("the tool is heavier", "at the tool", "99\N{NO-BREAK SPACE}%", "picchio-model/1",
                 "picchio diagnose x", "2,100,000", "unlimited", "neither model",
                 "peak deflection"):  # fmt: skip
        assert said.lower() in everything.lower(), said
    assert "cable of link_3" in page  # in words, beside the picture
    gain = case.found.diagnosis.gain
    assert f"{100 * gain.baseline_nrmse:.3g} %" in everything


def test_the_pictures_are_there_and_described(page):
    tree = lxml_html.fromstring(page)
    pictures = tree.xpath("//figure/*[local-name()='svg']")
    # Overlay, two residuals, place, held out, two steps, three channel groups.
    assert len(pictures) == 10
    for svg in pictures:
        assert svg.get("aria-label")
        assert svg.get("role") == "img"
    assert len(set(tree.xpath("//@id"))) == len(tree.xpath("//@id"))
    for target in tree.xpath("//a/@href"):
        assert tree.xpath(f"//*[@id='{target[1:]}']"), target


@pytest.mark.parametrize("which", ["page", "residual_page"])
def test_nothing_comes_from_outside_and_it_can_be_mailed(request, which):
    html = request.getfixturevalue(which)
    assert OUTSIDE.search(html) is None
    assert "default-src 'none'" in html
    assert "<script" not in without_traces(html)
    assert "prefers-color-scheme: dark" in html
    assert len(html) < 4e6


def test_every_name_is_escaped(case):
    cause = Cause("payload", HOSTILE, 0.5, {HOSTILE: Value(1.0, 0.1, HOSTILE)})
    hostile = with_diagnosis(
        case,
        verdict="ambiguous",
        causes=(cause,),
        alternatives=(((HOSTILE, HOSTILE),),),
        leads=((HOSTILE, HOSTILE),),
        life={"baseline": {HOSTILE: HOSTILE}, "extended": {HOSTILE: 1.0}},
        next_measurement={"why": HOSTILE, "pose": {HOSTILE: 0.1}, "direction": [0, 0, 1],
                          "force": 300.0, "sensor": HOSTILE,
                          "rivals": [{"causes": [[HOSTILE, HOSTILE]], "chi_square": 12.0}]},
        scores=({"step": 1, "effect": HOSTILE, "target": HOSTILE, "bic": 1.0,
                 "screened_gain": 1.0, "chi_square_per_sample": 2.0},),
    )  # fmt: skip
    html = page_of(hostile, command=HOSTILE, warnings=[HOSTILE])
    assert "<script" not in without_traces(html)
    assert html.count("&lt;script&gt;") > 10


@pytest.mark.parametrize(
    ("told", "least", "most", "said"),
    [
        ("either way", 40.0, 50.0, ("tells it from", "(chi-square 40)")),
        ("one way", 20.0, 1e6, ("may tell it from", "(chi-square 20 or 1e+06, by what it is)")),
        ("no", 1.0, 2.0, ("does not tell it from", "(chi-square 1)")),
    ],
)
def test_whether_the_next_measurement_tells_is_said(told, least, most, said, case):
    ask = {"why": "", "pose": {}, "rivals": [
        {"causes": [["payload", "tool"]], "told": told, "chi_square": least,
         "chi_square_at_best": most},
    ]}  # fmt: skip
    ((name, words),) = _ask(replace(case.found.diagnosis, next_measurement=ask))
    assert name == said[0] and words.endswith(said[1])


def test_the_scene_is_at_the_worst_record_and_in_the_page(case):
    scene = diagnosis_scene(case.found, subdivisions=1)
    poses = {r.name: r.setup.geometry.pose for r in case.found.problem.records}
    assert any((scene.envelope.pose == pose).all() for pose in poses.values())
    assert scene.diagnosis["lines"][0]["text"] == f"payload: mass {case.mass:.3g} kg"
    html = page_of(case.found, scene=True)
    (frame,) = lxml_html.fromstring(html).xpath("//iframe")
    assert frame.get("srcdoc") == diagnosis_scene(case.found).html()
    assert "<script" not in without_traces(html)  # but for what the frame holds, escaped
    policy = lxml_html.fromstring(html).xpath("//meta[@http-equiv]/@content")[0]
    assert "default-src 'none'" in policy and "script-src 'unsafe-inline'" in policy


@pytest.mark.parametrize("verdict", ["nothing-wrong", "unexplained", "partial", "ambiguous"])
def test_every_verdict_has_its_page(case, verdict):
    found = case.found
    diagnosis = replace(found.diagnosis, verdict=verdict)
    if verdict in ("nothing-wrong", "unexplained"):
        diagnosis = replace(diagnosis, causes=(), leads=(("cable", "link_3"),))
    if verdict == "nothing-wrong":
        found = replace(found, extended=found.baseline, after=found.before)
        diagnosis = replace(diagnosis, scores=(), leads=())
    if verdict == "ambiguous":
        diagnosis = replace(diagnosis, alternatives=((("cable", "link_3"),),))
    html = page_of(replace(found, diagnosis=diagnosis))
    said = text(html, "//*[@id='verdict']").lower()
    assert {"nothing-wrong": "nothing wrong", "unexplained": "no known cause", "partial": "part of",
            "ambiguous": "cannot tell"}[verdict] in said  # fmt: skip
    assert ("payload" in said) == (verdict in ("partial", "ambiguous"))
    assert ("cable" in text(html)) == (verdict in ("unexplained", "ambiguous"))
    assert ("Candidates of step 1" in html) == (verdict != "nothing-wrong")


def test_a_partial_verdict_without_rivals_says_where_to_look(case):
    said = text(page_of(with_diagnosis(case, verdict="partial", next_measurement=None)))
    assert "there is nothing to tell apart" in said
    assert "No measurement is known" not in said


def test_a_wide_search_shows_its_best(case):
    row = {"step": 1, "target": "tool", "screened_gain": 1.0}
    rows = tuple(
        {**row, "effect": f"effect_{n}", "bic": 100.0 + n, "chi_square_per_sample": 2.0 + n}
        for n in range(22)
    )
    html = page_of(with_diagnosis(case, scores=rows))
    assert "10 more did no better" in text(html)
    assert "effect 11" in html and "effect 12" not in html


def test_what_all_sensors_have_alike_is_said_and_not_called_noise(case, capsys):
    why = "sensor gain would explain it, but by the same amount in all sensors"
    leads = tuple(("sensor_gain", group) for group in ("accelerometer.tool", "deflection"))
    diagnosis = replace(
        case.found.diagnosis, verdict="unexplained", causes=(), leads=leads, note=why
    )
    html = page_of(replace(case.found, diagnosis=diagnosis))
    assert why[1:] in text(html, "//*[@id='verdict']")
    assert "all of the leads together, none of which is claimed" in text(html)
    assert "they are not claimed" in text(html) and "force at the tool" in text(html)
    assert "helped a little" not in text(html)
    show_diagnosis(diagnosis)
    said = " ".join(capsys.readouterr().out.split())
    assert f"Unexplained: {why}." in said
    assert "but is not claimed: sensor_gain of deflection" in said
    assert "more than noise" not in said
    assert diagnosis.to_dict()["note"] == why


def test_records_from_which_no_value_is_are_told(case, capsys):
    diagnosis = replace(case.found.diagnosis, untold=("r05.csv", "r09.csv"))
    html = page_of(replace(case.found, diagnosis=diagnosis))
    why = "No value is from r05.csv, r09.csv: errors of a tolerance or less grow too large there."
    assert why in text(html)
    show_diagnosis(diagnosis)
    assert why in " ".join(capsys.readouterr().out.split())
    assert diagnosis.to_dict()["untold"] == ["r05.csv", "r09.csv"]
    assert "untold" not in case.found.diagnosis.to_dict()


def test_the_residual_page_names_no_cause_but_shows_where(case, residual_page):
    html = residual_page
    said = text(html)
    assert "payload" not in said.lower()
    assert "picchio check x" in said
    verdict = text(html, "//*[@id='verdict']")
    share = float(re.search(r"leaves ([\d.]+) % of the signal", verdict).group(1))
    floor = float(re.search(r"would leave ([\d.]+) %", verdict).group(1))
    assert share > 3.0 * floor
    # A row for every channel of every record.
    rows = lxml_html.fromstring(html).xpath("//details[1]//tbody/tr")
    assert len(rows) == sum(len(r.channels) for r in case.campaign)
    for heading in ("By frequency", "By time", "The torque that the model lacks",
                    "Frequency responses", "By pose", "By temperature",
                    "By peak force of the blows"):  # fmt: skip
        assert heading.lower() in said.lower(), heading


def test_a_campaign_without_blows_is_refused(case):
    import numpy as np

    from picchio.campaign.record import Record

    time = np.arange(50) / 100.0
    motion = Record.from_arrays("m.csv", time, {"position.joint_1": time}, kind="motion")
    campaign = Campaign.from_records([motion], robot="fanuc_like_3dof")
    with pytest.raises(InputError, match="neither blows"):
        picchio.report(picchio.check(campaign, robot=case.robot))


def test_motion_records_have_a_page_too(measured_data):
    """EMPS with inertia and the URDF's viscous friction alone: about 17 % of the force is left."""
    from picchio.datasets import load

    campaign = load("emps", measured_data / "emps")
    html = picchio.report(picchio.check(campaign, robot="emps")).text
    share = float(re.search(r"leaves ([\d.]+) %", text(html, "//*[@id='verdict']")).group(1))
    assert 14.0 < share < 20.0
    assert "friction" not in text(html, "//*[@id='verdict']")
    assert OUTSIDE.search(html) is None
    assert html.count("<svg") == 3


@pytest.mark.parametrize(
    ("value", "std", "unit", "said"),
    [
        (2.99379, 0.0042, "kg", "2.9938 ± 0.0042 kg"),
        (242439.2, 31.95, "N*m/rad", "242,439 ± 32 N m/rad"),
        (-0.5, 0.0, "1", "\N{MINUS SIGN}0.5"),
        (1.5e-7, 2e-9, "rad", "1.500 × 10⁻⁷ ± 2 × 10⁻⁹ rad"),
    ],
)
def test_values_end_where_their_spread_begins(value, std, unit, said):
    assert spread(value, std, unit).replace("1.5 ×", "1.500 ×") == said


def test_numbers():
    assert number(float("inf")) == "unlimited"
    assert number(None) == "\N{EN DASH}"
    assert number(6.49e4, 3) == "64,900"


def test_where_more_than_noise_is_left_the_cause_may_be_what_acts_like_it():
    cause = Cause("payload", "tool", 1.0, {"mass": Value(4.6, 0.2, "kg")})
    said = headline(Diagnosis("partial", (cause,)))
    assert "payload" in said
    assert "or something that acts much like it" in said
    assert "acts much like" not in headline(Diagnosis("named", (cause,)))
