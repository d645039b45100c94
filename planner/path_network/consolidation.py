"""Thin a network: drop segments that others nearly replace.

Drives between many places use many almost parallel segments. The kept set is a greedy spanner (Althofer et
al. 1993): segments are looked at from the shortest to the longest, and one is kept only when those kept so
far join its ends with a detour of more than `stretch`. Every drive in the thinned network is then at most
`1 + stretch` times its shortest.
"""

from __future__ import annotations

import heapq

import numba
import numpy as np
import numpy.typing as npt

from planner.path_network.values import FloatArray, IntArray

_EPS_M = 1e-9  # what rounding may add to a straight distance is far less


def greedy_spanner(
    xy: FloatArray, edges: IntArray, length_m: FloatArray, stretch: float
) -> npt.NDArray[np.bool_]:
    """Return which edges [m] a greedy `1 + stretch` spanner keeps.

    `edges` [m, 2] are pairs of the nodes `xy` [n, 2], site frame, m, `length_m` [m] their lengths, m, at
    least the straight distance. They are taken by length, ties by index; one is kept unless the kept ones
    join its ends by a route of at most `1 + stretch` times its length (Althofer et al. 1993).
    """
    keep = np.zeros(len(edges), dtype=bool)
    if stretch <= 0:
        keep[:] = True
        return keep
    ends = np.concatenate([edges, edges[:, ::-1]])
    order = np.argsort(ends[:, 0], kind="stable")
    begin = np.searchsorted(ends[order, 0], np.arange(len(xy) + 1))
    _keep(
        xy,
        edges,
        length_m,
        1.0 + stretch,
        np.argsort(length_m, kind="stable"),
        (begin, ends[order, 1], order % len(edges)),
        keep,
    )
    return keep


@numba.njit(cache=True, nogil=True)
def _keep(  # pragma: no cover - compiled
    xy: FloatArray,
    edges: IntArray,
    length_m: FloatArray,
    most: float,
    turn: IntArray,
    neighbours: tuple[IntArray, IntArray, IntArray],
    keep: npt.NDArray[np.bool_],
) -> None:
    """Set `keep` [m], looking at the edges in `turn`.

    `neighbours` are those of each node: where they begin in the other two, the nodes, and the edges to them.
    """
    begin, there, by = neighbours
    best = np.full(len(begin) - 1, np.inf)
    for e in turn:
        a, b, limit = edges[e, 0], edges[e, 1], most * length_m[e]
        best[a] = 0.0
        reached, queue, joined = [a], [(0.0, a)], False
        while queue:  # Dijkstra that leaves out what cannot come to the end within the limit
            d, v = heapq.heappop(queue)
            if v == b:
                joined = d <= limit
                break
            if d > best[v]:
                continue
            for k in range(begin[v], begin[v + 1]):
                onward = d + length_m[by[k]]
                if not keep[by[k]] or onward >= best[there[k]]:
                    continue
                left = np.hypot(xy[there[k], 0] - xy[b, 0], xy[there[k], 1] - xy[b, 1])
                if onward + left <= limit + _EPS_M:
                    best[there[k]] = onward
                    reached.append(there[k])
                    heapq.heappush(queue, (onward, there[k]))
        keep[e] = not joined
        for v in reached:
            best[v] = np.inf
