from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from picchio.core.errors import InputError
from picchio.fatigue.reducer import Reducer, load_reducer, read_reducers, reducer_names

RPM = 2.0 * math.pi / 60.0


def strain_wave(**changes: object) -> Reducer:
    """HFUC/CSF-40-120, of Harmonic Drive's selection example."""
    values = {
        "name": "CSF-40-120", "kind": "strain-wave", "manufacturer": "Harmonic Drive",
        "ratio": 120.0, "rated_torque": 294.0, "rated_speed": 2000 * RPM,
        "rated_life": 7000 * 3600.0, "repeated_peak_torque": 617.0, "average_torque": 451.0,
        "momentary_peak_torque": 1180.0,
    }  # fmt: skip
    return Reducer(**{**values, **changes})  # type: ignore[arg-type]


def cycloidal() -> Reducer:
    """RV-160E, of Nabtesco's selection example."""
    return Reducer(
        name="RV-160E", kind="cycloidal", manufacturer="Nabtesco", rated_torque=1568.0,
        rated_speed=15 * RPM, rated_life=6000 * 3600.0, repeated_peak_torque=3920.0,
        momentary_peak_torque=7840.0,
    )  # fmt: skip


def test_harmonic_drives_selection_example() -> None:
    # Harmonic Drive Engineering Data HFUC-2A, "Selection example": 400, 320 and 200 N m at 7, 14
    # and 7 rpm for 0.3, 3 and 0.4 s, then 0.2 s of rest; prints T_av = 319 N m, 1190 momentary
    # peaks of 0.15 s at 14 rpm, and L50 = 38,054 h at 1440 rpm and 319 N m.
    reducer = strain_wave()
    mean = reducer.mean_torque([400.0, 320.0, 200.0], [7.0, 14.0, 7.0], [0.3, 3.0, 0.4])
    assert mean == pytest.approx(319.7, abs=0.1)
    l50 = 5.0 * reducer.life(319.0, 1440 * RPM) / 3600.0
    assert l50 == pytest.approx(38_054, abs=1.0)
    assert reducer.momentary_events(14 * RPM, 0.15) == pytest.approx(1190, abs=1.0)


def test_a_second_makers_strain_wave_example() -> None:
    # honpine.com, "How to select harmonic reduction gear": 150, 82, 130 N m at 10, 20, 10 rpm for
    # 0.2, 3, 0.3 s: "Tav = 89 N m".
    mean = strain_wave().mean_torque([150.0, 82.0, 130.0], [10.0, 20.0, 10.0], [0.2, 3.0, 0.3])
    assert mean == pytest.approx(89.0, abs=0.5)


def test_nabtescos_selection_example() -> None:
    # Nabtesco RV catalogue, "Product selection": 2500, 500, 1500 N m at mean speeds of 10, 20,
    # 10 rpm for 0.2, 0.5, 0.2 s; prints T_m = 1,475 N m, N_m = 15.6 rpm, L = 7,073 h (RV-160E).
    reducer = cycloidal()
    mean = reducer.mean_torque([2500.0, 500.0, 1500.0], [10.0, 20.0, 10.0], [0.2, 0.5, 0.2])
    assert mean == pytest.approx(1475, abs=1.0)
    assert reducer.life(1475.0, 15.6 * RPM) / 3600.0 == pytest.approx(7073, abs=1.0)


@given(st.floats(1.0, 1e3), st.floats(0.1, 10.0))
def test_life_follows_its_exponent(torque: float, factor: float) -> None:
    for reducer, exponent in ((strain_wave(), 3.0), (cycloidal(), 10.0 / 3.0)):
        ratio = reducer.life(torque, RPM) / reducer.life(torque * factor, RPM)
        assert ratio == pytest.approx(factor**exponent, rel=1e-9)
        rated = reducer.life(reducer.rated_torque, reducer.rated_speed)
        assert rated == pytest.approx(reducer.rated_life, rel=1e-12)


def test_standstill_promises_nothing() -> None:
    reducer = strain_wave()
    assert reducer.momentary_events(0.0, 0.15) is None
    assert cycloidal().momentary_events(1.0, 0.15) is None
    assert reducer.life(300.0, 0.0) == math.inf
    assert reducer.mean_torque([10.0, -30.0], [0.0, 0.0], [1.0, 1.0]) == 30.0
    warnings = reducer.check_blows(100.0).warnings
    assert len(warnings) == 1
    assert "false brinelling" in warnings[0]


def test_blows_are_duty_not_an_emergency() -> None:
    check = strain_wave().check_blows(-900.0, 150.0)
    assert check.governed_by == "repeated peak torque"
    assert check.utilisation == pytest.approx(900.0 / 617.0)
    assert not check.passed
    assert any("repeated peaks (1.46 times)" in line for line in check.warnings)
    assert not any("emergencies" in line for line in check.warnings)
    assert any("emergencies" in line for line in strain_wave().check_blows(1200.0).warnings)
    assert strain_wave().check_blows(617.0).passed
    held = strain_wave().check_blows(300.0, 299.0)
    assert held.governed_by == "rated torque, held"
    ratchet = strain_wave(ratcheting_torque=500.0).check_blows(550.0)
    assert ratchet.governed_by == "ratcheting torque"
    assert ratchet.to_dict()["passed"] is False
    assert any("teeth skip (1.10 times)" in line for line in ratchet.warnings)
    loaded = strain_wave().check_blows(310.0, -300.0)
    assert any("gravity's torque exceeds the rated" in line for line in loaded.warnings)


def test_catalogue_agrees_with_the_makers_product_pages() -> None:
    # Rated torque (L10) on harmonicdrive.net's own pages of these units.
    for name, rated in (
        ("CSG-32-100-2UH", 178.0), ("CSG-45-100-2UH", 459.0), ("CSG-65-100-2UH", 1236.0),
        ("CSF-25-50-2UH", 39.0),
    ):  # fmt: skip
        reducer = load_reducer(name)
        assert reducer.rated_torque == rated
        assert reducer.rated_speed == pytest.approx(2000 * RPM)


@pytest.mark.parametrize("name", reducer_names())
def test_every_entry_is_ordered_and_sourced(name: str) -> None:
    reducer = load_reducer(name)
    assert reducer.rated_torque < reducer.repeated_peak_torque < reducer.momentary_peak_torque
    if reducer.average_torque is not None:
        assert reducer.rated_torque <= reducer.average_torque < reducer.repeated_peak_torque
    assert len(reducer.source) > 40
    expected = {"CSG": 10_000, "SHG": 10_000, "CSF": 7_000, "HFU": 7_000, "RV-": 6_000}[name[:3]]
    assert reducer.rated_life == expected * 3600.0
    if reducer.kind == "strain-wave":
        assert reducer.ratio == float(name.split("-")[2])


def test_a_cycloidal_name_may_carry_its_ratio() -> None:
    reducer = load_reducer("RV-42N-126")
    assert (reducer.name, reducer.ratio, reducer.rated_torque) == ("RV-42N-126", 126.0, 412.0)
    ours = load_reducer("RV-80E-121")
    assert (ours.name, ours.ratio, ours.rated_torque) == ("RV-80E-121", 121.0, 784.0)
    # What was not read of it is told, and agrees with the sizes that were.
    assert "not read for this size" in ours.source
    for name in ("RV-20E", "RV-40E", "RV-42N"):
        known = load_reducer(name)
        for key in ("repeated_peak_torque", "momentary_peak_torque"):
            ratio = getattr(known, key) / known.rated_torque
            assert getattr(ours, key) / ours.rated_torque == pytest.approx(ratio, rel=0.015)
    with pytest.raises(InputError, match="no such reducer"):
        load_reducer("CSG-32-101-2UH")


def test_a_users_catalogue(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    text = (
        'format = "picchio-reducers/1"\nmanufacturer = "Me"\nkind = "cycloidal"\n'
        'rated_speed_rpm = 15\nrated_life_hours = 6000\nsource = "a test"\n[[reducer]]\n'
        'name = "X-1"\nrated_torque = 100\nrepeated_peak_torque = 250\n'
        "momentary_peak_torque = 500\n"
    )
    path.write_text(text)
    assert load_reducer("X-1", catalogues=[path]).manufacturer == "Me"
    path.write_text(text + text[text.index("[[") :])
    with pytest.raises(InputError, match=r"twice, got 'X-1'"):
        read_reducers(path)
    path.write_text(text.replace("= 250", "= -250"))
    with pytest.raises(InputError, match="repeated_peak_torque"):
        read_reducers(path)
    path.write_text(text.replace("kind", "knd"))
    with pytest.raises(InputError, match=r"mine\.toml.*knd.*kind"):
        read_reducers(path)


@pytest.mark.parametrize("bad", [math.nan, math.inf, "x"])
def test_bad_torques_are_named(bad: object) -> None:
    with pytest.raises(InputError, match="peak_torque"):
        strain_wave().check_blows(bad)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="torque"):
        strain_wave().mean_torque([bad], [1.0], [1.0])
    with pytest.raises(InputError, match="duration"):
        strain_wave().mean_torque(np.array([1.0]), [1.0], [-1.0])
