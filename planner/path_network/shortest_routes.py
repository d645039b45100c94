"""Shortest routes between places along free segments (Dijkstra 1959)."""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_matrix

from planner.path_network.values import FloatArray, IntArray

Numbers = npt.NDArray[np.int32]

EVERYBODY = -1
"""Owner of a node that every route may pass."""


class ShortestRoutes:
    """Dijkstra's routes between places, where nodes with an owner serve its own routes only.

    Each such node has two copies: one that routes from its owner leave by, and one that routes to it come
    in by; no segment leads from the second to the first.

    `xy` [nodes, 2], site metres; `owner` [nodes] is the place that a node serves alone, `EVERYBODY` for all
    others; `edges` [m, 2] are pairs of nodes, `weight` [m] what each costs either way; `places` [k] are the
    nodes to route between.
    """

    def __init__(
        self, xy: FloatArray, owner: IntArray, edges: IntArray, weight: FloatArray, places: IntArray
    ) -> None:
        n = len(owner)
        owned = np.flatnonzero(owner != EVERYBODY)
        comes_in = np.arange(n)
        comes_in[owned] = n + np.arange(len(owned))
        self._node = np.concatenate([np.arange(n), owned])
        u, v = np.concatenate([edges, edges[:, ::-1]]).T
        both = np.concatenate([weight, weight])
        same = (owner[u] == owner[v]) & (owner[u] != EVERYBODY)
        first = np.concatenate([u[~same], u[same], comes_in[u[same]]])
        second = np.concatenate([comes_in[v[~same]], v[same], comes_in[v[same]]])
        cost = np.concatenate([both[~same], both[same], both[same]])
        graph = coo_matrix((cost, (first, second)), shape=(len(self._node), len(self._node))).tocsr()
        # From the outside inward: each search ends at the last of those farther in, after 3/4 of a full one.
        out = np.hypot(*(xy[places] - xy[places].mean(axis=0)).T)
        turn = np.argsort(-out, kind="stable")
        ends = comes_in[places[turn]]
        distance, self._before = _dijkstra(graph.indptr, graph.indices, graph.data, places[turn], ends)
        self._row = {int(place): k for k, place in enumerate(places[turn])}
        self._end = {int(place): int(end) for place, end in zip(places[turn], ends, strict=True)}
        self.distance: FloatArray = np.empty_like(distance)
        """Shape (places, places); infinite where there is no route."""
        self.distance[np.ix_(turn, turn)] = np.minimum(distance, distance.T)

    def route(self, first: int, second: int) -> list[int]:
        """Return the nodes of the shortest route between two of the places, which are connected."""
        outer, inner = sorted((first, second), key=self._row.__getitem__)
        before = self._before[self._row[outer]]
        nodes = [self._end[inner]]
        while nodes[-1] != outer:
            nodes.append(int(before[nodes[-1]]))
        if outer == first:
            nodes.reverse()
        return [int(self._node[node]) for node in nodes]


@numba.njit(cache=True, nogil=True)
def _dijkstra(
    begin: Numbers, there: Numbers, cost: FloatArray, sources: IntArray, ends: IntArray
) -> tuple[FloatArray, Numbers]:
    """Return distances (k, k) to the ends of later sources, and the nodes before each (k, nodes).

    The segments of node v lead to `there` at `cost` from `begin[v]` on; `ends` [k] are where routes to
    `sources` [k] come in. The distance to itself is 0, to earlier ones infinite.
    """
    nodes = len(begin) - 1
    is_end = np.zeros(nodes, np.bool_)
    is_end[ends] = True
    away = np.empty(nodes)
    done = np.empty(nodes, np.bool_)
    heap = np.empty(len(there) + 1, np.int32)
    key = np.empty(len(there) + 1)
    distance = np.full((len(sources), len(ends)), np.inf)
    before = np.full((len(sources), nodes), -1, np.int32)
    for s in range(len(sources)):
        away[:], done[:] = np.inf, False
        away[sources[s]] = 0.0
        heap[0], key[0], size = sources[s], 0.0, 1
        is_end[ends[s]] = False
        left = len(ends) - s - 1
        while size and left:
            node = heap[0]
            size -= 1
            _sink(heap, key, size)
            if done[node]:
                continue
            done[node] = True
            left -= is_end[node]
            for k in range(begin[node], begin[node + 1]):
                other, length = there[k], away[node] + cost[k]
                if length < away[other]:
                    away[other], before[s, other] = length, node
                    _rise(heap, key, size, other, length)
                    size += 1
        distance[s, s] = 0.0
        distance[s, s + 1 :] = away[ends[s + 1 :]]
    return distance, before


@numba.njit(cache=True, nogil=True)
def _sink(heap: Numbers, key: FloatArray, size: int) -> None:
    """Put the entry behind `size` others in the place of the first, down to where no smaller is below it."""
    node, own, at = heap[size], key[size], 0
    while 4 * at + 1 < size:
        below = 4 * at + 1
        for other in range(below + 1, min(below + 4, size)):
            if key[other] < key[below]:
                below = other
        if key[below] >= own:
            break
        heap[at], key[at] = heap[below], key[below]
        at = below
    heap[at], key[at] = node, own


@numba.njit(cache=True, nogil=True)
def _rise(heap: Numbers, key: FloatArray, size: int, node: int, own: float) -> None:
    """Put an entry behind `size` others, and up to where no larger is above it."""
    at = size
    while at > 0 and key[(at - 1) // 4] > own:
        above = (at - 1) // 4
        heap[at], key[at] = heap[above], key[above]
        at = above
    heap[at], key[at] = node, own
