"""What a relaxation tells of a long day before any plan is made: targets that matter, lines to begin with.

Routes on mean values know nothing of tracks that are lost, nor of branches: on 30 targets of seed 2539421
(looked at) the best of them was grown to 108.2, and one that follows a policy of the bound to 113.9.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from planner.contingency.by_place.bound import LAST_SHARE, searched
from planner.contingency.by_place.multipliers import Multipliers
from planner.evaluate.model import Ints, Model
from planner.problem import ObservationId, TargetId

LATEST = 20
"""Questions whose policies are asked, the latest. By hand: the mixture at the best multipliers is of few of
them, and misses a fifth of the targets that one of four times the work has."""

LEAST = 1e-3
"""Share of all that a policy wins from which a target matters. By hand."""

COUNTS, WALKS = 4, 100
"""Numbers of tracks to begin with whose policies are followed, those with the largest bounds, and in how many
futures. By hand."""


@dataclass(frozen=True, slots=True)
class Promising:
    """Targets where policies of a relaxation win something, and what these make in drawn futures, each
    observation once, the usual first.
    """

    targets: frozenset[TargetId]
    lines: tuple[tuple[ObservationId, ...], ...]


def promising(model: Model, *, limit_s: float) -> Promising:
    """Return what a relaxation tells within so many seconds of a processor, as `planner.tally` reckons them;
    nothing where the limit allows none.
    """
    found = searched(model, limit_s=limit_s / (1.0 - LAST_SHARE))
    if found is None:
        return Promising(frozenset(), ())
    wanted = found.relaxation.wanted
    won = np.zeros(model.n + 1)
    np.add.at(won, wanted.place, wanted.worth * np.mean(found.often[-LATEST:], axis=0))
    targets = frozenset(model.target_ids[p - 1] for p in np.nonzero(won >= LEAST * won.sum())[0] if p)
    lines = [
        tuple(model.observation_ids[wanted.number[m]] for m in line) for line in _lines(found, wanted.place)
    ]
    return Promising(targets, tuple(lines))


def _lines(found: Multipliers, place: Ints) -> list[tuple[int, ...]]:
    """Return what is made in futures of the policies with the largest bounds, the usual first, one line for
    each order of places.
    """
    usual: Counter[tuple[int, ...]] = Counter()
    line_of: dict[tuple[int, ...], tuple[int, ...]] = {}
    rng = np.random.default_rng(0)
    for count in np.argsort(-found.least)[:COUNTS]:
        found.relaxation.by_count(found.points[count])
        walks = found.relaxation.walks(int(count), WALKS, rng=rng)
        for events, happened in zip(walks.events, walks.happened, strict=True):
            made = tuple(dict.fromkeys(int(m) for m in events[:happened, 0]))
            order = tuple(dict.fromkeys(int(place[m]) for m in made))
            usual[order] += 1
            line_of.setdefault(order, made)
    return [line_of[order] for order, _ in usual.most_common() if order]
