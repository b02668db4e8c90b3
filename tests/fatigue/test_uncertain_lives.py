from __future__ import annotations

import math

import numpy as np
import pytest
from SALib.analyze import sobol as salib
from SALib.sample import sobol as salib_sample

from picchio.core.errors import InputError
from picchio.fatigue.uncertain_lives import REPLICATES, Draws, LifeSpread, Uncertain, summarise


def propagate(inputs, model, samples: int = 2048, seed: int = 0) -> LifeSpread:
    draws = Draws(len(inputs), seed)
    while draws.scores.shape[1] * REPLICATES < samples:
        draws.more()

    def run(scores: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        columns = zip(inputs.items(), np.moveaxis(scores, -1, 0), strict=True)
        return model({name: each.at(column) for (name, each), column in columns})

    mixed = run(draws.mixed(draws.scores.shape[1]))[1]
    return summarise(list(inputs), draws.scores, *run(draws.scores), mixed)


def power_law(values: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Life (a b^2)^-8: log-normal, so every quantile and share has a closed form."""
    stress = values["a"] * values["b"] ** 2 + 0.0 * values["idle"]
    return 1e6 * stress**-8.0, stress


INPUTS = {
    "a": Uncertain(1.0, 0.10), "b": Uncertain(1.0, 0.05), "idle": Uncertain(5.0, 0.3, "uniform"),
}  # fmt: skip


def test_closed_form_of_a_power_law() -> None:
    # ln stress ~ Normal(0, 0.1^2 + (2 * 0.05)^2): half the variance each.
    spread = propagate(INPUTS, power_law, samples=4096, seed=1)
    sigma = 8.0 * math.sqrt(0.02)
    assert spread.p50 == pytest.approx(1e6, rel=0.02)
    assert spread.p10 == pytest.approx(1e6 * math.exp(-1.281552 * sigma), rel=0.03)
    assert spread.p90 == pytest.approx(1e6 * math.exp(1.281552 * sigma), rel=0.03)
    for table in (spread.shares, spread.totals):
        assert table["a"] == pytest.approx(0.5, abs=0.04)
        assert table["b"] == pytest.approx(0.5, abs=0.04)
        assert table["idle"] == pytest.approx(0.0, abs=0.01)
    assert spread.endless == 0.0


def test_one_seed_one_result() -> None:
    first, again = (propagate(INPUTS, power_law, samples=64, seed=3) for _ in range(2))
    assert first == again
    other = propagate(INPUTS, power_law, samples=64, seed=4)
    assert other != first


def test_shares_with_interaction_agree_with_salib() -> None:
    # Ishigami's function, whose indices are known; SALib on its own samples gives the same.
    def ishigami(x: np.ndarray) -> np.ndarray:
        return np.asarray(
            np.sin(x[..., 0])
            + 7.0 * np.sin(x[..., 1]) ** 2
            + 0.1 * x[..., 2] ** 4 * np.sin(x[..., 0])
        )

    inputs = {name: Uncertain(1.0, math.pi, "uniform") for name in ("x1", "x2", "x3")}

    def model(values: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        y = ishigami(np.stack([values[name] - 1.0 for name in inputs], axis=-1))
        return np.exp(y), np.exp(y)

    ours = propagate(inputs, model, samples=8192, seed=0)
    problem = {"num_vars": 3, "names": list(inputs), "bounds": [[-math.pi, math.pi]] * 3}
    points = salib_sample.sample(problem, 4096, calc_second_order=False, seed=0)
    theirs = salib.analyze(problem, ishigami(points), calc_second_order=False, seed=0)
    exact = {"x1": (0.3139, 0.5576), "x2": (0.4424, 0.4424), "x3": (0.0, 0.2437)}
    for i, name in enumerate(inputs):
        assert ours.shares[name] == pytest.approx(float(theirs["S1"][i]), abs=0.03)
        assert ours.totals[name] == pytest.approx(float(theirs["ST"][i]), abs=0.03)
        assert ours.shares[name] == pytest.approx(exact[name][0], abs=0.03)
        assert ours.totals[name] == pytest.approx(exact[name][1], abs=0.03)


def test_lives_without_end_keep_their_ranking() -> None:
    def model(values: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        stress = values["a"]
        return np.where(stress < 1.0, np.inf, 1e6 * stress**-8), stress

    spread = propagate({"a": Uncertain(1.0, 0.1)}, model, samples=1024)
    assert spread.endless == pytest.approx(0.5, abs=0.01)
    assert spread.p90 == math.inf
    assert spread.p10 < 1e6
    assert spread.p90 == math.inf
    assert spread.shares["a"] == pytest.approx(1.0, abs=0.02)


def test_the_sampling_interval_covers_the_closed_form() -> None:
    # ln life is normal with sigma 8 sqrt(0.02): 60 seeds x 3 quantiles, 95 % each.
    sigma, inside = 8.0 * math.sqrt(0.02), []
    for seed in range(60):
        found = propagate(INPUTS, power_law, samples=256, seed=seed)
        for name, z in (("p10", -1.281552), ("p50", 0.0), ("p90", 1.281552)):
            low, high = found.sampling[name]
            inside.append(low <= 1e6 * math.exp(z * sigma) <= high)
    assert 0.90 <= np.mean(inside) <= 0.98


def test_bad_inputs_are_named() -> None:
    for call, key in (
        (lambda: propagate({}, power_law), "inputs"),
        (lambda: propagate(INPUTS, lambda v: (v["a"] * np.nan, v["a"])), "life"),
        (lambda: propagate(INPUTS, lambda v: (v["a"], -v["a"])), "measure"),
        (lambda: Uncertain(1.0, -0.1), "spread"),
        (lambda: Uncertain(1.0, 0.1, "gauss"), "shape"),  # type: ignore[arg-type]
    ):
        with pytest.raises(InputError, match=key):
            call()
