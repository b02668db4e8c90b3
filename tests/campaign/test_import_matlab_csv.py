"""MATLAB and CSV files into records, and every bad mapping."""

import numpy as np
import pandas
import pytest

from picchio.campaign.importing import isolated
from picchio.campaign.importing.importer import read_mapped, read_raw
from picchio.campaign.importing.mapping import read_mapping
from picchio.campaign.importing.template import mapping_template
from picchio.core.errors import InputError

from .conftest import MAPPING_RECORD as RECORD
from .conftest import mapped


def test_matlab(tmp_path, signals):
    from scipy.io import savemat

    time, values = signals
    path = tmp_path / "run.mat"
    content = {"t": time[:, None], "rec": {"deg": values, "motor": values.T * 2}, "rate": 2048.0}
    savemat(path, content)
    raw = read_raw(path)
    expected = ["t", "rec.deg(1)", "rec.deg(2)", "rec.motor(1)", "rec.motor(2)"]
    assert sorted(raw.channels) == sorted(expected)
    text = """[time]
series = "t"
[[channel]]
from = "rec.deg(2)"
to = "deflection.joint_1"
unit = "mdeg"
offset = 1.0
scale = 2.0
[[channel]]
from = "rec.motor(1)"
to = "force"
"""
    record = read_mapped(path, mapped(tmp_path, text + RECORD)).records[0]
    expected = np.deg2rad((2 * values[1] + 1) * 1e-3)
    np.testing.assert_allclose(record["deflection.joint_1"], expected, rtol=1e-14)
    assert (record["force"] == values[0] * 2).all()
    assert (record.time == time).all()


CSV = "Messung 7\nZeit;Kraft;Weg;Text\n" + "".join(
    f"{i / 10:.1f};{i * 0.5:.2f};{i * i};ok\n".replace(".", ",") for i in range(20)
)
CSV_LAYOUT = """[source]
delimiter = ";"
decimal = ","
skip_lines = 1
[time]
series = "Zeit"
unit = "ms"
zero = 0.0005
[[channel]]
from = "Kraft"
to = "force"
unit = "kN"
[[channel]]
from = "Weg"
to = "displacement.tool.x"
unit = "um"
remove = "quiet"
"""


def test_csv_with_german_decimals(tmp_path):
    path = tmp_path / "messung.csv"
    path.write_text(CSV)
    read = read_mapped(path, mapped(tmp_path, CSV_LAYOUT + RECORD)).records[0].read()
    steps = np.arange(20)
    np.testing.assert_allclose(read["time"], steps * 1e-4 - 5e-4, atol=1e-18)
    np.testing.assert_allclose(read["force"], steps * 500.0)
    quiet = np.mean(steps[:5] ** 2)
    np.testing.assert_allclose(read["displacement.tool.x"], (steps**2 - quiet) * 1e-6, atol=1e-18)


def test_a_rate_makes_the_clock_and_numbers_name_columns(tmp_path):
    path = tmp_path / "bare.txt"
    path.write_text("1,10\n2,20\n3,30\n")
    text = "[source]\nheader = false\n[time]\nrate = 4.0\nzero = 0.25\n"
    text += '[[channel]]\nfrom = "2"\nto = "force"\n'
    record = read_mapped(path, mapped(tmp_path, text + RECORD)).records[0]
    assert record.file == "bare.csv"
    assert record.time.tolist() == [-0.25, 0.0, 0.25]
    assert record["force"].tolist() == [10.0, 20.0, 30.0]


def test_a_contract_csv_goes_through_unchanged(campaign, tmp_path):
    source = campaign.folder / "r01.csv"
    names = campaign["r01.csv"].channels
    text = '[time]\nseries = "time [s]"\n'
    for name in names:
        header = campaign["r01.csv"].channel(name).header
        text += f'[[channel]]\nfrom = "{header}"\nto = "{name}"\n'
    imported = read_mapped(source, mapped(tmp_path, text + RECORD)).save(tmp_path / "c")
    assert (imported.folder / "r01.csv").read_bytes() == source.read_bytes()


BAD = {
    "an unknown series": (
        CSV_LAYOUT.replace('"Kraft"', '"Krft"'),
        ["Krft", "did you mean", "Kraft"],
    ),
    "an unknown channel": (CSV_LAYOUT.replace('"force"', '"farce"'), ["farce", "force"]),
    "a wrong unit": (CSV_LAYOUT.replace('"kN"', '"kg"'), ["Kraft -> force", "kg"]),
    "a wrong time unit": (CSV_LAYOUT.replace('"ms"', '"mm"'), ["time.unit", "mm"]),
    "no such time": (CSV_LAYOUT.replace('"Zeit"', '"Zeiten"'), ["time.series", "Zeit"]),
    "one channel twice": (CSV_LAYOUT.replace("displacement.tool.x", "force"), ["force"]),
    "text for numbers": (CSV_LAYOUT.replace('"Weg"', '"Text"'), ["Text", "text", "ok"]),
    "a key misspelt": (CSV_LAYOUT.replace("scale", "x").replace("remove", "remov"), ["remov"]),
    "a wrong sign": (CSV_LAYOUT.replace("remove = ", "sign = 2\nremove = "), ["sign"]),
    "no quiet time": (CSV_LAYOUT.replace("zero = 0.0005", ""), ["before zero"]),
    "an unknown kind of file": (
        CSV_LAYOUT.replace("[source]", '[source]\nkind = "xls"'),
        ["source.kind", "csv"],
    ),
    "the wrong decimal mark": (CSV_LAYOUT.replace('decimal = ","', ""), ["Zeit", "text", "0,0"]),
    "the time as a channel": (CSV_LAYOUT.replace('"force"', '"time"').replace("kN", "s"), ["time"]),
    "an odd record key": (CSV_LAYOUT + "[record]\npoze = 1\n", ["poze", "pose"]),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_mapping_is_refused_in_one_line(tmp_path, name):
    text, words = BAD[name]
    path = tmp_path / "messung.csv"
    path.write_text(CSV)
    with pytest.raises(InputError) as caught:
        read_mapped(path, mapped(tmp_path, text if "[record]" in text else text + RECORD))
    assert "\n" not in str(caught.value)
    for word in words:
        assert word in str(caught.value), str(caught.value)


def test_a_file_of_which_no_series_is_named_as_a_time(tmp_path):
    path = tmp_path / "messung.csv"
    path.write_text(CSV.replace("Zeit", "Nr"))
    with pytest.raises(InputError, match=r"messung\.csv.*no clock.*series.*rate"):
        read_mapped(path, mapped(tmp_path, CSV_LAYOUT.replace('series = "Zeit"', "") + RECORD))


@pytest.mark.parametrize("ending", [".uff", ".unv", ".mat", ".mcap", ".csv"])
@pytest.mark.parametrize("content", [b"", b"\x00" * 300, b"MATLAB 5.0 MAT-file, but no\n" * 20])
def test_files_that_are_none_of_their_kind(tmp_path, ending, content):
    path = tmp_path / f"bad{ending}"
    path.write_bytes(content)
    text = '[time]\nrate = 1.0\n[[channel]]\nfrom = "a"\nto = "force"\n'
    with pytest.raises(InputError) as caught:
        read_mapped(path, mapped(tmp_path, text + RECORD))
    assert f"bad{ending}" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_mat_file_that_kills_its_reader(tmp_path, signals, monkeypatch):
    """scipy's reader dies of a bus error on some damaged files, not on all systems alike."""
    from scipy.io import savemat

    path = tmp_path / "run.mat"
    savemat(path, {"t": signals[0], "rec": {"x": signals[1]}})
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match=r"run\.mat.*\.mat file"):
        read_raw(path)
    path.write_bytes(whole)
    die = "import os, signal; os.kill(os.getpid(), signal.SIGBUS)"
    monkeypatch.setattr(isolated, "_CHILD", die)
    with pytest.raises(InputError, match=r"run\.mat.*reader crashed"):
        read_raw(path)


def test_tables_structs_and_version_7_3(tmp_path, signals):
    """As MATLAB writes them: `table` is an object of its own, 7.3 is HDF5."""
    matio = pytest.importorskip("matio")
    time, values = signals
    frame = pandas.DataFrame({"t": time, "F": values[0], "who": ["a"] * time.size})
    for version in ("v7", "v7.3"):
        path = tmp_path / f"{version}.mat"
        matio.save_to_mat(path, {"T": frame, "s": {"x": values[1][None]}, "fs": np.array([[2.0]])},
                          version=version)  # fmt: skip
        raw = read_raw(path)
        assert (raw.channels["T.F"].values == values[0]).all()
        assert (raw.channels["T.t"].values == time).all()
        assert (raw.channels["s.x"].values == values[1]).all()
        assert raw.scalars == {"fs": 2.0}
        assert raw.texts["T.who"][0] == "a"


def test_a_template_lists_every_series_and_reads_back(tmp_path, signals):
    from scipy.io import savemat

    path = tmp_path / "run.mat"
    savemat(path, {"t": signals[0], 'a"b': signals[1][0], "x": signals[1]})
    text = mapping_template(read_raw(path))
    for name in ("t", "x(1)", "x(2)"):
        assert f'# from = "{name}"' in text
    filled = text.replace('# [[channel]]\n# from = "x(1)"\n# to = "..."\n# unit = "..."',
                          '[[channel]]\nfrom = "x(1)"\nto = "force"\nunit = "N"')  # fmt: skip
    assert filled != text
    target = tmp_path / "m.toml"
    target.write_text(filled.replace('kind = "percussion"', 'kind = "motion"'))
    record = read_mapped(path, read_mapping(target)).records[0]
    assert (record["force"] == signals[1][0]).all()
