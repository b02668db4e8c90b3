"""Bytes changed at random: an InputError or a sound campaign, never another exception."""

import contextlib
import importlib
import shutil
import warnings

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from picchio.campaign.campaign import load_campaign
from picchio.core.errors import InputError

from .conftest import write_good

BITS = (b"\n", b",", b"[", b"]", b'"', b"=", b"nan", b"-", b"e", b".", b" ", b"\x00", b"\xff",
        b"9" * 30, b"#", b"{", b"[[record]]", b"inf", b"\r")  # fmt: skip
changes = st.lists(
    st.tuples(st.floats(0, 1), st.sampled_from(BITS), st.integers(0, 3)), min_size=1, max_size=4
)


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    return write_good(tmp_path_factory.mktemp("fuzz") / "good")


@pytest.mark.parametrize("name", ["campaign.toml", "r01.csv"])
@settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))
@given(changes=changes)
def test_random_damage(good, tmp_path_factory, name, changes):
    folder = tmp_path_factory.mktemp("x") / "c"
    shutil.copytree(good, folder)
    data = (folder / name).read_bytes()
    for place, put, take in changes:
        at = int(place * len(data))
        data = data[:at] + put + data[at + take :]
    (folder / name).write_bytes(data)
    with warnings.catch_warnings(), contextlib.suppress(InputError):
        warnings.simplefilter("ignore")
        for record in load_campaign(folder):
            clock = record.check_samples()
            read = record.read()
            assert all(np.isfinite(values).all() for values in read.values())
            assert all(values.size == clock.samples for values in read.values())
    shutil.rmtree(folder.parent)


@pytest.mark.parametrize(
    ("module", "ending", "words"),
    [
        ("pyarrow", ".parquet", "pyarrow.*picchio\\[parquet\\]"),
        ("pyuff", ".uff", "pyuff.*picchio\\[import\\]"),
        ("mcap", ".mcap", "mcap.*picchio\\[import\\]"),
    ],
)
def test_an_extra_that_is_not_installed_is_named(tmp_path, monkeypatch, module, ending, words):
    import sys

    for name in [n for n in sys.modules if n.partition(".")[0] == module]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, module, None)
    if module == "pyarrow":
        folder = write_good(tmp_path / "c")
        (folder / "r01.csv").rename(folder / "r01.parquet")
        text = (folder / "campaign.toml").read_text().replace("r01.csv", "r01.parquet")
        (folder / "campaign.toml").write_text(text)
        with pytest.raises(InputError, match=words):
            load_campaign(folder)
        return
    path = tmp_path / f"a{ending}"
    path.write_bytes(b"x")
    reader = importlib.import_module(f"picchio.campaign.importing.read_{ending[1:]}")
    with pytest.raises(InputError, match=words):  # in a process of its own the module is there
        reader.read(path, {})
