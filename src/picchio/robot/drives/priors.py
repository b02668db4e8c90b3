"""What a robot's drives are probably like: stiffness and damping as distributions.

Nobody publishes the stiffness of most robots' joints. What a URDF has (inertias, weight, levers,
limits), and what a user may know (payload, reach, class of drives, reducers), predict it within a
factor of about two. The distribution is fitted to joints that were measured; which, how, and how
well it predicts a robot left out: docs/validation/priors.md.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from picchio.core.errors import InputError
from picchio.core.results import TableResult
from picchio.robot.drives.facts import (
    CLASSES,
    Fitted,
    catalogue_stiffness,
    effort_beside,
    fitted,
    group_of,
    stiffness_beside,
)
from picchio.robot.drives.hierarchy import Group, predict
from picchio.robot.drives.predictors import (
    OF_STIFFNESS,
    QUANTITIES,
    Predictors,
    meaning,
    predictors,
)
from picchio.robot.drives.reducer import Reducer, load_reducer
from picchio.robot.drives.strength import peak_over_effort, rated_torque, torque_ratios
from picchio.robot.spread import Posterior

if TYPE_CHECKING:
    from picchio.robot.flexible_robot import FlexibleRobot

Array = NDArray[np.float64]

UNITS = dict(zip(QUANTITIES, ("kg m^2", "N m", "m", "N m", "rad/s", "kg"), strict=True))
KNOWN_CLASSES = (*CLASSES, "direct", "ball-screw")
"""The classes that may be given; of the last two no joint was measured."""


@dataclass(frozen=True)
class JointPrior:
    """What a joint's drive is probably like.

    Attributes:
        name: of the joint.
        stiffness: N m/rad, the median.
        stiffness_spread: 1, a factor: one standard deviation of the logarithm is ln of it.
        stiffness_range: N m/rad, the 5 and 95 % points.
        damping_ratio: 1, modal, the median.
        damping_ratio_spread: 1, a factor, likewise.
        repeated_peak_torque: N m, the median: limit of peaks that belong to the duty.
        repeated_peak_torque_spread: 1, a factor, likewise; 1 of a named reducer.
        repeated_peak_torque_range: N m, the 5 and 95 % points.
        rated_torque: N m, the median.
        rated_torque_spread: 1, a factor, likewise.
        momentary_peak_torque: N m, that goes with the median of the repeated one.
        reasons: in plain words, what the values rest on.
        strength_reasons: the same of the torques.
        supported: whether drives of this kind were in the data.
    """

    name: str
    stiffness: float
    stiffness_spread: float
    stiffness_range: tuple[float, float]
    damping_ratio: float
    damping_ratio_spread: float
    repeated_peak_torque: float
    repeated_peak_torque_spread: float
    repeated_peak_torque_range: tuple[float, float]
    rated_torque: float
    rated_torque_spread: float
    momentary_peak_torque: float
    reasons: tuple[str, ...]
    strength_reasons: tuple[str, ...]
    supported: bool


@dataclass(frozen=True, eq=False, repr=False)
class DrivePriors(TableResult):
    """The joint distribution of a robot's n drives.

    Attributes:
        robot: its name.
        joints: the drives, from the base to the tool.
        mean: (n,) of ln stiffness, N m/rad.
        covariance: (n, n) of ln stiffness.
        torque_mean: (n,) of ln repeated-peak torque, N m.
        torque_covariance: (2 n, 2 n) of ln stiffness and ln repeated-peak torque.
        damping_mean: (n,) of ln damping ratio.
        damping_covariance: (n, n) of ln damping ratio.
        drive_class: the class assumed, or None.
        class_probability: of each class; where none is given, what the data teach.
        left_out: why a prismatic joint has no estimate, by its name.
    """

    INDEX = "name"
    LACKS: ClassVar = dict.fromkeys(("plot", "show"), "it is what is known before any test")

    robot: str
    joints: tuple[JointPrior, ...]
    mean: Array
    covariance: Array
    torque_mean: Array
    torque_covariance: Array
    damping_mean: Array
    damping_covariance: Array
    drive_class: str | None
    class_probability: Mapping[str, float]
    left_out: Mapping[str, str]

    def less_sure(self, factor: float, why: str) -> DrivePriors:
        """The same where what they rest on is itself uncertain: one error, common to all joints.

        Args:
            factor: of stiffness and torques alike, one standard deviation.
            why: a reason more, in words.

        Returns:
            the wider distribution.
        """
        size = math.log(factor)

        def wider(spread: float) -> float:
            return math.exp(math.hypot(math.log(spread), size))

        def ends(middle: float, low_high: tuple[float, float]) -> tuple[float, float]:
            """A range holds 90 %; its two sides grow each by itself."""
            low, high = (math.hypot(math.log(end / middle), 1.645 * size) for end in low_high)
            return middle * math.exp(-low), middle * math.exp(high)

        joints = tuple(
            replace(
                joint,
                stiffness_spread=wider(joint.stiffness_spread),
                stiffness_range=ends(joint.stiffness, joint.stiffness_range),
                repeated_peak_torque_spread=wider(joint.repeated_peak_torque_spread),
                repeated_peak_torque_range=ends(
                    joint.repeated_peak_torque, joint.repeated_peak_torque_range
                ),
                rated_torque_spread=wider(joint.rated_torque_spread),
                reasons=(*joint.reasons, why),
                strength_reasons=(*joint.strength_reasons, why),
            )
            if joint.repeated_peak_torque_spread > 1.0
            else joint  # a named reducer's torque is known
            for joint in self.joints
        )
        known = np.array([joint.repeated_peak_torque_spread > 1.0 for joint in self.joints])
        common = size**2 * np.outer(both := np.tile(known, 2), both)
        n = len(joints)
        return replace(
            self, joints=joints, covariance=self.covariance + common[:n, :n],
            torque_covariance=self.torque_covariance + common,
        )  # fmt: skip

    def posterior(self) -> Posterior:
        """How the logarithms are correlated, as `[posterior]` of a sidecar has it."""
        n = len(self.joints)
        whole = np.zeros((3 * n, 3 * n))
        whole[: 2 * n, : 2 * n] = self.torque_covariance
        whole[2 * n :, 2 * n :] = self.damping_covariance
        size = np.sqrt(np.diag(whole))
        matrix = np.clip(whole / np.maximum(np.outer(size, size), 1e-300), -1.0, 1.0)
        matrix = 0.5 * (matrix + matrix.T)
        np.fill_diagonal(matrix, 1.0)
        keys = ("stiffness", "strength.repeated_peak_torque", "damping_ratio")
        names = [f"{key}.{joint.name}" for key in keys for joint in self.joints]
        kept = np.flatnonzero(size > 0.0)  # a named reducer's torque has no spread
        even = tuple(tuple(row) for row in matrix[np.ix_(kept, kept)].tolist())
        return Posterior(names=tuple(names[k] for k in kept), correlation=even)

    def _content(self) -> Mapping[str, Any]:
        return {
            "robot": self.robot,
            "drive_class": self.drive_class,
            "class_probability": self.class_probability,
            "joints": self.joints,
            "left_out": self.left_out,
            "posterior": self.posterior(),
        }

    def _rows(self) -> list[dict[str, Any]]:
        return [vars(joint) for joint in self.joints]

    def _headline(self) -> str:
        widest = max(joint.stiffness_spread for joint in self.joints)
        return f"{self.robot}: {len(self.joints)} drives, stiffness to a factor of {widest:.2g}"

    def _repr_html_(self) -> str:
        from picchio.core.html import sheet

        rows = [
            (joint.name, joint.stiffness, *joint.stiffness_range, joint.damping_ratio,
             joint.damping_ratio_spread, "; ".join(joint.reasons))
            for joint in self.joints
        ]  # fmt: skip
        columns = ("joint", "stiffness [N m/rad]", "5 %", "95 %", "damping ratio",
                   "to a factor of", "from")  # fmt: skip
        return sheet(f"{self.robot}: probable drives", {}, columns, rows,
                     head="estimates, no value was measured on this robot")  # fmt: skip


def drive_priors(
    robot: FlexibleRobot,
    *,
    payload: float | None = None,
    reach: float | None = None,
    drive_class: str | None = None,
    reducers: Mapping[str, str | Reducer] | None = None,
) -> DrivePriors:
    """The probable stiffness and damping ratio of every rotary joint that moves a robot's tool.

    Its own stiffness, where it has any, is not looked at. Of prismatic joints none was measured:
    they are left out, with this reason.

    Args:
        robot: loaded, flexible or rigid.
        payload: kg, rated.
        reach: m, the tool's largest distance from an axis, if the URDF's is not right.
        drive_class: strain-wave, cycloidal, planetary, direct or ball-screw; if None, that of the
            reducers, if they share one, else any, each with its probability.
        reducers: a catalogue's reducers by joint.

    Returns:
        the joint distribution.

    Raises:
        InputError: an unknown class, joint or reducer; a reducer far softer than its joint can be;
            payload or reach not positive; no rotary joint moves the tool.
    """
    if drive_class is not None and drive_class not in KNOWN_CLASSES:
        raise InputError("no such class of drives", key="drive_class", value=drive_class,
                         choices=KNOWN_CLASSES)  # fmt: skip
    found = predictors(robot, payload, reach)
    named = {
        joint: one if isinstance(one, Reducer) else load_reducer(one)
        for joint, one in (reducers or {}).items()
    }
    for joint in named:
        if joint not in found.names:
            raise InputError("no such joint", key="reducers", value=joint, choices=found.names)
    kinds = {one.kind for one in named.values()}
    kind = drive_class or (kinds.pop() if len(kinds) == 1 else None)
    fit = fitted()
    group = group_of(found, kind=CLASSES.index(kind) if kind in CLASSES else None)
    n = len(found.names)
    mixture = predict(fit.stiffness, stiffness_beside(group))
    for joint, one in named.items():
        if (stiffness := catalogue_stiffness(one)) is not None:
            mixture = with_reducer(mixture, found.names.index(joint), stiffness, fit.shares)
    strength = repeated_peaks(predict(fit.effort, effort_beside(group), given=True), kind)
    strength = _with_reducers(strength, found, named)
    mean, covariance = moments(mixture)
    torque_mean, torques = moments(strength)
    # An error of the stiffness says nothing of one of the strength: they are fitted apart.
    torque_covariance = np.zeros((2 * n, 2 * n))
    torque_covariance[:n, :n], torque_covariance[n:, n:] = covariance, torques
    low, middle, high = (
        np.exp(np.concatenate(ends))
        for ends in zip(*(quantiles(each, (0.05, 0.5, 0.95)) for each in (mixture, strength)),
                        strict=True)
    )  # fmt: skip
    nothing = Group(np.full((n, 1), np.nan), np.zeros((n, 0)), np.zeros(n, dtype=np.intp))
    damping = predict(fit.damping, nothing)
    damping_mean, damping_covariance = moments(damping)
    damping_ratio = np.exp(quantiles(damping, (0.5,)))[0]
    spread = np.exp(np.sqrt(np.diag(covariance)))
    damping_spread = np.exp(np.sqrt(np.diag(damping_covariance)))
    share = fit.stiffness.share.mean(axis=0)
    torque_spread = np.exp(np.sqrt(np.diag(torques)))
    joints = []
    for k, name in enumerate(found.names):
        reducer, peak = named.get(name), float(middle[n + k])
        rated, own = rated_torque(peak, kind, reducer)
        joints.append(JointPrior(
            name, float(middle[k]), float(spread[k]), (float(low[k]), float(high[k])),
            float(damping_ratio[k]), float(damping_spread[k]),
            peak, float(torque_spread[k]), (float(low[n + k]), float(high[n + k])),
            rated, math.exp(math.hypot(math.log(own), math.log(torque_spread[k]))),
            reducer.momentary_peak_torque if reducer
            else peak * torque_ratios(kind).momentary_over_peak,
            tuple(_reasons(found, k, float(middle[k]), kind, reducer, fit)),
            tuple(_strength_reasons(found, k, kind, reducer)), kind is None or kind in CLASSES,
        ))  # fmt: skip
    return DrivePriors(
        robot.name, tuple(joints), mean, covariance, torque_mean, torque_covariance, damping_mean,
        damping_covariance, kind,
        {one: float(share[k]) for k, one in enumerate(CLASSES)} if kind is None else {kind: 1.0},
        {name: "no prismatic drive was measured" for name, joint in robot.tree.joints.items()
         if joint.type == "prismatic" and name in robot.joint_names},
    )  # fmt: skip


Mixture = tuple[Array, Array, Array]
"""Weights (k,), means (k, n) and covariances (k, n, n) of normal parts."""


def moments(mixture: Mixture) -> tuple[Array, Array]:
    """The mean (n,) and the covariance (n, n) of a mixture.

    Args:
        mixture: of normal parts.
    """
    weights, means, covs = mixture
    mean = weights @ means
    away = means - mean
    return mean, np.tensordot(weights, covs, 1) + (weights[:, None] * away).T @ away


def quantiles(mixture: Mixture, levels: tuple[float, ...]) -> Array:
    """The points (levels, n) below which a mixture lies with given probabilities.

    Args:
        mixture: of normal parts.
        levels: the probabilities.
    """
    means = mixture[1]
    sizes = np.sqrt(np.maximum(np.einsum("kii->ki", mixture[2]), 1e-24))
    low = np.tile((means - 12.0 * sizes).min(axis=0), (len(levels), 1))
    high = np.tile((means + 12.0 * sizes).max(axis=0), (len(levels), 1))
    for _ in range(60):
        middle = 0.5 * (low + high)
        below = probability_below(mixture, middle) < np.array(levels)[:, None]
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return 0.5 * (low + high)


def probability_below(mixture: Mixture, points: Array) -> Array:
    """The probability that each coordinate lies below a point: (..., n).

    Args:
        mixture: of normal parts.
        points: (..., n).
    """
    from scipy.special import ndtr  # takes a while to load

    weights, means, covs = mixture
    sizes = np.maximum(np.sqrt(np.maximum(np.einsum("kii->ki", covs), 0.0)), 1e-12)
    found: Array = np.einsum("k,...kn->...n", weights, ndtr((points[..., None, :] - means) / sizes))
    return found


def with_reducer(
    mixture: Mixture, joint: int, stiffness: float, shares: tuple[float, ...]
) -> Mixture:
    """A mixture for a joint whose reducer's stiffness is known, too.

    A joint is softer than its reducer: t = ln(reducer's / joint's) is above zero. An exponential
    distribution of t whose rate was learned from r robots (Jeffreys's prior) is a Lomax
    distribution of shape r and scale their sum of t. Each part is weighed with it on a grid.

    Args:
        mixture: of normal parts.
        joint: its index.
        stiffness: N m/rad, the reducer's by the catalogue.
        shares: joint's over reducer's stiffness, of robots that were measured; all below 1.

    Returns:
        the parts, weighed and moved; what moves the joint moves those correlated with it.

    Raises:
        InputError: a stiffness far below all that the joint may have.
    """
    weights, means, covs = mixture
    shape, scale = len(shares), -sum(math.log(share) for share in shares)
    size = np.sqrt(covs[:, joint, joint])
    score = np.linspace(-8.0, 8.0, 1601)
    at = means[:, joint, None] + size[:, None] * score
    softer = math.log(stiffness) - at
    density = np.exp(-0.5 * score**2) * np.where(
        softer > 0.0, (scale + np.maximum(softer, 0.0)) ** -(shape + 1.0), 0.0
    )
    total = density.sum(axis=1)
    kept = total > 0.0
    if not kept.any():
        raise InputError("is far softer than this joint can be", key="reducers", value=stiffness)
    weights, means, covs, size = weights[kept], means[kept], covs[kept], size[kept]
    density = density[kept] / total[kept, None]
    middle = density @ score
    variance = density @ score**2 - middle**2
    column = covs[:, :, joint] / size[:, None]
    changed = np.einsum("ki,kj->kij", column, column) * (variance - 1.0)[:, None, None]
    new = weights * total[kept]
    return new / new.sum(), means + column * middle[:, None], covs + changed


def repeated_peaks(effort: Mixture, kind: str | None) -> Mixture:
    """A mixture of a robot's effort limits, ln N m, as one of its limits for repeated peaks.

    Args:
        effort: of the n limits.
        kind: class of the reducers, or None.
    """
    weights, means, covs = effort
    middle, spread = peak_over_effort(means.shape[1], kind)
    return weights, means + middle, covs + spread


def _with_reducers(strength: Mixture, found: Predictors, named: Mapping[str, Reducer]) -> Mixture:
    """Limits for repeated peaks where some are known from reducers."""
    weights, means, covs = strength
    means, covs = means.copy(), covs.copy()
    for name, reducer in named.items():
        k = found.names.index(name)
        means[:, k] = math.log(reducer.repeated_peak_torque)
        covs[:, k, :] = covs[:, :, k] = 0.0
    return weights, means, covs


def _strength_reasons(
    found: Predictors, k: int, kind: str | None, reducer: Reducer | None
) -> list[str]:
    """What a joint's torques rest on."""
    if reducer is not None:
        return [f"the catalogue of its reducer {reducer.name}"]
    effort = found.values[k, QUANTITIES.index("effort")]
    ratio = torque_ratios(kind).peak_over_rated
    refused = found.refused.get(found.names[k], "")
    told = (
        f"from {meaning['effort']}, {math.exp(effort):.3g} N m"
        if np.isfinite(effort)
        else f"no effort limit is known{f' ({refused})' if refused else ''}: it is predicted from "
        "what the joint moves and holds"
    )
    return [
        f"{told}; it is taken to lie between the reducer's rated torque and its limit for repeated "
        f"peaks, and catalogues have the latter {ratio:.2g} times as high"
    ]


def _reasons(
    found: Predictors,
    k: int,
    stiffness: float,
    kind: str | None,
    reducer: Reducer | None,
    fit: Fitted,
) -> list[str]:
    """What a joint's values rest on."""
    row = found.values[k]
    known = [
        f"{meaning[name]}, {math.exp(value):.3g} {UNITS[name]}"
        for name in OF_STIFFNESS
        if np.isfinite(value := row[QUANTITIES.index(name)])
    ]
    if np.isfinite(payload := found.values[0, -1]) and k:
        known.append(f"{meaning['payload']}, {math.exp(payload):.3g} kg")
    said = [f"from {'; '.join(known)}" if known else "from the size of the rest of the arm"]
    inertia = row[QUANTITIES.index("inertia")]
    if np.isfinite(inertia):
        hertz = math.sqrt(stiffness / math.exp(inertia)) / (2.0 * math.pi)
        low, high, robots = fit.rings["arm" if k else "first"]
        said.append(
            f"as the only soft joint of the stretched arm it would ring at {hertz:.2g} Hz; those "
            f"that were measured, in {robots} robots, at {low:.2g} to {high:.2g} Hz"
        )
    if found.place[k, 1]:
        said.append("a wrist: what URDFs give there tells little, hence the wide range")
    if reducer is not None and (own := catalogue_stiffness(reducer)) is not None:
        robots = len(fit.shares)
        many = "one robot" if robots == 1 else f"{robots} robots"
        said.append(
            f"softer than its reducer {reducer.name} ({own:.3g} N m/rad); "
            f"in {many} that was measured a joint had "
            f"{', '.join(f'{share:.2f}' for share in fit.shares)} of it"
        )
    if kind is not None and kind not in CLASSES:
        said.append(f"no {kind} drive was among the joints measured: the range is not backed")
    return said
