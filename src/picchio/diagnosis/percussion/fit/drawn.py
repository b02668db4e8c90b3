"""Fits of the numbers that an effect draws anew in every record, together with all others."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from picchio.core.arrays import BoolArray, FloatArray
from picchio.core.errors import InputError
from picchio.diagnosis.percussion.data.problem import MeasuredRecord, Problem, take_out
from picchio.diagnosis.percussion.fit.least_squares import (
    HOPELESS,
    Fit,
    bounded_step,
    fit,
    from_prior,
    jacobian,
    prior_cost,
    prior_precision,
)
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.model.effects.effect import Effect, Latent

# What numbers that are drawn anew in every record cost: they come from one distribution.


def drawn_cost(fall: float, count: int, samples: int) -> float:
    """What a fit must pay for numbers drawn from a normal distribution of unknown width.

    A number that is told by the data with a standard deviation far below the width costs as much as
    any other, ln(samples) by BIC; one that is hardly told is not free to begin with. Minus twice
    the logarithm of the likelihood, integrated over the numbers: with the same information h of
    each and the width that is likeliest, h * width^2 = fall / count - 1, that is
    count (1 + ln(fall / count)). (Laird and Ware, Biometrics 38 (1982) 963, doi:10.2307/2529876.)

    Args:
        fall: of chi-square, by the numbers together.
        count: of the numbers.
        samples: of the data.

    Returns:
        the cost in units of chi-square, at least what the numbers gain by chance.
    """
    if count < 1 or fall <= count:
        return max(fall, 0.0)
    return count * min(1.0 + math.log(fall / count), math.log(max(samples, 2)))


def width_spread(width: float, fall: float, count: int) -> float:
    """Standard deviation of the width of a distribution, from numbers drawn from it.

    Args:
        width: of the distribution, without what noise adds.
        fall: of chi-square, by the numbers together.
        count: of the numbers.
    """
    if fall <= count or count < 1:
        return width
    return width * fall / (fall - count) / math.sqrt(2.0 * count)


# The numbers of every record.


def _drawn_by(effect: Effect) -> Latent:
    assert effect.latent is not None
    return effect.latent


def hidden_columns(problem: Problem, known: Fit, effect: Effect) -> list[FloatArray]:
    """The residual's change with every free number that an effect draws, per record."""
    latent, current = _drawn_by(effect), hidden_numbers(known, effect)
    found: list[list[FloatArray]] = [[] for _ in known.records]
    for k in range(latent.first, max(numbers.size for numbers in current.values())):
        hidden = {}
        for name, numbers in current.items():
            moved = numbers.copy()
            moved[k : k + 1] += latent.step
            hidden[name] = moved
        effects = with_hidden(known.hypothesis, effect, hidden).effects
        there = problem.residuals(effects, known.records, known.end)
        for own, record, new, old in zip(found, known.records, there, known.residuals, strict=True):
            if k < current[record.name].size:
                own.append(((new - old) / latent.step).ravel())
    return [
        np.stack(columns, axis=1) if columns else np.zeros((r.size, 0))
        for columns, r in zip(found, known.residuals, strict=True)
    ]


def current_hidden(hypothesis: Hypothesis, label: str) -> dict[str, tuple[float, ...]]:
    """Record -> an effect's hidden numbers, as far as they are known."""
    for effect in hypothesis.effects:
        if effect.label == label:
            return dict(effect.hidden)
    return {}


def hidden_numbers(here: Fit, effect: Effect) -> dict[str, FloatArray]:
    """Every record's hidden numbers, 0 where none are known."""
    current, latent = current_hidden(here.hypothesis, effect.label), _drawn_by(effect)
    return {
        r.name: np.array(
            current.get(r.name, np.zeros(latent.size(int(r.setup.blows.hit.max()) + 1))),
            dtype=float,
        )
        for r in here.records
    }


def with_hidden(
    hypothesis: Hypothesis, effect: Effect, hidden: Mapping[str, Iterable[float]]
) -> Hypothesis:
    """With an effect's hidden numbers (record -> numbers), and the effect if it was not there."""
    label, frozen = effect.label, {name: tuple(numbers) for name, numbers in hidden.items()}
    effects = tuple(e.with_hidden(frozen) if e.label == label else e for e in hypothesis.effects)
    if label not in {e.label for e in hypothesis.effects}:
        effects = (*effects, effect.with_hidden(frozen))
    return replace(hypothesis, effects=effects)


def hidden_cost(hypothesis: Hypothesis, n_records: int, samples: int) -> float:
    """What the causes' hidden numbers cost, in units of chi-square."""
    known = {label: drawn_cost(fall, count, samples) for label, fall, count in hypothesis.drawn}
    total = 0.0
    for effect in hypothesis.causes:
        latent = effect.latent
        if latent is None:
            continue
        count = sum(max(len(v) - latent.first, 0) for v in effect.hidden.values())
        if latent.linear:
            count = latent.size(0) * n_records
        if latent.whole:  # yes or no: a bit each, not a number
            total += count * math.log(2.0) * math.log(max(samples, 2))
            count = 0
        total += min(known.get(effect.label, math.inf), count * math.log(max(samples, 2)))
    return total


def with_solved_numbers(problem: Problem, found: Fit) -> Hypothesis:
    """The numbers that are solved for in the residual written into their effects."""
    hypothesis = found.hypothesis
    effects = list(hypothesis.effects)
    for i, effect in enumerate(effects):
        if effect.latent is None or not effect.latent.linear:
            continue
        others = [e for k, e in enumerate(effects) if k != i]
        predictions = problem.predictions(others)
        hidden = {}
        for record, predicted in zip(problem.records, predictions, strict=True):
            rows = {n: v - predicted[n] for n, v in record.values.items()}
            hidden[record.name] = take_out(rows, record.setup, effect)
        size = float(np.sqrt(np.mean([sum(x * x for x in v) for v in hidden.values()])))
        effects[i] = effect.with_values(**{effect.latent.spread: size}).with_hidden(hidden)
    return replace(hypothesis, effects=tuple(effects))


# Where each blow fell, found blow by blow: a start for what all blows' times together must fit.
#
# A blow that comes late changes nothing before it. So the first blow and what follows it until the
# second tell stiffnesses and force; then the second blow's time is looked for in what follows it
# until the third; and so on.

# How far a blow is looked for, in intervals of the blows; how finely at first, parts of a sample;
# and how often the model is asked on either side of where that leads.
_SPAN = 0.2
_FINER = 4
_MOVES = 3
# After so many blows the rest is fitted again.
_REFIT = (1, 2, 4, 8)


def blow_by_blow(problem: Problem, start: Fit, effect: Effect) -> Hypothesis:
    """The blows' times of every record, and the rest fitted to them.

    Args:
        problem: data and noise.
        start: what is known so far; its records and its end are used.
        effect: whose hidden numbers the times are.
    """
    records = start.records
    late = {r.name: np.zeros(int(r.setup.blows.hit.max()) + 1) for r in records}
    here = with_hidden(start.hypothesis, effect, late)
    for hit in range(1, max(numbers.size for numbers in late.values())):
        struck = [r for r in records if hit < late[r.name].size]
        first = min((hit - _SPAN) * r.setup.blows.interval for r in struck)
        if start.end is not None and first > start.end:
            break
        if hit in _REFIT:
            here = fit(problem, here, records, first, iterations=3).hypothesis
        found = _best_times(problem, here, effect, struck, late, hit)
        for record, time in zip(struck, found, strict=True):
            late[record.name][hit] = time
        here = with_hidden(here, effect, late)
    return here


def _best_times(
    problem: Problem,
    here: Hypothesis,
    effect: Effect,
    struck: Sequence[MeasuredRecord],
    late: Mapping[str, FloatArray],
    hit: int,
) -> FloatArray:
    """(records,) s: when this blow came.

    A blow's response is nearly its own, whatever moves already: so it is found once, and moved
    about to see where it fits best. Then the model has the word, at a few times about that one.
    """
    interval = np.array([r.setup.blows.interval for r in struck])
    end = float(((hit + 1 - _SPAN) * interval).max())

    def at(times: FloatArray) -> Hypothesis:
        trial = dict(late)
        for record, time in zip(struck, times, strict=True):
            trial[record.name] = late[record.name].copy()
            trial[record.name][hit] = time
        return with_hidden(here, effect, trial)

    def cost(times: FloatArray) -> FloatArray:
        there = problem.residuals(at(times).effects, struck, end)
        out = np.empty(len(struck))
        for i, (record, residual) in enumerate(zip(struck, there, strict=True)):
            own = _window(record.until(end).samples.times, hit, interval[i])
            out[i] = float((residual[:, own] ** 2).sum())
        return np.where(np.isfinite(out), out, np.inf)

    # Without it: so late that nothing of it is seen. A sample is known or not in both alike.
    never = at(np.full(len(struck), 2.0 * end))
    longer = end + _SPAN * float(interval.max())
    with problem.pinned(never.effects):
        gone = problem.residuals(never.effects, struck, longer)
        there = problem.residuals(at(np.zeros(len(struck))).effects, struck, longer)
    middle, spacing = np.empty(len(struck)), np.empty(len(struck))
    for i, (record, without, with_it) in enumerate(zip(struck, gone, there, strict=True)):
        samples = record.setup.samples
        own = _window(record.until(longer).samples.times, hit, interval[i])
        most = int(np.ceil(_SPAN * interval[i] / samples.step))
        place = _place(without, without - with_it, own, most)
        middle[i], spacing[i] = place * samples.step, samples.step / _FINER
    return _refined(cost, middle, spacing)


def _window(times: FloatArray, hit: int, interval: float) -> BoolArray:
    """Which samples tell when a blow came: from when it may have to when the next may."""
    first, last = (hit - _SPAN) * interval, (hit + 1 - _SPAN) * interval
    return np.asarray((times >= first) & (times < last))


def _place(without: FloatArray, response: FloatArray, own: BoolArray, most: int) -> float:
    """By how many samples a response is to be moved to explain most of what is seen without it.

    Args:
        without: (channels, m) residual without the blow.
        response: (channels, m) what the blow adds to the prediction, in the same units.
        own: (m,) where it is looked for.
        most: samples, to either side.
    """
    index = np.flatnonzero(own)
    if not index.size or not (np.isfinite(without).all() and np.isfinite(response).all()):
        return 0.0
    room = most + 1
    padded = np.pad(response, ((0, 0), (room, room)))
    seen = without[:, index]
    best, lowest = 0.0, np.inf
    for step in range(-most * _FINER, most * _FINER + 1):
        whole = step // _FINER
        part = step / _FINER - whole
        here = index + room - whole
        moved = (1.0 - part) * padded[:, here] + part * padded[:, here - 1]
        value = float(((seen - moved) ** 2).sum())
        if value < lowest:
            best, lowest = step / _FINER, value
    return best


def _refined(
    cost: Callable[[FloatArray], FloatArray], middle: FloatArray, spacing: FloatArray
) -> FloatArray:
    """The lowest point of a parabola about the best of three times, (records,) s."""
    for _ in range(_MOVES):
        before, here, after = cost(middle - spacing), cost(middle), cost(middle + spacing)
        with np.errstate(all="ignore"):
            bend = before - 2.0 * here + after
            vertex = np.where(bend > 0.0, 0.5 * (before - after) / bend, 0.0)
        lowest = np.minimum(np.minimum(before, here), after)
        side = np.where(lowest == here, 0.0, np.where(lowest == before, -1.0, 1.0))
        inside = (side == 0.0) & np.isfinite(vertex)
        middle = middle + spacing * np.where(inside, vertex, side)
        if inside.all():
            break
    return middle


_ROUNDS = 6
_SHARES = (1.0, 0.5, 0.25, 0.1)
_CONVERGED = 1e-4
_SMALLEST = 1e-6  # of the singular values of what a record's blows can do


def fit_latent(problem: Problem, start: Fit, effect: Effect, rival: float = np.inf) -> Fit:
    """Fit the hidden numbers of every record and the unknowns common to all.

    Blows' times are looked for blow by blow first, unless they are known in all of these records.
    Then all are moved at once, by Gauss and Newton's step, where that helps; else in turns. What
    stays far above the cost of a `rival` is given up.

    Args:
        problem: data and noise.
        start: the fit that is begun with.
        effect: one that draws numbers; it is found in the hypothesis by its label, or added.
        rival: cost of what does as well.
    """
    latent = _drawn_by(effect)
    if latent.linear:
        return _priced_solved(problem, start, effect)
    here = start
    known_in = set(current_hidden(start.hypothesis, effect.label))
    if latent.times and not {r.name for r in start.records} <= known_in:
        # What is not exact would make up for blows that are elsewhere.
        with problem.set_aside():
            plain = fit(problem, start.hypothesis, start.records, start.end, iterations=0)
            begun = blow_by_blow(problem, plain, effect)
            begun = fit(problem, begun, start.records, start.end, iterations=2).hypothesis
        here = fit(problem, begun, start.records, start.end, iterations=0)
    for turn in range(_ROUNDS):
        before = here.cost
        if turn > 1 and before > HOPELESS * rival:
            break
        columns = hidden_columns(problem, here, effect)
        together = None if latent.whole else _together(problem, here, effect, columns)
        here = together or _in_turns(problem, here, effect, columns)
        if (turn or together) and before - here.cost < _CONVERGED * here.cost:
            break
    return _with_fraction(here, effect) if latent.whole else _with_width(here, effect, columns)


def _with_width(here: Fit, effect: Effect, columns: Sequence[FloatArray]) -> Fit:
    """With the width of the numbers' spread, without what noise adds to it, and what they cost."""
    known, latent = hidden_numbers(here, effect), _drawn_by(effect)
    moved, fall, count = 0.0, 0.0, 0
    for record, own in zip(here.records, columns, strict=True):
        numbers = known[record.name][latent.first :]
        moved += float(numbers @ numbers)
        fall += float(((own @ numbers) ** 2).sum())
        count += own.shape[1]
    std = math.sqrt(moved / max(count, 1) * max(1.0 - count / max(fall, 1e-300), 0.0))
    return _priced(_with_own(here, effect, std), effect.label, fall, count)


def _with_fraction(here: Fit, effect: Effect) -> Fit:
    """With the share of the numbers that are 1."""
    hidden, first = current_hidden(here.hypothesis, effect.label), _drawn_by(effect).first
    numbers = np.concatenate([np.array(v)[first:] for v in hidden.values()])
    return _with_own(here, effect, float(numbers.mean()))


def _with_own(here: Fit, effect: Effect, spread: float) -> Fit:
    """With the effect's own parameter as its hidden numbers have it."""
    values = {_drawn_by(effect).spread: spread}
    effects = tuple(
        e.with_values(**values) if e.label == effect.label else e for e in here.hypothesis.effects
    )
    return replace(here, hypothesis=replace(here.hypothesis, effects=effects))


def _priced_solved(problem: Problem, here: Fit, effect: Effect) -> Fit:
    """With what numbers cost that are solved for, by how much chi-square falls by them."""
    effects = tuple(e for e in here.hypothesis.effects if e.label != effect.label)
    without = problem.residuals(effects, here.records, here.end)
    fall = sum(float((r * r).sum()) for r in without) - here.chi_square
    return _priced(here, effect.label, fall, _drawn_by(effect).size(0) * len(here.records))


def _priced(here: Fit, label: str, fall: float, count: int) -> Fit:
    """With what an effect's drawn numbers gain written down."""
    others = tuple(item for item in here.hypothesis.drawn if item[0] != label)
    drawn = (*others, (label, fall, count))
    return replace(here, hypothesis=replace(here.hypothesis, drawn=drawn))


def _bounds(here: Fit, latent: Latent) -> tuple[float, float]:
    """Of a hidden number."""
    largest = 0.45 * here.records[0].setup.blows.interval
    return (-largest, largest) if latent.times else (latent.lower, latent.upper)


def _in_turns(problem: Problem, here: Fit, effect: Effect, columns: Sequence[FloatArray]) -> Fit:
    """Hidden numbers first, record by record; then what is common to all."""
    known, latent = hidden_numbers(here, effect), _drawn_by(effect)
    wanted = {}
    for record, residual, slopes in zip(here.records, here.residuals, columns, strict=True):
        numbers = known[record.name].copy()
        if slopes.shape[1]:
            moved = np.linalg.lstsq(slopes, -residual.ravel(), rcond=_SMALLEST)[0]
            numbers[latent.first :] += moved
        numbers = np.clip(numbers, *_bounds(here, latent))
        wanted[record.name] = np.round(numbers) if latent.whole else numbers
    shortened = wanted if latent.whole else _shortened(problem, here, effect, known, wanted)
    hypothesis = with_hidden(here.hypothesis, effect, shortened)
    return fit(problem, hypothesis, here.records, here.end, iterations=2)


def _together(
    problem: Problem, here: Fit, effect: Effect, columns: Sequence[FloatArray]
) -> Fit | None:
    """One step of hidden and common numbers at once; None where it does not help.

    What each record's hidden numbers can do is projected out first, so that the equations are no
    larger than the common unknowns (Golub and Pereyra, doi:10.1137/0710036).
    """
    unknowns = here.hypothesis.unknowns()
    if not unknowns:
        return None
    slopes = jacobian(problem, here.hypothesis, here.records, here.end, here.residuals)
    vector, normal = here.hypothesis.vector(), prior_precision(here.hypothesis)
    gradient = normal @ from_prior(here.hypothesis)
    for residual, common, own in zip(here.residuals, slopes, columns, strict=True):
        alive = np.linalg.norm(own, axis=0) > 0.0
        basis = np.linalg.qr(own[:, alive])[0] if alive.any() else own[:, :0]
        free = common - basis @ (basis.T @ common)
        normal = normal + free.T @ free
        gradient = gradient + free.T @ residual.ravel()
    if not np.isfinite(normal).all():
        return None
    step = bounded_step(unknowns, vector, normal, gradient, 1e-6)
    known, latent = hidden_numbers(here, effect), _drawn_by(effect)
    for share in _SHARES:
        hidden = {}
        for record, residual, common, own in zip(
            here.records, here.residuals, slopes, columns, strict=True
        ):
            numbers = known[record.name].copy()
            if own.shape[1]:
                right = -(residual.ravel() + common @ step)
                moved = np.linalg.lstsq(own, right, rcond=_SMALLEST)[0]
                numbers[latent.first :] += share * moved
            hidden[record.name] = tuple(np.clip(numbers, *_bounds(here, latent)))
        hypothesis = with_hidden(here.hypothesis.at(vector + share * step), effect, hidden)
        try:
            there = problem.residuals(hypothesis.effects, here.records, here.end)
        except InputError:
            continue
        cost = float(sum((r * r).sum() for r in there)) + prior_cost(hypothesis)
        if cost < here.cost:
            here = replace(here, jacobians=None, by_record=None)
            return replace(here, hypothesis=hypothesis, residuals=there, cost=cost)
    return None


def _shortened(
    problem: Problem,
    here: Fit,
    effect: Effect,
    known: dict[str, FloatArray],
    wanted: dict[str, FloatArray],
) -> dict[str, tuple[float, ...]]:
    """Each record's step to what is wanted, halved until it helps that record."""
    best = {name: tuple(numbers) for name, numbers in known.items()}
    before = {
        r.name: float((x * x).sum()) for r, x in zip(here.records, here.residuals, strict=True)
    }
    left = list(here.records)
    for share in _SHARES:
        trial = {
            r.name: tuple(known[r.name] + share * (wanted[r.name] - known[r.name])) for r in left
        }
        effects = with_hidden(here.hypothesis, effect, {**best, **trial}).effects
        there = problem.residuals(effects, left, here.end)
        worse = []
        for record, residual in zip(left, there, strict=True):
            if float((residual * residual).sum()) < before[record.name]:
                best[record.name] = trial[record.name]
            else:
                worse.append(record)
        left = worse
        if not left:
            break
    return best


def refit(problem: Problem, hypothesis: Hypothesis, records: Sequence[MeasuredRecord]) -> Fit:
    """A hypothesis refitted to some records, from where it stands, with its Jacobian."""
    hidden = hypothesis.drawing
    solved = [e for e in hypothesis.effects if e.latent is not None and e.latent.linear]
    # Blows' times in records that were held out are not known yet: nothing can be fitted to them.
    turns = 0 if any(e.latent and e.latent.times for e in hidden) else 4
    found = fit(problem, hypothesis, records, None, iterations=turns, with_jacobian=not hidden)
    # What is solved for is another number in more records.
    for effect in (*hidden, *solved):
        found = fit_latent(problem, found, effect)
    if hidden:
        found = fit(problem, found.hypothesis, records, None, iterations=1, with_jacobian=True)
    return found
