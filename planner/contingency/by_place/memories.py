"""What is worth remembering where: what the policy of a relaxation does that no policy can do.

It makes an observation again that it made before, or one whose track it saw lost: then the legs driven in
between should have kept it (Roberti and Mingozzi 2014 for routes; kept by leg as Pecin, Pessoa, Poggi and
Uchoa 2017 keep their cuts). And while nobody remembers whose tracks are alive, it assumes those that suit it:
then all legs since the start should have known, or visits on the way, since the multiplier of a track weighs
more after them (`visited.py`). Each such excursion is credited with what it won, and those with the most
credit for what a question takes longer with them are remembered as long as the relaxation is not too large.
"""

from __future__ import annotations

import heapq
import math
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from planner.contingency.by_place.layout import Memory, Size, legs_of
from planner.contingency.by_place.relaxation import NgRelaxation
from planner.contingency.by_place.visited import lengths, weights_at
from planner.evaluate.model import Floats, Model

WALKS = 300
"""Futures in which a policy is followed. By hand: what one day in a thousand does wins little."""

MOST_AT = 11
"""Observations remembered at a place: each doubles its states. By hand."""

MOST_AT_START = 6
"""The same at the start, where every set of tracks is a way to begin. By hand."""

TRACE_SHARE = 0.5
"""What knowing of a track from the start on is credited with, of what it wins times the chance to lose it."""

FADED = 0.6
"""What is left of a credit when the policy is followed again. By hand: multipliers have changed since."""

VISIT_SHARE = 1.0
"""What remembering a visit is credited with, of what it adds to a track's multiplier. By hand."""

Legs = tuple[int, ...]

Excursion = tuple[int, Legs]
"""An observation, and the legs, in order of their numbers, that should keep it."""


@dataclass(eq=False)
class Credits:
    """What excursions of policies have won, in utility in the mean of a day."""

    model: Model
    seed: int = 0
    by: dict[Excursion, float] = field(default_factory=dict)
    weights: dict[tuple[int, frozenset[int]], float] = field(default_factory=dict)
    lengths: dict[int, Floats] = field(default_factory=dict)

    def followed(self, relaxation: NgRelaxation, count: int) -> dict[Excursion, float]:
        """Return what excursions win in the last policy of a relaxation that begins with so many tracks."""
        self.seed += 1
        walks = relaxation.walks(count, WALKS, rng=np.random.default_rng(self.seed))
        wanted, legs = relaxation.wanted, legs_of(self.model)
        kept = np.array([1.0 - self.model.loss[a, b, wanted.place] for a, b in legs]).tolist()  # leg, wanted
        image = ~self.model.is_place[wanted.number]
        found: dict[Excursion, float] = defaultdict(float)
        some = walks.legs[:, : walks.driven.max()].tolist(), walks.events[:, : walks.happened.max()].tolist()
        for path, events, happened in zip(*some, walks.happened.tolist(), strict=True):
            images: dict[int, int] = {}  # observations, and the legs before them
            for m, now, before in events[:happened]:
                if before >= 0:
                    found[m, tuple(sorted(set(path[before:now])))] += float(wanted.worth[m])
                if image[m]:
                    images.setdefault(m, now)
                if not relaxation.counted[m]:
                    continue
                if now:
                    way = tuple(sorted(set(path[:now])))
                    lost = 1.0 - math.prod(kept[e][m] for e in way)
                    found[m, way] += TRACE_SHARE * lost * float(wanted.worth[m])
                heavier = self._heavier(relaxation, m, {o: frozenset(path[k:now]) for o, k in images.items()})
                if heavier is not None:
                    o, legs_kept, more = heavier
                    found[o, legs_kept] += VISIT_SHARE * more * float(relaxation.prices[m])
        return {key: credit / WALKS for key, credit in found.items()}

    def _heavier(
        self, relaxation: NgRelaxation, m: int, ways: Mapping[int, frozenset[int]]
    ) -> tuple[int, Legs, float] | None:
        """Return the image that makes the multiplier of a track weigh most more, where it is to be kept, and
        by how much; None if none does.

        `ways` are the legs from images that were made to the track's.
        """
        on, place = relaxation.kept, relaxation.wanted.place
        places = {o: int(place[o]) for o in ways if place[o] != place[m]}
        known = frozenset(p for o, p in places.items() if all(o in on[e] for e in ways[o]))
        before = self._weight(int(place[m]), known)
        more = {
            o: self._weight(int(place[m]), known | {p}) - before for o, p in places.items() if p not in known
        }
        best = max(more, key=lambda o: (more[o], o), default=None)
        if best is None or more[best] <= 0.0:
            return None
        return best, tuple(sorted(ways[best])), more[best]

    def _weight(self, place: int, visited: frozenset[int]) -> float:
        if place not in self.lengths:
            self.lengths[place] = lengths(self.model, place)
        key = place, visited
        if key not in self.weights:
            own = np.array(sorted(visited), np.int64)
            self.weights[key] = float(weights_at(self.lengths[place], place, own)[-1])
        return self.weights[key]

    def add(self, policies: Iterable[tuple[float, Mapping[Excursion, float]]]) -> None:
        """Credit the excursions of policies, each with its share in what is done; older credits fade."""
        self.by = {key: FADED * credit for key, credit in self.by.items()}
        for share, found in policies:
            for key, credit in found.items():
                self.by[key] = self.by.get(key, 0.0) + share * credit

    def enlarged(
        self, memory: Memory, limits: Iterable[tuple[int, int, float]], largest_mb: float = math.inf
    ) -> Memory:
        """Return a memory with more.

        `limits` are numbers of nodes and of tracks counted, and the seconds that a question on so many may
        take.
        """
        return _Chosen(self.model, memory, limits, largest_mb).of(self.by)


class _Chosen:
    """A memory in the making, with what questions of it take."""

    def __init__(
        self, model: Model, memory: Memory, limits: Iterable[tuple[int, int, float]], largest_mb: float
    ) -> None:
        self.largest_mb = largest_mb
        self.legs = legs_of(model)
        self.at = [list(own) for own in memory.at]
        self.on = [set(memory.common(*leg)) for leg in self.legs]
        self.sizes = [(Size.of(model, memory, most, steps), seconds) for steps, most, seconds in limits]

    def of(self, credits: Mapping[Excursion, float]) -> Memory:
        """Return the memory of the excursions with the most credit for what a question takes more with them,
        as far as the seconds go.
        """
        queue = [(-math.inf, credit, key) for key, credit in sorted(credits.items()) if key[1]]
        heapq.heapify(queue)
        while queue:
            _, credit, (m, way) = heapq.heappop(queue)
            legs, places = self._lacking(m, way)
            if not legs or any(len(self.at[p]) >= (MOST_AT if p else MOST_AT_START) for p in places):
                continue
            larger = self._with(legs, places)
            now = -credit / sum(
                new.seconds - old.seconds for (new, _), (old, _) in zip(larger, self.sizes, strict=True)
            )
            if queue and now > queue[0][0]:  # it takes more than when it was put there
                heapq.heappush(queue, (now, credit, (m, way)))
                continue
            if any(size.seconds > most_s or size.bound_mb > self.largest_mb for size, most_s in larger):
                continue
            self.sizes = larger
            for p in places:
                self.at[p].append(m)
            for e in legs:
                self.on[e].add(m)
        kept = {leg: frozenset(on) for leg, on in zip(self.legs, self.on, strict=True) if on}
        return Memory.of(self.at, kept)

    def _lacking(self, m: int, way: tuple[int, ...]) -> tuple[list[int], list[int]]:
        """Return the legs and places of a way that do not keep an observation."""
        legs = [e for e in way if m not in self.on[e]]
        return legs, sorted({p for e in legs for p in self.legs[e] if m not in self.at[p]})

    def _with(self, legs: list[int], places: list[int]) -> list[tuple[Size, float]]:
        """Return the sizes, with their limits, where these keep one observation more."""
        states = sum(2 ** len(self.at[p]) for p in places)
        ways = sum(2 ** len(self.on[e]) for e in legs)
        return [(size.with_more(states, ways), most_s) for size, most_s in self.sizes]
