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
from numpy.typing import NDArray

from planner.evaluate.grid import Grid
from planner.evaluate.model import Floats, Ints
from planner.sols.order_kernels import Amounts, Days, Needs, Table, Told, carried_out
from planner.sols.path_problem import PathProblem
from planner.tally import Step, spend

AHEAD = 6
"""Next observations of the order that the rover may go to. By hand: leaving out five at once is rare."""

Acts = NDArray[np.int8]


@dataclass(frozen=True, eq=False)
class OrderPolicy:
    """A policy along an order, and what the table makes it worth."""

    value: float
    table: Table


class OrderPolicies:
    """Finds the best policy along orders of one problem; `nodes` are those of time and of energy drawn."""

    def __init__(self, path: PathProblem, nodes: tuple[int, int]) -> None:
        self.path, self.nodes = path, nodes
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

    def _after_rest(self, k: int, next_sol: Floats | None) -> Floats:
        """Return a morning's values, by d at t = 0, at the nodes of the sol before; 0 after the last sol."""
        if next_sol is None:
            return np.zeros(self.grids[k].shape)
        below, share = self.mornings[k]
        return (1.0 - share) * next_sol[below] + share * next_sol[below + 1]

    def _before(self, k: int, kernels: tuple[Floats, Floats], after: Floats, over: Floats) -> Floats:
        """Return the value before an action; `after` within the budgets, `over` by node where it overran."""
        grid = self.grids[k]
        kernel_t, kernel_g = kernels
        grid.count()
        empty = float(over[-1, -1])  # nothing left above the reserve
        lost = over - self.path.model.penalty
        inside = kernel_t @ (lost + grid.alive * (after - lost)) @ kernel_g.T
        late = np.maximum(1.0 - kernel_t.sum(axis=1), 0.0)
        more = np.maximum(1.0 - kernel_g.sum(axis=1), 0.0)
        ended = kernel_g @ (over[-1] - self.path.model.penalty)
        drained = more * (empty - self.path.model.penalty)
        return np.asarray(
            inside + np.outer(late, ended) + np.outer(1.0 - late, drained) + np.outer(late, drained)
        )

    def best(self, order: Ints) -> OrderPolicy:
        """Return the best policy along an order [k] of observations, by number."""
        path, model, size = self.path, self.path.model, len(order)
        shape = self.nodes
        leaving = np.zeros((path.sols, size + 1, *shape), np.int8)
        arrived = np.zeros((path.sols, max(size, 1), *shape), np.int8)
        places = [0, *(int(model.obs_place[m]) for m in order)]
        worth = model.utility * model.p_success
        later_s: list[Floats | None] = [None] * (size + 1)
        later_a: list[Floats | None] = [None] * size
        value = 0.0
        for k in range(path.sols - 1, -1, -1):
            grid = self.grids[k]
            s: list[Floats] = [np.zeros(shape)] * (size + 1)
            a: list[Floats] = [np.zeros(shape)] * size
            for i in range(size, -1, -1):
                stay = self._after_rest(k, later_s[i])
                best, act = stay.copy(), leaving[k, i]
                for j in range(i, min(i + AHEAD, size)):
                    here, to = places[i], places[j + 1]
                    if here == to:
                        found = a[j]
                    elif model.has_leg[here, to]:
                        kernels = grid.leg_t(here, to, 0), grid.leg_g(here, to)
                        found = self._before(k, kernels, a[j], stay)
                    else:
                        continue
                    better = (found > best) & (grid.alive > 0.0)
                    best[better] = found[better]
                    act[better] = j - i + 1
                s[i] = best
                if i:
                    m = int(order[i - 1])
                    a[i - 1] = self._arrived(k, m, float(worth[m]), s[i], later_a[i - 1], arrived[k, i - 1])
            later_s, later_a = [v[0] for v in s], [v[0] for v in a]
            value = float(np.interp(path.most_j(k) - path.charge_j, grid.g, s[0][0])) if k == 0 else 0.0
        steps = np.array([[g.step_t, g.step_g] for g in self.grids])
        most = np.array([path.most_j(k) for k in range(path.sols)])
        return OrderPolicy(value, Table(order, leaving, arrived, steps[:, 0], steps[:, 1], most))

    def _arrived(
        self, k: int, m: int, worth: float, behind: Floats, later: Floats | None, act: Acts
    ) -> Floats:
        """Return the value on arriving at an observation, and write what is done."""
        grid = self.grids[k]
        stay = self._after_rest(k, later)
        best = stay.copy()
        skip = behind > best
        best[skip] = behind[skip]
        act[skip] = 2
        if self.path.allowed[k, m]:
            found = self._before(k, (grid.obs_t(m), grid.obs_g(m)), behind + worth, stay)
            in_time = (grid.t <= self.path.window[k, m, 1])[:, None] & (grid.alive > 0.0)
            better = (found > best) & in_time
            best[better] = found[better]
            act[better] = 1
        return best

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
