"""Changes of a motion without integrating anew, held against scipy's own state-space simulation."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import StateSpace, lsim

import picchio
from picchio.excitation.piecewise import superposed
from picchio.excitation.pulse_train import HalfSineTrain, PulseTrain
from picchio.model.expansion import WideChain
from picchio.model.geometry import Geometry
from picchio.model.model import Model
from picchio.vibration.integration.integrate import Samples, follow, make_plan
from picchio.vibration.integration.sensitivity import (
    Strike,
    blow_changes,
    motion_changes,
)

FINE = 20  # scipy's steps to one sample: it takes the force as straight between its steps


def simulated(system, force, samples):
    """Position, velocity, acceleration (count, N) of the linear part, by scipy."""
    n = len(system.coordinates)
    inverse = np.linalg.inv(system.mass)
    held = inverse @ np.hstack([system.stiffness, system.damping])
    state = np.block([[np.zeros((n, n)), np.eye(n)], [-held]])
    push = np.concatenate([np.zeros(n), inverse @ system.force])[:, None]
    fine = np.arange(FINE * (samples.count - 1) + 1) * samples.step / FINE
    out = np.vstack([np.eye(2 * n), -held])
    through = np.concatenate([np.zeros(2 * n), push[n:, 0]])[:, None]
    _, y, _ = lsim(StateSpace(state, push, out, through), force(fine), fine)
    return [part[::FINE] for part in (y[:, :n], y[:, n : 2 * n], y[:, 2 * n :])]


@pytest.fixture(scope="module")
def plant_of():
    robot = picchio.load_robot("ur10")
    pose = np.array([0.3, -1.1, 1.4, -0.5, 0.7, 0.2])
    geometry = Geometry(WideChain(robot), pose)
    return lambda: Model(robot).plant(geometry)


def heavier(plant, size):
    plant.add_mass(0.1 * size, "wrist_1_link", (0.02, 0.1, 0.0))


def softer(plant, size):
    plant.springs["elbow_joint"] *= np.exp(0.02 * size)


def damped(plant, size):
    plant.damping_scale *= np.exp(0.1 * size)


def aside(plant, size):
    plant.force_offset = plant.force_offset + np.array([0.0, 0.004 * size, 0.0])


@pytest.mark.parametrize("change", [heavier, softer, damped, aside])
def test_a_change_is_what_two_simulations_of_scipy_differ_by(plant_of, change):
    direction = np.array([0.6, 0.0, 0.8])
    samples = Samples(0.0, 1e-3, 400)
    # Half-sines have no jumps, at which scipy's steps would have to end.
    force = HalfSineTrain(force=300.0, period=0.05, width=0.008).burst(4)

    def built(size):
        plant = plant_of()
        change(plant, size)
        return plant.build(direction)

    small = 0.01
    system, before, after = built(0.0), built(-small), built(small)
    plan = make_plan(force, samples, 2.5e-4)
    found = motion_changes(system, plan, samples.count, [(before, after), (before, system)])
    for one, other, weights in zip(
        simulated(before, force, samples),
        simulated(after, force, samples),
        (found.position, found.velocity, found.acceleration),
        strict=True,
    ):
        expected = other - one
        assert (
            np.abs((weights[0] @ found.series).T - expected).max() < 2e-3 * np.abs(expected).max()
        )
        halves = (weights[1] @ found.series).T
        assert np.abs(halves - 0.5 * expected).max() < 2e-2 * np.abs(expected).max()


@pytest.mark.parametrize("at_jumps", ["after", "mean", "moments"])
@pytest.mark.parametrize("train", [PulseTrain, HalfSineTrain, "ramped"])
@pytest.mark.parametrize("start", [-0.003, 0.0, 0.0214])
def test_single_blows_add_up_to_the_motion_that_steps_give(plant_of, start, train, at_jumps):
    samples = Samples(-0.01, 1e-3, 300)
    kind = PulseTrain if train == "ramped" else train
    shape = kind(force=1.0, period=0.05, width=0.008).unit_blows[0]
    if train == "ramped":
        shape = shape.ramped(7e-4)
    system = plant_of().build(np.array([0.6, 0.0, 0.8]))
    nothing = (np.zeros_like(system.mass_gradient), np.zeros_like(system.force_gradient))
    linear = replace(system, mass_gradient=nothing[0], gravity_curvature=nothing[0],
                     force_gradient=nothing[1])  # fmt: skip
    force = superposed(np.array([start, 0.11]), [(np.array([300.0, -200.0]), shape)])
    stepped = follow(linear, make_plan(force, samples, 1e-4, at_jumps=at_jumps), samples.count)
    strikes = [Strike(shape, start, 300.0), Strike(shape, 0.11, -200.0)]
    found = blow_changes(linear, samples, at_jumps, [[], strikes])
    for weights, expected in zip(
        (found.position, found.velocity, found.acceleration),
        (stepped.position, stepped.velocity, stepped.acceleration),
        strict=True,
    ):
        nothing, both = weights @ found.series
        assert not nothing.any()
        assert np.abs(both.T - expected).max() < 1e-6 * np.abs(expected).max()


def test_where_a_joint_has_slack_there_is_no_such_change(plant_of):
    from picchio.model.system import Element, ElementKind

    plant = plant_of()
    system = plant.build(np.array([0.0, 0.0, 1.0]))
    row = np.zeros((1, len(system.coordinates)))
    slack = replace(system, elements=(Element(ElementKind.CUBIC, (1e9,)),), rows=row)
    force = HalfSineTrain(force=300.0, period=0.05, width=0.008).burst(1)
    plan = make_plan(force, Samples(0.0, 1e-3, 50), 1e-3)
    assert motion_changes(slack, plan, 50, [(system, system)]) is None
    assert blow_changes(slack, Samples(0.0, 1e-3, 50), "after", []) is None
