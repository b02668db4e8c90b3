"""What is never exact on a real robot: drawn once a campaign, pose, record or blow, never told.

The names are those of the campaign's `[tolerance]`; what each does to a record is written here and
in `world.py`, in the world's own terms.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from picchio.campaign.tables import Tolerance

# What percussion records depend on; `static_force`, `dial` and `torque_gain` are of other kinds.
KEYS = (
    "stiffness", "damping_ratio", "damping_by_mode", "force", "link_mass", "link_com",
    "link_inertia", "pose", "pose_repeat", "direction", "tool_point", "sensor_angle",
    "sensor_position", "sensor_gain", "blow_force", "blow_time", "rise_time", "gravity_stiffness",
)  # fmt: skip
# What was drawn before there were others: it stays as it was in worlds that are otherwise exact.
ALWAYS = ("stiffness", "damping_ratio", "force")
STATED = {key: float(getattr(Tolerance(), key)) for key in KEYS}
_LEAST = 0.1  # no stiffness, mass, gain or force is less than this share of the nominal one
_TRIES = 300  # at a link's moments of inertia, until a body can have them


@dataclass(frozen=True, eq=False)
class Errors:
    """By how much a campaign differs from its files; relative numbers are the factor less one.

    What belongs to a pose, a record or a sensor is drawn when asked for, by its own seed: so that a
    burst that was never measured has errors of its own, too.

    Attributes:
        seed: of the campaign.
        sigma: key -> the standard deviation that was drawn with.
        stiffness: (n,) of the joints' springs. damping_ratio, force: of all modes, all blows.
        link_mass: (n,) of the bodies that the joints carry; their inertias grow with them.
        link_com: (n, 3) m, in the body's axes.
        link_inertia: (n, 3) of each body's principal moments, on top of what its mass does.
        pose: (n,) rad, true less told.
        tool_point: (3,) m, tool frame, where the force acts.
        sensor_position: (3,) m, tool frame, where the accelerometer and its like sit.
        rise_time: s, how long a blow's force takes to rise, and to fall.
        gravity_stiffness: of gravity's change with the deflection.
    """

    seed: int
    sigma: Mapping[str, float]
    stiffness: np.ndarray
    damping_ratio: float
    force: float
    link_mass: np.ndarray
    link_com: np.ndarray
    link_inertia: np.ndarray
    pose: np.ndarray
    tool_point: np.ndarray
    sensor_position: np.ndarray
    rise_time: float
    gravity_stiffness: float

    @classmethod
    def draw(cls, chain, seed, mismatch=1.0, only=None, tolerance=None) -> Errors:
        """Plain normals; the same seed gives the same errors, `mismatch` times as large.

        Args:
            chain: the nominal one, its first n bodies carried by the flexible joints.
            seed: of the campaign.
            mismatch: factor on the tolerances, 0 to 4.
            only: keys that are not exact; all where None.
            tolerance: key -> standard deviation; the campaign format's defaults where None.
        """
        for key in only or ():
            if key not in KEYS:
                raise ValueError(f"no error {key!r}; there are {', '.join(KEYS)}")
        stated = STATED if tolerance is None else tolerance
        sigma = {
            key: float(mismatch * stated[key]) if only is None or key in only else 0.0
            for key in KEYS
        }
        n = len(chain.names)
        own = {"seed": seed, "sigma": sigma}
        mass = _relative(seed, sigma, "link_mass", n)
        return cls(
            **own,
            stiffness=_relative(seed, sigma, "stiffness", n),
            damping_ratio=float(_relative(seed, sigma, "damping_ratio", 1)[0]),
            force=float(_relative(seed, sigma, "force", 1)[0]),
            link_mass=mass,
            link_com=_normal(seed, sigma, "link_com", (n, 3)),
            link_inertia=_moments(seed, sigma, chain),
            pose=_normal(seed, sigma, "pose", n),
            tool_point=_normal(seed, sigma, "tool_point", 3),
            sensor_position=_normal(seed, sigma, "sensor_position", 3),
            rise_time=abs(float(_normal(seed, sigma, "rise_time", 1)[0])),
            gravity_stiffness=float(_relative(seed, sigma, "gravity_stiffness", 1)[0]),
        )

    def chain(self, nominal):
        """The bodies as they really are."""
        inertia = nominal.inertia.copy()
        for i, factor in enumerate(1.0 + self.link_mass):
            size, axes = np.linalg.eigh(factor * nominal.inertia[i])
            if self.link_inertia[i].any():
                inertia[i] = (axes * (size * (1.0 + self.link_inertia[i]))) @ axes.T
            else:
                inertia[i] = factor * nominal.inertia[i]
        return replace(
            nominal,
            mass=nominal.mass * (1.0 + self.link_mass),
            com=nominal.com + self.link_com,
            inertia=inertia,
        )

    def true_pose(self, told):
        """(n,) rad, where the robot stands when (n,) rad are told."""
        told = np.asarray(told, float)
        return told + self.pose + self.pose_repeat(told)

    def pose_repeat(self, told):
        """(n,) rad, of one pose."""
        return _normal(self.seed, self.sigma, "pose_repeat", self.pose.size, *_code(told))

    def damping_by_mode(self, told):
        """(n,) of the modes at one pose, the slowest first."""
        return _relative(self.seed, self.sigma, "damping_by_mode", self.pose.size, *_code(told))

    def direction(self, index, shot):
        """(3,) rotation vector of record `index`'s force, world, rad; nothing along the force."""
        turn, told = _normal(self.seed, self.sigma, "direction", 3, *_of(index, shot)), _along(shot)
        return turn - told * (turn @ told)

    def true_direction(self, index, shot):
        """(3,) unit, world."""
        return Rotation.from_rotvec(self.direction(index, shot)).apply(_along(shot))

    def blow_force(self, index, shot, hits):
        """(hits,) of record `index`."""
        return _relative(self.seed, self.sigma, "blow_force", hits, *_of(index, shot))

    def blow_time(self, index, shot, hits):
        """(hits,) s; the first blow defines t = 0."""
        late = _normal(self.seed, self.sigma, "blow_time", hits, *_of(index, shot))
        late[0] = 0.0
        return late

    def sensor_angle(self, group):
        """(3,) rotation vector of a group's axes, rad."""
        return _normal(self.seed, self.sigma, "sensor_angle", 3, zlib.crc32(group.encode()))

    def sensor_gain(self, group):
        """Of a channel group."""
        code = zlib.crc32(group.encode())
        return float(_relative(self.seed, self.sigma, "sensor_gain", 1, code)[0])

    def numbers(self, robot, plan, groups):
        """All of them as plain numbers: {key: {target: number or list}}.

        Args:
            robot: with the joints' and links' names.
            plan: the campaign's.
            groups: channel groups that are measured.
        """
        joints, links = robot.joints, robot.links()
        hits = plan.hits or 0
        poses = {tuple(map(float, shot.pose)): None for shot in plan.shots}

        def each(names, values):
            return {name: _plain(value) for name, value in zip(names, values, strict=True)}

        def stands(ask):
            return {str(i + 1): _plain(ask(pose)) for i, pose in enumerate(poses)}

        def shots(ask):
            return {f"r{i + 1:02d}.csv": _plain(ask(i, s)) for i, s in enumerate(plan.shots)}

        vectors = [g for g in groups if g not in ("force", "deflection")]
        return {
            "stiffness": each(joints, self.stiffness),
            "damping_ratio": {"robot": self.damping_ratio},
            "damping_by_mode": stands(self.damping_by_mode),
            "force": {"tool": self.force},
            "link_mass": each(links, self.link_mass),
            "link_com": each(links, self.link_com),
            "link_inertia": each(links, self.link_inertia),
            "pose": each(joints, self.pose),
            "pose_repeat": stands(self.pose_repeat),
            "direction": shots(self.direction),
            "tool_point": {"tool": _plain(self.tool_point)},
            "sensor_angle": {g: _plain(self.sensor_angle(g)) for g in vectors},
            "sensor_position": {"tool": _plain(self.sensor_position)},
            "sensor_gain": {g: self.sensor_gain(g) for g in groups},
            "blow_force": shots(lambda i, shot: self.blow_force(i, shot, hits)) if hits else {},
            "blow_time": shots(lambda i, shot: self.blow_time(i, shot, hits)) if hits else {},
            "rise_time": {"tool": self.rise_time},
            "gravity_stiffness": {"robot": self.gravity_stiffness},
        }


def beyond(numbers, level=3.8, tolerance=None):
    """[(key, target, standard deviations)] of what was drawn farther out than the tolerance allows.

    Args:
        numbers: as `Errors.numbers` gives them, `truth["errors"]`.
        level: standard deviations.
        tolerance: as stated; the format's defaults where None.
    """
    stated = STATED if tolerance is None else tolerance
    out = []
    for key, targets in numbers.items():
        for target, value in targets.items():
            far = float(np.abs(value).max()) / stated[key] if stated[key] > 0.0 else 0.0
            if far > level:
                out.append((key, target, far))
    return out


def _along(shot):
    way = np.asarray(shot.direction, float)
    return way / np.linalg.norm(way)


def _plain(value):
    value = np.asarray(value, float)
    return value.tolist() if value.ndim else float(value)


def _code(values):
    """A whole number for a seed: the same for the same pose or direction, whatever its rounding."""
    return (zlib.crc32((np.round(np.asarray(values, float), 5) + 0.0).tobytes()),)


def _of(index, shot):
    """Whole numbers for a record's seed; another pose or direction is another record."""
    return (index, *_code(shot.pose), *_code(_along(shot)))


def _generator(seed, key, *more):
    return np.random.default_rng([seed, 6, zlib.crc32(key.encode()), *more])


def _normal(seed, sigma, key, size, *more):
    return sigma[key] * _generator(seed, key, *more).normal(size=size)


def _relative(seed, sigma, key, size, *more):
    """Normal; what would leave nothing of the value is drawn again (never at the tolerance)."""
    rng = _generator(seed, key, *more)
    out = sigma[key] * rng.normal(size=size)
    while (out < _LEAST - 1.0).any():
        out = np.where(out < _LEAST - 1.0, sigma[key] * rng.normal(size=size), out)
    return out


def _moments(seed, sigma, chain):
    """(n, 3) of the principal moments, such that no moment exceeds the sum of the other two.

    A slender body's two large moments can only differ by as much as the small one: such draws are
    repeated, and in the end all three moments get the same factor.
    """
    rng = _generator(seed, "link_inertia")
    out = np.empty((len(chain.mass), 3))
    for i, tensor in enumerate(chain.inertia):
        size = np.linalg.eigvalsh(tensor)
        for _ in range(_TRIES):
            draw = sigma["link_inertia"] * rng.normal(size=3)
            moments = size * (1.0 + draw)
            if (draw > _LEAST - 1.0).all() and 2.0 * moments.max() <= moments.sum():
                break
        else:
            draw = np.full(3, max(sigma["link_inertia"] * rng.normal(), _LEAST - 1.0))
        out[i] = draw
    return out
