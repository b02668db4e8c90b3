"""What is not installed is named, with the extra that brings it."""

import importlib

import pytest

from picchio.campaign.campaign import load_campaign
from picchio.core.errors import InputError

from .conftest import write_good


@pytest.mark.parametrize(
    ("module", "ending", "words"),
    [
        ("pyarrow", ".parquet", "pyarrow.*picchio\\[parquet\\]"),
        ("pyuff", ".uff", "pyuff.*picchio\\[import\\]"),
        ("mcap", ".mcap", "mcap.*picchio\\[import\\]"),
        ("rosbags", ".bag", "rosbags.*picchio\\[import\\]"),
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
    reader = importlib.import_module(f"picchio.campaign.importing.readers.read_{ending[1:]}")
    with pytest.raises(InputError, match=words):  # in a process of its own the module is there
        reader.read(path, {})
