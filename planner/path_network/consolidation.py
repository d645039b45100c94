"""Thin a network: drop segments that others nearly replace.

Drives between many places use many almost parallel segments. The kept set is a greedy spanner (Althofer et
al. 1993): segments are looked at from the shortest to the longest, and one is kept only when those kept so
far join its ends with a detour of more than `stretch`. Every drive in the thinned network is then at most
`1 + stretch` times its shortest.
"""

from __future__ import annotations

import heapq

import numpy as np
import numpy.typing as npt

from planner.path_network.values import FloatArray
from planner.path_network.visibility_graph import IntArray


def greedy_spanner(
    nodes: int, edges: IntArray, length_m: FloatArray, stretch: float
) -> npt.NDArray[np.bool_]:
    """Return which edges [m] a greedy `1 + stretch` spanner keeps.

    `edges` [m, 2] are pairs of node numbers below `nodes`, `length_m` [m] their lengths, m. They are taken by
    length, ties by index; one is kept unless the kept ones join its ends by a route of at most `1 + stretch`
    times its length (Althofer et al. 1993).
    """
    keep = np.zeros(len(edges), dtype=bool)
    if stretch <= 0:
        keep[:] = True
        return keep
    neighbours: list[list[tuple[int, float]]] = [[] for _ in range(nodes)]
    ends = edges.tolist()
    lengths = length_m.tolist()
    for e in np.argsort(length_m, kind="stable").tolist():
        a, b = ends[e]
        if _further_than(neighbours, a, b, (1.0 + stretch) * lengths[e]):
            keep[e] = True
            neighbours[a].append((b, lengths[e]))
            neighbours[b].append((a, lengths[e]))
    return keep


def _further_than(neighbours: list[list[tuple[int, float]]], a: int, b: int, limit: float) -> bool:
    """Return whether b is further from a than `limit` (Dijkstra that stops there)."""
    best = {a: 0.0}
    queue = [(0.0, a)]
    while queue:
        d, v = heapq.heappop(queue)
        if v == b:
            return False
        if d > best[v]:
            continue
        for w, length in neighbours[v]:
            onward = d + length
            if onward <= limit and onward < best.get(w, np.inf):
                best[w] = onward
                heapq.heappush(queue, (onward, w))
    return True
