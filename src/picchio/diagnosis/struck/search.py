"""One search: sets of causes with their evidence, all in one table."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from picchio.core.errors import InputError
from picchio.diagnosis.evidence.arrow import reduce
from picchio.diagnosis.evidence.estimate import (
    Fit,
    estimate,
    objective,
    scaled,
    squares_of,
    standardised,
)
from picchio.diagnosis.evidence.numbers import Numbers
from picchio.diagnosis.percussion.search.candidates import all_candidates
from picchio.diagnosis.struck.causes import Cause, candidate_starts, cause_of
from picchio.diagnosis.struck.likelihood import Data, Percussion
from picchio.diagnosis.struck.slopes import Candidate, Slopes

CLAIM = 3.0
"""nats: posterior odds for a claim, 20 to 1."""
LEFT = 0.01
"""Of the signal: what an honest model may leave."""
WINDOWS = (0.1, 0.3, None)
SHARE = 0.02
FAILED = (InputError, np.linalg.LinAlgError, FloatingPointError)


def clock():
    return time.process_time()


@dataclass(eq=False)
class Search:
    data: Data
    scales: object
    without: frozenset[str] = frozenset()
    verbose: bool = True
    table: dict[frozenset[str], Fit] = field(default_factory=dict)

    def __post_init__(self):
        problem = self.data.problem
        tol = problem.campaign.tolerance
        self.starts: dict[str, list[Cause]] = {}
        for kind, target in all_candidates(problem, self.without):
            if kind.latent is not None:
                continue
            try:
                found = candidate_starts(kind, target, self.scales, tol)
            except InputError:
                continue
            if found:
                self.starts[found[0].label] = found
        self.price = math.log(max(len(self.starts), 1))

    def say(self, *words):
        if self.verbose:
            print(*words, flush=True)

    def score(self, f: Fit) -> float:
        return f.evidence - self.price * len(f.likelihood.causes)

    def keep(self, f: Fit) -> Fit:
        key = frozenset(c.label for c in f.likelihood.causes)
        if key not in self.table or self.score(f) > self.score(self.table[key]):
            self.table[key] = f
        self.say("   fit", sorted(key), "phi %.1f score %.1f" % (f.objective.value, self.score(f)),
                 "chi %.4f" % (sum(f.objective.squares) / sum(f.likelihood.samples)),
                 "s %.4f/%.4f" % (f.objective.sizes.mean(), f.objective.sizes.max()))
        return f

    # ------------------------------------------------------------------------------------------
    def fit(self, causes, x=None, like=None, windows=WINDOWS, **options) -> Fit:
        f = None
        for end in windows:
            m = Percussion(self.data, tuple(causes), end=end)
            more = {"tolerance": 1.0, "renewals": 4} if end is not None else {}
            f = estimate(m, m.start(x, like), **{**more, **options})
            x, like = f.at, f.likelihood
        return f

    def strained(self, f: Fit) -> bool:
        z = standardised(f.likelihood.prior, f.at)
        n = z.shared.size
        free = n - float(np.trace(f.covariance))
        return bool(f.objective.sizes.max() > 0.5 * LEFT
                    or z.shared @ z.shared > free + 4.0 * math.sqrt(2.0 * free)
                    or np.abs(z.shared).max() > 4.0)

    def columns(self, labels) -> list[tuple[str, Cause, Candidate]]:
        """Distinct screening columns of candidates."""
        out = []
        for label in labels:
            for cause in self.starts[label]:
                if any(n.amount for n in cause.numbers):
                    out.append((label, cause, Candidate(cause.partly(SHARE), SHARE)))
                    if "modal_share" in cause.effect.values:
                        other = replace(cause, effect=cause.effect.with_values(modal_share=0.0))
                        out.append((label, other, Candidate(other.partly(SHARE), SHARE)))
                else:
                    out.append((label, cause, Candidate(cause.effect, 1.0)))
        return out

    def screen(self, f: Fit, end, records=None):
        """What slopes at a fit promise of every candidate: [(gain in score, label, start, amplitude)]."""
        t = clock()
        have = {c.label for c in f.likelihood.causes}
        cols = self.columns([k for k in self.starts if k not in have])
        few, at = f.likelihood.some(f.at)
        m = replace(few, end=end, edges=()).about(at)
        f = replace(f, at=at)
        residuals = m.residuals(f.at)
        slopes = Slopes.of(m, f.at, [c for _, _, c in cols])
        prior = m.prior
        n, k = prior.std.shared.size, len(cols)
        wide = np.array([max([x.std for x in c.numbers if x.amount], default=1.0) for _, c, _ in cols])
        std = Numbers(np.concatenate([prior.std.shared, wide]), prior.std.groups, prior.std.records)
        grams = scaled(slopes.grams(residuals), m.group_of, std)
        now = objective(m, f.at, squares_of(residuals))
        z = standardised(prior, f.at)
        z = Numbers(np.concatenate([z.shared, np.zeros(k)]), z.groups, z.records)
        system = reduce(grams, m.group_of, now.weights, z)
        a, b = system.precision, system.pull
        half = np.linalg.solve(a[:n, :n], a[:n, n:])
        s = a[n:, n:] - a[n:, :n] @ half
        r = b[n:] - half.T @ b[:n]
        out = []
        by_label: dict[str, list[int]] = {}
        for j, (label, _, _) in enumerate(cols):
            by_label.setdefault(label, []).append(j)
        for label, own in by_label.items():
            names = {tuple(sorted(cols[j][1].effect.values)) for j in own}
            distinct = self._block(cols, own)
            if distinct:
                g = np.linalg.solve(s[np.ix_(own, own)], r[own])
                gain = 0.5 * r[own] @ g
                occam = 0.5 * np.linalg.slogdet(s[np.ix_(own, own)])[1]
                start = self._combined(cols, own, g * wide[own])
                out.append((gain - occam - self.price, label, start, gain))
            else:
                for j in own:
                    cause = cols[j][1]
                    if not any(x.amount for x in cause.numbers):
                        x = min(max(r[j] / s[j, j], 0.2 / wide[j]), 1.5 / wide[j])
                        gain = r[j] * x - 0.5 * s[j, j] * x * x
                        out.append((gain - self.price, label, cause, gain))
                        continue
                    if cause.effect.values.get("modal_share") == 0.0:
                        continue
                    if "modal_share" in cause.effect.values:
                        both = [j, j + 1]
                        g = np.linalg.solve(s[np.ix_(both, both)], r[both])
                        gain, u = 0.5 * r[both] @ g, float(g.sum()) * wide[j]
                        share = float(np.clip(g[0] / g.sum(), 0.0, 1.0)) if g.sum() else 1.0
                        cause = replace(cause, effect=cause.effect.with_values(modal_share=share))
                    else:
                        gain, u = 0.5 * r[j] ** 2 / s[j, j], r[j] / s[j, j] * wide[j]
                    if u <= 0 and not self._two_sided(cause):
                        continue
                    occam = 0.5 * math.log(s[j, j])
                    out.append((gain - occam - self.price, label, self._moved(cause, u), gain))
        out.sort(key=lambda o: -o[0])
        best, seen = [], set()
        for o in out:
            if o[1] not in seen:
                seen.add(o[1])
                best.append(o)
        self.say("screen %.1f s:" % (clock() - t), ", ".join("%s %.0f" % (o[1], o[0]) for o in best[:8]))
        return best

    @staticmethod
    def _two_sided(cause):
        return all(x.low < 0 for x in cause.numbers if x.amount)

    @staticmethod
    def _block(cols, own):
        """Whether an effect's columns are of different numbers: all together are one candidate."""
        if len(own) < 2:
            return False
        which = [tuple(n.parameter for n, u in zip(cols[j][1].numbers, cols[j][1].coordinates(cols[j][1].effect)) if n.amount and abs(u) > 1e-9) for j in own]
        return len(set(which)) == len(which) and all(which)

    @staticmethod
    def _combined(cols, own, amplitude):
        cause = cols[own[0]][1]
        u = [0.0] * len(cause.numbers)
        for j, a in zip(own, amplitude):
            for i, (n, x) in enumerate(zip(cols[j][1].numbers, cols[j][1].coordinates(cols[j][1].effect))):
                if n.amount and abs(x) > 1e-9:
                    u[i] = min(max(x * a, n.low), n.high)
                elif not n.amount:
                    u[i] = x
        return replace(cause, effect=cause.at(u))

    @staticmethod
    def _moved(cause, amplitude):
        a = min(max(amplitude, -4.0), 4.0)
        u = [min(max(x * a, n.low), n.high) if n.amount else x
             for n, x in zip(cause.numbers, cause.coordinates(cause.effect))]
        return replace(cause, effect=cause.at(u))

    # ------------------------------------------------------------------------------------------
    def scan(self, causes, x, like, labels, end):
        """Every candidate at several sizes about given numbers, with springs, damping and force moved linearly."""
        t = clock()
        m = Percussion(self.data, tuple(causes), end=end, light=True)
        at = m.start(x, like)
        lin = m.linearised(at)
        base = m.residuals(at)
        now = objective(m, at, squares_of(base))
        out = []
        for label in labels:
            best = None
            for cause in self.starts[label]:
                sizes = (1.0,)
                if any(n.amount for n in cause.numbers):
                    sizes = (0.5, 1.0, 2.0, 4.0)
                    if self._two_sided(cause) and len(self.starts[label]) == 1:
                        sizes = (-2.0, -1.0, -0.5, 0.5, 1.0, 2.0, 4.0)
                for size in sizes:
                    moved = self._moved(cause, size) if any(n.amount for n in cause.numbers) else cause
                    m2 = Percussion(self.data, (*causes, moved), end=end, light=True)
                    try:
                        e = m2.residuals(m2.start(at, m))
                    except FAILED:
                        continue
                    grams = scaled(lin.grams(e), m.group_of, m.prior.std)
                    then = objective(m, at, squares_of(e))
                    system = reduce(grams, m.group_of, then.weights, standardised(m.prior, at))
                    gain = 0.5 * system.pull @ np.linalg.solve(system.precision, system.pull)
                    value = then.value - min(gain, then.value)
                    phi = then.value - gain
                    if best is None or phi < best[0]:
                        best = (phi, label, moved)
            if best:
                out.append(best)
        out.sort(key=lambda o: o[0])
        self.say("scan %.1f s, nothing %.0f:" % (clock() - t, now.value), ", ".join("%s %.0f" % (o[1], o[0]) for o in out[:8]))
        return out

    def light(self, causes, x, like, scanned, most=16):
        t = clock()
        out = []
        for _, label, cause in scanned[:most]:
            m = Percussion(self.data, (*causes, cause), end=WINDOWS[0], light=True)
            try:
                f = estimate(m, m.start(x, like), tolerance=2.0, renewals=3, steps=5)
            except FAILED:
                continue
            out.append((f.objective.value, label, f))
        out.sort(key=lambda o: o[0])
        self.say("light %.1f s:" % (clock() - t), ", ".join("%s %.0f" % (o[1], o[0]) for o in out[:8]))
        return out

    def race(self, causes, runners, most=6):
        """Fits on growing windows, the leaders go on."""
        t = clock()
        field_ = [(f.likelihood.causes[-1], f.at, f.likelihood) for _, _, f in runners[:most]]
        for i, end in enumerate(WINDOWS):
            new = []
            for cause, x, like in field_:
                m = Percussion(self.data, (*causes, cause), end=end)
                try:
                    new.append(estimate(m, m.start(x, like), tolerance=1.0 if end else 0.05, renewals=4 if end else 8))
                except FAILED:
                    continue
            new.sort(key=lambda f: -f.evidence)
            self.say("  window", end, "%.1f s" % (clock() - t), ", ".join("%s %.0f" % (f.likelihood.causes[-1].label, f.evidence - new[0].evidence) for f in new))
            near = [f for f in new if f.evidence > new[0].evidence - (200 if end else 100)][: 4 if i == 0 else 3]
            field_ = [(f.likelihood.causes[-1], f.at, f.likelihood) for f in near]
        return [self.keep(f) for f in new]

    def latents(self, f: Fit):
        """What numbers drawn anew in every record promise at a fit: [(gain in score, cause)]."""
        t = clock()
        problem = self.data.problem
        have = {c.label for c in f.likelihood.causes}
        out = []
        for kind, target in all_candidates(problem, self.without):
            latent = kind.latent
            if latent is None or latent.whole or f"{kind.name}:{target}" in have:
                continue
            for values in kind(target).trials(self.scales):
                unit = 1.0
                effect = kind(target).bounded(**values, **{latent.spread: unit})
                cause = cause_of(effect, [values], problem.campaign.tolerance)
                m = replace(f.likelihood, causes=(*f.likelihood.causes, cause))
                at = m.start(f.at, f.likelihood)
                slopes = m.linearised(at)
                grams = slopes.grams(f.residuals)
                rms = self.scales.reading[target][0] if target in self.scales.reading else self.scales.period
                best = None
                plain = None
                for size in (0.0, *np.geomspace(1e-5, 1.0, 16) * rms):
                    std = m.prior.std
                    records = []
                    for k in range(len(m.data.records)):
                        mine = np.array([o.__class__.__name__ == "Drawn" for o, _ in m.own(k)])
                        tol = getattr(problem.campaign.tolerance, kind.exceeds, 0.0) if kind.exceeds else 0.0
                        records.append(np.where(mine, max(np.hypot(size, tol), 1e-12), std.records[k]))
                    std = Numbers(std.shared, std.groups, tuple(records))
                    g = scaled(grams, m.group_of, std)
                    z = (at + m.prior.mean.scaled(-1.0)) / std
                    system = reduce(g, m.group_of, f.objective.weights, z)
                    _, log_det = np.linalg.slogdet(system.precision)
                    value = 0.5 * system.pull @ np.linalg.solve(system.precision, system.pull)
                    value += self._own_gain(g, m, f.objective.weights, z) - 0.5 * (system.log_determinant + log_det)
                    if size == 0.0:
                        plain = value
                    elif best is None or value - plain > best[0]:
                        best = (value - plain, size)
                out.append((best[0] - self.price, replace(cause, effect=effect.with_values(**{latent.spread: best[1]}))))
        out.sort(key=lambda o: -o[0])
        self.say("latents %.1f s:" % (clock() - t), ", ".join("%s %.1f" % (c.effect, g) for g, c in out[:4]))
        return out

    @staticmethod
    def _own_gain(grams, m, weights, z):
        """What eliminated numbers gain by themselves: half the squared pull over the precision."""
        total = 0.0
        for k, gram in enumerate(grams):
            n = z.records[k].size
            own = weights[m.group_of[k]] * gram[:n, :n] + np.eye(n)
            pull = weights[m.group_of[k]] * gram[:n, -1] - z.records[k]
            total += 0.5 * pull @ np.linalg.solve(own, pull)
        return total

    def near(self, f: Fit, screened, most=5):
        out = []
        top = [o for o in screened[:most] if o[0] > -2.0]
        for _, label, start, _ in top:
            try:
                out.append(self.keep(self.fit((*f.likelihood.causes, start), f.at, f.likelihood, windows=(None,))))
            except FAILED:
                continue
        return out

    def run(self, most=2):
        t = clock()
        null = self.keep(self.fit(()))
        self.null = null
        zero = Percussion(self.data).start()
        cur = null
        for _ in range(most):
            fits = []
            best_s = cur.objective.sizes.max()
            if best_s < 5 * LEFT:
                sc = self.screen(cur, None if self.data.problem.records[0].setup.samples.last < 0.5 else 0.6)
                fits += self.near(cur, sc)
                for gain, cause in self.latents(cur):
                    if gain > 0.0:
                        fits.append(self.keep(self.fit((*cur.likelihood.causes, cause), cur.at, cur.likelihood, windows=(None,))))
            top = max([cur, *fits], key=self.score)
            if self.strained(top):
                have = {c.label for c in cur.likelihood.causes}
                causes = tuple(replace(c, effect=e) for c, e in zip(cur.likelihood.causes, cur.likelihood.effects_at(cur.at)[-len(cur.likelihood.causes):] if cur.likelihood.causes else ()))
                base = Percussion(self.data, causes)
                x = base.start()
                scanned = self.scan(causes, x, base, [k for k in self.starts if k not in have], WINDOWS[0])
                fits += self.race(causes, self.light(causes, x, base, scanned))
            better = [f for f in fits if self.score(f) > self.score(cur)]
            if not better:
                break
            cur = max(better, key=self.score)
        while len(cur.likelihood.causes) > 1:
            drops = []
            for c in cur.likelihood.causes:
                rest = tuple(o for o in cur.likelihood.causes if o is not c)
                drops.append(self.keep(self.fit(rest, cur.at, cur.likelihood, windows=(None,))))
            b = max(drops, key=self.score)
            if self.score(b) < self.score(cur) - CLAIM:
                break
            cur = b
        self.best = cur
        self.seconds = clock() - t
        return self.verdict()

    def verdict(self):
        cur = max(self.table.values(), key=self.score)
        s = math.sqrt(float((cur.objective.sizes**2).mean()))
        sets = [(self.score(f), k, f) for k, f in self.table.items()]
        rivals = [(v, sorted(k)) for v, k, f in sets if v > self.score(cur) - CLAIM and k != frozenset(c.label for c in cur.likelihood.causes)]
        nothing = self.score(self.table[frozenset()])
        total = np.logaddexp.reduce([v for v, k, _ in sets if k])if len(sets) > 1 else -np.inf
        claim = total - nothing
        if claim < CLAIM or not cur.likelihood.causes:
            verdict = "nothing-wrong" if math.sqrt(float((self.null.objective.sizes**2).mean())) < LEFT else "unexplained"
            names = []
        else:
            rivals = [r for r in rivals if r[1]]
            names = sorted(c.label for c in cur.likelihood.causes)
            verdict = "unexplained" if s > LEFT else "ambiguous" if rivals else "named"
        return {"verdict": verdict, "causes": names, "rivals": rivals, "s": s, "odds": claim, "seconds": self.seconds}
