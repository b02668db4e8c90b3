"""Writing: bit for bit, whole or not at all, whatever goes wrong."""

import os

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from picchio.campaign import campaign as write_module
from picchio.campaign.campaign import Campaign, load_campaign
from picchio.campaign.record import Record
from picchio.core.errors import InputError, OutputError

finite = st.floats(allow_nan=False, allow_infinity=False, width=64)


def motion(file="a.csv", samples=20, **channels):
    time = np.arange(samples) / 1000.0
    given = channels or {"position.joint_1": np.linspace(0.0, 1.0, samples)}
    return Record.from_arrays(file, time, given, kind="motion")


@settings(max_examples=30, deadline=None)
@given(values=arrays(np.float64, 6, elements=finite), suffix=st.sampled_from([".csv", ".parquet"]))
def test_every_float_comes_back_bit_for_bit(tmp_path_factory, values, suffix):
    folder = tmp_path_factory.mktemp("w") / "c"
    record = motion(samples=6, **{"torque.joint_1": values})
    back = Campaign.from_records([record]).save(folder, suffix=suffix)
    found = back.records[0]["torque.joint_1"]
    assert found.tobytes() == values.tobytes()


def test_a_copy_says_the_same(campaign, tmp_path):
    for suffix in (".parquet", ".csv"):
        copy = campaign.save(tmp_path / f"copy{suffix[1:]}", suffix=suffix)
        assert copy.table.model_dump(exclude={"record"}) == campaign.table.model_dump(
            exclude={"record"}
        )
        for old, new in zip(campaign.records, copy.records, strict=True):
            assert new.file == old.file.split(".")[0] + suffix
            assert new.table.model_dump(exclude={"file"}) == old.table.model_dump(exclude={"file"})
            a, b = old.read(), new.read()
            assert list(a) == list(b)
            assert all(a[name].tobytes() == b[name].tobytes() for name in a)
        campaign = copy


def test_parquet_units_types_and_empty_values(tmp_path, campaign, monkeypatch):
    import pyarrow as pa
    import pyarrow.parquet as pq

    folder = campaign.save(tmp_path / "p", suffix=".parquet").folder
    time = np.arange(50) / 50.0

    def write(**columns):
        pq.write_table(pa.table(columns), folder / "r02.parquet")

    write(**{"time [ms]": time * 1e3, "position.joint_1 [deg]": pa.array(range(50), pa.int16())})
    found = load_campaign(folder)["r02.parquet"]
    assert found.clock.rate == pytest.approx(50.0)
    np.testing.assert_allclose(found["position.joint_1"], np.deg2rad(np.arange(50)))
    broken = {
        "row 4.*missing": pa.array([None if i == 3 else 1.0 for i in range(50)]),
        "row 5.*nan": pa.array([float("nan") if i == 4 else 1.0 for i in range(50)]),
        "column of numbers": pa.array(["x"] * 50),
    }
    for message, column in broken.items():
        write(**{"time [s]": time, "position.joint_1 [rad]": column})
        with pytest.raises(
            InputError, match=rf"r02\.parquet.*position\.joint_1.*{message}|{message}"
        ):
            load_campaign(folder).check_samples()
    write(**{"time [s]": time, "position.joint_1 [rad]": time})
    monkeypatch.setattr("picchio.campaign.parquet_source.memory_size", lambda: 1000.0)
    with pytest.raises(InputError, match=r"r01\.parquet.*row 1: its row group needs"):
        load_campaign(folder).check_samples()
    monkeypatch.undo()
    (folder / "r02.parquet").write_bytes(b"time [s]\n0\n")
    with pytest.raises(InputError, match=r"r02\.parquet.*Parquet"):
        load_campaign(folder)
    whole = (folder / "r01.parquet").read_bytes()
    (folder / "r01.parquet").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match=r"r01\.parquet.*Parquet"):
        load_campaign(folder)


def test_a_failure_half_way_leaves_nothing(tmp_path):
    def read():
        raise InputError("the sensor burnt")

    records = [motion("a.csv"), Record.from_function("b.csv", ["force"], read, kind="motion")]
    with pytest.raises(InputError, match="burnt"):
        Campaign.from_records(records).save(tmp_path / "c")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("failing", ["write_csv", "_toml", "load_campaign", "swap_in"])
def test_an_interrupt_anywhere_leaves_the_old_campaign(tmp_path, monkeypatch, failing):
    old = Campaign.from_records([motion("old.csv")]).save(tmp_path / "c")
    before = {p.name: p.read_bytes() for p in old.folder.iterdir()}

    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(write_module, failing, interrupt)
    with pytest.raises(KeyboardInterrupt):
        Campaign.from_records([motion("new.csv")]).save(tmp_path / "c", overwrite=True)
    assert [p.name for p in tmp_path.iterdir()] == ["c"]
    assert {p.name: p.read_bytes() for p in old.folder.iterdir()} == before


def test_a_rename_that_fails_puts_the_old_one_back(tmp_path, monkeypatch):
    Campaign.from_records([motion("old.csv")]).save(tmp_path / "c")
    replace = os.replace

    def second_fails(source, target):
        if ".part" in str(source):
            raise OSError(28, "No space left on device")
        replace(source, target)

    monkeypatch.setattr(os, "replace", second_fails)
    with pytest.raises(OutputError, match="No space"):
        Campaign.from_records([motion("new.csv")]).save(tmp_path / "c", overwrite=True)
    assert [p.name for p in tmp_path.iterdir()] == ["c"]
    assert load_campaign(tmp_path / "c").records[0].file == "old.csv"


def test_what_stands_there_is_respected(tmp_path):
    campaign = Campaign.from_records([motion()])
    campaign.save(tmp_path / "c")
    with pytest.raises(InputError, match="exists here already"):
        campaign.save(tmp_path / "c")
    campaign.save(tmp_path / "c", overwrite=True)
    precious = tmp_path / "home"
    precious.mkdir()
    (precious / "thesis.tex").write_text("x")
    with pytest.raises(InputError, match="is not replaced"):
        campaign.save(precious, overwrite=True)
    assert (precious / "thesis.tex").read_text() == "x"
    (tmp_path / "empty").mkdir()
    assert len(campaign.save(tmp_path / "empty")) == 1
    for target, message in (
        (tmp_path / "none" / "c", "no such folder"),
        (precious / "thesis.tex", "is a file"),
    ):
        with pytest.raises(InputError, match=message):
            campaign.save(target)


def test_a_campaign_may_be_rewritten_over_itself(campaign_folder):
    before = load_campaign(campaign_folder)["r01.csv"].read()
    load_campaign(campaign_folder).save(campaign_folder, overwrite=True)
    after = load_campaign(campaign_folder)["r01.csv"].read()
    assert all((before[name] == after[name]).all() for name in before)


def test_two_records_may_not_get_one_name(tmp_path):
    campaign = Campaign.from_records([motion("a.csv"), motion("a.parquet")])
    with pytest.raises(InputError, match=r"a\.csv"):
        campaign.save(tmp_path / "c", suffix=".csv")
    assert list(tmp_path.iterdir()) == []


def test_a_urdf_and_a_blow_file_move_with_the_campaign(campaign_folder, tmp_path):
    (tmp_path / "arm.urdf").write_text("<robot name='a'/>")
    (campaign_folder / "blow.csv").write_text("time [s],force [N]\n0,0\n0.002,400\n0.004,0\n")
    file = campaign_folder / "campaign.toml"
    text = file.read_text().replace('"fanuc_like_3dof"', '"../arm.urdf"')
    text = text.replace(
        'kind = "pulse_train"\nforce = 300.0', 'kind = "measured"\nfile = "blow.csv"'
    )
    file.write_text(text.replace("width = 0.004\n", "").replace("force = 250.0\n", ""))
    (tmp_path / "far").mkdir()
    copy = load_campaign(campaign_folder).save(tmp_path / "far" / "copy")
    assert copy.table.robot == "../../arm.urdf"
    assert os.path.samefile(copy.robot, tmp_path / "arm.urdf")
    assert copy["r01.csv"].blows().peak_force == 400.0
