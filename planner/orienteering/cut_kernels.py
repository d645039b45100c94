"""Compiled loops of branch-and-cut: least cuts of a fractional tour, and reduced profits in integers.

A fractional tour is an undirected graph of `m` edges: arc 2 e runs from `tail[e]` to `head[e]`, arc 2 e + 1
back, and both may carry `weight[e]`. `first` (n + 1,) and `arcs` (2 m,) list the arcs that leave each node.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]

DELTA, INNER, PLAIN = 0, 1, 2
"""What a row's node set stands for: its boundary x(d(S)), y(S) - x(E(S)), or nothing."""

_NONE = 1e-9  # flow that counts as none


@numba.njit(cache=True, nogil=True)
def adjacency(nodes: int, tail: Array, head: Array) -> tuple[Array, Array]:
    """Return `first` (nodes + 1,) and `arcs` (2 m,) of edges given by their ends, each (m,)."""
    first = np.zeros(nodes + 1, np.int64)
    for e in range(len(tail)):
        first[tail[e] + 1] += 1
        first[head[e] + 1] += 1
    for v in range(nodes):
        first[v + 1] += first[v]
    filled = first[:-1].copy()
    arcs = np.empty(2 * len(tail), np.int64)
    for e in range(len(tail)):
        arcs[filled[tail[e]]] = 2 * e
        filled[tail[e]] += 1
        arcs[filled[head[e]]] = 2 * e + 1
        filled[head[e]] += 1
    return first, arcs


@numba.njit(cache=True, nogil=True)
def _end_of(tail: Array, head: Array, arc: int) -> int:
    return head[arc >> 1] if arc & 1 == 0 else tail[arc >> 1]


@numba.njit(cache=True, nogil=True)
def _flow(
    first: Array,
    arcs: Array,
    tail: Array,
    head: Array,
    left: Array,
    source: int,
    sink: int,
    limit: float,
    came: Array,
    queue: Array,
) -> tuple[float, int]:
    """Push up to `limit` from source to sink by shortest paths; return the flow and the arcs looked at."""
    flow, work = 0.0, 0
    while flow < limit - _NONE:
        came[:] = -1
        came[source] = -2
        queue[0] = source
        begin, end = 0, 1
        while begin < end and came[sink] == -1:
            u = queue[begin]
            begin += 1
            for k in range(first[u], first[u + 1]):
                arc = arcs[k]
                v = _end_of(tail, head, arc)
                if came[v] == -1 and left[arc] > _NONE:
                    came[v] = arc
                    queue[end] = v
                    end += 1
            work += first[u + 1] - first[u]
        if came[sink] == -1:
            return flow, work
        push = limit - flow
        v = sink
        while v != source:
            push = min(push, left[came[v]])
            v = _end_of(tail, head, came[v] ^ 1)
        v = sink
        while v != source:
            left[came[v]] -= push
            left[came[v] ^ 1] += push
            v = _end_of(tail, head, came[v] ^ 1)
        flow += push
    return flow, work


@numba.njit(cache=True, nogil=True)
def _reach(
    first: Array, arcs: Array, tail: Array, head: Array, left: Array, root: int, back: bool, queue: Array
) -> Array:
    """Return which nodes the root reaches on arcs that can carry more; with `back`, which reach the root."""
    seen = np.zeros(len(first) - 1, np.bool_)
    seen[root] = True
    queue[0] = root
    begin, end = 0, 1
    while begin < end:
        u = queue[begin]
        begin += 1
        for k in range(first[u], first[u + 1]):
            arc = arcs[k]
            v = _end_of(tail, head, arc)
            if not seen[v] and left[arc ^ 1 if back else arc] > _NONE:
                seen[v] = True
                queue[end] = v
                end += 1
    return seen


@numba.njit(cache=True, nogil=True)
def sets_below(
    nodes: int, tail: Array, head: Array, weight: Array, visit: Array, order: Array, margin: float, most: int
) -> tuple[Array, Array, int]:
    """Return node sets without node 0 whose boundary weighs less than twice the visit of a node in them.

    Parameters
    ----------
    tail, head, weight
        Edges (m,) of the fractional tour.
    visit
        By how much each node (nodes,) is visited.
    order
        Nodes (k,) to look at, in this order; one that lies in a set already found is passed over.
    margin
        By how much at least the boundary is too light.
    most
        No more sets than so many.

    Returns
    -------
    tuple
        Sets (found, nodes) as flags, the node (found,) for which each is too light, and the arcs looked at.
    """
    first, arcs = adjacency(nodes, tail, head)
    came, queue = np.empty(nodes, np.int64), np.empty(nodes, np.int64)
    left = np.empty(2 * len(tail))
    sets, witness = np.zeros((most, nodes), np.bool_), np.empty(most, np.int64)
    covered = np.zeros(nodes, np.bool_)
    found, work = 0, 0
    for t in order:
        if covered[t] or found >= most:
            continue
        for e in range(len(tail)):
            left[2 * e] = left[2 * e + 1] = weight[e]
        need = 2.0 * visit[t]
        flow, looked = _flow(first, arcs, tail, head, left, 0, t, need, came, queue)
        work += looked + 2 * len(tail)
        if flow >= need - margin:
            continue
        small = _reach(first, arcs, tail, head, left, t, True, queue)
        large = _reach(first, arcs, tail, head, left, 0, False, queue)
        differ = False
        for v in range(nodes):
            covered[v] |= small[v]
            differ |= small[v] == large[v]
        sets[found], witness[found] = small, t
        found += 1
        if differ and found < most:
            sets[found], witness[found] = ~large, t
            found += 1
    return sets[:found], witness[:found], work


@numba.njit(cache=True, nogil=True)
def cut_tree(nodes: int, tail: Array, head: Array, weight: Array) -> tuple[Array, int]:
    """Return one side (nodes - 1, nodes) of a least cut for each node but 0, and the arcs looked at.

    Gusfield 1990: among these lies a least cut between any two nodes of the graph of edges (m,).
    """
    first, arcs = adjacency(nodes, tail, head)
    came, queue = np.empty(nodes, np.int64), np.empty(nodes, np.int64)
    left = np.empty(2 * len(tail))
    sides = np.zeros((nodes - 1, nodes), np.bool_)
    parent = np.zeros(nodes, np.int64)
    work = 0
    for s in range(1, nodes):
        for e in range(len(tail)):
            left[2 * e] = left[2 * e + 1] = weight[e]
        _, looked = _flow(first, arcs, tail, head, left, s, parent[s], 1e9, came, queue)
        work += looked + 2 * len(tail)
        side = _reach(first, arcs, tail, head, left, s, False, queue)
        sides[s - 1] = side
        for v in range(s + 1, nodes):
            if side[v] and parent[v] == parent[s]:
                parent[v] = s
    return sides, work


@numba.njit(cache=True, nogil=True)
def edge_profits(
    tail: Array,
    head: Array,
    length: Array,
    per_length: int,
    node: Array,
    kind: Array,
    sides: Array,
    by: Array,
) -> Array:
    """Return what each edge adds to the Lagrangean, int64 (m,), rows' own edge coefficients left out.

    Parameters
    ----------
    tail, head, length
        Edges (m,).
    per_length, node
        Multiplier of the budget and of each node's degree (n,).
    kind, sides, by
        Kind (r,), node sets (n, r) as flags and multipliers (r,) of the rows that have a set.
    """
    out = np.empty(len(tail), np.int64)
    rows = len(kind)
    for e in range(len(tail)):
        u, v = tail[e], head[e]
        total = node[u] + node[v] - per_length * length[e]
        for r in range(rows):
            if kind[r] == DELTA:
                if sides[u, r] != sides[v, r]:
                    total += by[r]
            elif sides[u, r] and sides[v, r]:
                total -= by[r]
        out[e] = total
    return out


@numba.njit(cache=True, nogil=True)
def heavy_path(
    value: Array, visit: Array, length: Array, home: Array, budget: int, first: int, margin: float
) -> Array:
    """Return a path (k,) from `first` whose flow cannot all go on within the budget; (0,) for none.

    Parameters
    ----------
    value, visit
        Flow between two nodes (n, n), and by how much each is visited (n,).
    length, home, budget
        Lengths (n, n), the least length to the depot (n,), and the most that a tour may be long.
    first
        Where the path begins; it avoids node 0 and takes the heaviest edge each time.
    margin
        Flow that must be stuck at least.
    """
    n = len(visit)
    path = np.empty(n, np.int64)
    taken = np.zeros(n, np.bool_)
    taken[0] = taken[first] = True
    path[0] = first
    size, run, excess = 1, home[first], 0.0
    while True:
        last = path[size - 1]
        after, heaviest = -1, margin
        for v in range(n):
            if not taken[v] and value[last, v] > heaviest:
                after, heaviest = v, value[last, v]
        if after < 0:
            return path[:0].copy()
        if size > 1:
            excess -= visit[last]
        excess += heaviest
        if excess <= margin:
            return path[:0].copy()
        run += length[last, after]
        taken[after] = True
        path[size] = after
        size += 1
        going = value[after, 0] if run + length[after, 0] <= budget else 0.0
        for v in range(1, n):
            if not taken[v] and run + length[after, v] + home[v] <= budget:
                going += value[after, v]
        if excess - going > margin:
            return path[:size].copy()
