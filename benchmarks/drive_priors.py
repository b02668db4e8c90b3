"""How well the drive priors foretell a robot that was left out; and the command that refits them.

    python benchmarks/drive_priors.py [--chains 3]     # leave one robot out, arm by arm
    python benchmarks/drive_priors.py --nested         # would the others choose its predictors?
    python benchmarks/drive_priors.py --refit          # write fitted.json anew

Each robot with measured stiffness is left out in turn; everything is fitted to the others; its
stiffness is predicted from what a URDF and its designation say, its class of drives unknown.
The same with one predictor alone, and with none. The log score is the mean logarithm of the density
of ln(stiffness), a joint at a time and all joints of a robot together; higher is better.
"""

from __future__ import annotations

import argparse
import json
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations
from pathlib import Path
from typing import Any

import drive_fit
import numpy as np
from drive_fit import MeasuredRobot

from picchio.core.files import atomic_write
from picchio.robot.drives.facts import stiffness_beside
from picchio.robot.drives.hierarchy import Draws, predict
from picchio.robot.drives.predictors import OF_STIFFNESS, QUANTITIES
from picchio.robot.drives.priors import Mixture, moments, probability_below, quantiles
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.loading.load import load_robot

Names = tuple[str, ...]


@dataclass(frozen=True)
class Left:
    """A robot that was left out.

    Its truth, the estimate and its 90 % interval, ln N m/rad; whether it is in; log densities.
    """

    robot: MeasuredRobot
    rows: np.ndarray
    truth: np.ndarray
    estimate: np.ndarray
    low: np.ndarray
    high: np.ndarray
    below: np.ndarray
    score: np.ndarray
    together: float


@cache
def load(name: str) -> FlexibleRobot:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return load_robot(name, allow_rigid=True)


def log_density(mixture: Mixture, point: np.ndarray) -> float:
    weights, means, covs = mixture
    away = point - means
    fits = -0.5 * np.einsum("ki,ki->k", away, np.linalg.solve(covs, away[..., None])[..., 0])
    fits += np.log(weights) - 0.5 * np.linalg.slogdet(2.0 * np.pi * covs)[1]
    return float(np.logaddexp.reduce(fits))


def foretold(draws: Sequence[Draws], robot: MeasuredRobot, kept: Names) -> Mixture:
    """The stiffness of a robot's measured joints, ln N m/rad, by fits to others.

    Several chains are pooled: the more of them, the less is left to chance.
    """
    rows = np.flatnonzero(np.isfinite(robot.truth))
    group = replace(stiffness_beside(robot.group, kept), kind=None)
    columns = zip(*(predict(each, group) for each in draws), strict=True)
    weights, means, covs = (np.concatenate(column) for column in columns)
    return weights / len(draws), means[:, rows], covs[:, rows][:, :, rows]


def nested(robots: list[MeasuredRobot]) -> None:
    """For each robot left out: which predictors the others choose, by leaving out one of them."""
    names = {"stiffness": OF_STIFFNESS, "every": QUANTITIES}
    measured = [k for k, robot in enumerate(robots) if np.isfinite(robot.truth).any()]
    inner = {name: dict.fromkeys(measured, 0.0) for name in names}
    for pair in combinations(measured, 2):
        others = [one for i, one in enumerate(robots) if i not in pair]
        for name, kept in names.items():
            draws = [drive_fit.fit_stiffness(others, kept)]
            for out, left in (pair, pair[::-1]):
                truth = robots[left].truth[np.isfinite(robots[left].truth)]
                inner[name][out] += log_density(foretold(draws, robots[left], kept), truth)
    print("log density of the other robots, each left out; chosen without the robot named")
    chosen = []
    for k in measured:
        chosen.append(max(names, key=lambda name: inner[name][k]))
        scores = ", ".join(f"{name} {inner[name][k]:7.2f}" for name in names)
        print(f"  {robots[k].name:20} {scores}   {chosen[-1]}")
    print(f"chosen: {OF_STIFFNESS} by {chosen.count('stiffness')} of {len(chosen)}")


def leave_one_out(robots: list[MeasuredRobot], kept: Names, chains: int = 1) -> list[Left]:
    found = []
    for k, robot in enumerate(robots):
        rows = np.flatnonzero(np.isfinite(robot.truth))
        if not len(rows):
            continue
        others = [one for i, one in enumerate(robots) if i != k]
        draws = [drive_fit.fit_stiffness(others, kept, seed) for seed in range(chains)]
        mixture = foretold(draws, robot, kept)
        weights = mixture[0]
        truth = robot.truth[rows]
        low, high = quantiles(mixture, (0.05, 0.95))
        each = [
            log_density((weights, mixture[1][:, [i]], mixture[2][:, [i]][:, :, [i]]), truth[[i]])
            for i in range(len(rows))
        ]
        found.append(
            Left(robot, rows, truth, moments(mixture)[0], low, high,
                 probability_below(mixture, truth), np.array(each), log_density(mixture, truth))
        )  # fmt: skip
    return found


def summary(left: list[Left]) -> dict[str, Any]:
    inside = [np.abs(one.below - 0.5) <= 0.45 for one in left]
    rng = np.random.default_rng(0)
    draws = rng.integers(len(left), size=(10000, len(left)))
    hits, sizes = (np.array([f(one) for one in inside]) for f in (np.sum, len))
    spread = np.quantile(hits[draws].sum(axis=1) / sizes[draws].sum(axis=1), [0.025, 0.975])
    away = np.abs(np.concatenate([one.estimate - one.truth for one in left]))
    joints = int(sizes.sum())
    below = np.concatenate([one.below for one in left])
    return {
        "robots": len(left),
        "joints": joints,
        "median_factor": float(np.exp(np.median(away))),
        "coverage_50": float(np.mean(np.abs(below - 0.5) <= 0.25)),
        "coverage": float(hits.sum() / joints),
        "coverage_bootstrap_95": spread.tolist(),
        "log_score": float(np.concatenate([one.score for one in left]).mean()),
        "log_score_by_robot": float(np.mean([one.score.mean() for one in left])),
        "log_score_together": sum(one.together for one in left) / joints,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--refit", action="store_true", help="write fitted.json")
    parser.add_argument("--nested", action="store_true", help="are the predictors the others'?")
    parser.add_argument("--chains", type=int, default=1, help="pooled in every fit")
    parser.add_argument("--json", type=Path, help="write what is printed")
    options = parser.parse_args()
    robots = drive_fit.measured_robots(load)
    if options.refit:
        path = drive_fit.FOLDER / "fitted.json"
        with atomic_write(path) as file:
            file.write(drive_fit.to_json(drive_fit.refit(robots)))
        print(f"{path}: fitted to {len(robots)} robots")
        return
    if options.nested:
        nested(robots)
        return
    left = leave_one_out(robots, OF_STIFFNESS, options.chains)
    print("N m/rad; interval: 90 %; factor: estimate over truth")
    for one in left:
        print(f"{one.robot.name} ({one.robot.evidence.split(';')[0]})")
        for k in range(len(one.truth)):
            low, high, estimate, truth = np.exp(
                [one.low[k], one.high[k], one.estimate[k], one.truth[k]]
            )
            inside = "in" if low <= truth <= high else "OUT"
            print(f"  {one.rows[k] + 1}  estimate {estimate:9.3g}  ({low:8.2g} .. {high:8.2g})"
                  f"  truth {truth:9.3g}  factor {estimate / truth:5.2f}  {inside}")  # fmt: skip
    found = {"as shipped": summary(left)}
    alone = {name: (name,) for name in QUANTITIES}
    for name, kept in {"every": QUANTITIES, **alone, "none": ()}.items():
        found[name] = summary(leave_one_out(robots, kept, options.chains))
    print(f"\n{'predictors':16}  joint  robot  together  coverage (bootstrap)  50 %  factor")
    for name, one in found.items():
        low, high = one["coverage_bootstrap_95"]
        print(f"{name:16} {one['log_score']:6.3f} {one['log_score_by_robot']:6.3f} "
              f"{one['log_score_together']:8.3f}    {one['coverage']:.3f} ({low:.3f}..{high:.3f})"
              f"   {one['coverage_50']:.2f}  {one['median_factor']:.2f}")  # fmt: skip
    if options.json:
        with atomic_write(options.json) as file:
            json.dump(found, file, indent=1)


if __name__ == "__main__":
    main()
