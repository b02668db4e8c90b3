"""Campaigns of the worlds: honest, complete, the same again for the same seed."""

import ast
from pathlib import Path

import numpy as np
import pytest

from picchio.campaign.campaign import load_campaign
from worlds import campaign, cases, detect, draw, effects, outside, robots
from worlds import plan as plans

HERE = Path(__file__).resolve().parent
SHORT = {"records": 3, "hits": 4, "ring": 0.2}
ALLOWED = {"numpy", "scipy", "numba", "pinocchio", "mujoco", "tomlkit"}


def test_worlds_import_nothing_of_the_forward_model():
    import sys

    files = [f for f in HERE.glob("*.py") if not f.name.startswith(("test_", "conftest"))]
    assert len(files) > 10
    for file in files:
        for node in ast.walk(ast.parse(file.read_text())):
            names = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and not node.level:
                names = [node.module]
            for name in names:
                top = name.partition(".")[0]
                own = name.startswith("picchio.campaign.")
                assert own or top in ALLOWED or top in sys.stdlib_module_names, (file.name, name)


def test_a_saved_campaign_reads_back_and_says_nothing_of_the_truth(tmp_path):
    causes = [("payload", "tool", {"mass": 3.0}), "backlash"]
    made, truth = campaign.make(seed=5, causes=causes, folder=tmp_path / "c", **SHORT)
    again, _ = campaign.make(seed=5, causes=causes, **SHORT)
    read = load_campaign(tmp_path / "c")
    read.check_samples()
    assert [r.file for r in read] == [r.file for r in again] == ["r01.csv", "r02.csv", "r03.csv"]
    for one, other in zip(read, again, strict=True):
        assert one.channels == other.channels and "accelerometer.tool.x" in one.channels
        assert all(np.array_equal(one[c], other[c]) for c in ("time", *one.channels))
        assert one.pose == other.pose and one.hits == 4
    assert read.robot == "fanuc_like_3dof" and read.tool == "tool"
    assert made.tolerance.stiffness == read.tolerance.stiffness == 0.05
    text = (tmp_path / "c" / "campaign.toml").read_text()
    assert not any(word in text for word in ("payload", "backlash", "seed", "scale", "truth"))
    assert truth["causes"][0] == {
        "effect": "payload", "target": "tool", "parameters": {"mass": 3.0}
    }  # fmt: skip
    assert truth["causes"][1]["parameters"]["gap"] > 0.0


def test_another_seed_is_another_campaign():
    one, first = campaign.make(seed=1, **SHORT)
    other, second = campaign.make(seed=2, **SHORT)
    assert one.records[0].pose != other.records[0].pose
    assert first["nuisances"] != second["nuisances"]


@pytest.mark.parametrize(
    "name", ["fanuc_like_3dof", "fanuc_r2000ic", "ur10", "kinova_gen3", "kuka_iiwa14"]
)
def test_plans_spread_and_stay_within_limits(name):
    robot = robots.load(name)
    plan = plans.make(name, np.random.default_rng(9))
    poses = np.array([shot.pose for shot in plan.shots])
    assert len(np.unique(poses, axis=0)) == 6 and len(plan.shots) == 18
    assert (poses > robot.lower).all() and (poses < robot.upper).all()
    directions = np.array([shot.direction for shot in plan.shots])
    assert np.abs(directions.mean(axis=0)).max() < 0.25
    assert np.linalg.eigvalsh(directions.T @ directions / 18).min() > 0.2
    levels = np.array([shot.force for shot in plan.shots]) / robot.force
    assert (levels == 1.0).sum() >= 6 and 0.5 <= levels.min() < 0.9 and 1.1 < levels.max() <= 1.5
    days = np.array([shot.when for shot in plan.shots])
    assert days[0] == 0.0 and (np.diff(days) > 0).all() and days[-1] > 3.0
    assert 13.0 < np.ptp([shot.temperature for shot in plan.shots]) < 25.0
    times = plan.times()
    assert times[0] < -0.14 and times[-1] > 0.48 + 0.7


@pytest.mark.parametrize("snr", [20.0, 40.0])
def test_the_noise_is_as_far_down_as_it_says(snr):
    groups = ("accelerometer.tool", "deflection", "force")
    made, truth = campaign.make(seed=3, snr_db=snr, sensors=groups, **SHORT)
    for group in groups:
        names = [c for c in made.records[0].channels if made.records[0].channel(c).group == group]
        error, size = [], []
        for record, clean in zip(made, truth["clean"], strict=True):
            read = np.stack([record[c] for c in names], axis=1)
            after = record["time"] >= 0.0
            error.append(read - clean[group])
            size.append(clean[group][after])
        ratio = np.std(np.concatenate(error)) / np.sqrt(np.mean(np.concatenate(size) ** 2))
        assert ratio == pytest.approx(10 ** (-snr / 20), rel=0.05)
        quiet = np.stack([made.records[0][c] for c in names])[:, made.records[0]["time"] < 0.0]
        assert quiet.std() == pytest.approx(truth["noise"][group], rel=0.3)


def test_nuisances_stay_within_the_tolerance_and_causes_out_of_it():
    rng = np.random.default_rng(4)
    drawn = [campaign.Nuisances.draw(3, rng) for _ in range(300)]
    stiffness = np.array([n.stiffness for n in drawn])
    assert np.abs(stiffness - 1.0).max() < 0.095 + 1e-12 and 0.04 < stiffness.std() < 0.05
    assert max(abs(n.force - 1.0) for n in drawn) < 0.095 + 1e-12
    for seed in range(4):
        cause = ("modal_damping", "robot", {"scale": 2.0})
        _, truth = campaign.make(seed=seed, causes=[cause], **{**SHORT, "hits": 1})
        assert 2.0 * truth["nuisances"]["damping_ratio"] > 1.0 + 2.5 * 0.20


def test_half_the_step_changes_nothing_that_a_sensor_could_see():
    """At 40 dB a thousandth of the signal is a tenth of the noise."""
    groups = ("accelerometer.tool0", "deflection")
    rng = np.random.default_rng(6)
    for name in ("fanuc_like_3dof", "kinova_gen3"):
        robot = robots.load(name)
        plan = plans.make(name, rng, 1, hits=2, ring=0.1)
        world = campaign.World(plan, campaign.Nuisances.none(len(robot.joints)))
        fine = campaign.World(plan, world.nuisances, step=1e-5)
        groups = campaign.groups_of(("accelerometer", "deflection"), robot)
        one, other = campaign.clean(world, groups)[0], campaign.clean(fine, groups)[0]
        for group in groups:
            error = np.sqrt(np.mean((one[group] - other[group]) ** 2) / np.mean(one[group] ** 2))
            print(f"{name} {group}: {error:.1e}")
            assert error < 2e-4


def test_a_steady_record_repeats_itself():
    drift = ("clock_drift", "deflection", {"rate": 1e-6})  # too little to be seen in a second
    options = {"seed": 3, "records": 1, "hits": None, "snr_db": 300.0, "bandwidth": None}
    made, _ = campaign.make(causes=[drift], **options)
    record = made.records[0]
    plain = campaign.make(**options)[0].records[0]
    for channel in plain.channels:
        change = np.abs(record[channel] - plain[channel]).max()
        assert change < 1e-3 * np.abs(plain[channel]).max()
    assert record.hits is None and record["time"][0] >= 0.0
    for channel in record.channels:
        x = record[channel]
        period = round(0.040 * 1000)
        assert np.abs(x[period:] - x[:-period]).max() < 0.01 * np.abs(x).max()
        assert abs(x.mean()) < 1e-12 + 1e-9 * np.abs(x).max()


def test_quantities_are_those_of_the_record():
    _, truth = campaign.make(seed=3, causes=["backlash"], snr_db=300.0, **SHORT)
    found = campaign.quantities(truth["world"], index=2)
    clean = truth["clean"][2]["deflection"]
    for j, (name, peak) in enumerate(found["peak_deflection"].items()):
        assert peak >= np.abs(clean[:, j]).max() - 1e-12, name
        assert peak == pytest.approx(np.abs(clean[:, j]).max(), rel=0.02)
    harder = campaign.quantities(truth["world"], index=2, force=900.0)
    assert harder["peak_deflection"]["joint_2"] > 1.5 * found["peak_deflection"]["joint_2"]


def test_what_nuisances_imitate_is_not_detectable():
    """A softer joint within tolerance, a gain that force explains; and a payload that shows."""
    plan = plans.make("fanuc_like_3dof", np.random.default_rng(8), 3, hits=6, ring=0.3)
    nuisances = campaign.Nuisances.none(3)
    group = ("accelerometer.tool",)

    def gain(*cause):
        world = campaign.World(plan, nuisances, (cause,))
        return detect.detectability(world, group, 20.0)["bic_gain"]

    assert gain("joint_stiffness", "joint_2", {"scale": 1.02}) < 10.0
    # so large a shift is no line: what a linear change leaves of it is no evidence
    assert gain("joint_stiffness", "joint_2", {"scale": 1.07}) < 10.0
    assert gain("sensor_gain", "accelerometer.tool", {"gain": 1.04}) < 10.0
    assert gain("payload", "tool", {"mass": 1e-4}) < 10.0
    assert gain("payload", "tool", {"mass": 3.0}) > 100.0
    assert gain("joint_stiffness", "joint_2", {"scale": 1.3}) > 100.0


@pytest.mark.parametrize("name", ["fanuc_like_3dof", "fanuc_r2000ic", "ur10", "kinova_gen3"])
def test_blows_give_a_few_milliradians(name):
    """What a real tool does: more would be another problem, less would drown."""
    for seed in range(2):
        size = draw.sizes(plans.make(name, np.random.default_rng(seed), 9))
        print(f"{name}: {1e3 * size.most.max():.2f} mrad")
        assert 3e-4 < size.most.max() < 6e-3
        assert size.active(0.3)


def test_seven_joints_draw_what_shows():
    size = draw.sizes(plans.make("kinova_gen3", np.random.default_rng(2), 3, hits=4, ring=0.2))
    assert "joint_7" not in size.active(0.3)  # the tool stands on its axis
    assert len(size.active(0.3)) >= 3


def test_cases_are_drawn_by_their_seed_and_keep_their_causes_apart():
    for kind, count in cases.KINDS.items():
        for seed in range(3):
            found = cases.causes(kind, seed, **SHORT)
            assert found == cases.causes(kind, seed, **SHORT) and len(found) == count
            assert len({name for name, _, _ in found}) == count
            assert all((name in effects.EFFECTS) == (kind != "outside") for name, _, _ in found)
            joints = [t for _, t, _ in found if str(t).startswith("joint")]
            assert len(joints) == len(set(joints))
    one = cases.causes("single", 1, effect="backlash", sensors=("accelerometer",), **SHORT)
    made, truth = campaign.make(seed=1, causes=one, sensors=("accelerometer",), **SHORT)
    assert one[0][0] == "backlash" and cases.is_detectable(truth, 40.0)
    assert made.records[0].channels == tuple(f"accelerometer.tool.{axis}" for axis in "xyz")
    with pytest.raises(ValueError, match="no sensor"):
        cases.causes("single", 1, effect="sensor_axes", sensors=("deflection",), **SHORT)


def test_the_truth_is_json():
    import json

    _, truth = campaign.make(seed=1, causes=cases.causes("triple", 1, **SHORT), **SHORT)
    assert json.loads(json.dumps(campaign.plain(truth))) == campaign.plain(truth)


@pytest.mark.slow
def test_filters_and_friction_are_drawn_of_every_sort():
    found = [cases.causes("filter", seed, **SHORT)[0] for seed in range(16)]
    assert {name for name, _, _ in found} == {"sensor_highpass"}
    assert {(p["order"], p["digital"]) for _, _, p in found} == {
        (1.0, 0.0), (1.0, 1.0), (2.0, 0.0), (2.0, 1.0)
    }  # fmt: skip
    rubbing = [cases.causes("rubbing", seed, **SHORT)[0] for seed in range(8)]
    assert all(2.0 <= p["torque"] <= 8.0 for _, _, p in rubbing)
    assert {p.get("smoothing") for _, _, p in rubbing} == {None, 5e-4}
    hum = cases.causes("hum", 3, **SHORT)
    assert hum[0][0] == "mains_hum" and hum[1][0] != "mains_hum"
    # what came later is drawn where the world may be wrong, not by the published seeds
    later = set(outside.EFFECTS) - set(outside.FIRST)
    drawn = {cases.causes("outside", seed, mismatch=1.0, **SHORT)[0][0] for seed in range(60)}
    before = {cases.causes("outside", seed, **SHORT)[0][0] for seed in range(60)}
    assert later <= drawn and not later & before and len(drawn) >= 8
