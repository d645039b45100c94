"""The relaxation behind the exact engine's bounds: a table of optimistic completions, and its multipliers.

The walk of the relaxation remembers time and the experiments done at the site where it is, and forgets those
done elsewhere (state-space relaxation, Christofides, Mingozzi and Toth 1981). Energy is not a dimension of
the table but has a multiplier; a table holds 16 of them side by side ("lanes"); the least bound counts. That
loses nothing to rounding, and the bound at the root is as good as that of a (time x energy) table ten times
the size. Multipliers on "at most once", on precedence and on side limits make the walk behave.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from planner.orienteering.label_kernels import NEVER, fill_table, lay_moves, trace_table
from planner.orienteering.layout import Layout, Root
from planner.orienteering.problem import IntArray
from planner.tally import SECONDS, Step, spend

Floats = npt.NDArray[np.float64]

_AROUND = np.array([0.2, 0.4, 0.55, 0.68, 0.78, 0.86, 0.93, 1, 1.07, 1.16, 1.28, 1.45, 1.75, 2.4, 4.0])
_EXACT = 2**33  # energies below have exact products with multipliers of 20 bits


@dataclass(frozen=True, slots=True, eq=False)
class Multipliers:
    """Multipliers, in prize units: `once` (X,), `order` (links,), `sides` (limits,); none negative."""

    once: Floats
    order: Floats
    sides: Floats

    @staticmethod
    def none(layout: Layout) -> Multipliers:
        """Return zeros."""
        return Multipliers(
            np.zeros(len(layout.worth)), np.zeros(len(layout.links)), np.zeros(len(layout.capacity))
        )

    def stepped(self, layout: Layout, way: Slack, length: float) -> Multipliers | None:
        """Return the multipliers after a step that is to lower the bound by `length`, utility (Polyak 1969).

        `None` when there is nothing to correct.
        """
        parts = ((way.once, self.once), (way.order, self.order), (way.sides, self.sides))
        norm = sum(float(np.where((g > 0) & (price <= 0), 0.0, g) @ g) for g, price in parts)
        if norm == 0:
            return None
        length /= norm
        return Multipliers(
            np.maximum(0.0, self.once - length * way.once),
            np.maximum(0.0, self.order - length * way.order),
            np.maximum(0.0, self.sides - length * way.sides / np.maximum(1, layout.capacity)),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Slack:
    """What a walk leaves of each rule: negative where it breaks one. Shapes as in `Multipliers`."""

    once: Floats
    order: Floats
    sides: Floats

    def plus(self, other: Slack, share: float) -> Slack:
        """Return the sum with a share of another."""
        return Slack(
            self.once + share * other.once,
            self.order + share * other.order,
            self.sides + share * other.sides,
        )


def slack_of(layout: Layout, counts: Floats) -> Slack:
    """Return the slack of a walk that does each experiment `counts` [X] times."""
    return Slack(
        1.0 - counts,
        np.array([counts[a] - counts[b] for a, b in layout.links], dtype=float),
        (layout.capacity - layout.amounts @ counts) / np.maximum(1, layout.capacity),
    )


class Relaxation:
    """Table, gains and lanes for one layout.

    Attributes
    ----------
    scale
        Table units a prize unit.
    gain, once, offset
        What an experiment adds to a walk (X,), the "at most once" part of the multipliers (X,), and what is
        added to every bound; scaled.
    table
        Shape (states, time buckets, lanes).
    price
        What a unit of energy costs in each lane, scaled; multiples of 2^-k with 20 significant bits.
    slack
        Added to energy terms where products could be inexact.
    """

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self.multipliers = Multipliers.none(layout)
        self.scale = max(1, min(64, 2**24 // max(1, int(layout.worth.max()) * 64)))
        self.price = self._prices()
        self.slack = 1 if layout.e_budget >= _EXACT else 0
        self.table: npt.NDArray[np.signedinteger] = np.empty((0, 0, 0), dtype=np.int32)
        self.step = 0
        self._probes: dict[int, npt.NDArray[np.signedinteger]] = {}
        self.set(self.multipliers)

    def _prices(self) -> Floats:
        lay = self.layout
        if lay.problem.energy_budget is None:
            return np.zeros(1)
        dearest = float((lay.value / np.maximum(1, lay.energy)).max()) * self.scale
        if dearest <= 0:
            return np.zeros(1)
        return _short(np.concatenate([[0.0], np.geomspace(dearest / 100, dearest, len(_AROUND))]))

    def recentre(self, lane: int) -> None:
        """Put the lanes closer together round the multiplier of one of them; out of date until `fill`."""
        if lane > 0 and len(self.price) > 1:
            self.price = _short(np.concatenate([[0.0], self.price[lane] * _AROUND]))
            self.step = 0

    def twin(self) -> Relaxation:
        """Return a relaxation with the same multipliers, that of energy too, and a table of its own."""
        twin = Relaxation(self.layout)
        twin.price = self.price
        twin.set(self.multipliers)
        return twin

    def probe(self, lane: int) -> npt.NDArray[np.signedinteger]:
        """Return a copy of one lane of the table, shape (states, time buckets)."""
        if lane not in self._probes:
            self._probes[lane] = np.ascontiguousarray(self.table[:, :, lane])
        return self._probes[lane]

    def set(self, multipliers: Multipliers) -> None:
        """Take other multipliers; the table is out of date until `fill`."""
        self.multipliers = multipliers
        lay = self.layout
        lam = np.rint(multipliers.once * self.scale).astype(np.int64)
        mu = np.rint(multipliers.order * self.scale).astype(np.int64)
        nu = np.rint(multipliers.sides * self.scale).astype(np.int64)
        gain = lay.worth * self.scale - lam
        self._order: list[int] = mu.tolist()
        for m, (a, b) in zip(self._order, lay.links, strict=True):
            gain[a] += m
            gain[b] -= m
        self.offset = int(lam.sum())
        for k in range(len(nu)):
            gain -= nu[k] * lay.amounts[k]
            self.offset += int(nu[k] * lay.capacity[k])
        self.gain: IntArray = gain
        self.once: IntArray = lam

    def _step(self, buckets: int) -> int:
        lay = self.layout
        budget = lay.problem.time_budget
        return max(1, min(math.ceil(max(1, budget) / max(16, buckets)), lay.shortest_move))

    def _work(self, buckets: int) -> float:
        """Return how many moves from cells a table of so many buckets looks at; 16 lanes count as one."""
        lay = self.layout
        cells = lay.states * (lay.problem.time_budget // self._step(buckets) + 1)
        return float(cells) * len(lay.order) * (1.0 + len(self.price) / 16.0)

    def cost_s(self, buckets: int) -> float:
        """Return what a table takes, in seconds of a processor as they are reckoned."""
        return self._work(buckets) * SECONDS[Step.RELAXED]

    def fill(self, buckets: int, since: int = 0) -> None:
        """Make the table with at least about so many time buckets, good for roots from `since` on."""
        lay = self.layout
        budget = lay.problem.time_budget
        step = self._step(buckets)
        spend(Step.RELAXED, self._work(buckets))
        if step != self.step:
            self.step = step
            self._ahead, self._last, self._soonest, self._paid = lay_moves(
                lay.road_s,
                lay.road_j,
                lay.first,
                lay.duration,
                lay.energy,
                lay.opens,
                lay.latest,
                lay.e_budget,
                step,
                self.price,
                self.slack,
            )
            self._end_paid = np.floor(lay.end_j[:, None] * self.price).astype(np.int64) - self.slack
        # How often a relaxed walk can change groups decides which integers hold its sums.
        moves = budget // max(1, lay.shortest_move) + 2
        most = max(int(np.abs(self.gain).max()), int(self._paid.max()), int(self._end_paid.max(initial=0)))
        kind = np.int32 if most * moves * 4 < -NEVER // 4 else np.int64
        shape = (lay.states, budget // step + 1, len(self.price))
        if self.table.shape != shape or self.table.dtype != kind:
            self.table = np.empty(shape, dtype=kind)
        self._probes = {}
        self._worth = (self.gain[None, :, None] - self._paid).astype(kind)
        fill_table(
            self.table,
            self._worth,
            self._ahead,
            self._last,
            self._soonest,
            lay.first,
            lay.base,
            lay.end_s,
            self._end_paid.astype(kind),
            step,
            budget,
            min(since, budget) // step,
        )

    def completion(self, root: Root) -> tuple[int, int]:
        """Return the scaled bound on what the walk can gain from a root on, and its lane."""
        k, left = root.time // self.step, self.layout.e_budget - root.fuel
        if k >= self.table.shape[1] or left < 0:
            return NEVER, 0
        lanes = self.table[self.layout.base[root.group] + root.mask, k] + np.ceil(left * self.price)
        m = int(lanes.argmin())
        return int(lanes[m]) + self.slack, m

    def start(self, root: Root) -> int:
        """Return the scaled worth with which the first label starts.

        That is what the multipliers add to or take from what is already done (its prize was earned before
        and counts no more), less the "at most once" multipliers of what is out of reach. A precedence whose
        second is done and whose first is not no longer binds: its multiplier is given back.
        """
        done = root.done
        start = int(
            ((self.gain - self.layout.worth * self.scale) * done).sum() - (self.once * root.late).sum()
        )
        for price, (a, b) in zip(self._order, self.layout.links, strict=True):
            if done[b] and not done[a]:
                start += price
        return start

    def walk(self, root: Root, lane: int) -> Floats:
        """Return how often a best walk does each experiment, counting what was done before, shape (X,).

        When the walk of the lane uses more or less energy than there is, it is mixed with the one of the next
        lane on the other side so that both together use what there is: only then do the counts say in which
        direction the least bound of all multipliers falls.
        """
        left = self.layout.e_budget - root.fuel
        counts, used = self._walk(root, lane)
        other = lane - 1 if used < left else lane + 1
        if used != left and 0 <= other < len(self.price):
            more, used_more = self._walk(root, other)
            if (used_more - left) * (used - left) < 0:
                share = (left - used_more) / (used - used_more)
                counts = share * counts + (1.0 - share) * more
        return counts + root.done

    def _walk(self, root: Root, lane: int) -> tuple[Floats, int]:
        counts, used = trace_table(
            self.table,
            self._worth,
            self._ahead,
            self._last,
            self._soonest,
            self.layout.first,
            self.layout.base,
            self.layout.road_j,
            self.layout.energy,
            root.group,
            root.mask,
            root.time // self.step,
            lane,
        )
        return counts.astype(np.float64), int(used)


def _short(prices: Floats) -> Floats:
    """Return the multipliers rounded to 20 significant bits."""
    mantissa, exponent = np.frexp(prices)
    return np.ldexp(np.rint(mantissa * 2**20), exponent - 20)
