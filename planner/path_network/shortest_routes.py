"""Shortest routes between places along free segments (Dijkstra 1959)."""

from __future__ import annotations

import numpy as np

from planner.path_network.values import FloatArray, IntArray

EVERYBODY = -1
"""Owner of a node that every route may pass."""


class ShortestRoutes:
    """Dijkstra's routes between places, where nodes with an owner serve its own routes only.

    Each such node has two copies: one that routes from its owner leave by, and one that routes to it come
    in by; no segment leads from the second to the first.

    `owner` [nodes] is the place that a node serves alone, `EVERYBODY` for all others; `edges` [m, 2] are
    pairs of nodes, `weight` [m] what each costs either way; `places` [k] are the nodes to route between.
    """

    def __init__(self, owner: IntArray, edges: IntArray, weight: FloatArray, places: IntArray) -> None:
        from scipy.sparse import coo_matrix
        from scipy.sparse.csgraph import dijkstra

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
        ends = comes_in[places]
        distance, self._before = dijkstra(graph, indices=places, return_predecessors=True)
        self._row = {int(place): k for k, place in enumerate(places)}
        self._end = {int(place): int(end) for place, end in zip(places, ends, strict=True)}
        self.distance: FloatArray = distance[:, ends]
        """Shape (places, places); infinite where there is no route."""
        np.fill_diagonal(self.distance, 0.0)

    def route(self, first: int, second: int) -> list[int]:
        """Return the nodes of the shortest route between two of the places, which are connected.

        Walked from the earlier of the places, so that both directions take the same way.
        """
        begin, end = sorted((first, second), key=self._row.__getitem__)
        before = self._before[self._row[begin]]
        nodes = [self._end[end]]
        while nodes[-1] != begin:
            nodes.append(int(before[nodes[-1]]))
        if begin == first:
            nodes.reverse()
        return [int(self._node[node]) for node in nodes]
