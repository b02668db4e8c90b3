"""Universal files written by pyuff itself, ASCII and binary."""

import numpy as np
import pytest

from picchio.campaign.importing.importer import read_mapped, read_raw
from picchio.core.errors import InputError, PicchioWarning

from .conftest import MAPPING_RECORD as RECORD
from .conftest import mapped


def write_uff(path, time, values, *, unit="g", func_type=1, binary=0):
    import pyuff

    sets = [
        pyuff.prepare_58(
            binary=binary,
            func_type=func_type,
            rsp_node=7,
            rsp_dir=direction,
            rsp_ent_name="hammer",
            ref_dir=1,
            ref_node=1,
            data=data,
            x=time,
            id1=label,
            ord_data_type=4,
            abscissa_spacing=1,
            abscissa_spec_data_type=17,
            ordinate_spec_data_type=12,
            orddenom_spec_data_type=13,
            ordinate_axis_units_lab=unit,
            abscissa_axis_units_lab="s",
        )
        for direction, data, label in ((1, values[0], "acc x"), (-3, values[1], "acc z"))
    ]
    # pyuff 2.5 leaves an empty file when it overwrites with a binary set; adding works.
    pyuff.UFF(str(path)).write_sets(sets, mode="add")
    return path


UFF_CHANNELS = """[[channel]]
from = "7+X"
to = "accelerometer.tool.x"
[[channel]]
from = "7-Z"
to = "accelerometer.tool.z"
sign = -1
"""


@pytest.mark.parametrize("binary", [0, 1])
def test_uff_58(tmp_path, signals, binary):
    time, values = signals
    path = write_uff(tmp_path / "run.uff", time, values, binary=binary)
    raw = read_raw(path)
    assert [(c.name, c.unit) for c in raw.channels.values()] == [("7+X", "g"), ("7-Z", "g")]
    assert "acc z" in raw.channels["7-Z"].note
    campaign = read_mapped(path, mapped(tmp_path, UFF_CHANNELS + RECORD))
    read = campaign["run.csv"].read()
    # ASCII double precision of data set 58 is E20.12.
    tolerance = 0.0 if binary else 1e-11
    np.testing.assert_allclose(read["accelerometer.tool.x"], values[0] * 9.80665, rtol=tolerance)
    np.testing.assert_allclose(read["accelerometer.tool.z"], -values[1] * 9.80665, rtol=tolerance)
    np.testing.assert_allclose(read["time"], time, rtol=1e-6, atol=1e-12)
    assert campaign["run.csv"].hits == 12


def test_uff_spectra_are_left_out(tmp_path, signals):
    time, values = signals
    path = write_uff(tmp_path / "frf.uff", time, values, func_type=4)
    with (
        pytest.warns(PicchioWarning, match="no time histories"),
        pytest.raises(InputError, match="no time history"),
    ):
        read_raw(path)
