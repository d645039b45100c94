"""Compiled dynamic programme of the best policy along an order, and the search for orders by its value.

The values are those of `order_policy`; grids of all sols have the same numbers of nodes. Kernels of actions
are rows: the chance to move j nodes on.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import numba
import numpy as np
import numpy.typing as npt

from planner.sols.order_kernels import Days, Needs, changed_order, mean_starts

Array = npt.NDArray[Any]
Loop = TypeVar("Loop", bound=Callable[..., Any])


def _compiled(loop: Loop) -> Loop:
    return numba.njit(cache=True, nogil=True, fastmath=True)(loop)


class Rows(NamedTuple):
    """Moves of actions on G grids: of drives (G, P, P, nodes) and observations (G, m, nodes), in time and in
    energy, `early` those of an observation that waits for its window, from the first node, at the first
    `waits` (G, m) nodes; `spans` hold the first move and the one behind the last, (..., 2).
    """

    leg_t: Array
    leg_g: Array
    obs_t: Array
    obs_g: Array
    early: Array
    leg_t_spans: Array
    leg_g_spans: Array
    obs_t_spans: Array
    obs_g_spans: Array
    early_spans: Array
    waits: Array


class Nodes(NamedTuple):
    """Of K sols: their grid, the share of each node within the budgets (G, nt, nd), the node of the next
    morning's energy that each node comes to and the share of the one behind it (K - 1, nt, nd), the last node
    at which an observation may begin (K, m), -1 where it may not.
    """

    grid: Array
    alive: Array
    below: Array
    share: Array
    closes: Array


@_compiled
def _rested(nodes: Nodes, k: int, later: Array, out: Array) -> None:
    """Write a morning's values (nd,) at the nodes of the sol before."""
    below, share = nodes.below[k], nodes.share[k]
    for a in range(out.shape[0]):
        for b in range(out.shape[1]):
            at = below[a, b]
            out[a, b] = (1.0 - share[a, b]) * later[at] + share[a, b] * later[at + 1]


@_compiled
def _in_time(
    row_t: Array, span_t: Array, early: Array, early_span: Array, waits: int, mixed: Array, moved: Array,
    late: Array,
) -> None:  # fmt: skip
    """Write what is moved on in time, and by node the chance that it ends too late."""
    nt, nd = mixed.shape
    for a in range(nt):
        if 0 < a < waits:
            moved[a], late[a] = moved[0], late[0]
            continue
        moved[a, :] = 0.0
        base, row, span = (0, early, early_span) if a < waits else (a, row_t, span_t)
        in_time = 0.0
        for j in range(span[0], min(span[1], nt - base)):
            in_time += row[j]
            for b in range(nd):
                moved[a, b] += row[j] * mixed[base + j, b]
        late[a] = max(1.0 - in_time, 0.0)


@_compiled
def _before(
    row_t: Array, span_t: Array, row_g: Array, span_g: Array, early: Array, early_span: Array, waits: int,
    alive: Array, after: Array, over: Array, worth: float, penalty: float, work: Array, out: Array,
) -> None:  # fmt: skip
    """Write the value before an action: `after` and `worth` within the budgets, `over` where it overran."""
    nt, nd = out.shape
    mixed, moved, ended, drained, late = work[0], work[1], work[2, 0], work[2, 1], work[3, :, 0]
    for a in range(nt):
        for b in range(nd):
            lost = over[a, b] - penalty
            mixed[a, b] = lost + alive[a, b] * (after[a, b] + worth - lost)
    _in_time(row_t, span_t, early, early_span, waits, mixed, moved, late)
    empty = over[nt - 1, nd - 1] - penalty
    within = 0.0
    for b in range(nd - 1, -1, -1):
        ended[b] = 0.0
        for j in range(span_g[0], min(span_g[1], nd - b)):
            ended[b] += row_g[j] * (over[nt - 1, b + j] - penalty)
        within += row_g[nd - 1 - b]
        drained[b] = max(1.0 - within, 0.0) * empty
    for a in range(nt):
        for b in range(nd):
            out[a, b] = late[a] * ended[b] + drained[b]
        for j in range(span_g[0], min(span_g[1], nd)):
            for b in range(nd - j):
                out[a, b] += row_g[j] * moved[a, b + j]


@_compiled
def _take(value: Array, alive: Array, best: Array, act: Array, number: int) -> None:
    """Do what is numbered so where it is worth more than the best yet."""
    for x in range(best.shape[0]):
        for y in range(best.shape[1]):
            if value[x, y] > best[x, y] and alive[x, y] > 0.0:
                best[x, y] = value[x, y]
                act[x, y] = number


@_compiled
def _arrive(
    stay: Array, behind: Array, made: Array, closes: int, alive: Array, best: Array, act: Array
) -> None:
    """Write the best of ending the sol, leaving an observation out and making it."""
    for x in range(best.shape[0]):
        for y in range(best.shape[1]):
            best[x, y], act[x, y] = stay[x, y], 0
            if behind[x, y] > best[x, y]:
                best[x, y], act[x, y] = behind[x, y], 2
            if x <= closes and alive[x, y] > 0.0 and made[x, y] > best[x, y]:
                best[x, y], act[x, y] = made[x, y], 1


@_compiled
def policy_along(
    nodes: Nodes, rows: Rows, needs: Needs, order: Array, size: int, low: Array, high: Array, ahead: int,
    penalty: float, leaving: Array, arrived: Array,
) -> tuple[float, float]:  # fmt: skip
    """Return the value of the best policy along the first `size` observations of an order, and the products
    done; `order` is (m,), of observations by number. Write what is done into `leaving` (K, size + 1, nt, nd)
    and `arrived` (K, size, nt, nd).

    On sol k only places `low` to `high` (K,) of the order are worked out: beyond them nothing is earned.
    """
    sols = len(nodes.grid)
    nt, nd = nodes.alive.shape[1], nodes.alive.shape[2]
    s, a = np.zeros((size + 1, nt, nd)), np.zeros((size + 1, nt, nd))
    later_s, later_a = np.zeros((size + 1, nd)), np.zeros((size + 1, nd))
    stay, found, work = np.zeros((nt, nd)), np.zeros((nt, nd)), np.zeros((4, nt, nd))
    products = 0.0
    for k in range(sols - 1, -1, -1):
        g = nodes.grid[k]
        alive = nodes.alive[g]
        for i in range(high[k], low[k] - 1, -1):
            here = needs.place[order[i - 1]] if i else 0
            if k + 1 < sols:
                _rested(nodes, k, later_s[i], stay)
            s[i] = stay
            act = leaving[k, i]
            for j in range(i, min(i + ahead, high[k])):
                to = needs.place[order[j]]
                if here == to:
                    _take(a[j], alive, s[i], act, j - i + 1)
                elif needs.has_leg[here, to]:
                    _before(
                        rows.leg_t[g, here, to], rows.leg_t_spans[g, here, to], rows.leg_g[g, here, to],
                        rows.leg_g_spans[g, here, to], rows.early[g, 0], rows.early_spans[g, 0], 0,
                        alive, a[j], stay, 0.0, penalty, work, found,
                    )  # fmt: skip
                    spans = rows.leg_t_spans[g, here, to], rows.leg_g_spans[g, here, to]
                    products += nt * nd * (4.0 + spans[0][1] - spans[0][0] + spans[1][1] - spans[1][0])
                    _take(found, alive, s[i], act, j - i + 1)
            if i == low[k]:
                break  # nothing arrives at what lies before
            m = order[i - 1]
            if k + 1 < sols:
                _rested(nodes, k, later_a[i - 1], stay)
            act = arrived[k, i - 1]
            if nodes.closes[k, m] >= 0:
                _before(
                    rows.obs_t[g, m], rows.obs_t_spans[g, m], rows.obs_g[g, m], rows.obs_g_spans[g, m],
                    rows.early[g, m], rows.early_spans[g, m], rows.waits[g, m],
                    alive, s[i], stay, needs.worth[m], penalty, work, found,
                )  # fmt: skip
                products += nt * nd * 8.0
            _arrive(stay, s[i], found, nodes.closes[k, m], alive, a[i - 1], act)
        later_s[:] = 0.0
        later_a[:] = 0.0
        for i in range(low[k], high[k] + 1):
            later_s[i] = s[i, 0]
            if i < high[k]:
                later_a[i] = a[i, 0]
        stay[:] = 0.0
    return later_s[0, 0], products


@_compiled
def annealed_by_policy(
    days: Days, nodes: Nodes, rows: Rows, needs: Needs, order: Array, length: int, margin: int, ahead: int,
    seed: int, steps: int, hot: float, cold: float,
) -> tuple[Array, int, Array, int, float, float]:  # fmt: skip
    """Return the order that simulated annealing by the policy's value ends at and its length, the best with
    length and value, and the products done.

    Each sol is worked out from `margin` places before where it begins in the mean to as many behind its end.
    `order` (m,) holds observations by number, of which the first `length` count.
    """
    np.random.seed(seed)
    sols, n = len(nodes.grid), len(order)
    nt, nd = nodes.alive.shape[1], nodes.alive.shape[2]
    leaving = np.zeros((sols, n + 1, nt, nd), np.int8)
    arrived = np.zeros((sols, n, nt, nd), np.int8)
    now, size, new = order.copy(), length, order.copy()
    best, best_size = order.copy(), length
    value, best_value, total = -np.inf, -np.inf, 0.0
    for step in range(steps + 1):
        changed = changed_order(now, size, new) if step else size
        low, high = mean_starts(days, needs, new, changed, margin)
        found, done = policy_along(
            nodes, rows, needs, new, changed, low, high, ahead, days.penalty, leaving, arrived
        )
        total += done
        heat = hot * (cold / hot) ** (step / max(steps, 1))
        if step == 0 or found >= value or np.random.random() < np.exp((found - value) / heat):
            now, new = new, now
            size, value = changed, found
            if value > best_value:
                best[:] = now
                best_size, best_value = size, value
    return now, size, best, best_size, best_value, total
