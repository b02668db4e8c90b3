"""About which model, and which inexact numbers, the records are linearised."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.diagnosis.percussion.data.problem import MeasuredRecord, Moved, Problem, signal_power
from picchio.diagnosis.percussion.fit.drawn import refit
from picchio.diagnosis.percussion.fit.least_squares import (
    Fit,
    central_jacobian,
    fit,
    is_nonsmooth,
    prior_cost,
)
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.tolerance.alone import FARTHEST, left_behind, sought_alone
from picchio.diagnosis.percussion.tolerance.marginal import Marginal
from picchio.diagnosis.percussion.tolerance.nudges import POSE, inexact, nudged
from picchio.diagnosis.percussion.tolerance.slopes import Slopes, all_slopes, slopes_of

# Standard deviations beyond which it is asked whether a number had to go there.
_FAR = 3.0
# The stretch, s, that is looked at first; how often slopes are taken at most, how often numbers are
# moved by the same ones, what share of the fall that they foretold must come for that, and what
# fall of the cost asks for one move more.
_SHORT = 0.16
_KINKED = (_SHORT, 0.3, 0.6, None)  # where a small error early is a large one late
_ROUNDS = 3
_MOVES = 3
_TRUSTED = 0.5
_SETTLED = 0.002
# To how much of the cost slopes must foretell it where values are told: a part of a deviation.
_TOLD = 1.0
_LAST_ROUNDS = 8
# To how much they must foretell it to be the same where it comes to stand.
_STRAIGHT = 0.1
# What share of a foretold fall must come: numbers that are held at the farthest explain no more.
_LITTLE_CAME = 0.02
# Chi-square per sample above which more is wrong than what is not exact.
ELSE = 3.0
# What is not exact explains little where it leaves more than this share of chi-square.
_LITTLE = 0.5
# One standard deviation that would move a record by so many times what it shows is beyond slopes.
_WHOLE = 3.0
# How far numbers are moved towards where slopes have them, until that is for the better.
_SHARES = (1.0, 0.5, 0.2, 0.05)


def linearise(
    problem: Problem,
    here: Hypothesis,
    fitted: Sequence[MeasuredRecord],
    end: float | None = None,
    both: bool = False,
) -> list[FloatArray]:
    """Have what is never exact integrated out of all residuals, to first order about a hypothesis.

    What its own unknowns can take up of what the campaign shares is left to them: a link that
    is heavier looks like a softer joint, and what is left of it is small, so that it stays linear.
    What they take up makes them less sure (`Absorbed`).

    Args:
        problem: what is changed: its `marginal`, and where its inexact numbers are taken to be.
        here: the hypothesis.
        fitted: the records that it is fitted to: what its unknowns take up they take up there.
        end: s, up to when; None for whole records.
        both: take slopes either way. What the unknowns take up must cancel to a thousandth, or the
            little that is left passes for knowledge of what no record can tell, such as the mass of
            all. That matters for how sure values are, not for which model is the better.

    Returns:
        the hypothesis's Jacobian in every record, in units of the noise alone; none where
        everything is exact.
    """
    effects = here.effects
    slopes = all_slopes(problem, effects, end, both)
    if len(slopes) < len(problem.records) or not any(s.what for s in slopes.values()):
        problem.marginal = None
        return []
    if is_nonsmooth(here):
        signals = {r.name: math.sqrt(signal_power([r])) for r in problem.records}
        slopes = {n: s.silenced(_WHOLE * signals[n]) for n, s in slopes.items()}
    _place(problem)
    problem.marginal, problem.shifts = None, {}
    raw = problem.unmarginalised(effects, None, end)
    jacobians = central_jacobian(problem, here, problem.records, end, raw)
    shared, absorbed = _without(problem, slopes, jacobians, {r.name for r in fitted})
    unknowns = [(here.effects[u.effect].label, u.name) for u in here.unknowns()]
    problem.marginal = Marginal(shared, dict(zip(unknowns, absorbed, strict=True)))
    problem.unsettled = 0.0
    _shift(problem)
    return jacobians


def _whitened(
    problem: Problem,
    here: Hypothesis,
    jacobians: Sequence[FloatArray],
    records: Sequence[MeasuredRecord],
) -> list[FloatArray]:
    """Jacobians of all records, of some of them and with what is never exact integrated out."""
    assert problem.marginal is not None
    names, labels = [r.name for r in records], [effect.label for effect in here.effects]
    known = {r.name: one for r, one in zip(problem.records, jacobians, strict=True)}
    found = [np.empty_like(known[name]) for name in names]
    for k in range(found[0].shape[1]):
        rows = [known[r.name][:, k].reshape(len(r.values), -1) for r in records]
        for own, column in zip(found, problem.marginal.whitened(rows, names, labels), strict=True):
            own[:, k] = column.ravel()
    return found


def beside(problem: Problem, record: MeasuredRecord, here: Hypothesis) -> Moved | None:
    """Have what is never exact integrated out of one more record, which is not the campaign's.

    Args:
        problem: what is changed, until its slopes are taken anew or restored.
        record: as it is stated; what its channels read does not matter.
        here: the hypothesis.

    Returns:
        where its inexact numbers are taken to be; None where everything is exact, or as stated.
    """
    marginal = problem.marginal
    if marginal is None:
        return None
    some = next(iter(marginal.slopes.values()))
    slopes = slopes_of(problem, record, here.effects, some.what[some.own :])
    problem.marginal = None
    (raw,) = problem.unmarginalised(here.effects, [record])
    (jacobian_of,) = central_jacobian(problem, here, [record], None, [raw])
    taken = np.zeros((jacobian_of.shape[1], len(some.what) - some.own))
    for k, u in enumerate(here.unknowns()):
        taken[k] = marginal.absorbed.get((here.effects[u.effect].label, u.name), 0.0)
    slopes.columns[:, :, slopes.own :] -= (jacobian_of @ taken).reshape(*raw.shape, -1)
    problem.marginal = Marginal({**marginal.slopes, record.name: slopes}, marginal.absorbed)
    if not problem.sizes:
        return None
    # What the campaign shares is where the campaign has it.
    size = next(iter(problem.sizes.values()))[some.own :]
    size = np.concatenate([np.zeros(slopes.own), size])
    moved = Moved(*nudged(record, slopes.moved(size)), size)
    problem.moved = {**problem.moved, record.name: moved}
    problem.shifts = {**problem.shifts, record.name: slopes.by(size)}
    problem.renew()
    return moved


def _without(
    problem: Problem,
    slopes: Mapping[str, Slopes],
    jacobians: Sequence[FloatArray],
    fitted: Set[str],
) -> tuple[dict[str, Slopes], FloatArray]:
    """The slopes without what a fit's unknowns take up of the shared ones; that, (unknowns, k).

    As the fit does it: by the records that are fitted, their own numbers integrated out. Records
    held out then show just what the fit could not know.
    """
    from picchio.diagnosis.percussion.tolerance.kernel import less_taken_up

    names = [r.name for r in problem.records]
    pairs = dict(zip(names, jacobians, strict=True))
    crosses = {n: _across(slopes[n].columns, pairs[n]) for n in names}
    inner = {n: pairs[n].T @ pairs[n] for n in names}
    normal: FloatArray | float = 0.0
    right: FloatArray | float = 0.0
    for name in names:
        if name in fitted and not slopes[name].silent:
            own, gram, cross = slopes[name].own, slopes[name].gram, crosses[name]
            narrowed = cross[:, :own] @ np.linalg.inv(np.eye(own) + gram[:own, :own])
            normal = normal + inner[name] - narrowed @ cross[:, :own].T
            right = right + cross[:, own:] - narrowed @ gram[:own, own:]
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    inverse = np.linalg.pinv(normal / np.outer(scale, scale), hermitian=True)
    absorbed = inverse @ (right / scale[:, None]) / scale[:, None]
    found = {}
    for name in names:
        if slopes[name].silent:
            found[name] = slopes[name]
            continue
        own, columns, gram = slopes[name].own, slopes[name].columns.copy(), slopes[name].gram.copy()
        less_taken_up(columns, own, np.ascontiguousarray(pairs[name]), absorbed)
        taken = crosses[name].T @ absorbed
        gram[:, own:] -= taken
        gram[own:] -= taken.T
        gram[own:, own:] += absorbed.T @ inner[name] @ absorbed
        found[name] = replace(slopes[name], columns=columns, gram=gram)
    return found, absorbed


def _across(columns: np.ndarray, jacobian_of: FloatArray) -> FloatArray:
    """(n, k) products of (samples, n) with columns (channels, samples, k)."""
    from picchio.diagnosis.percussion.tolerance.kernel import across

    found = np.empty((jacobian_of.shape[1], columns.shape[2]))
    across(columns, np.ascontiguousarray(jacobian_of), found)
    return found


def settled(
    problem: Problem,
    start: Fit,
    records: Sequence[MeasuredRecord],
    rounds: int = _ROUNDS,
    *,
    anew: bool = True,
    patient: bool = False,
    give_up: Callable[[Fit, float | None], bool] | None = None,
) -> Fit:
    """A hypothesis fitted together with what is not exact, linearised where it comes to stand.

    A long record at once lets a frequency skip cycles: the stretch that is looked at grows. Where
    what is not exact cannot explain the first stretch, something else is wrong: then it stays where
    it is stated, or it would be pulled to the ends of what is tolerated.

    Args:
        problem: its slopes, and where its inexact numbers are taken to be, are found anew.
        start: the hypothesis, fitted; where everything is exact, that is all.
        records: to fit; what is inexact in the others is found beside it.
        rounds: how often slopes are taken at most, of the first stretch and of all.
        anew: begin where everything is as stated; else where it is taken to be now. Without the
            right cause it was pulled to wherever it made up for that.
        patient: go on however much is left on the way: nothing else is wrong.
        give_up: asked of a fit on the way. Its second argument is by how much the cost fell since
            slopes were taken before; None where they were not, which is asked only of what begins
            near.

    Raises:
        InputError: it is given up.
    """
    if not any(inexact(problem, problem.records[0], problem.campaign.tolerance)):
        return start
    if anew:
        _move(problem, {})
        problem.idle = frozenset()  # a cause may set free what stood still without it
    here = start.hypothesis
    ends: Sequence[float | None] = _KINKED if is_nonsmooth(here) else (_SHORT, None)
    near = not anew and start.end is None and start.chi_square <= ELSE * start.samples
    if near:
        ends = (None,)  # no cycle is skipped any more
    terms = _Terms(rounds, math.inf if patient else ELSE, give_up, near)
    for end in ends:
        here = _settled_up_to(problem, here, records, end, terms)
    found = fit(problem, here, records, None, with_jacobian=True)
    if is_nonsmooth(here) and found.chi_square <= ELSE * found.samples:
        found = with_those_left_behind(problem, found)
    if found.chi_square > terms.else_wrong * found.samples:
        return _unless_little(problem, found)
    return found


@dataclass(frozen=True)
class _Terms:
    """How long what is not exact is settled.

    Attributes:
        rounds: how often slopes are taken at most.
        else_wrong: chi-square per sample above which something else is wrong.
        give_up: as of `settled`.
        near: whether it begins where little is left.
    """

    rounds: int
    else_wrong: float = math.inf
    give_up: Callable[[Fit, float | None], bool] | None = None
    near: bool = False

    def in_vain(self, found: Fit, fall: float | None, moves: int) -> bool:
        """Whether a fit is given up, after so many moves by the same slopes.

        Args:
            found: the fit.
            fall: of its cost since slopes were taken before; None where they were not.
            moves: how many; only one with new slopes tells anything new.
        """
        known = not moves and (self.near or fall is not None)
        return self.give_up is not None and known and self.give_up(found, fall)


def released(problem: Problem, found: Fit, least: float) -> Fit:
    """A fit settled once more with what stands far off put back; itself, where that is no better.

    A number may have gone there while an unknown that does nearly the same was missing: a blow's
    slow rise for a sensor's delay. Each then holds the other where it is.

    Args:
        problem: linearised about the fit; about the other one, where that is better.
        found: the fit.
        least: fall of the cost that must be in sight.

    Returns:
        the better one.
    """
    if not problem.sizes or problem.marginal is None:
        return found
    name = problem.records[0].name
    own = problem.marginal.slopes[name].own
    shared = np.abs(problem.sizes[name][own:]) >= _FAR
    if not shared.any():
        return found
    before, records = About.of(problem), found.records
    sizes = {n: v.copy() for n, v in problem.sizes.items()}
    for size in sizes.values():
        size[size.size - shared.size :][shared] = 0.0
    _move(problem, sizes)
    linearise(problem, found.hypothesis, records)
    begun = fit(problem, found.hypothesis, records, None, iterations=6)
    # Slopes foretell more than comes of it, if anything.
    if begun.cost < found.cost - least:
        here = _settled_up_to(problem, begun.hypothesis, records, None, _Terms(1))
        again = fit(problem, here, records, None, with_jacobian=True)
        if again.cost < found.cost:
            return again
    before.restore(problem)
    return found


def left_there(problem: Problem, found: Fit) -> float:
    """What a fit costs with its inexact numbers where they are; slopes may foretell less.

    Args:
        problem: linearised about the fit, or near it.
        found: the fit.
    """
    if problem.marginal is None:
        return found.cost
    staying = problem.marginal.only(POSE)
    return _cost(problem, found.hypothesis, None, staying, found.records)


def to_the_last(problem: Problem, found: Fit, *, both: bool = True) -> Fit:
    """A fit settled until its slopes foretell its cost to one unit, for its values to be told.

    While more is wrong models differ by much more; values, how well they are known and a last small
    cause by less: 4 more of the cost are two standard deviations of a value.

    Args:
        problem: linearised about the fit; in the end about the other.
        found: the fit.
        both: as of `linearise`.

    Returns:
        the fit, with its Jacobian.
    """
    records, off = found.records, math.inf
    jacobians: list[FloatArray] = []
    for _ in range(_LAST_ROUNDS):
        here = found.hypothesis
        jacobians = linearise(problem, here, records, both=both)
        found = refit(problem, here, records)
        if problem.marginal is None or found.chi_square > ELSE * found.samples:
            break
        before = _cost(problem, here, None, problem.marginal.only(POSE))
        there, now, kept = _moved_on(problem, here, found)
        found = replace(found, hypothesis=there)
        off = abs(before - now) * abs(1.0 - kept) / max(kept, 1e-300)
        if kept < _LITTLE_CAME or off <= _TOLD:
            break
    if off > _STRAIGHT:
        jacobians = linearise(problem, found.hypothesis, records, both=both)
    # The Jacobian where slopes were taken, or the two would differ, and what no record can tell
    # would pass for known.
    slopes = _whitened(problem, found.hypothesis, jacobians, records) if jacobians else None
    return fit(
        problem, found.hypothesis, records, None,
        iterations=0, with_jacobian=True, slopes=slopes,
    )  # fmt: skip


def with_those_left_behind(problem: Problem, found: Fit) -> Fit:
    """A fit after the records that it left behind have been sought one by one; see `alone`.

    Args:
        problem: linearised about the fit; what is changed.
        found: a fit that leaves little of the records it was fitted to.

    Returns:
        itself, where none was left behind.
    """
    here = found.hypothesis
    sizes = sought_alone(problem, here, left_behind(problem, here))
    if not sizes:
        return found
    _move(problem, {**problem.sizes, **sizes})
    linearise(problem, here, found.records)
    found = fit(problem, here, found.records, None, with_jacobian=True)
    seek_the_silent(problem, found.hypothesis)
    return found


def silent(problem: Problem) -> list[MeasuredRecord]:
    """Records in which small errors grow beyond what slopes can say.

    Args:
        problem: linearised.

    Returns:
        of the campaign's.
    """
    marginal = problem.marginal
    return [r for r in problem.records if marginal is not None and marginal.slopes[r.name].silent]


def seek_the_silent(problem: Problem, here: Hypothesis) -> list[MeasuredRecord]:
    """Have the records that no slopes tell of sought by themselves, about a hypothesis.

    Args:
        problem: linearised; what is changed.
        here: the hypothesis.

    Returns:
        those of which little is left so.
    """
    records = silent(problem)
    sizes = sought_alone(problem, here, records)
    if sizes:
        _move(problem, {**problem.sizes, **sizes})
    left = problem.residuals(here.effects, records) if records else []
    pairs = zip(records, left, strict=True)
    return [record for record, rows in pairs if (rows**2).mean() < ELSE]


def _settled_up_to(
    problem: Problem,
    here: Hypothesis,
    records: Sequence[MeasuredRecord],
    end: float | None,
    terms: _Terms,
) -> Hypothesis:
    """As `settled`, of a first part of the records; slopes serve as long as they lead on."""
    before, earlier = math.inf, None
    for _ in range(terms.rounds):
        linearise(problem, here, records, end)
        moves = 0
        while moves < _MOVES:
            found = fit(problem, here, records, end, iterations=4)
            fall = None if earlier is None else earlier - found.cost
            if terms.in_vain(found, fall, moves):
                raise InputError("another leaves far less")
            if found.chi_square > terms.else_wrong * max(found.samples, 1):
                return _at_stated(problem, found, end)
            if not moves:
                earlier = found.cost
            here, cost, kept = _moved_on(problem, here, found)
            little = before - cost < _SETTLED * cost
            before, moves = cost, moves + 1
            if little or kept < _TRUSTED:
                break
        # What is but on the way need not be settled to the last.
        if little and (moves == 1 or end is not None):
            return here
    if end is None:  # it has moved on since slopes were taken
        linearise(problem, here, records, end)
    return here


def _unless_little(problem: Problem, found: Fit) -> Fit:
    """A fit without what is not exact, where that explains but little of what is left; else it.

    Slopes about a model that is far off lead astray: what is wrong is looked for without them. So
    it is where what is not exact would have to be far beyond what it can be.
    """
    with problem.set_aside():
        plain = fit(problem, found.hypothesis, found.records, None, with_jacobian=True)
    taken = problem.taken_up(found.hypothesis.effects, found.records)
    absurd = taken is not None and taken.is_absurd
    if found.chi_square < _LITTLE * plain.chi_square and not absurd:
        return found
    _move(problem, {})
    if problem.marginal is not None:
        columns = [s.columns for s in problem.marginal.slopes.values()]
        samples = sum(c.shape[0] * c.shape[1] for c in columns)
        problem.unsettled = sum(float((c * c).sum()) for c in columns) / max(samples, 1)
    problem.marginal = None
    return plain


@dataclass(frozen=True, eq=False)
class About:
    """About what the records are linearised: what `linearise` and `recentre` have found.

    Attributes:
        marginal, sizes, moved, shifts, idle, unsettled: the problem's.
    """

    marginal: Marginal | None
    sizes: dict[str, FloatArray]
    moved: dict[str, Moved]
    shifts: dict[str, FloatArray]
    idle: frozenset[str]
    unsettled: float

    @classmethod
    def of(cls, problem: Problem) -> About:
        """As it is now.

        Args:
            problem: whose slopes, and numbers that are not exact.
        """
        return cls(
            problem.marginal, problem.sizes, problem.moved, problem.shifts,
            problem.idle, problem.unsettled,
        )  # fmt: skip

    def without_slopes(self) -> About:
        """The same to go on settling from, where slopes are taken anew: they are large."""
        if self.marginal is None:
            return self
        slopes = {name: one.dropped() for name, one in self.marginal.slopes.items()}
        return replace(self, marginal=Marginal(slopes))

    def restore(self, problem: Problem) -> None:
        """Linearise as it was then.

        Args:
            problem: what is changed.
        """
        known = problem.moved is self.moved
        problem.marginal, problem.sizes, problem.moved = self.marginal, self.sizes, self.moved
        problem.shifts, problem.idle = self.shifts, self.idle
        problem.unsettled = self.unsettled
        if not known:
            problem.renew()


@contextmanager
def about_another(problem: Problem, other: About | None = None) -> Iterator[None]:
    """Within the block other hypotheses may be settled; then all is linearised as before.

    Args:
        problem: whose slopes, and numbers that are not exact, are kept.
        other: about what to linearise within the block; as before where None.

    Returns:
        a context manager.
    """
    kept = About.of(problem)
    if other is not None:
        other.restore(problem)
    try:
        yield
    finally:
        kept.restore(problem)


def _at_stated(problem: Problem, found: Fit, end: float | None) -> Hypothesis:
    """A fit's hypothesis about the numbers as they are stated, and the slopes there."""
    if problem.sizes:
        _move(problem, {})  # other processes are told as well
        linearise(problem, found.hypothesis, found.records, end)
    return found.hypothesis


def _moved_on(problem: Problem, here: Hypothesis, found: Fit) -> tuple[Hypothesis, float, float]:
    """A hypothesis and its inexact numbers, moved towards a fit.

    Slopes foretell more than is true of a move that is far: it goes as far as it really helps.

    Returns:
        the hypothesis, what it costs there, and what share of the fall that was foretold came.
    """
    before, marginal = problem.sizes, problem.marginal
    if marginal is None:
        return found.hypothesis, found.cost, 1.0
    staying = marginal.only(POSE)
    cost = _cost(problem, here, found.end, staying)
    temper = max(1.0, found.chi_square / max(found.samples, 1))
    # Of all records, as what it costs is: the fit's own are but those that it was fitted to.
    linear = problem.residuals(found.hypothesis.effects, _told_of(problem, here), found.end)
    foretold = sum(float((r * r).sum()) for r in linear) + prior_cost(found.hypothesis)
    whole = recentre(problem, found, temper)
    start, way, sizes = here.vector(), whole.vector() - here.vector(), problem.sizes
    for share in _SHARES:
        other = whole.at(start + share * way)
        _move(problem, _between(before, sizes, share))
        now = _cost(problem, other, found.end, staying)
        if now < cost:
            return other, now, (cost - now) / max(cost - foretold, 1e-300)
    _move(problem, before)
    return here, cost, 0.0


def _told_of(problem: Problem, here: Hypothesis) -> list[MeasuredRecord]:
    """Records that tell what is not exact: of those held out blows' times may not be known."""
    return [r for r in problem.records if here.is_known_in(r.name)] or list(problem.records)


def _between(
    before: Mapping[str, FloatArray], after: Mapping[str, FloatArray], share: float
) -> dict[str, FloatArray]:
    """Numbers on the way from where they were, or from where they are stated."""
    return {
        n: share * v + (1.0 - share) * before.get(n, np.zeros_like(v)) for n, v in after.items()
    }


def _cost(
    problem: Problem,
    hypothesis: Hypothesis,
    end: float | None,
    staying: Marginal,
    records: Sequence[MeasuredRecord] | None = None,
) -> float:
    """What it costs to have everything just where it is: no slope but of what always stays."""
    told = _told_of(problem, hypothesis) if records is None else records
    names = [record.name for record in told]
    labels = [effect.label for effect in hypothesis.effects]
    try:
        there = problem.unmarginalised(hypothesis.effects, told, end)
    except InputError:
        return math.inf
    held = 0.0
    quiet = {n for n in names if problem.marginal and problem.marginal.slopes[n].silent}
    for k, name in enumerate(names):
        shift, sizes = problem.shifts.get(name), problem.sizes.get(name)
        if shift is not None:
            there[k] = there[k] + shift[:, : there[k].shape[1]]
        if sizes is not None and problem.marginal is not None:
            own = problem.marginal.slopes[name].own
            held += float((sizes[:own] ** 2).sum())
            held += float((sizes[own:] ** 2).sum()) / len(names)
    rows = zip(names, staying.whitened(there, names, labels), strict=True)
    # Where small errors grow beyond what slopes say, no step of all can be judged.
    left = sum(float((r * r).sum()) for name, r in rows if name not in quiet)
    return left + held + prior_cost(hypothesis)


def recentre(problem: Problem, found: Fit, temper: float = 1.0) -> Hypothesis:
    """Move the inexact numbers to where the records have them, the slopes being kept.

    Args:
        problem: what is changed.
        found: a fit.
        temper: variance of what the residuals hold beside the inexact numbers, 1 for noise.

    Returns:
        the fit's hypothesis, less what its unknowns had taken up of what was moved.
    """
    marginal, hypothesis = problem.marginal, found.hypothesis
    if marginal is None:
        return hypothesis
    told = _told_of(problem, hypothesis)
    names = [record.name for record in told]
    raw = problem.unmarginalised(hypothesis.effects, told, found.end)
    sizes = marginal.estimated(raw, names, temper, (e.label for e in hypothesis.effects))
    for record in problem.records:
        if record.name not in sizes:  # what is its own stays where it is stated
            shared = sizes[names[0]][marginal.slopes[names[0]].own :]
            stated = np.zeros(marginal.slopes[record.name].own)
            sizes[record.name] = np.concatenate([stated, shared])
    new = {}
    for name, size in sizes.items():
        # A pose's geometry takes long to find, and its small errors act in proportion.
        stays = np.array([what.where == POSE for what in marginal.slopes[name].what])
        new[name] = np.where(stays, 0.0, np.clip(size, -FARTHEST, FARTHEST))
        if marginal.slopes[name].silent and name in problem.sizes:
            # Slopes say nothing of it: its own numbers stay where they were sought.
            count = marginal.slopes[name].own
            new[name][:count] = problem.sizes[name][:count]
    own = marginal.slopes[names[0]].own
    change = new[names[0]][own:]
    if names[0] in problem.sizes:
        change = change - problem.sizes[names[0]][own:]
    vector = hypothesis.vector()
    for k, u in enumerate(hypothesis.unknowns()):
        taken = marginal.absorbed.get((hypothesis.effects[u.effect].label, u.name))
        if taken is not None:
            vector[k] -= taken @ change
        vector[k] += _in_common(marginal, new, (hypothesis.effects[u.effect].label, u.name))
    _move(problem, new)
    return hypothesis.at(vector)


def _in_common(marginal: Marginal, sizes: dict[str, FloatArray], value: tuple[str, str]) -> float:
    """What all factors on a fitted value have in common, taken from them for it, a logarithm.

    Nothing that is predicted changes. One and the other undo each other exactly, slopes of both
    only nearly: a fit would creep along the valley between them and stop on the way.
    """
    found = []
    for name, size in sizes.items():
        for k, one in enumerate(marginal.slopes[name].what):
            if one.factor_on is not None and one.factor_on[0] == value:
                found.append((size, k, one.factor_on[1]))
    weight = sum(sigma**-2 for _, _, sigma in found)
    common = sum(size[k] / sigma for size, k, sigma in found) / weight if found else 0.0
    for size, k, sigma in found:
        size[k] -= common / sigma
    return float(common)


def _move(problem: Problem, sizes: dict[str, FloatArray]) -> None:
    """Have what is not exact so many standard deviations off in every record that is named."""
    problem.sizes = sizes
    _place(problem)
    _shift(problem)


def _place(problem: Problem) -> None:
    """Have every record predicted where its inexact numbers are taken to be."""
    before, problem.moved = problem.moved, {}
    for record in problem.records:
        size = problem.sizes.get(record.name)
        if size is None:
            continue
        known = before.get(record.name)
        if known is None or known.size is not size:
            assert problem.marginal is not None
            numbers = problem.marginal.slopes[record.name].moved(size)
            known = Moved(*nudged(record, numbers), size)
        problem.moved[record.name] = known
    if problem.moved == before:  # the same, each of them
        problem.moved = before
    else:
        problem.renew()


def _shift(problem: Problem) -> None:
    """Take what is moved out of the residuals again, by the slopes as they are now."""
    marginal = problem.marginal
    problem.shifts = (
        {}
        if marginal is None
        else {name: marginal.slopes[name].by(size) for name, size in problem.sizes.items()}
    )
