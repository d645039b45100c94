"""How much longer than the best path to a place is one through the places known to have been visited.

Let W be 1 over the chance that a track survived all legs driven so far, while it lives, and 0 once it is
lost or given up. A drive that loses it with chance l multiplies W by 1 / (1 - l) with chance 1 - l: W is a
martingale, and its mean is 1 for each track of the start. With S the survival on the best path to the place
and g the chance to come there, every policy that makes the observation once at most has E[S W; made] <= S g,
whatever it knows of tracks. S g is also what bounds the chance that it is made, but S W is at least 1. It is
not known; but an image that is remembered as made was made at its place, so S W is at least S over the
survival on the best path through all such places.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from planner.evaluate.model import Floats, Ints, Model

LARGEST = 1e4
"""Weight that no observation passes, where no track survives at all: any smaller one is true too. By hand."""


def lengths(model: Model, target: int) -> Floats:
    """Return for all pairs of places the least of -log of a track's survival on any path, (n + 1, n + 1)."""
    kept = np.where(model.has_leg, 1.0 - model.loss[:, :, target], 0.0)
    with np.errstate(divide="ignore"):
        length = np.maximum(0.0, -np.log(kept))
    np.fill_diagonal(length, 0.0)
    for by in range(len(length)):
        length = np.minimum(length, length[:, by, None] + length[by])
    return np.asarray(length)


def weights_at(length: Floats, place: int, own: Ints) -> Floats:
    """Return how much the track of a place weighs more, at least 1, by what is remembered there, (states,).

    `length` is that of `lengths`; `own` holds the place of each bit, or -1 where the bit says of no place
    that it was visited.
    """
    visited = sorted({int(p) for p in own if p not in (-1, 0, place)})
    through = shortest_through(length, np.array([*visited, place], np.int64))
    weight = np.exp(np.clip(through - length[0, place], 0.0, np.log(LARGEST)))
    sets, states = np.zeros(1 << len(own), np.int64), np.arange(1 << len(own))
    for bit, p in enumerate(own):
        if int(p) in visited:
            sets |= (states >> bit & 1) << visited.index(int(p))
    return np.asarray(weight[sets])


@njit(cache=True)
def shortest_through(length: Floats, places: Ints) -> Floats:
    """Return the shortest path from place 0 through each subset of places to the last one, (subsets,).

    Subsets are bits of all but the last place; the order of a visit is free (Held and Karp 1962).
    """
    count, to = len(places) - 1, places[-1]
    path = np.full((1 << count, count + 1), np.inf)
    found = np.full(1 << count, np.inf)
    found[0] = length[0, to]
    for made in range(1, 1 << count):
        for k in range(count):
            if not made >> k & 1:
                continue
            before = made ^ (1 << k)
            best = length[0, places[k]] if before == 0 else np.inf
            for j in range(count):
                if before >> j & 1:
                    best = min(best, path[before, j] + length[places[j], places[k]])
            path[made, k] = best
            found[made] = min(found[made], best + length[places[k], to])
    return found
