"""Work shared among processes: the same results to the last bit, whatever happens to them."""

import json
import multiprocessing
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trial

import picchio
from picchio.core.errors import InputError
from picchio.core.workers import Worker, shared_array, worker_pool
from picchio.diagnosis.attempt import trials
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.fit.least_squares import fit
from picchio.diagnosis.percussion.fit.parallel import parallel_records
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.search.candidates import all_candidates, measure_scales
from picchio.diagnosis.percussion.search.state import Search
from picchio.diagnosis.percussion.search.trials import try_candidates
from picchio.model.effects.registry import effect_class

ARM = "fanuc_like_3dof"
CASE = {"robot": ARM, "kind": "single", "effect": "payload", "snr": 40, "draw": 0, "records": 3}

linux = pytest.mark.skipif(sys.platform != "linux", reason="nothing is forked elsewhere")


@pytest.fixture(scope="module")
def campaign():
    return trial.make(CASE)[0]


@pytest.fixture
def problem(campaign):
    return Problem(picchio.load_robot(ARM), campaign, workers=2)


@pytest.fixture
def start(problem):
    return Hypothesis.baseline(problem.robot, problem.campaign.tolerance)


def test_workers_change_nothing(campaign):
    """Processes or not: the same suspects, the same fits."""
    names = ("payload", "joint_stiffness", "coulomb_friction", "sensor_gain", "mains_hum")
    found = []
    for workers in (1, 2):
        problem = Problem(picchio.load_robot(ARM), campaign, workers=workers)
        start = Hypothesis.baseline(problem.robot, campaign.tolerance)
        with parallel_records(problem):
            base = fit(problem, start, iterations=3)
            scales = measure_scales(
                problem, base.hypothesis.effects, problem.predictions(base.hypothesis.effects)
            )
            some = [c for c in all_candidates(problem) if c[0].name in names]
            search = Search(problem, some, scales, problem.records, (), base, base)
            trials = try_candidates(search, base.hypothesis)
        assert all(t.fit.records for t in trials)
        found.append([(t.label, t.promise, t.score, t.fit.hypothesis) for t in trials])
    assert found[0] == found[1]
    assert found[0][0][0] == "payload:tool"


def test_what_fails_in_a_worker_gives_nothing():
    def fail(item):
        if item == 3:
            raise InputError("broken", key="item", value=item)
        return -item

    for workers in (1, 2):
        with worker_pool(workers, trials({"fail": fail})) as mapped:
            assert mapped("fail", [1, 2, 4]) == [-1, -2, -4]
            assert mapped("fail", [1, 3, 2]) == [-1, None, -2]


def _late(start, rate):
    return start.plus(effect_class("clock_drift")("accelerometer.tool", rate=rate)).effects


def _same(problem, effects, end=None):
    """Whether shared residuals are those of this process alone; and that they were shared."""
    told = problem.helpers.residuals(tuple(effects), problem.records, end)
    assert told is not None
    alone = problem.own_residuals(effects, problem.records, end)
    return all(np.array_equal(a, b) for a, b in zip(told, alone, strict=True))


@linux
def test_shared_records_are_predicted_alike(problem, start):
    drift = _late(start, 3e-4)
    with parallel_records(problem):
        assert _same(problem, start.effects)
        assert _same(problem, drift, 0.5)
        free = problem.residuals(drift)
        with problem.pinned(start.effects):
            assert _same(problem, drift)
            assert not np.array_equal(problem.residuals(drift)[-1], free[-1])
            with problem.pinned(drift):
                assert _same(problem, drift)
            assert _same(problem, drift)
        assert _same(problem, drift)
        # Less than it costs to send.
        assert problem.helpers.residuals(start.effects, problem.records, 0.05) is None
    assert problem.helpers is None


@linux
def test_shared_changes_are_those_of_one_process(problem, start):
    before, after = (start.plus(effect_class("payload")("tool", mass=m)).effects for m in (0, 0.2))
    pairs = [(before, after), (after, before)]
    alone = problem.own_changes(before, pairs, problem.records, None)
    whitened = problem.changes(before, pairs, problem.records, None)
    with parallel_records(problem):
        told = problem.helpers.changes(before, pairs, problem.records, None)
        assert all(np.array_equal(a, b) for a, b in zip(told, alone, strict=True))
        shared = problem.changes(before, pairs, problem.records, None)
    assert all(np.abs(own).max() > 1.0 for own in alone)
    for ours, theirs in zip(shared, whitened, strict=True):
        assert all(np.array_equal(a, b) for a, b in zip(ours, theirs, strict=True))


@linux
def test_what_a_worker_writes_in_shared_memory_is_read_here():
    room = shared_array((3, 2), np.float32)

    def write(k):
        room[k] = k + 1.0
        return multiprocessing.current_process().daemon

    with worker_pool(2, {"write": write}) as mapped:
        assert mapped("write", range(3)) == [True] * 3  # in others
    assert room.tolist() == [[1.0, 1.0], [2.0, 2.0], [3.0, 3.0]]
    assert shared_array((0, 4), np.float32).shape == (0, 4)


def test_a_worker_forks_no_others():
    def within(item):
        with worker_pool(2, {"who": lambda _: os.getpid()}) as mapped:
            return os.getpid(), set(mapped("who", [1, 2, 3]))

    with worker_pool(2, {"within": within}) as mapped:
        told = mapped("within", range(3))
    assert all({own} == forked != {os.getpid()} for own, forked in told)


@linux
def test_an_error_leaves_no_answer_behind(problem, start):
    nowhere = (*start.effects, effect_class("joint_stiffness")("nowhere", scale=0.9))
    with parallel_records(problem):
        for _ in range(2):
            with pytest.raises(InputError, match="nowhere"):
                problem.residuals(nowhere)
            assert _same(problem, start.effects)


@linux
def test_it_goes_on_alone_when_a_helper_is_killed(problem, start):
    alone = problem.own_residuals(start.effects, problem.records, None)
    with parallel_records(problem):
        assert _same(problem, start.effects)
        helper = problem.helpers._workers[0].process
        os.kill(helper.pid, signal.SIGKILL)
        helper.join()
        for _ in range(2):
            told = problem.residuals(start.effects)
            assert all(np.array_equal(a, b) for a, b in zip(told, alone, strict=True))


@linux
def test_one_that_is_killed_in_the_midst_of_an_answer_holds_nobody_up():
    """Ctrl-C does that; with one queue for all, what was half written was waited for for ever."""
    worker, other = Worker(bytes), Worker(len)
    worker.connection.send(10**7)
    assert worker.connection.poll(30.0)  # more than a pipe holds, so that it is not all written
    os.kill(worker.process.pid, signal.SIGKILL)
    with pytest.raises((EOFError, OSError)):
        worker.connection.recv()
    other.connection.send("four")
    assert other.connection.recv() == 4
    worker.connection.close()
    worker.process.join(5.0)
    other.end()
    assert not worker.process.is_alive() and not other.process.is_alive()


@linux
def test_what_a_killed_worker_was_at_is_done_here():
    here = os.getpid()

    def risky(item):
        if item == 2 and os.getpid() != here:
            os.kill(os.getpid(), signal.SIGKILL)
        return item, os.getpid() == here

    with worker_pool(2, {"risky": risky}) as mapped:
        told = mapped("risky", [1, 2, 3, 4])
        assert [item for item, _ in told] == [1, 2, 3, 4] and told[1][1]
        assert not all(alone for _, alone in told)
        assert all(alone for _, alone in mapped("risky", [3, 4]))


LOADED = """
import sys
sys.path[:0] = {folders!r}
import gc
import numba
import picchio, trial
from picchio.diagnosis.percussion.search.candidates import all_candidates, measure_scales
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.search.candidates import warm_up

def loaded():
    found = [o for o in gc.get_objects() if isinstance(o, numba.core.registry.CPUDispatcher)]
    ours = [len(o.signatures) for o in found if o.__module__.startswith("picchio")]
    return sum(ours), len(sys.modules)

campaign, _ = trial.make({case!r})
problem = Problem(picchio.load_robot({arm!r}), campaign, workers={workers})
candidates = all_candidates(problem)
before = loaded()
warm_up(problem, candidates)
after = loaded()
nominal = Hypothesis.baseline(problem.robot, campaign.tolerance)
scales = measure_scales(problem, nominal.effects, problem.predictions(nominal.effects))
for kind, target in candidates:
    for values in kind(target).trials(scales):
        try:
            effects = nominal.plus(kind(target, **values)).effects
            problem.own_residuals(effects, problem.records, None)
        except picchio.InputError:
            pass
print(before, after, loaded(), sep=";")
"""


def _loaded(workers):
    script = LOADED.format(
        folders=[str(Path(trial.__file__).parent), trial.TESTS], case=CASE, arm=ARM, workers=workers
    )
    told = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert not told.returncode, told.stderr
    return told.stdout.strip().splitlines()[-1].split(";")


def test_what_effects_need_is_loaded_before_processes_are_forked():
    before, after, end = _loaded(workers=2)
    assert before != after == end


def test_one_process_loads_when_it_needs():
    before, after, end = _loaded(workers=1)
    assert before == after != end


ANSWER = """
import json
import multiprocessing
import sys
sys.path[:0] = {folders!r}
import picchio, trial
from picchio.diagnosis.percussion.diagnosis import diagnose_percussion

if __name__ == "__main__":
    campaign, _ = trial.make({case!r})
    found = diagnose_percussion(picchio.load_robot({arm!r}), campaign, workers={workers})
    print(json.dumps(found.diagnosis.to_dict()))
"""


@pytest.mark.slow
def test_the_same_data_get_the_same_answer():
    """Whatever order Python's sets have in a run, and however many processes there are."""
    case = {"robot": ARM, "kind": "pair", "snr": 40, "draw": 1, "records": 9}
    answers = []
    for seed, workers in (("1", 1), ("2", 2)):
        script = ANSWER.format(
            folders=[str(Path(trial.__file__).parent), trial.TESTS],
            case=case,
            arm=ARM,
            workers=workers,
        )
        told = subprocess.run(
            [sys.executable, "-c", script],
            capture_output=True, text=True, env={**os.environ, "PYTHONHASHSEED": seed},
        )  # fmt: skip
        assert not told.returncode, told.stderr
        answers.append(told.stdout)
    assert json.loads(answers[0])["format"] == "picchio-diagnosis/1"
    assert len(set(answers)) == 1
