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


def uff(folder, functions, more="", names=(), force="N", system=None):
    """Functions by (response node, direction, reference node, direction, type, numerator, unit)."""
    sets = [
        pyuff.prepare_58(
            id1=f"f{k}", id5=names[k] if names else "NONE", rsp_node=rsp, rsp_dir=rsp_dir,
            ref_node=ref, ref_dir=ref_dir, func_type=kind, x=FREQUENCY,
            data=(k + 1) * VALUES if kind == 4 else np.full(20, 0.8 if k < 3 else 0.6),
            ordinate_spec_data_type=numerator, ordinate_axis_units_lab=unit,
            abscissa_spec_data_type=18, orddenom_spec_data_type=13, orddenom_axis_units_lab=force,
        )
        for k, (rsp, rsp_dir, ref, ref_dir, kind, numerator, unit) in enumerate(functions)
    ]  # fmt: skip
    file = pyuff.UFF(str(folder / "a.uff"))
    if system is not None:
        length, newtons = system
        sets.insert(
            0,
            pyuff.prepare_164(
                units_code=9,
                units_description="own",
                temp_mode=1,
                length=length,
                force=newtons,
                temp=1.0,
                temp_offset=0.0,
            ),
        )
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


@pytest.mark.parametrize(
    ("label", "force", "system", "factor"),
    [
        ("g", "N", None, 9.80665),
        ("g/N", "NONE", None, 9.80665),
        ("g/N", "N", None, 9.80665),  # the label is the whole quotient's
        ("(1/N)*(m/s²)", "NONE", None, 1.0),
        ("in/s^2", "lbf", None, 0.0254 / 4.4482216152605),
        ("mm/s^2", "kN", None, 1e-6),
        ("NONE", "NONE", (1e3, 1.0), 1e-3),  # data set 164: divide by its factors to have SI
        ("NONE", "lbf", (1e3, 1.0), 1e-3 / 4.4482216152605),
        ("g", "NONE", (1e3, 0.2248089), 9.80665 * 0.2248089),
    ],
)  # fmt: skip
def test_units_of_a_universal_file(tmp_path, label, force, system, factor):
    function = (1, 3, 1, 3, 4, 12, label)
    _, columns = record(uff(tmp_path, [function], force=force, system=system))
    np.testing.assert_allclose(columns["imag"], factor * VALUES.imag, rtol=1e-5)


@pytest.mark.parametrize("label", ["V/N", "dB", "mm/s/N", "g*N", "m/s^3/N", "1"])
def test_a_unit_that_is_not_understood_is_refused(tmp_path, label):
    with pytest.raises(picchio.InputError, match=r"a\.uff: .*unit.*; .*valid: m/s\^2"):
        record(uff(tmp_path, [(1, 3, 1, 3, 4, 12, label)]))


def test_a_function_without_a_unit_is_told_once(tmp_path):
    folder = uff(tmp_path, [(1, 3, 1, 3, 4, 12, "NONE")], force="NONE")
    with pytest.warns(picchio.PicchioWarning, match=r"taken to be in m/s\^2/N"):
        _, columns = record(folder)
    np.testing.assert_allclose(columns["real"], VALUES.real, rtol=1e-5)


NOWHERE = [(0, 0, 0, 0, 4, 12, "m/s^2")] * 3
NAMES = ["H1 : # 2 / # 1", "H1 : # 3 / # 1", "Point 4"]


@pytest.mark.parametrize(
    ("asked", "found"),
    [("1", 1), ("3", 3), ('"H1 : # 3 / # 1"', 2), ('"Point 4"', 3), ('"f0"', 1), ('"2"', 2)],
)
def test_functions_without_places_by_name_or_number(tmp_path, asked, found):
    folder = uff(tmp_path, NOWHERE, f"function = {asked}\n", NAMES)
    np.testing.assert_allclose(record(folder)[1]["real"], found * VALUES.real, rtol=1e-5)


def test_coherences_of_functions_without_places_come_in_their_order(tmp_path):
    both = [*NOWHERE[:2], *[(0, 0, 0, 0, 6, 0, "NONE")] * 2]
    (tmp_path / "two").mkdir()
    _, columns = record(uff(tmp_path / "two", both, "function = 2\n"))
    np.testing.assert_allclose(columns["coherence"], 0.6, rtol=1e-5)
    (tmp_path / "one").mkdir()
    folder = uff(tmp_path / "one", both[:3], "function = 2\n")
    with pytest.warns(picchio.PicchioWarning, match="coherences are left out"):
        assert "coherence" not in record(folder)[1]


@pytest.mark.parametrize(
    ("functions", "more", "words"),
    [
        ([(12, 3, 1, 3, 4, 12, ""), (12, 1, 1, 3, 4, 12, "")], "", "2 functions: which.*1: f0"),
        (NOWHERE, "function = 4", "no such function.*3: f2 0 by 0"),
        (NOWHERE, 'function = "x"', "no such function"),
        ([(12, 3, 1, 3, 4, 12, "")], 'response = "9+X"', r"no such function.*12\+Z by 1\+Z"),
        ([(12, 3, 1, 3, 4, 11, "")], "", "another quantity.*mobility"),
        ([(12, 3, 1, 3, 6, 0, "")], "", "no function of type 4"),
    ],
)
def test_which_function(tmp_path, functions, more, words):
    with pytest.raises(picchio.InputError, match=words):
        record(uff(tmp_path, functions, more))


@pytest.mark.parametrize(
    ("unit", "quantity", "factor"),
    [("g/N", "accelerance", 9.80665), ("in/s/lbf", "mobility", 0.0254 / 4.4482216152605),
     ("µm/N", "receptance", 1e-6)],
)  # fmt: skip
def test_units_of_a_table(tmp_path, unit, quantity, factor):
    more = f'quantity = "{quantity}"\n'
    head = f"frequency [Hz],real [{unit}],imag [{unit}],coherence"
    _, columns = record(csv(tmp_path, more, head))
    np.testing.assert_allclose(columns["real"], factor * VALUES.real, rtol=1e-12)
    with pytest.raises(picchio.InputError, match="both parts must be in the unit"):
        record(csv(tmp_path, more, f"frequency [Hz],real [{unit}],imag,coherence"))
    with pytest.raises(picchio.InputError, match=r"channel real, imag: .*valid: a multiple of"):
        other = "mobility" if quantity != "mobility" else "accelerance"
        record(csv(tmp_path, f'quantity = "{other}"\n', head))


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
