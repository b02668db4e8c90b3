"""Every claim can come out otherwise: the same test on another paper, or in another world."""

import numpy as np
import pytest

from picchio.paper.claims import Verdict, try_claim
from picchio.paper.printed import printed
from picchio.paper.world import Assumptions

HOLDS, ONLY_IF, FAILS = Verdict.HOLDS, Verdict.CONDITIONAL, Verdict.FAILS


def verdict(study, name):
    return try_claim(study, name).verdict


def rows(**changes):
    return tuple(row.model_copy(update=changes) for row in printed().table2)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("poses", HOLDS), ("direction", HOLDS), ("lives_differ", HOLDS), ("decoupled", HOLDS),
        ("fourier", HOLDS), ("phase", ONLY_IF), ("miner_algebra", HOLDS), ("mimics", FAILS),
        ("shaft_steel", FAILS), ("curve_of_table", FAILS), ("upward_joint_1", HOLDS),
        ("x_force_joint_1", FAILS), ("z_force_joint_2", FAILS), ("reach_joint_2", ONLY_IF),
        ("direction_joint_1", HOLDS), ("envelope_size", HOLDS),
        ("hits", Verdict.UNKNOWN), ("total", Verdict.UNKNOWN),
    ],
)  # fmt: skip
def test_what_becomes_of_the_paper(study, name, expected):
    assert verdict(study, name) is expected


def test_stronger_actuators_hold_the_arm(altered):
    torques = (200.0, 700.0, 200.0)
    assert verdict(altered(arm={"actuator_torques": torques}), "mimics") is HOLDS


def test_a_lighter_arm_is_held(altered):
    assert verdict(altered(arm={"masses": (80.0, 5.0, 5.0)}), "mimics") is HOLDS


def test_a_weaker_curve_is_a_shaft_steels(altered):
    assert verdict(altered(sn_curve={"a": 5000.0}), "shaft_steel") is HOLDS


def test_a_table_by_its_own_curve_holds(altered):
    paper = printed()
    made = tuple(
        row.model_copy(update={"cycles": tuple(paper.sn_curve.cycles(np.array(row.stress)))})
        for row in paper.table2
    )
    assert verdict(altered(table2=made), "curve_of_table") is HOLDS


def test_a_tilted_vertical_force_moves_joint_1(altered):
    tilted = rows(force_direction=(0.0, 0.6, 0.8))
    assert verdict(altered(table2=tilted), "upward_joint_1") is FAILS


def test_one_direction_three_times_does_not_matter(altered):
    alike = rows(force_direction=(0.0, 0.6, 0.8))
    assert verdict(altered(table2=alike), "direction") is FAILS


def test_the_dominant_joint_follows_what_is_claimed(altered):
    study = altered(given=Assumptions())
    ours = tuple(int(j) + 1 for j in study.base.path_peaks.peak_deflection.argmax(axis=1))
    other = tuple(j % 3 + 1 for j in ours)
    names = ("dominant_top", "dominant_second", "dominant_third", "dominant_low")
    right = altered(count=0, task={"dominant_joints": ours})
    assert [verdict(right, name) for name in names] == [HOLDS] * 4
    wrong = altered(count=0, task={"dominant_joints": other})
    assert [verdict(wrong, name) for name in names] == [FAILS] * 4


def test_a_stiff_joint_1_never_leads(altered):
    study = altered(arm={"stiffness": (2.4e8, 1.0e5, 1.0e5)})
    assert verdict(study, "dominant_low") is FAILS
    assert verdict(study, "dominant_all") is FAILS


def test_a_soft_joint_1_always_leads(altered):
    study = altered(arm={"stiffness": (2.0e3, 1.0e6, 1.0e6)})
    assert verdict(study, "dominant_low") is HOLDS


def test_with_strong_damping_the_steady_state_stands_in(study, altered):
    assert try_claim(study, "transient").number > 1.5
    quiet = altered(given=Assumptions(damping_ratio=0.9), count=0)
    assert verdict(quiet, "transient") is HOLDS


def test_slow_blows_make_joint_1_worst_at_full_reach(altered):
    # Nothing resonates: only the lever counts.
    slow = Assumptions(period=2.0, duty=0.5, damping_ratio=0.9)
    assert verdict(altered(given=slow, count=0), "reach_joint_1") is HOLDS


def test_a_hair_between_the_rivets_changes_no_stress(altered):
    tight = altered(given=Assumptions(pitch=1e-4, panel_y=0.3), count=0)
    assert verdict(tight, "poses") is FAILS


def test_a_heavy_hammer_turns_the_gun(altered):
    assert verdict(altered(count=0), "fixed_direction") is HOLDS
    assert verdict(altered(count=0, task={"force": 30000.0}), "fixed_direction") is FAILS
