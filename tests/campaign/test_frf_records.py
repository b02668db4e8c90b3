"""Frequency response functions as records: CSV and universal files, and what is refused."""

import numpy as np
import pytest
import pyuff

import picchio
from picchio.campaign.campaign import load_campaign

FREQUENCY = np.linspace(2.0, 40.0, 20)
VALUES = (0.01 + 0.002j) * FREQUENCY
HEAD = """format = "picchio-campaign/1"
robot = "fanuc_like_3dof"
[[record]]
file = "{file}"
kind = "frf"
pose = {{ joint_2 = 0.5 }}
force_direction = [0, 0, 1]
response_direction = [0, 0, 1]
"""


def table(folder, file, more=""):
    (folder / "campaign.toml").write_text(HEAD.format(file=file) + more)
    return folder


def csv(folder, more="", header="frequency [Hz],real,imag,coherence", coherence=0.9):
    rows = [f"{f!r},{v.real!r},{v.imag!r},{coherence}"
            for f, v in zip(FREQUENCY.tolist(), VALUES.tolist(), strict=True)]  # fmt: skip
    (folder / "a.csv").write_text("\n".join([header, *rows]) + "\n")
    return table(folder, "a.csv", more)


def uff(folder, functions, more=""):
    """Functions by (response node, direction, reference node, direction, type, numerator)."""
    sets = [
        pyuff.prepare_58(
            id1=f"f{k}", rsp_node=rsp, rsp_dir=rsp_dir, ref_node=ref, ref_dir=ref_dir,
            func_type=kind, x=FREQUENCY, data=VALUES if kind == 4 else np.full(20, 0.8),
            ordinate_spec_data_type=numerator, ordinate_axis_units_lab=unit,
            abscissa_spec_data_type=18, orddenom_spec_data_type=13, orddenom_axis_units_lab="N",
        )
        for k, (rsp, rsp_dir, ref, ref_dir, kind, numerator, unit) in enumerate(functions)
    ]  # fmt: skip
    file = pyuff.UFF(str(folder / "a.uff"))
    for one in sets:
        file.write_sets(one, mode="add")
    return table(folder, "a.uff", more)


def record(folder):
    (one,) = load_campaign(folder)
    return one, one.read()


def test_a_table(tmp_path):
    one, columns = record(csv(tmp_path))
    assert not one.in_time and one.direction is None and one.blows() is None
    np.testing.assert_allclose(columns["frequency"], FREQUENCY)
    np.testing.assert_allclose(columns["real"] + 1j * columns["imag"], VALUES)
    assert (columns["coherence"] == 0.9).all()


def test_a_universal_file_and_its_coherence(tmp_path):
    functions = [(12, 3, 1, -3, 4, 12, "m/s^2"), (12, 3, 1, -3, 6, 0, ""),
                 (12, 1, 1, -3, 4, 12, "m/s^2")]  # fmt: skip
    folder = uff(tmp_path, functions, 'response = "12+Z"\nreference = "1-Z"\n')
    _, columns = record(folder)
    np.testing.assert_allclose(columns["real"] + 1j * columns["imag"], VALUES, rtol=1e-5)
    np.testing.assert_allclose(columns["coherence"], 0.8, rtol=1e-5)
    saved = load_campaign(folder).save(tmp_path / "saved")
    _, again = record(saved.folder)
    np.testing.assert_array_equal(again["real"], columns["real"])


def test_units_of_a_universal_file(tmp_path):
    _, columns = record(uff(tmp_path, [(1, 3, 1, 3, 4, 12, "g")]))
    np.testing.assert_allclose(columns["real"], 9.80665 * VALUES.real, rtol=1e-5)


@pytest.mark.parametrize(
    ("functions", "more", "words"),
    [
        ([(12, 3, 1, 3, 4, 12, ""), (12, 1, 1, 3, 4, 12, "")], "", "2 functions: which"),
        ([(12, 3, 1, 3, 4, 12, "")], 'response = "9+X"', r"no such function.*12\+Z by 1\+Z"),
        ([(12, 3, 1, 3, 4, 11, "")], "", "another quantity.*mobility"),
        ([(12, 3, 1, 3, 6, 0, "")], "", "no function of type 4"),
    ],
)
def test_which_function(tmp_path, functions, more, words):
    with pytest.raises(picchio.InputError, match=words):
        record(uff(tmp_path, functions, more))


def test_what_is_refused(tmp_path):
    with pytest.raises(picchio.InputError, match=r"first column must be 'frequency \[Hz\]'"):
        record(csv(tmp_path, header="real,frequency [Hz],imag,coherence"))
    with pytest.raises(picchio.InputError, match="no such column"):
        (tmp_path / "a.csv").write_text("frequency [Hz],real\n1,2\n2,3\n")
        record(table(tmp_path, "a.csv"))
    csv(tmp_path)
    text = (tmp_path / "campaign.toml").read_text()
    (tmp_path / "campaign.toml").write_text(text.replace("force_direction = [0, 0, 1]\n", ""))
    with pytest.raises(picchio.InputError, match=r"record\[0\]\.force_direction"):
        record(tmp_path)
    (tmp_path / "campaign.toml").write_text(text.replace('kind = "frf"', 'kind = "static"'))
    with pytest.raises(picchio.InputError):
        record(tmp_path)
    (tmp_path / "a.uff").write_text("no universal file")
    with pytest.raises(picchio.InputError, match=r"a\.uff"):
        record(table(tmp_path, "a.uff"))
