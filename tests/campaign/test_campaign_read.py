"""What a campaign says, and that nothing is read that was not asked for."""

import csv
import os
import warnings
from datetime import UTC, datetime

import numpy as np
import pytest

from picchio.campaign.campaign import Campaign, load_campaign
from picchio.campaign.record import Record
from picchio.core.errors import InputError, PicchioWarning


def test_the_contract_example_means_what_it_says(campaign):
    first, second = campaign.records
    assert (campaign.robot, campaign.tool, len(campaign)) == ("fanuc_like_3dof", "tool", 2)
    assert (campaign.tolerance.stiffness, campaign.tolerance.damping_ratio) == (0.05, 0.20)
    assert campaign.tolerance.force == 0.05
    assert first.pose == {"joint_1": 0.3, "joint_2": 0.5, "joint_3": -0.8}
    assert (first.hits, first.temperature) == (12, 22.0)
    assert first.taken == datetime(2026, 3, 1, 8, tzinfo=UTC)
    blows = first.blows()
    assert (blows.force, blows.period, blows.width) == (250.0, 0.040, 0.004)
    assert campaign.excitation.force == 300.0
    assert second.blows() is None
    assert second.direction is None
    assert first.channels == ("force", "deflection.joint_1", "accelerometer.tool.x")
    assert (first.clock.rate, first.clock.start) == (1024.0, -10 / 1024)


def test_samples_are_what_another_reader_finds(campaign, campaign_folder):
    with open(campaign_folder / "r01.csv", newline="") as stream:
        rows = list(csv.reader(stream))[1:]
    read = campaign["r01.csv"].read()
    for index, name in enumerate(["time", *campaign["r01.csv"].channels]):
        assert read[name].dtype == np.float64
        assert read[name].tolist() == [float(row[index]) for row in rows]


def test_only_the_columns_asked_for_come(campaign):
    record = campaign["r01.csv"]
    assert set(record.read(["force"])) == {"time", "force"}
    assert record["force"].shape == record.time.shape
    with pytest.raises(InputError, match=r"no such channel.*deflection\.joint_1"):
        record.read(["deflection.joint_2"])


@pytest.mark.parametrize("size", [1, 7, 99, 100, 1000])
def test_chunks_join_to_the_whole(campaign, size):
    record = campaign["r01.csv"]
    chunks = list(record.chunks(["accelerometer.tool.x"], size))
    assert all(0 < chunk["time"].size <= size for chunk in chunks)
    joined = np.concatenate([chunk["accelerometer.tool.x"] for chunk in chunks])
    assert (joined == record["accelerometer.tool.x"]).all()


def test_opening_does_not_touch_the_samples(campaign_folder):
    with open(campaign_folder / "r02.csv", "a") as stream:
        stream.write("not,a,number\n")
    campaign = load_campaign(campaign_folder)
    with pytest.raises(InputError, match="line 102"):
        campaign.check_samples()


def test_units_of_a_header_are_converted(campaign_folder):
    path = campaign_folder / "r01.csv"
    before = load_campaign(campaign_folder)["r01.csv"].read()
    text = path.read_text()
    new = "time [ms],force [kN],deflection.joint_1 [deg],accelerometer.tool.x [g]"
    path.write_text(text.replace(text.partition("\n")[0], new))
    after = load_campaign(campaign_folder)["r01.csv"].read()
    factors = {"time": 1e-3, "force": 1e3, "deflection.joint_1": np.pi / 180}
    factors["accelerometer.tool.x"] = 9.80665
    for name, factor in factors.items():
        np.testing.assert_allclose(after[name], before[name] * factor, rtol=1e-15)


@pytest.mark.parametrize("change", ["crlf", "bom", "quotes", "spaces", "blank end", "no line end"])
def test_harmless_differences_read_the_same(campaign_folder, change):
    path = campaign_folder / "r01.csv"
    before = load_campaign(campaign_folder)["r01.csv"].read()
    text = path.read_text()
    lines = text.splitlines()
    path.write_bytes(
        {
            "crlf": text.replace("\n", "\r\n"),
            "bom": "\ufeff" + text,
            "quotes": "\n".join(",".join(f'"{c}"' for c in line.split(",")) for line in lines)
            + "\n",
            "spaces": text.replace(",", " , "),
            "blank end": text + "\n\n",
            "no line end": text.rstrip("\n"),
        }[change].encode()
    )
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        after = load_campaign(campaign_folder)["r01.csv"].read()
    assert bool(caught) == (change == "no line end")
    assert all((after[name] == before[name]).all() for name in before)


def test_a_rounded_clock_passes_and_a_lost_sample_does_not(campaign_folder):
    path = campaign_folder / "r02.csv"
    time = np.arange(300) / 3000.0
    rows = [f"{t:.6f},0.5,1.0" for t in time]
    header = path.read_text().partition("\n")[0]
    path.write_text("\n".join([header, *rows]) + "\n")
    assert load_campaign(campaign_folder)["r02.csv"].clock.rate == pytest.approx(3000.0, rel=1e-4)
    del rows[150]
    path.write_text("\n".join([header, *rows]) + "\n")
    with pytest.raises(InputError, match=r"line 152.* 2 times"):
        load_campaign(campaign_folder)["r02.csv"].read()
    lenient = load_campaign(campaign_folder, clock_tolerance=np.inf)
    assert lenient["r02.csv"].clock.jitter == pytest.approx(1.0, abs=0.01)


def test_a_clock_that_drifts_slowly_is_refused(campaign_folder):
    """Every step is within tolerance of its neighbour, but the rate sinks by 3 % overall."""
    steps = 1e-3 * (1.0 + np.linspace(0.0, 0.03, 5000))
    path = campaign_folder / "r02.csv"
    header = path.read_text().partition("\n")[0]
    rows = [f"{t!r},0.5,1.0" for t in np.cumsum(steps).tolist()]
    path.write_text("\n".join([header, *rows]) + "\n")
    with pytest.raises(InputError, match="departs by"):
        load_campaign(campaign_folder)["r02.csv"].check_samples()


def test_a_robot_beside_the_campaign_is_found_from_anywhere(campaign_folder, tmp_path):
    (tmp_path / "arm.urdf").write_text("<robot name='a'/>")
    file = campaign_folder / "campaign.toml"
    file.write_text(file.read_text().replace('"fanuc_like_3dof"', '"../arm.urdf"'))
    found = load_campaign(file)
    assert os.path.samefile(found.robot, tmp_path / "arm.urdf")


def test_a_motion_record_says_what_it_has_no_use_for(campaign_folder):
    file = campaign_folder / "campaign.toml"
    file.write_text(file.read_text() + "direction = [0.0, 0.0, 1.0]\n")
    with pytest.warns(PicchioWarning, match=r"record\[1\].*direction"):
        load_campaign(campaign_folder)


def test_records_are_made_in_memory_and_only_when_asked():
    calls = []

    def read():
        calls.append(1)
        return {"time": np.arange(5) / 10.0, "torque.slide": np.ones(5)}

    record = Record.from_function(
        "a.csv", ["torque.slide"], read, units={"torque.slide": "N"}, kind="motion"
    )
    campaign = Campaign.from_records([record])
    assert not calls
    assert campaign["a.csv"].channel("torque.slide").unit == "N"
    assert campaign["a.csv"]["torque.slide"].sum() == 5.0
    assert campaign["a.csv"]["torque.slide"].sum() == 5.0
    assert len(calls) == 1
    with pytest.raises(ValueError, match="read-only"):
        next(record.chunks())["torque.slide"][0] = 2.0


def test_arrays_that_do_not_fit_are_refused():
    time = np.arange(4.0)
    with pytest.raises(InputError, match="as many samples"):
        Record.from_arrays("a.csv", time, {"force": np.ones(3)}, kind="motion")
    with pytest.raises(InputError, match=r"force, sample 3.*nan"):
        Record.from_arrays("a.csv", time, {"force": [0, 0, np.nan, 0]}, kind="motion")
    with pytest.raises(InputError, match="one-dimensional"):
        Record.from_arrays("a.csv", time[None], {"force": np.ones((1, 4))}, kind="motion")
    with pytest.raises(InputError, match="unknown channel"):
        Record.from_arrays("a.csv", time, {"forces": np.ones(4)}, kind="motion")
    with pytest.raises(InputError, match="unknown key"):
        Record.from_arrays("a.csv", time, {"force": np.ones(4)}, knd="motion")
