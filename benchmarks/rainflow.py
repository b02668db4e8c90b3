"""Rainflow counting: ours, pyLife's compiled four-point counter, and the `rainflow` package.

    python benchmarks/rainflow.py [--samples 1000000] [--repeat 7] [--json FILE]

Every counter gets the same samples in the same run, best of `--repeat` (the pure-Python package
gets one go on a tenth of the samples: it is linear). pyLife counts without the residue.
"""

from __future__ import annotations

import argparse
import importlib
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
from pylife.stress.rainflow import FourPointDetector, LoopValueRecorder

from picchio.fatigue.counting.counter import rainflow


def package() -> ModuleType:
    """The `rainflow` package: this file has its name, and its folder comes first on the path."""
    here = Path(__file__).resolve().parent
    sys.path[:] = [entry for entry in sys.path if Path(entry or ".").resolve() != here]
    return importlib.import_module("rainflow")


def signals(samples: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(1)
    t = np.arange(samples) * 1e-3
    return {
        "white noise": rng.normal(size=samples),
        "random walk": np.cumsum(rng.normal(size=samples)),
        "blows": np.exp(-3.0 * (t % 2.0)) * np.sin(2.0 * np.pi * 5.3 * (t % 2.0)),
    }


def best(call: Callable[[], object], repeat: int) -> float:
    times = []
    for _ in range(repeat):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return min(times)


def pylife(signal: np.ndarray) -> LoopValueRecorder:
    recorder = LoopValueRecorder()
    FourPointDetector(recorder=recorder).process(signal)
    return recorder


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=1_000_000)
    parser.add_argument("--repeat", type=int, default=7)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    extract = package().extract_cycles
    rainflow([0.0, 2.0, 1.0, 3.0])  # compile, or load what was compiled
    rows: dict[str, dict[str, float]] = {}
    print(f"{options.samples} samples; seconds, and how many times ours it takes")
    print(f"{'signal':<12} {'ours':>9} {'pyLife':>9} {'rainflow':>9} {'pyLife/ours':>12} "
          f"{'rainflow/ours':>14}")  # fmt: skip
    for name, signal in signals(options.samples).items():
        part = signal[: len(signal) // 10].tolist()
        ours = best(lambda signal=signal: rainflow(signal), options.repeat)
        theirs = best(lambda signal=signal: pylife(signal), options.repeat)
        slow = 10.0 * best(lambda part=part: list(extract(part)), 1)
        counted = rainflow(signal, "discarded")
        values = pylife(signal)
        if len(counted) != len(values.values_from):
            sys.exit(f"{name}: {len(counted)} closed cycles, pyLife {len(values.values_from)}")
        rows[name] = {
            "ours_s": ours, "pylife_s": theirs, "rainflow_s": slow,
            "pylife_over_ours": theirs / ours, "rainflow_over_ours": slow / ours,
        }  # fmt: skip
        print(f"{name:<12} {ours:9.4f} {theirs:9.4f} {slow:9.3f} {theirs / ours:12.2f} "
              f"{slow / ours:14.1f}")  # fmt: skip
    if options.json:
        report = {"format": "picchio-benchmark/1", "samples": options.samples, "signals": rows}
        options.json.write_text(json.dumps(report, indent=2) + "\n")


if __name__ == "__main__":
    main()
