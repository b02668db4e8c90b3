from __future__ import annotations

import math
from importlib.resources import files
from pathlib import Path

import pytest

from picchio.core.errors import InputError
from picchio.robot.drives.reducer import Reducer, load_reducer, read_reducers
from picchio.robot.joint import StiffnessCurve

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


def test_standstill_promises_nothing() -> None:
    warnings = strain_wave().check_blows(100.0).warnings
    assert len(warnings) == 1
    assert "false brinelling" in warnings[0]


def test_blows_are_duty_not_an_emergency() -> None:
    check = strain_wave().check_blows(-900.0, 150.0)
    governing = check.governing
    assert (governing.name, governing.torque, governing.limit) == (
        "repeated peak torque", 900.0, 617.0,
    )  # fmt: skip
    assert governing.share == pytest.approx(900.0 / 617.0)
    assert any("repeated peaks (1.46 times)" in line for line in check.warnings)
    assert not any("emergencies" in line for line in check.warnings)
    assert any("emergencies" in line for line in strain_wave().check_blows(1200.0).warnings)
    assert strain_wave().check_blows(617.0).governing.share == 1.0
    ratchet = strain_wave(ratcheting_torque=500.0).check_blows(550.0)
    assert ratchet.governing.name == "ratcheting torque"
    assert ratchet.governing.share > 1.0
    assert any("teeth skip (1.10 times)" in line for line in ratchet.warnings)


def test_held_torque_is_judged_by_the_average_limit_and_never_by_the_rated_one() -> None:
    # CSG-25-100: rated 87, average 140, repeated peaks 204 N m.
    held = load_reducer("CSG-25-100-2UH").check_blows(176.0, -112.0)
    assert (held.governing.name, held.governing.share) == ("repeated peak torque", 176.0 / 204.0)
    told = {limit.name: limit for limit in held.limits}
    assert told["average torque, held"].to_dict() == {
        "name": "average torque, held", "torque": 112.0, "limit": 140.0, "share": 0.8,
    }  # fmt: skip
    assert len(held.warnings) == 1
    above = load_reducer("CSG-25-100-2UH").check_blows(150.0, 145.0)
    assert above.governing.name == "average torque, held"
    assert any("limit for the average torque (1.04 times)" in line for line in above.warnings)
    # A catalogue without a limit for the average torque gives none for what is held.
    assert not any(
        "held" in one.name for one in load_reducer("RV-20E").check_blows(400, 390).limits
    )


def test_an_unknown_reducer_is_told_with_the_closest_names() -> None:
    with pytest.raises(InputError, match=r"valid: CSG-25-100-2UH,.*--reducers FILE"):
        load_reducer("CSG-25-101-2UH")


def test_catalogue_agrees_with_the_makers_product_pages() -> None:
    # Rated torque (L10) on harmonicdrive.net's own pages of these units.
    for name, rated in (
        ("CSG-32-100-2UH", 178.0), ("CSG-45-100-2UH", 459.0), ("CSG-65-100-2UH", 1236.0),
        ("CSF-25-50-2UH", 39.0),
    ):  # fmt: skip
        reducer = load_reducer(name)
        assert reducer.rated_torque == rated
        assert reducer.rated_speed == pytest.approx(2000 * RPM)


SHIPPED = [
    entry
    for path in files("picchio.robot.drives").joinpath("reducers").iterdir()
    for entry in read_reducers(str(path))
]


@pytest.mark.parametrize("name", SHIPPED)
def test_every_entry_is_ordered_and_sourced(name: str) -> None:
    reducer = load_reducer(name)
    assert reducer.rated_torque < reducer.repeated_peak_torque < reducer.momentary_peak_torque
    # Regression over catalogues (K2 against the repeated peak torque): a slip of a digit shows.
    law = 170.0 * reducer.repeated_peak_torque**1.11
    for spring in reducer.spring.values():
        curve = spring if isinstance(spring, StiffnessCurve) else None
        k2 = curve.k2 if curve else spring
        assert law / 3.0 < k2 < law * 3.0
        if curve:
            assert curve.k1 < curve.k2 < curve.k3
            assert 2.0 < curve.t2 / curve.t1 < 4.0
            assert curve.t2 < reducer.momentary_peak_torque
    if reducer.output_bearing is not None:
        # Its own moment loads it to a fraction of C0: pi over 4 of the pitch circle at most.
        bearing = reducer.output_bearing
        share = 2.0 * bearing.permissible_moment / bearing.pitch_diameter
        assert 0.1 < share / bearing.static_load_rating < 0.6
    if reducer.average_torque is not None:
        assert reducer.rated_torque <= reducer.average_torque < reducer.repeated_peak_torque
    assert len(reducer.source) > 40
    lives = {"CSG-": 10_000, "SHG-": 10_000, "CSF-": 7_000, "HFUC": 7_000, "RV-2": 6_000}
    if name[:4] in lives:
        assert reducer.rated_life == lives[name[:4]] * 3600.0
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


def test_a_component_set_has_its_unit_s_ratings_and_no_bearing() -> None:
    unit, alone = load_reducer("CSG-25-100-2UH"), load_reducer("CSG-25-100")
    # CHA manual, table 50.3: K1 to K3 of size 25 at ratios above 50 are 31, 50, 57 kN m/rad.
    curve = StiffnessCurve(k1=31e3, k2=50e3, k3=57e3, t1=14.0, t2=48.0)
    assert alone.spring == unit.spring == {"stiffness_curve": curve}
    assert (alone.rated_torque, alone.output_bearing) == (87.0, None)
    assert unit.output_bearing is not None


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
    with pytest.raises(InputError, match=r"duplicate name, got 'X-1'"):
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
