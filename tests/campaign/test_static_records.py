"""Static records: what is read of a table of loadings, and what is refused."""

import numpy as np
import pytest

import picchio
from picchio.campaign.campaign import load_campaign
from picchio.campaign.loadings import read_loadings

TABLE = {
    "pose.joint_1 [deg]": [10.0, 20.0], "pose.joint_2 [rad]": [0.5, 0.6],
    "pose.joint_3 [rad]": [-0.8, -0.7], "force.x [N]": [100.0, 0.0], "force.z [kN]": [0.0, -0.2],
    "dial [mm]": [0.4, -0.5], "dial_direction.x": [2.0, 0.0], "dial_direction.z": [0.0, 3.0],
    "set": [1, 1],
}  # fmt: skip
HEAD = 'format = "picchio-campaign/1"\nrobot = "fanuc_like_3dof"\n[[record]]\nfile = "loads.csv"\n'


def write(folder, table=TABLE, more="", kind='kind = "static"\n', drop=(), **changed):
    columns = {k: v for k, v in {**table, **changed}.items() if k not in drop}
    rows = zip(*columns.values(), strict=True)
    lines = [",".join(columns), *(",".join(str(x) for x in row) for row in rows)]
    (folder / "loads.csv").write_text("\n".join(lines) + "\n")
    (folder / "campaign.toml").write_text(HEAD + kind + more)
    return folder


def loadings(folder):
    (record,) = load_campaign(folder)
    return read_loadings(record)


def test_what_a_table_says(tmp_path):
    found = loadings(write(tmp_path))
    assert len(found) == 2 and found.weight is None and found.point is None
    np.testing.assert_allclose(found.pose["joint_1"], np.radians([10.0, 20.0]))
    np.testing.assert_allclose(found.force, [[100.0, 0.0, 0.0], [0.0, 0.0, -200.0]])
    (dial,) = found.readings
    assert dial.name == "dial" and dial.frame is None and dial.point is None
    np.testing.assert_allclose(dial.values[:, 0], [4e-4, -5e-4])
    np.testing.assert_allclose(dial.axes[:, 0], [[1, 0, 0], [0, 0, 1]])
    np.testing.assert_allclose(found.set, [1, 1])


@pytest.mark.parametrize(
    ("encoding", "sep", "decimal", "units"),
    [
        ("cp1252", ";", ",", False),
        ("utf-16", "\t", ",", False),
        ("utf-8-sig", ";", ".", False),
        ("cp1252", ",", ".", False),
        ("utf-8", ";", ",", True),
    ],
)
def test_a_table_from_a_spreadsheet(tmp_path, encoding, sep, decimal, units):
    """The same loadings in other letters, separators, signs, and with a line of units."""
    table = {name.replace("deg", "°"): cells for name, cells in TABLE.items()}
    plain = loadings(write(tmp_path, table))
    lines = [list(table), *(list(map(str, row)) for row in zip(*table.values(), strict=True))]
    if units:
        parts = [name.rstrip("]").partition(" [") for name in lines[0]]
        lines[:1] = [[part[0] for part in parts], [part[2] for part in parts]]
    body = [[cell.replace(".", decimal) if k > units else cell for cell in line]
            for k, line in enumerate(lines)]  # fmt: skip
    text = "\r\n".join(sep.join(line) for line in body) + "\r\n"
    (tmp_path / "loads.csv").write_text(text, encoding=encoding, newline="")
    found = loadings(tmp_path)
    for name, values in plain.pose.items():
        np.testing.assert_array_equal(found.pose[name], values)
    np.testing.assert_array_equal(found.force, plain.force)
    np.testing.assert_array_equal(found.readings[0].values, plain.readings[0].values)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("pose.joint_1 [deg];weight [N];dial [mm]\n1,5;100;\n2,5;90;0,1\n", "dial.*line 2"),
        (
            "pose.joint_1 [deg];weight [N];dial [mm]\n1,5;100;0,2\n2,5;90;0,1\n3;9\n4;8;1\n",
            "line 4.*3 c",
        ),
        ("pose.joint_1 [Grad];weight [N];dial [mm]\n1,5;100;0,2\n", "pose.joint_1.*'Grad'.*deg"),
        ("1;100;2\n2;90;1\n", "name the columns"),
    ],
)
def test_a_table_from_a_spreadsheet_that_is_refused(tmp_path, text, words):
    write(tmp_path)
    (tmp_path / "loads.csv").write_text(text)
    with pytest.raises(picchio.InputError, match=words):
        loadings(tmp_path)


def test_displacements_weights_points_and_deflections(tmp_path):
    table = {
        "pose.joint_2 [rad]": [0.5], "weight [N]": [50.0], "point.z [m]": [0.1],
        "displacement.tool.x [mm]": [0.1], "displacement.tool.z [mm]": [-0.3],
        "deflection.joint_2 [mrad]": [0.2],
    }  # fmt: skip
    found = loadings(write(tmp_path, table, "pose = { joint_1 = 0.3 }\n"))
    assert found.force is None and found.weight == [50.0]
    assert {k: float(v[0]) for k, v in found.pose.items()} == {"joint_1": 0.3, "joint_2": 0.5}
    place, turn = found.readings
    np.testing.assert_allclose(place.values, [[1e-4, -3e-4]])
    np.testing.assert_allclose(place.axes, [[[1, 0, 0], [0, 0, 1]]])
    assert place.frame == "tool" and turn.joint == "joint_2"
    np.testing.assert_allclose(turn.values, [[2e-4]])


def test_controller_angles_become_the_urdfs(tmp_path):
    text = """[record.joint_map]
joint_3 = { joint_2 = -1.0, joint_3 = -1.0 }
joint_1 = { joint_1 = 1.0, offset = 0.1 }
"""
    found = loadings(write(tmp_path, more=text))
    np.testing.assert_allclose(found.pose["joint_1"], np.radians([10.0, 20.0]) + 0.1)
    np.testing.assert_allclose(found.pose["joint_2"], [0.5, 0.6])
    np.testing.assert_allclose(found.pose["joint_3"], [0.3, 0.1])


def test_it_is_written_and_read_back(tmp_path):
    (tmp_path / "a").mkdir()
    text = "[record.joint_map]\njoint_3 = { joint_2 = -1.0, joint_3 = -1.0 }\n"
    campaign = load_campaign(write(tmp_path / "a", more=text))
    campaign.check_samples()
    for suffix in (".csv", ".parquet"):
        again = campaign.save(tmp_path / suffix[1:], suffix=suffix)
        one, other = loadings(campaign.folder), loadings(again.folder)
        np.testing.assert_array_equal(one.force, other.force)
        np.testing.assert_array_equal(one.pose["joint_3"], other.pose["joint_3"])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"drop": ["force.x [N]", "force.z [kN]"]}, "the load is missing"),
        ({"weight [N]": [1.0, 2.0]}, "the load is stated twice"),
        ({"drop": ["dial [mm]"]}, "tells nothing that moved"),
        ({"dial_direction.x": [2.0, 0.0], "dial_direction.z": [0.0, 0.0]},
         r"dial_direction, line 3: is zero or missing"),
        ({"drop": ["pose.joint_1 [deg]", "pose.joint_2 [rad]", "pose.joint_3 [rad]"]},
         "tells no pose"),
        ({"dial [mm]": [0.4, "nan"]}, r"channel dial, line 3: is not a finite number"),
        ({"dail [mm]": [0.4, 0.1]}, "did you mean 'dial'"),
        ({"force [N]": [0.4, 0.1]}, r"named force\.x"),
        ({"dial [N]": [0.4, 0.1], "drop": ["dial [mm]"]}, "must be a multiple of m"),
        ({"more": "[record.joint_map]\njoint_3 = { joint_9 = 1.0 }\n"}, r"pose\.joint_9"),
        ({"more": "[record.joint_map]\njoint_3 = { offset = 1.0 }\n"}, "follows no angle"),
        ({"more": "pose = [0.1, 0.2]\n"}, "must name the joints"),
        ({"kind": "", "more": "pose = { joint_1 = 0.0 }\ndirection = [1, 0, 0]\n"},
         "unknown channel"),
    ],
)  # fmt: skip
def test_what_is_refused(tmp_path, change, words):
    with pytest.raises(picchio.InputError, match=words) as error:
        loadings(write(tmp_path, **change))
    assert "\n" not in str(error.value)


def test_joint_map_is_of_static_records_alone(tmp_path):
    (tmp_path / "r.csv").write_text("time [s],torque.joint_1 [N*m]\n0,1\n1,2\n2,3\n")
    text = (
        HEAD.replace("loads.csv", "r.csv") + 'kind = "motion"\n[record.joint_map.joint_1]\na = 1.0'
    )
    (tmp_path / "campaign.toml").write_text(text)
    with pytest.raises(picchio.InputError, match=r"record\[0\]\.joint_map: only a static record"):
        load_campaign(tmp_path)


def test_who_has_no_use_for_them_says_so(tmp_path):
    write(tmp_path)
    for does in (picchio.check, lambda c: picchio.diagnose("fanuc_like_3dof", c)):
        with pytest.raises(picchio.InputError, match="no use for static records"):
            does(tmp_path)


def test_a_table_without_a_row_is_refused(tmp_path):
    (tmp_path / "loads.csv").write_text("weight [N],dial [m],dial_direction.z\n")
    (tmp_path / "campaign.toml").write_text(
        'format = "picchio-campaign/1"\n[[record]]\nfile = "loads.csv"\nkind = "static"\n'
    )
    with pytest.raises(picchio.InputError, match=r"loads\.csv.*is empty"):
        load_campaign(tmp_path).records[0].read()
