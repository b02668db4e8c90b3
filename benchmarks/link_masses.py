"""How well an arm's masses are foretold by its lengths; fitted to the shipped robots.

    python benchmarks/link_masses.py

Prints the four numbers of `picchio.robot.estimate.masses`, and how far the largest inertia about
each joint is off, each robot by numbers fitted to the others.
"""

from __future__ import annotations

import warnings

import numpy as np
from scipy.optimize import minimize

import picchio
from picchio.robot.estimate import masses
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.loading.catalogue import shipped_robots
from picchio.robot.urdf.shapes import link_ends
from picchio.robot.urdf.tree import MOVABLE

NAMES = ("AT_ONE_METRE", "GROWTH", "TAPER", "LEAST_LENGTH")


def arms() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Of every shipped arm that has a length: its links' lengths, m, and their masses, kg."""
    found = {}
    for name in sorted(shipped_robots()):
        robot = picchio.load_robot(name, allow_rigid=True)
        lengths = np.linalg.norm(link_ends(robot.tree, robot.tool_frame), axis=1)
        if lengths.sum() > 0.0:
            found[name] = lengths, own_masses(robot)
    return found


def own_masses(robot: FlexibleRobot) -> np.ndarray:
    tree = robot.tree
    moving = [j.name for j in tree.chain(robot.tool_frame) if j.type in MOVABLE and not j.mimic]
    beyond = [sum(body.mass for link in tree.beyond(name) if (body := tree.links[link]))
              for name in moving]  # fmt: skip
    return np.array(beyond) - np.array([*beyond[1:], 0.0])


def held(lengths: np.ndarray, own: np.ndarray) -> np.ndarray:
    """kg m^2, about each of the first three joints, of the stretched arm as rods."""
    start = np.cumsum([0.0, *lengths[:-1]])
    found = []
    for k in range(min(3, len(own))):
        near, far = start[k:] - start[k], start[k:] - start[k] + lengths[k:]
        found.append(float(own[k:] @ (near**2 + near * far + far**2)) / 3.0)
    return np.array(found)


def set_to(numbers: np.ndarray) -> None:
    for name, value in zip(NAMES, numbers, strict=True):
        setattr(masses, name, float(value))


def off(numbers: np.ndarray, data: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """ln of foretold over true inertia, of every arm's joints."""
    set_to(np.array([np.exp(numbers[0]), numbers[1], numbers[2], np.exp(numbers[3])]))
    parts = [np.log(held(lengths, masses.masses(lengths)) / held(lengths, own))
             for lengths, own in data]  # fmt: skip
    return np.concatenate(parts)


def fit(data: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    start = np.array([np.log(18.0), 3.0, 0.7, np.log(0.08)])
    return minimize(lambda x: np.abs(off(x, data)).sum() + 0.1 * ((x - start) ** 2).sum(), start,
                    method="Nelder-Mead", options={"maxiter": 4000}).x  # fmt: skip


def main() -> None:
    warnings.simplefilter("ignore")
    found = arms()
    every = list(found.values())
    missed = []
    for k, (name, own) in enumerate(found.items()):
        left = off(fit(every[:k] + every[k + 1 :]), [own])
        missed.append(left)
        print(f"{name:20s} {own[0].sum():5.2f} m {own[1].sum():7.1f} kg   foretold over true: "
              + " ".join(f"{value:.2f}" for value in np.exp(left)))  # fmt: skip
    ratio = np.concatenate(missed)
    print(f"left out: median factor {np.exp(np.median(np.abs(ratio))):.2f}, "
          f"one standard deviation {np.exp(np.std(ratio)):.2f}")  # fmt: skip
    best = fit(every)
    numbers = [np.exp(best[0]), best[1], best[2], np.exp(best[3])]
    print(", ".join(f"{name} {value:.3g}" for name, value in zip(NAMES, numbers, strict=True)))


if __name__ == "__main__":
    main()
