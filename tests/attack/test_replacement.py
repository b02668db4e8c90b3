"""A campaign or a map is replaced: whatever stops it, wherever, the old or the new one is whole."""

import multiprocessing
import os
import warnings

import numpy as np
import pytest

import picchio
from picchio.campaign.campaign import Campaign, load_campaign
from picchio.campaign.record import Record
from picchio.core import files
from picchio.core.errors import PicchioWarning

DIED = 77


def campaign(name):
    time = np.arange(20) / 100.0
    return Campaign.from_records(
        [Record.from_arrays(name, time, {"position.joint_1": np.sin(time)}, kind="motion")]
    )


def dies_at(call, exchange, folder):
    """Replace the campaign in another process, which is gone at its `call`-th rename."""

    def child():
        count = 0
        rename = os.replace

        def counted(*names):
            nonlocal count
            count += 1
            if count == call:
                os._exit(DIED)
            rename(*names)

        os.replace = counted
        if not exchange:  # a disk that cannot exchange two names
            files._exchange = lambda *_: False
        campaign("new.csv").save(folder, overwrite=True)
        os._exit(0)

    process = multiprocessing.get_context("fork").Process(target=child)
    process.start()
    process.join()
    return process.exitcode


@pytest.mark.parametrize("exchange", [True, False])
def test_a_kill_at_any_rename_leaves_one_whole(tmp_path, exchange):
    folder = tmp_path / "c"
    outcomes = []
    for call in range(1, 9):
        campaign("old.csv").save(folder, overwrite=folder.exists())
        died = dies_at(call, exchange, folder)
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            found = load_campaign(folder)
        assert found.records[0].file in ("old.csv", "new.csv")
        assert len(found.records[0].read(["position.joint_1"])["position.joint_1"]) == 20
        outcomes.append((died, any("interrupted" in str(w.message) for w in said)))
        if died == 0:
            break
    assert outcomes[-1] == (0, False)
    # Where two names cannot be exchanged there is a gap; who falls into it is told.
    assert any(told for _, told in outcomes) == (not exchange)
    assert len(outcomes) == (2 if exchange else 5)


def test_between_two_names_there_is_no_gap(tmp_path):
    """The folder is read all the while it is replaced again and again."""
    folder = tmp_path / "c"
    campaign("old.csv").save(folder)
    stop = multiprocessing.get_context("fork").Event()

    def child():
        while not stop.is_set():
            campaign("new.csv").save(folder, overwrite=True)

    process = multiprocessing.get_context("fork").Process(target=child)
    process.start()
    try:
        missing = sum(not (folder / "campaign.toml").is_file() for _ in range(20_000))
    finally:
        stop.set()
        process.join()
    assert missing == 0


def test_a_map_is_replaced_whole(tmp_path):
    old, new = tmp_path / "m.zarr", tmp_path / ".m.zarr.part"
    for folder, text in ((old, "old"), (new, "new")):
        folder.mkdir()
        (folder / "zarr.json").write_text(text)
    files.swap_in(new, old)
    assert (old / "zarr.json").read_text() == "new"
    assert os.listdir(tmp_path) == ["m.zarr"]
    file = tmp_path / "m.nc"
    file.write_text("new")
    files.swap_in(file, old)  # a file where a folder was
    assert old.read_text() == "new" and os.listdir(tmp_path) == ["m.zarr"]
    new.mkdir()
    (new / "zarr.json").write_text("newest")
    files.swap_in(new, old)  # and a folder where a file was
    assert (old / "zarr.json").read_text() == "newest" and os.listdir(tmp_path) == ["m.zarr"]


def test_a_campaign_that_is_gone_is_said_to_be(tmp_path):
    with pytest.raises(picchio.InputError, match="no such campaign"):
        load_campaign(tmp_path / "c")
    aside = tmp_path / ".c.x1.old"
    campaign("old.csv").save(tmp_path / "c")
    aside.mkdir()
    os.replace(tmp_path / "c", aside / "c")
    with pytest.warns(PicchioWarning, match=r"interrupted; the campaign from before"):
        assert load_campaign(tmp_path / "c").records[0].file == "old.csv"
    assert os.listdir(tmp_path) == ["c"]
