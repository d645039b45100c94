"""Valid inequalities of the orienteering polytope, and the search for those that a fractional tour breaks.

x(e) says whether the tour uses edge e, y(v) whether it visits node v; y = 1 at the depot, node 0. E(S) are
the edges inside a node set S, d(S) those that leave it. Everything here holds for every tour that is
within the budget, but for rows told to be for more than a prize: these hold for every tour worth more.

Sources: Fischetti, Salazar and Toth 1998 (FST), INFORMS Journal on Computing 10(2); Kobeaga, Merino and
Lozano 2021 (KML), arXiv 2011.02743; Letchford, Reinelt and Theis 2008, SIAM J. Discrete Math. 22(4).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from planner.orienteering.cut_kernels import DELTA, INNER, PLAIN, cut_tree, heavy_path, sets_below

Array = npt.NDArray[Any]
Flags = npt.NDArray[np.bool_]

_LEAST = 0.02  # violation from which a row is worth its place in the linear program. By hand
_SUPPORT = 1e-7  # value from which an edge belongs to the fractional tour
_SETS = 200  # node sets looked for at a time


@dataclass(frozen=True, slots=True, eq=False)
class Row:
    """An inequality `set part + edges + nodes >= at_least`.

    Parameters
    ----------
    kind, side
        DELTA: the set part is x(d(S)); INNER: y(S) - x(E(S)); PLAIN: none. `side` (n,) flags S.
    edges
        Rows (u, v, coefficient), u < v, int64 (k, 3), added to the set part; no edge twice.
    nodes
        Pairs (v, coefficient) of y, added to the set part; no node twice.
    """

    kind: int
    side: Flags
    edges: Array
    nodes: tuple[tuple[int, int], ...]
    at_least: int

    @property
    def parts_clusters(self) -> bool:
        """Whether the set is one that tours may pass by: that of a subtour elimination."""
        return self.kind == INNER or (self.kind == DELTA and not len(self.edges) and bool(self.nodes))

    def edge_coefficients(self, tail: Array, head: Array) -> Array:
        """Return the coefficients, int64 (m,), of edges with ends `tail` < `head`, each (m,)."""
        if self.kind == DELTA:
            out = (self.side[tail] != self.side[head]).astype(np.int64)
        elif self.kind == INNER:
            out = -(self.side[tail] & self.side[head]).astype(np.int64)
        else:
            out = np.zeros(len(tail), dtype=np.int64)
        if len(self.edges):
            n = len(self.side)
            named = self.edges[:, 0] * n + self.edges[:, 1]
            order = np.argsort(named)
            keys = tail * n + head
            at = np.minimum(np.searchsorted(named[order], keys), len(named) - 1)
            found = named[order[at]] == keys
            out[found] += self.edges[order[at[found]], 2]
        return out

    def node_coefficients(self) -> Array:
        """Return the coefficients of y, int64 (n,)."""
        out = self.side.astype(np.int64) if self.kind == INNER else np.zeros(len(self.side), dtype=np.int64)
        for v, coefficient in self.nodes:
            out[v] += coefficient
        return out


@dataclass(frozen=True, slots=True, eq=False)
class FractionalTour:
    """A point of the relaxation: edges (m,) with ends `tail` < `head` and value `x`, and visits `y` (n,)."""

    tail: Array
    head: Array
    x: Array
    y: Array

    @staticmethod
    def of(tail: Array, head: Array, x: Array, y: Array) -> FractionalTour:
        """Return the point without the edges (m,) that it does not use; `y` (n,)."""
        used = x > _SUPPORT
        return FractionalTour(tail[used], head[used], x[used], y)

    def boundary(self, side: Flags) -> float:
        """Return x(d(S)) of the set flagged by `side` (n,)."""
        return float(self.x[side[self.tail] != side[self.head]].sum())

    def lacks(self, row: Row) -> float:
        """Return by how much the point breaks a row."""
        held = float(row.edge_coefficients(self.tail, self.head) @ self.x) + float(
            row.node_coefficients() @ self.y
        )
        return row.at_least - held


def subtour_row(side: Flags, witness: int, sparse: bool) -> Row:
    """Return x(d(S)) >= 2 y(witness), the generalised subtour elimination of FST.

    Parameters
    ----------
    side
        Flags S (n,), which holds the witness and not the depot.
    sparse
        Write it as y(S) - x(E(S)) >= y(witness), which the degree equations make the same.
    """
    if sparse:
        return Row(INNER, side, _NO_EDGES, ((witness, -1),), 0)
    return Row(DELTA, side, _NO_EDGES, ((witness, -2),), 0)


def leaving_row(side: Flags) -> Row:
    """Return x(d(S)) >= 2 for S (n,): a tour worth more than all nodes outside S must visit S.

    Valid for every tour worth more than the prizes of the nodes outside S together: a conditional cut of FST.
    """
    return Row(DELTA, side, _NO_EDGES, (), 2)


def parity_row(side: Flags, teeth: Array) -> Row:
    """Return x(d(H) - T) - x(T) >= 1 - |T| for an odd T within d(H): tours cross d(H) evenly often.

    With the degree equations these are the 2-matching (blossom) inequalities of FST and KML. `side` (n,)
    flags H, `teeth` (k, 2) are the ends of T.
    """
    return Row(DELTA, side, _with(teeth, -2), (), 1 - len(teeth))


def cover_row(nodes: int, edges: Array) -> Row:
    """Return x(C) <= |C| - 1 for edges (k, 2) that are together longer than the budget (FST: cover)."""
    return Row(PLAIN, np.zeros(nodes, dtype=np.bool_), _with(edges, -1), (), 1 - len(edges))


def path_row(nodes: int, path: Array, onward: Array) -> Row:
    """Return sum of y inside the path + x from its last node to `onward` >= x(path) (FST: path).

    A tour that uses all edges of a path without the depot leaves it at the last node for one of `onward`:
    those that still let it close within the budget, and the depot.

    Parameters
    ----------
    nodes
        How many there are, the depot among them.
    path, onward
        Nodes (k,) in their order, and nodes (j,).
    """
    used = _with(np.sort(np.stack([path[:-1], path[1:]], axis=1), axis=1), -1)
    ahead = _with(np.sort(np.stack([np.full_like(onward, path[-1]), onward], axis=1), axis=1), 1)
    inside = tuple((v, 1) for v in path[1:-1].tolist())
    return Row(PLAIN, np.zeros(nodes, dtype=np.bool_), np.concatenate([used, ahead]), inside, 0)


_NO_EDGES = np.empty((0, 3), dtype=np.int64)


def _with(ends: Array, coefficient: int) -> Array:
    return np.column_stack([ends, np.full(len(ends), coefficient, dtype=np.int64)])


@dataclass(slots=True)
class Separator:
    """Finds rows that a fractional tour breaks.

    Parameters
    ----------
    length
        Of the edge between two nodes, integers (n, n).
    home
        Least length from a node to the depot, integers (n,).
    prize, budget
        Prizes (n,), and the most that a tour may be long.
    work
        Arcs looked at so far.
    """

    length: Array
    home: Array
    prize: Array
    budget: int
    work: int = field(default=0)

    def rows(self, point: FractionalTour, worth: int, *, thorough: bool) -> list[Row]:
        """Return rows that the point breaks, for tours worth more than `worth` (depot's prize included)."""
        found = list(self._subtours(point, worth))
        if thorough or not found:
            found += self._parities(point)
            found += self._covers(point)
            found += self._paths(point)
        return found

    def _subtours(self, point: FractionalTour, worth: int) -> Iterator[Row]:
        n = len(self.prize)
        order = np.argsort(-point.y, kind="stable")
        order = order[(point.y[order] > _LEAST) & (order > 0)]
        sets, witnesses, work = sets_below(n, point.tail, point.head, point.x, point.y, order, _LEAST, _SETS)
        self.work += work
        total = int(self.prize.sum())
        for side, witness in zip(sets, witnesses.tolist(), strict=True):
            if total - int(self.prize[side].sum()) <= worth:
                yield leaving_row(side)
                continue
            crossing = point.boundary(side)
            inside = np.nonzero(side)[0]
            best = inside[np.argsort(-point.y[inside], kind="stable")[:_WITNESSES]]
            for v in {witness, *best.tolist()}:
                if 2.0 * point.y[v] > crossing + _LEAST:
                    yield subtour_row(side, v, len(inside) <= _SPARSE)

    def _parities(self, point: FractionalTour) -> Iterator[Row]:
        broken = (point.x > _SUPPORT) & (point.x < 1.0 - _SUPPORT)
        if not broken.any():
            return
        members = np.unique(np.concatenate([point.tail[broken], point.head[broken]]))
        rank = np.full(len(self.prize), -1, dtype=np.int64)
        rank[members] = np.arange(len(members))
        sides, work = cut_tree(
            len(members),
            rank[point.tail[broken]],
            rank[point.head[broken]],
            np.minimum(point.x[broken], 1.0 - point.x[broken]),
        )
        self.work += work
        seen: set[bytes] = set()
        for part in sides:
            side = np.zeros(len(self.prize), dtype=np.bool_)
            side[members[part]] = True
            if side[0]:
                side = ~side
            key = side.tobytes()
            if key not in seen:
                seen.add(key)
                yield from self._parity_of(point, side)

    def _parity_of(self, point: FractionalTour, side: Flags) -> Iterator[Row]:
        crossing = np.nonzero(side[point.tail] != side[point.head])[0]
        if not len(crossing):
            return
        x = point.x[crossing]
        tooth = x > 0.5
        if tooth.sum() % 2 == 0:
            nearest = int(np.argmin(np.abs(2.0 * x - 1.0)))
            tooth[nearest] = ~tooth[nearest]
        if float(np.where(tooth, 1.0 - x, x).sum()) < 1.0 - _LEAST:
            teeth = crossing[tooth]
            yield parity_row(side, np.stack([point.tail[teeth], point.head[teeth]], axis=1))

    def _covers(self, point: FractionalTour) -> Iterator[Row]:
        order = np.argsort(-point.x, kind="stable")
        slack = np.cumsum(1.0 - point.x[order])
        length = np.cumsum(self.length[point.tail[order], point.head[order]])
        fits = int(np.searchsorted(length, self.budget, side="right"))
        if fits < len(order) and slack[fits] < 1.0 - _LEAST:
            chosen = order[: fits + 1]
            yield cover_row(len(self.prize), np.stack([point.tail[chosen], point.head[chosen]], axis=1))

    def _paths(self, point: FractionalTour) -> Iterator[Row]:
        """Follow heavy edges from each node on."""
        n = len(self.prize)
        if n > _PATHS:
            return
        value = np.zeros((n, n))
        value[point.tail, point.head] = value[point.head, point.tail] = point.x
        for first in np.nonzero(point.y[1:] > _LEAST)[0] + 1:
            path = heavy_path(value, point.y, self.length, self.home, self.budget, first, _LEAST)
            self.work += n * (len(path) + 1)
            if len(path):
                yield path_row(n, path, self._onward(path))

    def _onward(self, path: Array) -> Array:
        """Return the nodes (j,) to which a tour within the budget may go on from the end of a path (k,)."""
        run = int(self.home[path[0]] + self.length[path[:-1], path[1:]].sum())
        ahead = run + self.length[path[-1]] + self.home <= self.budget
        ahead[path] = False
        return np.nonzero(ahead)[0]


_WITNESSES = 1  # nodes of a set for which its row is added
_SPARSE = 6  # nodes up to which y(S) - x(E(S)) has fewer entries than x(d(S))
_PATHS = 400  # nodes up to which paths are followed
