"""What is worth remembering where: what the policy of a relaxation does that no policy can do.

It makes an observation again that it made before, or one whose track it saw lost: then the legs driven in
between should have kept it (Roberti and Mingozzi 2014 for routes; kept by leg as Pecin, Pessoa, Poggi and
Uchoa 2017 keep their cuts). And while nobody remembers whose tracks are alive, it assumes those that suit it:
then all legs since the start should have known. Each such excursion is credited with what it won, and those
with the most credit for a leg are remembered as long as the relaxation is not too large.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from planner.contingency.by_place.layout import Memory, Size, legs_of
from planner.contingency.by_place.relaxation import NgRelaxation
from planner.evaluate.model import Model

WALKS = 3000
"""Futures in which a policy is followed. By hand: what one day in a thousand does wins little."""

MOST_AT = 11
"""Observations remembered at a place: each doubles its states. By hand."""

MOST_AT_START = 6
"""The same at the start, where every set of tracks is a way to begin. By hand."""

TRACE_SHARE = 0.5
"""What knowing of a track from the start on is credited with, of what it wins times the chance to lose it."""

FADED = 0.6
"""What is left of a credit when the policy is followed again. By hand: multipliers have changed since."""

Excursion = tuple[int, tuple[int, ...]]
"""An observation, and the legs, in order of their numbers, that should keep it."""


@dataclass(eq=False)
class Credits:
    """What excursions of policies have won, in utility in the mean of a day."""

    model: Model
    seed: int = 0
    by: dict[Excursion, float] = field(default_factory=dict)

    def follow(self, relaxation: NgRelaxation) -> None:
        """Add the excursions of the policy that a relaxation was last asked for."""
        self.seed += 1
        walks = relaxation.walks(WALKS, rng=np.random.default_rng(self.seed))
        wanted, legs = relaxation.wanted, legs_of(self.model)
        loss = np.array([self.model.loss[a, b, wanted.place] for a, b in legs])  # (legs, wanted)
        found: dict[Excursion, float] = defaultdict(float)
        every = zip(walks.legs.tolist(), walks.events.tolist(), walks.happened, strict=True)
        for path, events, happened in every:
            for m, now, before in events[:happened]:
                if before >= 0:
                    found[m, tuple(sorted(set(path[before:now])))] += float(wanted.worth[m])
                if relaxation.counted[m] and now:
                    way = tuple(sorted(set(path[:now])))
                    lost = 1.0 - float(np.prod(1.0 - loss[list(way), m]))
                    found[m, way] += TRACE_SHARE * lost * float(wanted.worth[m])
        self.by = {key: FADED * credit for key, credit in self.by.items()}
        for key, credit in found.items():
            self.by[key] = self.by.get(key, 0.0) + credit / WALKS

    def enlarged(self, memory: Memory, most: int, steps: int, seconds: float) -> Memory:
        """Return a memory with more, for a question of so many seconds, with so many tracks counted."""
        return _Chosen(self.model, memory, most, steps, seconds).of(self.by)


class _Chosen:
    """A memory in the making, with what a question of it takes."""

    def __init__(self, model: Model, memory: Memory, most: int, steps: int, seconds: float) -> None:
        self.legs, self.seconds = legs_of(model), seconds
        self.at = [list(own) for own in memory.at]
        self.on = [set(memory.common(*leg)) for leg in self.legs]
        self.size = Size.of(model, memory, most, steps)

    def of(self, credits: Mapping[Excursion, float]) -> Memory:
        """Return the memory of the excursions with the most credit for a leg, as far as the seconds go."""
        for m, way in sorted(credits, key=lambda key: (-credits[key] / max(len(key[1]), 1), key)):
            if way:
                self._remember(m, way)
        kept = {leg: frozenset(on) for leg, on in zip(self.legs, self.on, strict=True) if on}
        return Memory.of(self.at, kept)

    def _remember(self, m: int, way: tuple[int, ...]) -> None:
        """Keep an observation on some legs, unless that makes the relaxation too large."""
        legs = [e for e in way if m not in self.on[e]]
        places = sorted({p for e in legs for p in self.legs[e] if m not in self.at[p]})
        if any(len(self.at[p]) >= (MOST_AT if p else MOST_AT_START) for p in places):
            return
        states = sum(2 ** len(self.at[p]) for p in places)
        ways = sum(2 ** len(self.on[e]) for e in legs)
        larger = self.size.with_more(states, ways)
        if larger.seconds > self.seconds:
            return
        self.size = larger
        for p in places:
            self.at[p].append(m)
        for e in legs:
            self.on[e].add(m)
