"""Residuals with what is never exact integrated out.

The whitened residual r of a campaign is white noise plus A v, where v holds what is not exact, in
standard deviations, and A its slopes: the covariance is 1 + A A^T. What is returned is W r with
W^T W = (1 + A A^T)^-1, of unit variance again, so that everything downstream goes on as it was. The
record's own numbers are taken first, then those that the campaign shares; both by Woodbury's
identity, so that no matrix is larger than there are numbers (Rasmussen and Williams, Gaussian
Processes for Machine Learning (2006), section A.3).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.recent import Recent
from picchio.diagnosis.percussion.tolerance.slopes import Slopes, products

_KEPT = 24
# A number of which the records know less than this share is not told from where it is stated.
_UNKNOWN = 0.02
# Standard deviations, root mean square, at which slopes say nothing any more.
ABSURD = 10.0


@dataclass(frozen=True, eq=False)
class _Own:
    """Of one record up to some time: products of its columns.

    Attributes:
        root: (own, own) G, the record's W = 1 - L G L^T.
        inverse: (own, own) H, (1 + L L^T)^-1 = 1 - L H L^T.
        cross: (own, shared) L^T B.
        shared: (shared, shared) B^T (1 + L L^T)^-1 B.
    """

    root: FloatArray
    inverse: FloatArray
    cross: FloatArray
    shared: FloatArray


@dataclass(frozen=True, eq=False)
class TakenUp:
    """Where what is not exact is taken to be, for the sake of some residuals.

    Attributes:
        numbers: all of it, standard deviations.
        left: what the residuals are then, (channels, m) a record, in units of the noise.
        by_record: (records,) chi-square of each, its own numbers included; what the campaign shares
            belongs to no record: all have a share.
    """

    numbers: FloatArray
    left: list[FloatArray]
    by_record: FloatArray

    @property
    def held(self) -> float:
        """What that costs: minus twice the logarithm of its density."""
        return float((self.numbers**2).sum())

    @property
    def is_absurd(self) -> bool:
        """Whether it is so far off, as a whole, that slopes say nothing any more."""
        return self.held > ABSURD**2 * self.numbers.size


class Marginal:
    """Integrates what is never exact out of the residuals of a campaign.

    Args:
        slopes: of every record, by name; their shared columns in one order.
        absorbed: (effect's label, parameter) -> (shared,) what an unknown, as a fit has it, takes
            up of one standard deviation of each: it is no longer in the slopes.
    """

    def __init__(
        self,
        slopes: Mapping[str, Slopes],
        absorbed: Mapping[tuple[str, str], FloatArray] | None = None,
    ) -> None:
        self.slopes = slopes
        self.absorbed = dict(absorbed or {})
        self._own: Recent[_Own] = Recent(_KEPT * max(len(slopes), 1))
        self._grams: dict[tuple[str, int], FloatArray] = {}
        self._roots: Recent[FloatArray] = Recent(_KEPT)

    @property
    def shared(self) -> tuple[str, ...]:
        """Names of what the campaign shares."""
        some = next(iter(self.slopes.values()))
        return tuple(one.name for one in some.what[some.own :])

    def only(self, where: str) -> Marginal:
        """What integrates out nothing but what is changed in one place.

        Args:
            where: as of `Inexact`.
        """
        others = {w.name for s in self.slopes.values() for w in s.what if w.where != where}
        return Marginal({name: s.without(others) for name, s in self.slopes.items()})

    def whitened(
        self, residuals: Sequence[FloatArray], names: Sequence[str], claimed: Iterable[str] = ()
    ) -> list[FloatArray]:
        """Residuals (channels, m) of some records, of unit variance with what is inexact in it.

        Args:
            residuals: in units of the noise alone; they may end before the record does.
            names: of their records.
            claimed: effects and targets that are causes: they have their own prior instead.
        """
        from picchio.diagnosis.percussion.tolerance.kernel import projected, taken_out

        freed = frozenset(claimed)
        parts, right = [], None
        for name, rows in zip(names, residuals, strict=True):
            slopes = self.slopes[name]
            products = np.empty(slopes.columns.shape[2])
            projected(slopes.columns, np.ascontiguousarray(rows), products)
            own = self._products(name, rows.shape[1], freed)
            left = products[: slopes.own]
            mine = products[slopes.own :] - own.cross.T @ (own.inverse @ left)
            right = mine if right is None else right + mine
            parts.append((own, left))
        assert right is not None
        key = (tuple(names), tuple(r.shape[1] for r in residuals), freed & self.means)
        root = self._roots.get(
            key, lambda: self._root(np.sum([o.shared for o, _ in parts], axis=0), freed)[0]
        )
        common = root @ right
        found = []
        for name, rows, (own, left) in zip(names, residuals, parts, strict=True):
            weights = np.concatenate([own.root @ (left - own.cross @ common), common])
            out = np.array(rows)
            taken_out(self.slopes[name].columns, weights, out)
            found.append(out)
        return found

    def taken(self, unknowns: Sequence[tuple[str, str]]) -> FloatArray:
        """(unknowns, shared) what each unknown takes up of one standard deviation of each number.

        Args:
            unknowns: effect's label and parameter of each.
        """
        count = len(self.shared)
        rows = [self.absorbed.get(unknown, np.zeros(count)) for unknown in unknowns]
        return np.array(rows).reshape(len(unknowns), count)

    def absorbed_covariance(self, unknowns: Sequence[tuple[str, str]]) -> FloatArray:
        """(unknowns, unknowns) by how much what they took up leaves a fit's unknowns unsure.

        Args:
            unknowns: effect's label and parameter of each.
        """
        count, rows = len(self.shared), self.taken(unknowns)
        whole = {name: s.columns.shape[1] for name, s in self.slopes.items()}
        gram = np.sum([self._products(n, m, frozenset()).shared for n, m in whole.items()], axis=0)
        return np.asarray(rows @ (np.eye(count) - _left(gram)) @ rows.T)

    def estimated(
        self,
        residuals: Sequence[FloatArray],
        names: Sequence[str],
        temper: float = 1.0,
        claimed: Iterable[str] = (),
    ) -> dict[str, FloatArray]:
        """Where the inexact numbers of each record most probably are, standard deviations.

        Args:
            residuals: (channels, m) in units of the noise alone.
            names: of their records.
            temper: variance of what the residuals hold beside the inexact numbers.
            claimed: as in `whitened`; their numbers stay where they are.

        Returns:
            (columns,) of each record.
        """
        return self._estimated(residuals, names, temper, frozenset(claimed))[0]

    def taken_up(
        self,
        residuals: Sequence[FloatArray],
        names: Sequence[str],
        temper: float = 1.0,
        claimed: Iterable[str] = (),
    ) -> TakenUp:
        """How far off what is not exact most probably is, and what it leaves of the residuals.

        Args:
            residuals: (channels, m) in units of the noise alone.
            names: of their records.
            temper: as in `estimated`.
            claimed: as in `estimated`.
        """
        found = self.estimated(residuals, names, temper, claimed)
        own = self.slopes[names[0]].own
        numbers = [found[names[0]][own:], *(found[n][: self.slopes[n].own] for n in names)]
        left = [
            rows + self.slopes[name].by(found[name])[:, : rows.shape[1]]
            for name, rows in zip(names, residuals, strict=True)
        ]
        squares = [float((rows**2).sum() + (each**2).sum())
                   for rows, each in zip(left, numbers[1:], strict=True)]  # fmt: skip
        shared = float((numbers[0] ** 2).sum()) / len(left)
        return TakenUp(np.concatenate(numbers), left, np.array(squares) + shared)

    def shared_estimate(
        self,
        residuals: Sequence[FloatArray],
        names: Sequence[str],
        temper: float = 1.0,
        claimed: Iterable[str] = (),
    ) -> tuple[FloatArray, FloatArray]:
        """What the campaign shares: where it most probably is, and how well that is known.

        Args:
            residuals: (channels, m) in units of the noise alone.
            names: of their records.
            temper: as in `estimated`.
            claimed: as in `estimated`.

        Returns:
            (shared,) standard deviations of the tolerances, and their covariance (shared, shared).
        """
        found, together = self._estimated(residuals, names, temper, frozenset(claimed))
        return found[names[0]][self.slopes[names[0]].own :], _functions(together)[1]

    def freed(
        self, residuals: Sequence[FloatArray], names: Sequence[str], claimed: Iterable[str] = ()
    ) -> dict[str, float]:
        """By how much chi-square falls where shared numbers are free that a cause stands for.

        Args:
            residuals: (channels, m) in units of the noise alone.
            names: of their records.
            claimed: as in `estimated`.

        Returns:
            by the cause's label.
        """
        where, covariance = self.shared_estimate(residuals, names, claimed=claimed)
        slopes = self.slopes[names[0]]
        means = np.array(slopes.means[slopes.own :], dtype=object)
        falls = {}
        for label in set(means) - {""}:
            own = means == label
            spread = np.eye(int(own.sum())) - covariance[np.ix_(own, own)]
            inverse = np.linalg.pinv(spread, rcond=_UNKNOWN, hermitian=True)
            falls[label] = float(where[own] @ inverse @ where[own])
        return falls

    def _estimated(
        self,
        residuals: Sequence[FloatArray],
        names: Sequence[str],
        temper: float,
        freed: frozenset[str],
    ) -> tuple[dict[str, FloatArray], FloatArray]:
        """As `estimated`; and what the records know of the shared numbers, (shared, shared)."""
        from picchio.diagnosis.percussion.tolerance.kernel import projected

        parts = []
        for name, rows in zip(names, residuals, strict=True):
            slopes = self.slopes[name]
            products = np.empty(slopes.columns.shape[2])
            projected(slopes.columns, np.ascontiguousarray(rows), products)
            gram, n = self._gram(name, rows.shape[1]) / temper, slopes.own
            free = np.array([m in freed for m in slopes.means], dtype=bool)
            gram[free], gram[:, free], products[free] = 0.0, 0.0, 0.0
            inverse = _functions(gram[:n, :n])[1]
            cross = gram[:n, n:]
            mine = gram[n:, n:] - cross.T @ inverse @ cross
            parts.append((inverse, cross, mine, products / temper))
        right = sum(p[len(i) :] - c.T @ (i @ p[: len(i)]) for i, c, _, p in parts)
        together = np.sum([mine for _, _, mine, _ in parts], axis=0)
        common = -(_functions(together)[1] @ right)
        found = {}
        for name, (inverse, cross, _, products) in zip(names, parts, strict=True):
            left = products[: len(inverse)] + cross @ common
            found[name] = np.concatenate([-(inverse @ left), common])
        return found, together

    @property
    def means(self) -> frozenset[str]:
        """Labels of the causes that stand for a number which is never exact."""
        return frozenset(m for s in self.slopes.values() for m in s.means if m)

    def _products(self, name: str, samples: int, freed: frozenset[str]) -> _Own:
        slopes = self.slopes[name]
        used = frozenset(m for m in slopes.means if m in freed)

        def make() -> _Own:
            gram = self._gram(name, samples)
            n = slopes.own
            free = np.array([m in freed for m in slopes.means[:n]], dtype=bool)
            inner = gram[:n, :n].copy()
            inner[free], inner[:, free] = 0.0, 0.0
            root, inverse = _functions(inner)
            root[free], root[:, free] = 0.0, 0.0
            inverse[free], inverse[:, free] = 0.0, 0.0
            cross = gram[:n, n:]
            return _Own(root, inverse, cross, gram[n:, n:] - cross.T @ inverse @ cross)

        return self._own.get((name, samples, used), make)

    def _gram(self, name: str, samples: int) -> FloatArray:
        slopes, key = self.slopes[name], (name, samples)
        if samples >= slopes.columns.shape[1]:
            return slopes.gram
        if key not in self._grams:
            self._grams[key] = products(slopes.columns[:, :samples])
        return self._grams[key]

    def _root(self, gram: FloatArray, freed: frozenset[str]) -> tuple[FloatArray, FloatArray]:
        some = next(iter(self.slopes.values()))
        free = np.array([m in freed for m in some.means[some.own :]], dtype=bool)
        inner = gram.copy()
        inner[free], inner[:, free] = 0.0, 0.0
        root, inverse = _functions(inner)
        root[free], root[:, free] = 0.0, 0.0
        inverse[free], inverse[:, free] = 0.0, 0.0
        return root, inverse


def _left(gram: FloatArray) -> FloatArray:
    """(k, k) by how much the data narrow unit variances: 1 - (1 + A^T A)^-1."""
    return np.asarray(np.eye(len(gram)) - _functions(gram)[1])


def _functions(gram: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(k, k) G and H with (1 + A A^T)^-1/2 = 1 - A G A^T and (1 + A A^T)^-1 = 1 - A H A^T."""
    if not gram.size:
        return gram.copy(), gram.copy()
    values, vectors = np.linalg.eigh(gram)
    values = np.maximum(values, 0.0)
    over = 1.0 + values
    # (1 - over^-1/2) / values, and (1 - 1 / over) / values, without cancellation.
    root = 1.0 / (over + np.sqrt(over))
    return (vectors * root) @ vectors.T, (vectors / over) @ vectors.T
