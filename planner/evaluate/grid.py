"""Sampling-free value of a plan: propagation of distributions over elapsed time and drive energy.

The resources are kept on a product grid of time t and drive energy g (energy used = hotel load x t + g),
where the increments of an action are independent. A node stands for the piecewise linear interpolant around
it, so the kernel of an action holds the expectations of hat functions, in closed form for log-normal
amounts. The error is of second order in the cell, and two grids with Richardson's extrapolation leave a few
hundredths of a per cent.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from enum import StrEnum
from functools import cached_property
from typing import Any

import numpy as np
from scipy.special import ndtr

from planner.evaluate.model import Floats, Model
from planner.tally import SECONDS, Step, spend

PASSES = 3
"""How often an action reads and writes its nodes, beside its products."""

SHARED, MOST_SHARES = 40, 200
"""Passes that the shares of a test on energy take, and for how many tests they are kept. By hand."""

BATCHED_NODES = 80
"""Up to so many time nodes the drives to a place are computed in one batch."""

FAINT, FAINT_SINGLE = 1e-18, 1e-10
"""Weight below which an amount is taken never to land on a node, in double and in single precision: all
such together are less than a weight is rounded by (`bounds.MARGIN` has room for a hundred times that).
Products of tails soon are too small to be held as usual, and one of them takes as long as a hundred others: a
drive on a table of 49 by 29 nodes took 1.5 times as long.
"""


class Rounding(StrEnum):
    """How consumption meets the grid.

    `MID` keeps the mean (an estimate); `DOWN` rounds every consumption down to the grid, which can only
    help a policy, so values are upper bounds; `UP` rounds up, so values are lower bounds. `ABOVE` keeps the
    mean and adds what may be missing between nodes: closer upper bounds (`planner.evaluate.majorant`).
    """

    MID = "mid"
    DOWN = "down"
    UP = "up"
    ABOVE = "above"


def mean_above(c: Floats, mu: float, sigma: float) -> Floats:
    """Return E[(X - c)+], [...], for thresholds `c` [...] and a log-normal (sigma > 0) or constant X in the
    unit of `c`; `mu` -inf means X = 0.
    """
    mean = math.exp(mu + sigma * sigma / 2.0) if mu > -math.inf else 0.0
    if sigma == 0.0 or mean == 0.0:
        return np.maximum(mean - c, 0.0)
    positive = np.maximum(c, 1e-300)
    d2 = (mu - np.log(positive)) / sigma
    return np.where(c > 0.0, mean * ndtr(d2 + sigma) - positive * ndtr(d2), mean - c)


def probability_below(c: Floats, mu: float, sigma: float) -> Floats:
    """Return P(X <= c) for thresholds `c` [...] and a log-normal X in the unit of `c`.

    `mu` and `sigma` are mean and standard deviation of ln X; `mu` -inf means X = 0, `sigma` 0 a constant.
    """
    if mu == -math.inf:
        return np.where(c >= 0.0, 1.0, 0.0)
    if sigma == 0.0:
        return np.where(c >= math.exp(mu) * (1.0 - 1e-12), 1.0, 0.0)
    positive = np.maximum(c, 1e-300)
    return np.where(c > 0.0, ndtr((np.log(positive) - mu) / sigma), 0.0)


def weights_from(
    origin: float, nodes: int, step: float, mu: float, sigma: float, shift: float, how: Rounding
) -> Floats:
    """Return the mass [nodes] that lands on nodes 0..nodes-1, `step` apart, when X + shift starts from
    `origin` (not rounded). `origin`, `step` and `shift` are in the unit of X, `mu` and `sigma` as in
    `probability_below`.
    """
    k = np.arange(nodes)
    base = k * step - origin - shift
    if how is Rounding.MID:
        values = mean_above(np.concatenate([base[:1] - step, base, base[-1:] + step]), mu, sigma)
        return _without_faint((values[:-2] - 2.0 * values[1:-1] + values[2:]) / step, FAINT)
    if how is Rounding.DOWN:
        slack = 1e-9 * step
        edges = probability_below(np.concatenate([base, base[-1:] + step]) - slack, mu, sigma)
        edges[0] = 0.0
        return _without_faint(np.diff(edges), FAINT)
    edges = probability_below(np.concatenate([base[:1] - step, base]), mu, sigma)
    return _without_faint(np.diff(edges), FAINT)


def _without_faint(weights: Floats, faint: float) -> Floats:
    return np.where(weights < faint, 0.0, weights)


def toeplitz(first_row: Floats) -> Floats:
    """Return the upper triangular Toeplitz matrix K[i, j] = first_row[j - i], (n, n), of a row (n,)."""
    n = len(first_row)
    padded = np.concatenate([np.zeros(n - 1), first_row])
    view = np.lib.stride_tricks.sliding_window_view(padded, n)[::-1]
    return np.ascontiguousarray(view)


def _ramp(u: Floats) -> Floats:
    return np.square(np.maximum(u, 0.0)) / 2.0


class Grid:
    """Nodes, kernels and edge weights of one model on one grid.

    Nodes are t_i = i * step_t, i < nt, with t_{nt-1} the time budget, and likewise for drive energy up to
    the energy budget. `alive[i, j]` is the share of the node's cell within both budgets (0 or 1 where
    rounding is rigorous).
    """

    def __init__(self, model: Model, nt: int, ng: int, how: Rounding = Rounding.MID, dtype: Any = np.float64):
        model.require_one_kind("a grid")
        self.model, self.nt, self.ng, self.how, self.dtype = model, nt, ng, how, np.dtype(dtype)
        self.step_t = model.t_max_s / (nt - 1)
        self.step_g = model.e_max_j / (ng - 1)
        self.t = np.arange(nt) * self.step_t
        self.g = np.arange(ng) * self.step_g
        self.energy = model.hotel_w * self.t[:, None] + self.g[None, :]
        self._energy_shares: dict[float, Floats] = {}
        if how is Rounding.MID:
            alive = 1.0 - self.at_least_energy(model.e_max_j)
            alive[-1] *= 0.5
        else:
            alive = np.where(self.energy <= model.e_max_j * (1.0 + 1e-12), 1.0, 0.0)
        self.alive = alive.astype(self.dtype)
        self.products = nt * ng * (nt + ng)
        """Multiplications of one action: a kernel of time and one of energy."""
        self._way = 1.0 + 2 * nt * ng * SECONDS[Step.PASS] / SECONDS[Step.WAY]
        self._leg_t: dict[tuple[int, int, int], Any] = {}
        self._leg_g: dict[tuple[int, int], Any] = {}
        self._obs_t: dict[int, Any] = {}
        self._obs_g: dict[int, Any] = {}
        self._stacks: dict[tuple[int, int], Any] = {}

    @property
    def bounds(self) -> bool:
        """Whether values are upper bounds."""
        return self.how in (Rounding.DOWN, Rounding.ABOVE)

    @property
    def kernels_mb(self) -> float:
        """What the kernels of all drives take, MB, where that is not little."""
        return 0.0

    @property
    def shape(self) -> tuple[int, int]:
        return self.nt, self.ng

    def at_least_time(self, threshold_s: float) -> Floats:
        """Return, per time node, the share of its cell at or after a threshold; shape (nt, 1)."""
        return np.clip((self.t - threshold_s) / self.step_t + 0.5, 0.0, 1.0)[:, None]

    def at_least_energy(self, threshold_j: float) -> Floats:
        """Return the share of each node's cell in which the energy used is at least a threshold; shape (nt,
        ng). Do not write to it: a test of a plan is asked in many states.
        """
        known = self._energy_shares.get(threshold_j)
        if known is None:
            if len(self._energy_shares) >= MOST_SHARES:
                self._energy_shares.clear()
            known = self._energy_shares[threshold_j] = self._at_least_energy(threshold_j)
            spend(Step.PASS, SHARED * self.nt * self.ng)
        return known

    def _at_least_energy(self, threshold_j: float) -> Floats:
        a, b = self.model.hotel_w * self.step_t, self.step_g
        z = self.energy - threshold_j
        if a <= 1e-9 * b:
            return np.clip(z / b + 0.5, 0.0, 1.0)
        half, rest = (a + b) / 2.0, (a - b) / 2.0
        return np.clip(
            (_ramp(z + half) - _ramp(z + rest) - _ramp(z - rest) + _ramp(z - half)) / (a * b), 0.0, 1.0
        )

    def open_until(self, closes_s: float) -> Floats:
        """Return, per time node, the share of its cell in which such a window is open; (nt, 1)."""
        if closes_s == math.inf:
            return np.ones((self.nt, 1))
        if self.how is Rounding.MID:
            return 1.0 - self.at_least_time(closes_s)
        return np.where(self.t <= closes_s * (1.0 + 1e-12), 1.0, 0.0)[:, None]

    # ------------------------------------------------------------------------------------- kernels

    def _kept(self, row: Floats) -> Floats:
        return _without_faint(row, FAINT_SINGLE) if self.dtype == np.float32 else row

    def leg_t(self, a: int, b: int, tracked: int) -> Any:
        """Return the kernel K[i, j] of time on the leg a -> b with so many targets tracked."""
        key = (a, b, tracked)
        if key not in self._leg_t:
            mu, sigma = self.model.leg_ln[a, b, 0], self.model.leg_ln[a, b, 1]
            row = weights_from(
                0.0, self.nt, self.step_t, mu, sigma, tracked * self.model.track_leg_s, self.how
            )
            self._leg_t[key] = toeplitz(self._kept(row)).astype(self.dtype)
        return self._leg_t[key]

    def leg_g(self, a: int, b: int) -> Any:
        key = (a, b)
        if key not in self._leg_g:
            mu, sigma = self.model.leg_ln[a, b, 2], self.model.leg_ln[a, b, 3]
            row = weights_from(0.0, self.ng, self.step_g, mu, sigma, 0.0, self.how)
            self._leg_g[key] = toeplitz(self._kept(row)).astype(self.dtype)
        return self._leg_g[key]

    def obs_t(self, m: int) -> Any:
        """Return the kernel of time of an observation; before its window opens all rows start when it
        opens.
        """
        if m not in self._obs_t:
            mu, sigma = self.model.obs_ln[m, 0], self.model.obs_ln[m, 1]
            row = weights_from(0.0, self.nt, self.step_t, mu, sigma, 0.0, self.how)
            kernel = toeplitz(self._kept(row))
            opens = float(self.model.window[m, 0])
            if opens > 0.0:
                early = self.t < opens
                row = weights_from(opens, self.nt, self.step_t, mu, sigma, 0.0, self.how)
                kernel[early] = self._kept(row)
            self._obs_t[m] = kernel.astype(self.dtype)
        return self._obs_t[m]

    def obs_g(self, m: int) -> Any:
        if m not in self._obs_g:
            mu, sigma = self.model.obs_ln[m, 2], self.model.obs_ln[m, 3]
            row = weights_from(0.0, self.ng, self.step_g, mu, sigma, 0.0, self.how)
            self._obs_g[m] = toeplitz(self._kept(row)).astype(self.dtype)
        return self._obs_g[m]

    # ------------------------------------------------------------------------------------- one action

    def count(self, actions: int = 1) -> None:
        """Count actions worked out on this grid."""
        spend(Step.ACT, actions * self._act)

    @cached_property
    def _act(self) -> float:
        return 1.0 + self.drive_s / SECONDS[Step.ACT]

    @property
    def drive_s(self) -> float:
        """Reckoned seconds of one of many drives worked out at once on this grid."""
        each = SECONDS[Step.CELL if self.dtype == np.float32 else Step.PRODUCT]
        return self.products * each + PASSES * self.nt * self.ng * SECONDS[Step.PASS]

    def count_ways(self, ways: int) -> None:
        """Count ways in which drives of a plan may end, with the masses or values of each added up."""
        spend(Step.WAY, ways * self._way)

    def before_leg(self, a: int, b: int, tracked: int, after: Any) -> Any:
        """Return the value before a drive, given the value after it (losses already averaged)."""
        self.count()
        gain = self.alive * (after + self.model.penalty)
        return self.leg_t(a, b, tracked) @ gain @ self.leg_g(a, b).T - self.model.penalty

    def before_legs(
        self, origins: list[int], to: int, tracked: int, after: Any
    ) -> Iterator[tuple[list[int], Any]]:
        """Yield origins, and values before drives from them to one place, (origins, nt, ng).

        `after` holds the values after the drives of all origins, (origins, nt, ng), losses already averaged;
        it is overwritten. Who asks counts the work.
        """
        penalty = self.dtype.type(self.model.penalty)
        after += penalty
        after *= self.alive
        if self.nt <= BATCHED_NODES:
            times, energies = self._kernels(to, tracked)
            values = times[origins] @ after @ energies[origins]
            values -= penalty
            yield origins, values
            return
        for k, origin in enumerate(origins):
            value = self.leg_t(origin, to, tracked) @ after[k] @ self.leg_g(origin, to).T
            value -= penalty
            yield [origin], value[None]

    def _kernels(self, to: int, tracked: int) -> tuple[Any, Any]:
        """Return the kernels of the drives to a place, stacked by origin; zero where there is no way."""
        key = (to, tracked)
        if key not in self._stacks:
            n1 = self.model.n + 1
            times = np.zeros((n1, self.nt, self.nt), self.dtype)
            energies = np.zeros((n1, self.ng, self.ng), self.dtype)
            for a in range(n1):
                if self.model.has_leg[a, to]:
                    times[a] = self.leg_t(a, to, tracked)
                    energies[a] = self.leg_g(a, to).T
            self._stacks[key] = times, energies
        return self._stacks[key]

    def before_observation(self, m: int, after: Any, utility: float) -> Any:
        """Return the value before an observation that is carried out."""
        self.count()
        gain = self.alive * (after + (self.model.penalty + utility))
        return self.obs_t(m) @ gain @ self.obs_g(m).T - self.model.penalty

    def after_leg(self, a: int, b: int, tracked: int, mass: Any) -> Any:
        """Return the mass that is within the budgets after a drive."""
        self.count()
        return self.alive * (self.leg_t(a, b, tracked).T @ mass @ self.leg_g(a, b))

    def after_observation(self, m: int, mass: Any) -> Any:
        self.count()
        return self.alive * (self.obs_t(m).T @ mass @ self.obs_g(m))

    def corner(self, t_s: float, g_j: float) -> tuple[slice, slice, Floats]:
        """Return where a point lies: two slices and the bilinear weights (rounded where rounding is
        rigorous).
        """
        x, y = t_s / self.step_t, g_j / self.step_g
        if self.how is Rounding.DOWN:
            i, j = math.floor(x * (1.0 + 1e-12)), math.floor(y * (1.0 + 1e-12))
            return slice(i, i + 1), slice(j, j + 1), np.ones((1, 1))
        if self.how is Rounding.UP:
            i, j = min(math.ceil(x), self.nt - 1), min(math.ceil(y), self.ng - 1)
            return slice(i, i + 1), slice(j, j + 1), np.ones((1, 1))
        i, j = min(int(x), self.nt - 2), min(int(y), self.ng - 2)
        fx, fy = x - i, y - j
        return slice(i, i + 2), slice(j, j + 2), np.outer([1.0 - fx, fx], [1.0 - fy, fy])

    def point(self, t_s: float, g_j: float) -> Any:
        """Return a unit mass (nt, ng) at a point, spread over its neighbours."""
        mass = np.zeros(self.shape, self.dtype)
        rows, columns, w = self.corner(t_s, g_j)
        mass[rows, columns] = w
        return mass

    def at(self, values: Any, t_s: float, g_j: float) -> float:
        """Return the value at a point."""
        rows, columns, w = self.corner(t_s, g_j)
        return float(np.sum(values[rows, columns] * w))
