"""What is impossible or doubtful about a URDF's own numbers, with the likely cause."""

from __future__ import annotations

import re
import warnings

import numpy as np
import pytest

from picchio.core.errors import InputError, PicchioWarning
from picchio.robot.finding import Finding
from picchio.robot.loading.find import shipped_robots
from picchio.robot.loading.load import load_robot

# Of each link: m to the next joint, kg, m to the centre of mass, ixx = iyy and izz in kg m^2.
LINKS = (
    (0.2, 9.0, 0.1, 0.05, 0.03),
    (0.6, 14.0, 0.28, 0.4, 0.03),
    (0.5, 6.0, 0.22, 0.12, 0.01),
    (0.1, 2.2, 0.05, 0.004, 0.003),
    (0.1, 2.0, 0.04, 0.004, 0.003),
    (0.08, 0.4, 0.02, 0.0003, 0.0004),
)
TURNS = ("0 0 1", "0 1 0", "0 1 0", "0 0 1", "0 1 0", "0 0 1")


def urdf(length=1.0, mass=1.0, inertia=1.0, centre=1.0, angle=1.0, size=1.0, turn="0 0 0"):
    """A six-axis arm, its numbers as they are in a file of other units."""
    parts = ['<robot name="arm"><link name="l0"/>']
    before = 0.15 * length
    for k, (end, m, c, across, along) in enumerate(LINKS, 1):
        across, along = (size**5 * inertia * moment for moment in (across, along))
        parts.append(
            f'<joint name="j{k}" type="revolute"><parent link="l{k - 1}"/><child link="l{k}"/>'
            f'<origin xyz="0 0 {size * before!r}" rpy="{turn}"/><axis xyz="{TURNS[k - 1]}"/>'
            f'<limit lower="{-2.8 * angle!r}" upper="{2.8 * angle!r}" effort="300" velocity="2"/>'
            f'</joint><link name="l{k}"><inertial>'
            f'<origin xyz="0 0 {size * centre * length * c!r}"/>'
            f'<mass value="{size**3 * mass * m!r}"/><inertia ixx="{across!r}" ixy="0" ixz="0" '
            f'iyy="{across!r}" iyz="0" izz="{along!r}"/></inertial></link>'
        )
        before = length * end
    parts.append(
        '<link name="tool0"/><joint name="f" type="fixed"><parent link="l6"/><child link="tool0"/>'
        f'<origin xyz="0 0 {size * before!r}"/></joint></robot>'
    )
    return "".join(parts)


def changed(link: int, **values: float) -> str:
    """The arm with some of one link's values replaced, by attribute."""
    head, rest = urdf().split(f'<link name="l{link}"><inertial>')
    body, tail = rest.split("</inertial>", 1)
    for name, value in values.items():
        body = re.sub(rf'{name}="[^"]*"', f'{name}="{value}"', body)
    return f'{head}<link name="l{link}"><inertial>{body}</inertial>{tail}'


def findings(write, text: str) -> tuple[Finding, ...]:
    # With a tensor that is not positive, springs are refused.
    rigid = re.search(r'i(xx|yy|zz)="-', text) is not None
    stiff = None if rigid else {f"j{k}": {"stiffness": 2e4} for k in range(1, 7)}
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", PicchioWarning)
        robot = load_robot(write("arm.urdf", text), values=stiff, allow_rigid=rigid)
    told = [str(w.message) for w in said]
    assert all(f"arm.urdf: {finding}" in told for finding in robot.findings)
    return tuple(f for f in robot.findings if "would vibrate" not in f.what)


@pytest.mark.parametrize(
    ("units", "severity", "cause"),
    [
        ({"length": 1e3}, "impossible", "lengths and centres of mass look like millimetres"),
        ({"length": 1e3, "inertia": 1e6}, "impossible",
         "lengths and centres of mass look like millimetres, inertias look like kg mm^2"),
        ({"length": 1e3, "inertia": 1e9, "mass": 1e3}, "impossible",
         "lengths and centres of mass look like millimetres, masses look like grams, inertias look "
         "like g mm^2"),
        ({"length": 1e2}, "impossible", "lengths and centres of mass look like centimetres"),
        ({"length": 1 / 0.0254}, "impossible", "lengths and centres of mass look like inches"),
        ({"mass": 1e3}, "impossible", "masses look like grams"),
        ({"inertia": 1e6}, "doubtful", "inertias look like kg mm^2"),
        ({"inertia": 1e9}, "doubtful", "inertias look like g mm^2"),
        ({"inertia": 1e4}, "doubtful", "inertias look like kg cm^2"),
        ({"centre": 1e3}, "impossible", "centres of mass look like millimetres"),
        ({"angle": 180 / np.pi}, "doubtful", "limits of angles look like degrees"),
        ({"turn": "0 0 90"}, "impossible", "rotations look like degrees"),
        ({"turn": "180 0 0"}, "impossible", "rotations look like degrees"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("size", [0.5, 1.0, 1.7])
def test_a_unit_is_named(write, units, severity, cause, size):
    (found,) = findings(write, urdf(**units, size=size))
    assert (found.where, found.severity) == ("the whole arm", severity), found
    assert found.cause == cause


@pytest.mark.parametrize("size", [0.3, 0.5, 1.0, 1.7, 2.5])
def test_arms_of_any_size_are_believed(write, size):
    assert findings(write, urdf(size=size)) == ()


@pytest.mark.parametrize(
    ("link", "values", "severity", "cause"),
    [
        (2, {"ixx": -0.4}, "impossible", "never negative: a wrong sign?"),
        (5, {"izz": -0.003}, "impossible", "never negative: a wrong sign?"),
        (2, {"ixx": 4.0}, "impossible", "ixx looks 10 times too large: a decimal point?"),
        (3, {"iyy": 0.0012}, "doubtful", "iyy looks 100 times too small: a decimal point?"),
        (6, {"izz": 0.04}, "impossible", "izz looks 100 times too large: a decimal point?"),
        (2, {"ixx": 0.4, "iyy": 0.4, "izz": 0.4, "ixy": 0.15, "iyz": 0.15, "ixz": 0.15},
         "doubtful", "the products of inertia look turned in sign"),
        (3, {"ixx": 0.136}, "doubtful", ""),
        (3, {"ixx": 12.0, "iyy": 12.0, "izz": 1.0}, "doubtful",
         "it looks some 100 times too large"),
        (3, {"ixx": 120.0, "iyy": 120.0, "izz": 10.0}, "impossible",
         "it looks some 1,000 times too large"),
        (2, {"ixx": 4e-4, "iyy": 4e-4, "izz": 3e-4}, "doubtful",
         "it looks some 900 times too small"),
        (3, {"value": 600.0}, "doubtful", "a decimal point, or grams?"),
        (3, {"value": 6000.0}, "impossible", "a decimal point, or grams?"),
        (6, {"value": 400.0}, "doubtful", "a decimal point, or grams?"),
    ],
)  # fmt: skip
def test_a_links_number_is_named(write, link, values, severity, cause):
    found = [f for f in findings(write, changed(link, **values)) if cause in f.cause]
    assert [(f.where, f.severity) for f in found] == [(f"link 'l{link}'", severity)], found


def test_a_moment_that_no_joint_feels_stops_nothing(write):
    """The first link turns about z only: what is wrong about x is told, and believed."""
    (found,) = findings(write, changed(1, ixx=0.5))
    assert found.severity == "doubtful"
    assert "ixx looks 10 times too large" in found.cause


def test_a_finding_follows_from_the_tensor_alone():
    """Of 500 clouds of points none is called impossible; beyond the bound each is."""
    from picchio.robot.masses.doubts import _can_be

    rng = np.random.default_rng(3)
    for _ in range(500):
        points = rng.normal(size=(4, 3)) * rng.uniform(0.1, 1.0, 3)
        points -= points.mean(axis=0)
        tensor = np.sum([p @ p * np.eye(3) - np.outer(p, p) for p in points], axis=0)
        assert _can_be(tensor)
        values, axes = np.linalg.eigh(tensor)
        values[2] = 1.001 * (values[0] + values[1])
        assert not _can_be(axes @ np.diag(values) @ axes.T)


@pytest.mark.parametrize("inertia", ['ixx="-1" ixy="0"', 'ixx="0.4" ixy="0.9"'])
def test_an_estimate_names_what_stops_it(write, inertia):
    """Where every joint carries a body that cannot be, that is the reason, not the joints."""
    text = urdf().replace(
        '<link name="tool0"/>',
        '<link name="tool0"><inertial><mass value="1"/>'
        f'<inertia {inertia} ixz="0" iyy="0.4" iyz="0" izz="0.4"/></inertial></link>',
    )
    with pytest.raises(InputError, match="link 'tool0': its inertia is not positive semidefinite"):
        load_robot(write("arm.urdf", text))


@pytest.mark.parametrize("name", sorted(shipped_robots()))
def test_nothing_shipped_is_impossible(name):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PicchioWarning)
        robot = load_robot(name)
    assert [f for f in robot.findings if f.severity == "impossible"] == []


@pytest.mark.parametrize("count", [33, 100, 200])
def test_a_very_long_arm_is_told_at_once(write, count):
    parts = ['<robot name="snake"><link name="l0"/>']
    for k in range(1, count + 1):
        parts.append(
            f'<joint name="j{k}" type="revolute"><parent link="l{k - 1}"/><child link="l{k}"/>'
            f'<origin xyz="0 0 {2 / count}"/><axis xyz="{TURNS[k % 6]}"/><limit lower="-1" '
            f'upper="1" effort="9" velocity="1"/></joint><link name="l{k}"><inertial><origin '
            f'xyz="0 0 {1 / count}"/><mass value="{20 / count}"/><inertia ixx="1e-4" ixy="0" '
            'ixz="0" iyy="1e-4" iyz="0" izz="1e-4"/></inertial></link>'
        )
    snake = write("snake.urdf", "".join(parts) + "</robot>")
    for values in (None, {f"j{k}": {"stiffness": 1e4} for k in range(1, count + 1)}):
        with pytest.raises(InputError, match=f"{count} joints would be flexible, and at most 32"):
            load_robot(snake, values=values)
    # The message's way out works.
    some = load_robot(snake, values={f"j{k}": {"stiffness": 1e4} for k in (1, 5, 30)})
    assert np.isfinite(some.state([0.1] * count).mass_matrix).all()
