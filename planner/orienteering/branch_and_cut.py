"""Proofs for surveys: branch-and-cut over edges and visits, warm-started by a known route.

At each node of the tree the linear relaxation is cut by rows that its optimum breaks (`cuts`), gets the edges
that may still win, and is bounded exactly (`cut_relaxation`). Edges and visits are fixed whose change would
push the bound down to what is already known. The tree branches on a node set first: a tour visits none of it
or crosses its boundary twice; that settles clusters, where single visits or edges would not. Branching on
visits and edges follows Fischetti, Salazar and Toth 1998; the choice by trying both sides is strong branching
(Applegate et al. 2007, The Traveling Salesman Problem).
"""

from __future__ import annotations

import heapq
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import count
from typing import Any

import numpy as np
import numpy.typing as npt

from planner.orienteering.cut_relaxation import Bound, Box, Relaxation, Tours
from planner.orienteering.cuts import FractionalTour, Row, Separator, leaving_row
from planner.tally import Step, now_s, spend

Array = npt.NDArray[Any]
Polish = Callable[[Array], "tuple[int, tuple[int, ...]]"]


@dataclass(frozen=True, slots=True)
class CutOptions:
    """Sizes of the search, set by hand while the twelve files of up to 300 nodes were proven.

    Parameters
    ----------
    near
        Nearest nodes of each node whose edges are columns from the beginning.
    columns
        Most columns that are added at a time.
    rounds, tree_rounds
        Rounds of cuts at the root and at other nodes.
    flat
        Rounds at the root after which too little was won, and `won`, the share of the gap that is enough.
    tried
        Candidates whose two sides are tried before a branch.
    polish
        Nodes of the tree between two routes made of the relaxation.
    """

    near: int = 8
    columns: int = 200
    rounds: int = 400
    tree_rounds: int = 8
    flat: int = 8
    won: float = 0.01
    tried: int = 8
    polish: int = 10


@dataclass(slots=True, eq=False)
class _Branch:
    """One way to part a box: what to do on either side."""

    side: Array | None = None
    row: Row | None = None
    visit: int = -1
    edge: int = -1

    def parts(self, box: Box) -> tuple[Box, Box]:
        """Return the boxes of both sides."""
        none, some = box.copy(), box.copy()
        if self.side is not None and self.row is not None:
            none.y_high[self.side] = 0
            some.local = (*some.local, self.row)
        elif self.visit >= 0:
            none.y_high[self.visit] = 0
            some.y_low[self.visit] = 1
        else:
            none.x_high[self.edge] = 0
            some.x_low[self.edge] = 1
        return none, some


@dataclass(slots=True, eq=False)
class Proof:
    """What branch-and-cut knows: the best tour, a bound on all, and the nodes of the tree looked at.

    `tour` lists the nodes after the depot; `value` and `upper` are without its prize.
    """

    value: int
    tour: tuple[int, ...]
    upper: int
    nodes: int = field(default=0)

    @property
    def closed(self) -> bool:
        """Whether nothing is better than the tour."""
        return self.upper <= self.value


class BranchAndCut:
    """One search for a better tour than the one given, and a bound on all."""

    def __init__(
        self,
        tours: Tours,
        known: tuple[int, tuple[int, ...]],
        polish: Polish,
        options: CutOptions = CutOptions(),
    ) -> None:
        self._tours, self._options, self._polish = tours, options, polish
        self.proof = Proof(known[0], known[1], int(tours.prize.sum()))
        self._separator = Separator(tours.length, tours.home, tours.prize, tours.budget)
        self._sets: dict[bytes, Row] = {}
        tail, head = np.triu_indices(tours.nodes, 1)
        fits = tours.home[tail] + tours.length[tail, head] + tours.home[head] <= tours.budget
        if tours.joined:
            fits |= (tail == 0) & (head == tours.nodes - 1)
        self._tail, self._head = tail[fits], head[fits]
        self._open: list[tuple[int, int, Box]] = []
        self._number = count()
        self._ages: dict[Row, int] = {}

    def run(self, until: float) -> Proof:
        """Return the proof as far as it gets until so many seconds of `planner.tally`."""
        m, n = len(self._tail), self._tours.nodes
        if m == 0:
            self.proof.upper = self.proof.value
        if m == 0 or now_s() >= until:
            return self.proof
        box = Box(
            np.zeros(m, dtype=np.int8),
            np.ones(m, dtype=np.int8),
            np.zeros(n, dtype=np.int8),
            np.ones(n, dtype=np.int8),
        )
        box.y_low[0] = 1
        if self._tours.joined:
            box.y_low[n - 1] = 1
            box.x_low[(self._tail == 0) & (self._head == n - 1)] = 1
        self._relaxed = Relaxation(self._tours, self._tail, self._head, self._first_columns())
        self._best_units = self._relaxed.scale * (self.proof.upper + 1)
        self._node(box, self._best_units, until, root=True)
        while self._open and now_s() < until:
            units, _, box = heapq.heappop(self._open)
            units = -units
            if units // self._relaxed.scale <= self.proof.value:
                self._open.clear()
                break
            self._node(box, units, until, root=False)
        left = [-units // self._relaxed.scale for units, _, _ in self._open]
        self.proof.upper = min(self.proof.upper, max([self.proof.value, *left]))
        return self.proof

    # ------------------------------------------------------------------ one node

    def _node(self, box: Box, units: int, until: float, *, root: bool) -> None:
        """Cut and bound one box; put what is left of it back as boxes that are open."""
        self.proof.nodes += 1
        opt, relaxed = self._options, self._relaxed
        gaps: list[float] = []
        point, bound = self._solved(box)
        for k in range(opt.rounds if root else opt.tree_rounds):
            units = min(units, bound.units)
            if self._done(units):
                return
            if now_s() >= until:
                break
            self._fix(box, bound)
            fresh = relaxed.missing(bound, box, opt.columns)
            if len(fresh):
                relaxed.add_columns(fresh)
                point, bound = self._solved(box)
                if len(fresh) > _FEW:
                    continue
            gaps.append(bound.units / relaxed.scale - self.proof.value)
            if self._stalled(gaps):
                break
            before = self._separator.work
            thorough = root or k % 4 == 0
            rows = self._separator.rows(point, self.proof.value, thorough=thorough)
            spend(Step.ARC, self._separator.work - before)
            spend(Step.HANDED, _FOUND * len(rows) + _THOROUGH * self._tours.nodes * thorough)
            if not rows:
                if self._integral(point):
                    self._take(point)
                break
            self._remember(rows)
            if root or relaxed.crowded():
                self._tidy()
            relaxed.add_rows(rows)
            point, bound = self._solved(box)
        units = min(units, bound.units)
        if self._done(units):
            return
        self._fix(box, bound)
        if (root or self.proof.nodes % opt.polish == 0) and now_s() < until:
            self._offer(point)
            if self._done(units):
                return
        if now_s() >= until:
            self._push(box, units)
            return
        if root:
            box = self._shrunk(box)
            point, bound = self._solved(box)
        self._part(box, units, point, until)

    def _solved(self, box: Box) -> tuple[FractionalTour, Bound]:
        point = self._relaxed.solve(box)
        return point, self._relaxed.bound(box)

    def _stalled(self, gaps: list[float]) -> bool:
        flat = self._options.flat
        return len(gaps) > flat and gaps[-1 - flat] - min(gaps[-flat:]) < self._options.won * gaps[-1]

    def _done(self, units: int) -> bool:
        return units // self._relaxed.scale <= self.proof.value

    def _push(self, box: Box, units: int) -> None:
        if not self._done(units):
            heapq.heappush(self._open, (-units, next(self._number), box))

    def _fix(self, box: Box, bound: Bound) -> None:
        """Fix what would bring the bound down to the value known if it were the other way."""
        least = bound.units - (self.proof.value + 1) * bound.scale
        box.x_high[(-bound.edge > least) & (box.x_low == 0)] = 0
        box.x_low[(bound.edge > least) & (box.x_high == 1)] = 1
        box.y_high[(-bound.node > least) & (box.y_low == 0)] = 0
        box.y_low[(bound.node > least) & (box.y_high == 1)] = 1

    def _remember(self, rows: list[Row]) -> None:
        for row in rows:
            if row.parts_clusters:
                self._sets.setdefault(row.side.tobytes(), leaving_row(row.side))

    # ------------------------------------------------------------------ tidying

    def _first_columns(self) -> Array:
        t = self._tours
        place = np.full((t.nodes, t.nodes), -1, dtype=np.int64)
        place[self._tail, self._head] = np.arange(len(self._tail))
        place = np.maximum(place, place.T)
        apart = t.length.astype(np.float64)
        np.fill_diagonal(apart, np.inf)
        near = np.argsort(apart, axis=1, kind="stable")[:, : self._options.near]
        tour = [0, *self.proof.tour]
        wanted = {*place[np.arange(t.nodes)[:, None], near].ravel().tolist()}
        wanted |= {int(place[a, b]) for a, b in zip(tour, [*tour[1:], 0], strict=True)}
        if t.joined:
            wanted.add(int(place[0, t.nodes - 1]))
        return np.array(sorted(wanted - {-1}), dtype=np.int64)

    def _tidy(self) -> None:
        """Drop rows that have had no multiplier for some rounds, once they are many."""
        slack = self._relaxed.slack_rows()
        rows = self._relaxed.rows
        ages = {r: self._ages.get(r, 0) + 1 if s else 0 for r, s in zip(rows, slack, strict=True)}
        self._ages = ages
        old = sum(a > _OLD for a in ages.values())
        if 2 * old > len(rows) > _FEW:
            keep = [r for r in rows if ages[r] <= _OLD]
            self._relaxed.keep(np.arange(len(self._relaxed.tail)), keep)

    def _shrunk(self, box: Box) -> Box:
        """Leave out the edges that are fixed to 0 for good."""
        alive = np.nonzero(box.x_high > 0)[0]
        slack = self._relaxed.slack_rows()
        self._relaxed.keep(alive, [r for r, s in zip(self._relaxed.rows, slack, strict=True) if not s])
        return Box(box.x_low[alive], box.x_high[alive], box.y_low, box.y_high)

    # ------------------------------------------------------------------ routes

    @staticmethod
    def _integral(point: FractionalTour) -> bool:
        return bool((np.abs(point.x - np.rint(point.x)) < _WHOLE).all())

    def _take(self, point: FractionalTour) -> None:
        """Make the integral point the best tour if it is one."""
        used = point.x > 0.5
        follow: dict[int, list[int]] = {}
        for u, v in zip(point.tail[used].tolist(), point.head[used].tolist(), strict=True):
            follow.setdefault(u, []).append(v)
            follow.setdefault(v, []).append(u)
        tour, at, last = [0], 0, -1
        while True:
            ahead = [v for v in follow.get(at, []) if v != last]
            if not ahead:
                return
            last, at = at, ahead[0]
            if at == 0:
                break
            tour.append(at)
            if len(tour) > self._tours.nodes:
                return
        self._better(tuple(tour[1:]))

    def _better(self, tour: tuple[int, ...]) -> None:
        if self._tours.joined and tour and tour[0] == self._tours.nodes - 1:
            tour = tour[::-1]
        value = int(self._tours.prize[list(tour)].sum())
        ring = np.array([0, *tour, 0])
        if (
            value > self.proof.value
            and int(self._tours.length[ring[:-1], ring[1:]].sum()) <= self._tours.budget
        ):
            self.proof.value, self.proof.tour = value, tour

    def _offer(self, point: FractionalTour) -> None:
        """Make a route of the relaxation's visits and hand it to the local search."""
        value, tour = self._polish(point.y)
        if value > self.proof.value:
            self._better(tour)

    # ------------------------------------------------------------------ branching

    def _part(self, box: Box, units: int, point: FractionalTour, until: float) -> None:
        """Part the box by the candidate whose worse side lowers the bound most."""
        candidates = self._candidates(box, point)
        if not candidates:
            free = np.nonzero(box.x_low < box.x_high)[0]
            if not len(free):  # one tour is left at most
                used = box.x_low > 0
                edges = self._relaxed.tail[used], self._relaxed.head[used]
                self._take(FractionalTour(*edges, np.ones(len(edges[0])), box.y_high))
                return
            candidates = [_Branch(edge=int(free[0]))]
        best: tuple[float, list[tuple[int, Box]]] | None = None
        for branch in candidates:
            sides = []
            for part in branch.parts(box):
                if part.empty:
                    sides.append((-1, part))
                    continue
                _, bound = self._solved(part)
                if not self._done(bound.units):
                    self._fix(part, bound)
                sides.append((min(units, bound.units), part))
            drops = [max(1, min(units - s, units - self._relaxed.scale * self.proof.value)) for s, _ in sides]
            score = float(min(drops)) * 5.0 + float(max(drops))
            settled = any(self._done(s) for s, _ in sides)
            if best is None or score > best[0] or settled:
                best = score, sides
            if settled or now_s() >= until:
                break
        assert best is not None
        for s, part in best[1]:
            self._push(part, s)

    def _candidates(self, box: Box, point: FractionalTour) -> list[_Branch]:
        """Return ways to part the box: sets half crossed, visits and edges half used, the best first."""
        found: list[tuple[float, int, _Branch]] = []
        y, prize = point.y, self._tours.prize
        for row in self._sets.values():
            if row in box.local:
                continue
            crossing = point.boundary(row.side)
            if _CUT < crossing < 2.0 - _CUT:
                half = 1.0 - abs(1.0 - crossing)
                found.append((half * float((prize * y)[row.side].sum()), 0, _Branch(side=row.side, row=row)))
        top: list[_Branch] = _first(found, self._options.tried // 2)
        whole = np.minimum(y, 1.0 - y)
        scores = [
            (float(whole[v] * (1.0 + prize[v])), v, _Branch(visit=v))
            for v in np.nonzero(whole > _WHOLE)[0].tolist()
        ]
        top += _first(scores, self._options.tried // 4)
        x = self._relaxed.x
        part = np.minimum(x, 1.0 - x)
        edges = [(float(part[e]), e, _Branch(edge=e)) for e in np.nonzero(part > _WHOLE)[0].tolist()]
        top += _first(edges, self._options.tried - len(top))
        return top


def _first(scored: list[tuple[float, int, _Branch]], most: int) -> list[_Branch]:
    scored.sort(key=lambda s: (-s[0], s[1]))
    return [branch for _, _, branch in scored[:most]]


_FOUND, _THOROUGH = 35.0, 7.0  # cost of a row found, and of a node in a thorough search, as `Step.HANDED`
_FEW = 20  # columns or rows that are not worth a round of their own
_OLD = 5  # rounds without a multiplier after which a row may go
_WHOLE = 1e-5  # distance from a whole number that counts as none
_CUT = 0.1  # crossing of a set, from 0 or 2, that is worth a branch
