"""The best policy along an order: value functions of the sols, chained backward.

The rover comes through the observations in one order and decides after each, by the time and the charge that
are left, to which of the next ones it goes, or that it ends the sol. Its value is found by dynamic
programming from the last sol back:

    S_k(i, t, d)  the i-th is behind: the best of ending the sol, M_k+1, and of driving to one of the next
    A_k(j, t, d)  arrived at the j-th: the best of observing, leaving it out, and ending the sol

with d the energy drawn so far beside the hotel load, counted from the fullest battery that the morning can
have. A sol that begins with less charge has drawn the difference already, so one grid of time and d holds all
mornings (`evaluate.grid`), and M_k+1 is S_k+1 or A_k+1 at t = 0 and the d that the rest leaves. An action
that ends over a budget goes on next morning from where it began; there the table takes the hotel load to
the end of the time for its own, an estimate. What the policy is worth is said by carrying it out.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from planner.evaluate.grid import Grid, weights_from
from planner.evaluate.model import Floats, Ints
from planner.sols.order_kernels import Amounts, Days, Needs, Table, Told, carried_out
from planner.sols.path_problem import PathProblem
from planner.sols.policy_kernels import Nodes, Rows, annealed_by_policy, policy_along
from planner.tally import Step, spend

AHEAD = 6
"""Next observations of the order that the rover may go to. By hand: leaving out five at once is rare."""

MARGIN = 4
"""Places of the order before and behind a sol's own that the search works out. By hand."""

NEAR = 3
"""Next observations of the order that the search looks at. By hand."""

SLOWER = 3.5
"""What a product on a coarse grid takes in those of a large matrix (`Step.NODE`): its rows are short."""

FAINT = 1e-6
"""Chance of a far move that counts as overrun."""


def _spans(rows: Floats) -> Ints:
    """Return the first move of rows (..., nodes) and the one behind the last, (..., 2)."""
    tails = np.cumsum(rows[..., ::-1], axis=-1)[..., ::-1]
    behind = np.count_nonzero(tails > FAINT, axis=-1)
    first = np.where(behind > 0, np.argmax(rows > 0.0, axis=-1), 0)
    return np.stack([first, behind], axis=-1).astype(np.int64)


@dataclass(frozen=True, eq=False)
class OrderPolicy:
    """A policy along an order, and what the table makes it worth."""

    value: float
    table: Table


class OrderPolicies:
    """Finds the best policy along orders of one problem; `nodes` are those of time and of energy drawn."""

    def __init__(self, path: PathProblem, needs: Needs, nodes: tuple[int, int]) -> None:
        self.path, self.needs, self.nodes = path, needs, nodes
        self.grids: list[Grid] = []
        for k in range(path.sols):
            span = path.most_j(k) - float(path.reserve_j[k])
            model = dataclasses.replace(
                path.model, t_max_s=float(path.time_s[k]), e_max_j=max(span, 1e-6), window=path.window[k]
            )
            same = [
                g
                for g in self.grids
                if g.model.t_max_s == model.t_max_s
                and g.model.e_max_j == model.e_max_j
                and np.array_equal(g.model.window, model.window)
            ]
            self.grids.append(same[0] if same else Grid(model, *nodes))
        self.mornings = [self._morning(k) for k in range(path.sols - 1)]
        self.table_nodes, self.rows = self._table_nodes(), self._rows()

    def _morning(self, k: int) -> tuple[Ints, Floats]:
        """Return where the nodes of a sol come to in the next morning: a node of its d, and the share of the
        one behind it.
        """
        path, grid, after = self.path, self.grids[k], self.grids[k + 1]
        charge = path.most_j(k) - grid.g[None, :] - path.model.hotel_w * grid.t[:, None]
        charge = np.maximum(charge, path.reserve_j[k])
        morning = np.minimum(path.rests[k].ceiling_j, charge + path.rests[k].gain_j)
        drawn = np.clip((path.most_j(k + 1) - morning) / after.step_g, 0.0, after.ng - 1.0)
        below = np.minimum(drawn.astype(np.int64), after.ng - 2)
        return below, drawn - below

    def _table_nodes(self) -> Nodes:
        path = self.path
        distinct = list(dict.fromkeys(map(id, self.grids)))
        first = {id(grid): grid for grid in self.grids}
        closes = [
            np.minimum(np.floor(path.window[k, :, 1] / grid.step_t * (1.0 + 1e-12)), grid.nt - 1.0)
            for k, grid in enumerate(self.grids)
        ]
        below = [row for row, _ in self.mornings] or [np.zeros(self.nodes, np.int64)]
        share = [row for _, row in self.mornings] or [np.zeros(self.nodes)]
        return Nodes(
            np.array([distinct.index(id(grid)) for grid in self.grids]),
            np.stack([first[one].alive for one in distinct]),
            np.stack(below),
            np.stack(share),
            np.where(path.allowed, np.array(closes), -1.0).astype(np.int64),
        )

    def _rows(self) -> Rows:
        """Return the moves of all actions on all distinct grids."""
        model, grids = self.path.model, list({id(grid): grid for grid in self.grids}.values())
        nt, nd = self.nodes
        count, size, places = len(grids), model.m, model.n + 1
        leg_t, leg_g = np.zeros((count, places, places, nt)), np.zeros((count, places, places, nd))
        obs_t, obs_g = np.zeros((count, size, nt)), np.zeros((count, size, nd))
        early, waits = np.zeros((count, max(size, 1), nt)), np.zeros((count, size), np.int64)
        for g, grid in enumerate(grids):

            def row(origin: float, ln: Floats, grid: Grid = grid) -> Floats:
                return weights_from(origin, nt, grid.step_t, float(ln[0]), float(ln[1]), 0.0, grid.how)

            def drawn(ln: Floats, grid: Grid = grid) -> Floats:
                return weights_from(0.0, nd, grid.step_g, float(ln[2]), float(ln[3]), 0.0, grid.how)

            for a, b in np.argwhere(model.has_leg).tolist():
                leg_t[g, a, b], leg_g[g, a, b] = row(0.0, model.leg_ln[a, b]), drawn(model.leg_ln[a, b])
            for m in range(size):
                obs_t[g, m], obs_g[g, m] = row(0.0, model.obs_ln[m]), drawn(model.obs_ln[m])
                opens = float(grid.model.window[m, 0])
                if opens > 0.0:
                    early[g, m] = row(opens, model.obs_ln[m])
                    waits[g, m] = int(np.count_nonzero(grid.t < opens))
            spend(Step.ELEMENT, float((nt + nd) * (model.has_leg.sum() + size)))
        return Rows(
            leg_t,
            leg_g,
            obs_t,
            obs_g,
            early,
            _spans(leg_t),
            _spans(leg_g),
            _spans(obs_t),
            _spans(obs_g),
            _spans(early),
            waits,
        )

    def best(self, order: Ints) -> OrderPolicy:
        """Return the best policy along an order [k] of observations, by number."""
        path, size = self.path, len(order)
        leaving = np.zeros((path.sols, size + 1, *self.nodes), np.int8)
        arrived = np.zeros((path.sols, max(size, 1), *self.nodes), np.int8)
        low, high = np.zeros(path.sols, np.int64), np.full(path.sols, size)
        value, products = policy_along(
            self.table_nodes, self.rows, self.needs, order, size, low, high, AHEAD, path.model.penalty,
            leaving, arrived,
        )  # fmt: skip
        spend(Step.NODE, products)
        steps = np.array([[g.step_t, g.step_g] for g in self.grids])
        most = np.array([path.most_j(k) for k in range(path.sols)])
        return OrderPolicy(value, Table(order, leaving, arrived, steps[:, 0], steps[:, 1], most))

    def annealed(
        self, days: Days, order: Ints, length: int, *, seed: int, steps: int, hot: float, cold: float
    ) -> tuple[Ints, int, Ints, float]:
        """Return the order that annealing by the policy's value ends at, its length, and the best with its
        value; `order` [m] holds observations, of which the first `length` count.
        """
        now, size, best, best_size, value, products = annealed_by_policy(
            days, self.table_nodes, self.rows, self.needs, order, length, MARGIN, NEAR, seed, steps, hot, cold
        )
        spend(Step.NODE, SLOWER * products)
        return now, size, best[:best_size].copy(), value

    def carry_out(self, table: Table, days: Days, needs: Needs, *, seed: int, futures: int) -> Told:
        """Return what a policy came to in drawn futures."""
        model, sols = self.path.model, self.path.sols
        told = Told(
            np.zeros((futures, sols)),
            np.zeros((sols, model.m)),
            np.zeros((futures, sols)),
            np.zeros(sols),
            np.zeros((futures, sols)),
        )
        spend(Step.ACTION, 2.0 * futures * (len(table.order) + sols))
        carried_out(days, needs, Amounts(model.leg_ln, model.obs_ln, model.fail), table, seed, futures, told)
        return told
