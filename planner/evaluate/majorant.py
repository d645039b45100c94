"""Values that no policy exceeds, on a coarse grid: piecewise linear functions above the value.

Consumption that is rounded down to a grid (`Rounding.DOWN`) gives away half a cell with every action. Here a
table holds the nodes of a function W of time t and drive energy g, linear between them, that is nowhere below
the value: at each node, for each action, W is at least the expected value of W after the action, plus what
that expectation may bulge between the nodes. What is given away is of second order in the cell.

1. *Expectation.* Let w be linear between nodes u_j, and c_j the change of its slope there. For an amount X

       q(u) = E[w(u + X)] = a + b u + sum of c_j psi(u_j - u),   psi(y) = E[(y - X)+].

   psi is convex, so a term lies below its chord over a cell if c_j > 0, and above it by at most
   -c_j D if c_j < 0, with D the largest distance between psi and its chord: where psi' = P(X <= y) is the
   slope of the chord. So the chord of q(u_i) + e_i is nowhere below q, where e_i is the larger, of both cells
   at the node, of the sums over c_j < 0 of -c_j D.
2. *Both resources.* With g at a node the expectation over the time of an action is as in 1; between nodes of
   g it is linear in g, as w is. The expectation over the energy then is as in 1 of that bilinear function.
   The value falls in g, so behind the last node W is what it is there: that node may lie where a day hardly
   comes to (`_most_driven_j`), short of the budget.
3. *Ending within the budgets.* What an action earns and the overrun cost that it does not meet are won with
   the chance P(t, g) that it ends within both budgets. P falls in t and g. It is worked out, rounded up, on
   cells finer by `FINER`, and raised at the nodes until its chords are above it there too, by as little as
   that takes and not above 1 (`least_above`). What is worth something after the action is the value, which
   is 0 over the budgets: no edge is left in w.
4. *Windows.* An observation waits for the light: before it opens all is as at that instant, and so it is
   taken to be up to the node behind; for that the values are made to fall. It may begin up to the node
   behind the end of the light.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from scipy.special import ndtri

from planner.evaluate.grid import Grid, Rounding, mean_above, probability_below, weights_from
from planner.evaluate.model import LEAST, Floats, Model
from planner.evaluate.raised_chances import LITTLE, least_above
from planner.tally import SECONDS, Step, spend

FINER = 6
"""Cells to a cell of the grid on which the chance to end within the budgets is worked out. By hand."""

MOST_FINE = 400
"""Cells of time to which those are kept: more take longer than the table."""

TAIL = 1e-10
"""Chance of a cell, or share of it, that is left out far ahead: `bounds.MARGIN` has room for all of them."""

FASTER = 1.3
"""How much faster than by the hungriest drives a day may use its energy before a table grows loose. By hand:
drive times scatter, most of all those of single drives."""

ENDS, RAISES = 10, 3.5
"""Elements (`Step.ELEMENT`) that one fine node takes, once for each drive, and once more for each number of
tracks. By hand, by processor seconds."""


VECTORED, ABOVE_PASSES = 0.45, 20
"""Products (`Step.CELL`) that one of a sum over nodes ahead takes, as eight rows go together, and passes over
the nodes beside them. Fitted to grids of 25 by 29, 49 by 57 and 73 by 85 nodes, within 10 %."""


def _below(y: Floats, mu: float, sigma: float) -> Floats:
    """Return E[(y - X)+] for a log-normal or constant X."""
    mean = math.exp(mu + sigma * sigma / 2.0) if mu > -math.inf else 0.0
    return np.maximum(mean_above(y, mu, sigma) - mean + y, 0.0)


def _bulges(nodes: int, step: float, mu: float, sigma: float, shift: float) -> Floats:
    """Return by how much the chord over a cell is above E[(y - X - shift)+], in cells, (nodes,).

    The k-th is of a kink k nodes ahead of the cell's first node; one there or before does nothing in it.
    """
    left = np.asarray(np.arange(-1, nodes - 1) * step - shift, np.float64)
    right = left + step
    low, high = _below(left, mu, sigma), _below(right, mu, sigma)
    slope = np.clip((high - low) / step, 0.0, 1.0)
    if mu == -math.inf or sigma == 0.0:
        at = np.full(len(left), math.exp(mu))
    else:
        at = np.exp(mu + sigma * ndtri(slope))
    at = np.clip(at, left, right)
    return np.asarray(np.maximum(low + slope * (at - left) - _below(at, mu, sigma), 0.0) / step)


def _steepest(mu: float, sigma: float) -> float:
    """Return the largest slope, up or down, of the density of a log-normal."""
    if mu == -math.inf or sigma == 0.0:
        return math.inf
    z = -1.5 * sigma + np.array([-1.0, 1.0]) * math.sqrt(1.0 + sigma * sigma / 4.0)
    density = np.exp(-z * z / 2.0 - 2.0 * (mu + sigma * z)) / (math.sqrt(2.0 * math.pi) * sigma)
    return float(np.max(density * np.abs(1.0 + z / sigma)))


def _densest(mu: float, sigma: float) -> float:
    """Return the largest density of a log-normal."""
    if mu == -math.inf or sigma == 0.0:
        return math.inf
    return math.exp(sigma * sigma / 2.0 - mu) / (math.sqrt(2.0 * math.pi) * sigma)


@njit(cache=True, nogil=True)
def _bends(values: Any, goes_on: bool, bends: Any) -> None:
    """Write how far each node of values [n, w] is above the chord of its neighbours, times 2, along the first
    axis. Nothing is before the first node; after the last all is 0, or as there if it `goes_on`.
    """
    n, width = values.shape
    for c in range(width):
        bends[0, c] = 0.0
    for i in range(1, n - 1):
        for c in range(width):
            bends[i, c] = max(2 * values[i, c] - values[i - 1, c] - values[i + 1, c], np.float32(0.0))
    twice = 1 if goes_on else 2
    for c in range(width):
        bends[n - 1, c] = max(twice * values[n - 1, c] - values[n - 2, c], np.float32(0.0))


@njit(cache=True, nogil=True, fastmath=True)
def _add(weights: Any, low: int, high: int, rows: Any, width: int, found: Any) -> None:
    """Add the sum over low <= k < high of weights[k] * rows[k, :width] to found[:width].

    Eight rows go together: with one at a time the sum would be stored and read again for each.
    """
    end = low + max(0, high - low) // 8 * 8
    for k in range(low, end, 8):
        a, b, c, d = weights[k], weights[k + 1], weights[k + 2], weights[k + 3]
        e, f, g, h = weights[k + 4], weights[k + 5], weights[k + 6], weights[k + 7]
        for x in range(width):
            found[x] += (
                (a * rows[k, x] + b * rows[k + 1, x]) + (c * rows[k + 2, x] + d * rows[k + 3, x])
            ) + ((e * rows[k + 4, x] + f * rows[k + 5, x]) + (g * rows[k + 6, x] + h * rows[k + 7, x]))
    for k in range(end, high):
        a = weights[k]
        for x in range(width):
            found[x] += a * rows[k, x]


@njit(cache=True, nogil=True)
def _above_mean(
    values: Any, kernel: Any, span: Any, widths: Any, goes_on: bool, bends: Any, needs: Any, found: Any
) -> None:
    """Write nodes above the expectation of values [n, w] after an amount along the first axis.

    `kernel` [3, n] and `span` (low, high, early) are as in `Majorant._kernel`; `widths` [n] says how many
    columns may be within the budgets; after the last node all is 0, or as there if it `goes_on`. `bends` and
    `needs` [n, w] are overwritten.
    """
    n = len(values)
    low, high, early = span[0], span[1], span[2]
    _bends(values, goes_on, bends)
    found[:] = 0.0
    needs[:] = 0.0
    if early > 0:
        _add(kernel[2], np.int64(0), n, values, widths[0], found[0])
    for i in range(n):
        if i <= early and early > 0:
            found[i] = found[0]
        else:
            _add(kernel[0], low, min(high, n - i), values[i:], widths[i], found[i])
        if goes_on:
            for c in range(widths[i]):
                found[i, c] += kernel[2, i] * values[n - 1, c]
        if i >= early:
            _add(kernel[1], low, min(high, n - i), bends[i:], widths[i], needs[i])
    for i in range(n):
        behind, ahead = max(i - 1, 0), min(i, n - 2)
        for c in range(values.shape[1]):
            found[i, c] += max(needs[behind, c], needs[ahead, c])


@njit(cache=True, nogil=True)
def _above_both(
    after: Any, actions: Any, times: Any, spans_t: Any, energies: Any, spans_g: Any, within: Any, earned: Any,
    widths: Any, heights: Any, goes_on: tuple[bool, bool],
) -> Any:  # fmt: skip
    """Return nodes [k, nt, ng] of functions above what k actions earn and the expectations of `after` them.

    `actions` [k] are numbers of the n actions whose kernels [n, 3, nodes], spans [n, 3] and chances to end
    `within` the budgets [n, nt, ng] are given; `earned` holds what that wins with the penalty that it saves,
    and the penalty. `goes_on` says it of time and of energy; a constant there would be compiled on its own.
    """
    count, nt, ng = after.shape
    found = np.empty_like(after)
    bends, needs, means = np.empty_like(after[0]), np.empty_like(after[0]), np.empty_like(after[0])
    turned = np.empty((4, ng, nt), after.dtype)
    for k in range(count):
        a = actions[k]
        _above_mean(after[k], times[a], spans_t[a], widths, goes_on[0], bends, needs, means)
        for i in range(nt):
            for j in range(ng):
                turned[0, j, i] = means[i, j]
        _above_mean(turned[0], energies[a], spans_g[a], heights, goes_on[1], turned[1], turned[2], turned[3])
        for i in range(nt):
            for j in range(ng):
                found[k, i, j] = turned[3, j, i] + (earned[0] * within[a, i, j] - earned[1])
    return found


def _most_driven_j(model: Model) -> float:
    """Return the drive energy, J, above which a table says what it says there.

    The value falls in the energy used, so any choice bounds it. This is where a day ends that draws `FASTER`
    times what the hungriest observation, or drive with one behind it, draws in the mean, besides the hotel
    load.
    """
    seconds, joules = model.leg[:, :, 0], model.leg[:, :, 2]
    most = 0.0
    for m in range(model.m):
        to = int(model.obs_place[m])
        legs = (
            np.append(0.0, seconds[model.has_leg[:, to], to]),
            np.append(0.0, joules[model.has_leg[:, to], to]),
        )
        drawn = (legs[1] + model.obs[m, 2]) / np.maximum(legs[0] + model.obs[m, 0], LEAST)
        most = max(most, float(np.max(drawn)))
    draw_w = FASTER * most
    return model.e_max_j * (draw_w / (draw_w + model.hotel_w) if draw_w > LEAST else 1.0)


class Action(NamedTuple):
    """Log-normal amounts `ln` (mu T, sigma T, mu G, sigma G); nodes of a function above the chance to end
    `within` the budgets [nt, ng]; a time that comes on top, and when the window opens, s.
    """

    ln: Floats
    within: Any
    shift_s: float = 0.0
    opens_s: float = 0.0


class Actions(NamedTuple):
    """Kernels of n actions: `times` [n, 3, nt] and `energies` [n, 3, ng] with their spans [n, 3], as
    `Majorant._kernel` has them, and the chances to end `within` the budgets, nodes of functions above
    [n, nt, ng].
    """

    times: Any
    spans_t: Any
    energies: Any
    spans_g: Any
    within: Any


class Majorant(Grid):
    """A grid whose table holds the nodes of functions above the value (`Rounding.ABOVE`)."""

    def __init__(self, model: Model, nt: int, ng: int, dtype: Any = np.float32):
        super().__init__(model, nt, ng, Rounding.ABOVE, dtype)
        most_j = _most_driven_j(model)
        self._cut = most_j < model.e_max_j
        self.step_g = most_j / (ng - 1)
        self.g = np.arange(ng) * self.step_g
        self.energy = model.hotel_w * self.t[:, None] + self.g[None, :]
        self.alive = np.ones(self.shape, self.dtype)
        self._fine = max(2, min(FINER, MOST_FINE // (nt - 1)))
        self._leg_p: dict[tuple[int, int], tuple[Floats, float]] = {}
        self._leg_within: dict[tuple[int, int, int], Any] = {}
        self._obs_within: dict[int, Any] = {}
        self._observed: dict[int, Actions] = {}
        self._widths, self._heights = self._counts(self.energy), self._counts(self.energy.T)
        # one sum over the nodes ahead for chances and one for needs; those of energy end sooner
        self.products = 2 * int(self._widths.sum()) * (nt // 2 + min(ng // 2, self._spread_g()))

    def _spread_g(self) -> int:
        """Return over how many nodes the energy of a drive is spread, about."""
        of = self.model.leg_ln[self.model.has_leg][:, 2:]
        if not len(of):
            return 0
        low, high = (np.exp(of[:, 0] + far * of[:, 1]) for far in (-6.0, 6.0))
        return 2 + int(np.mean(high - low) / self.step_g)

    def _counts(self, energy: Floats) -> Any:
        """Return for each node along the first axis of energies used how many nodes of the other may be
        within the budget there, [n]: a node over it counts where a cell beside it holds something within.
        """
        alive = energy[:-1] <= self.model.e_max_j * (1.0 + 1e-12)
        counts = np.minimum(alive.sum(axis=1) + 1, energy.shape[1])
        return np.append(counts[:1], counts)

    @property
    def _kinds(self) -> tuple[int, int]:
        """Actions, and numbers of tracks that a drive may carry."""
        actions = int(self.model.has_leg.sum()) + self.model.m
        return actions, 1 + int(np.count_nonzero(self.model.trackable))

    @property
    def kernels_mb(self) -> float:
        """What the kernels of all drives take, MB."""
        actions, counts = self._kinds
        each = counts * 2 * self.nt * self.ng
        return 4e-6 * actions * (each + self.nt * self.ng * self._fine**2)

    @property
    def drive_s(self) -> float:
        """Reckoned seconds of one of many drives of a table."""
        passes = ABOVE_PASSES * self.nt * self.ng
        return VECTORED * self.products * SECONDS[Step.CELL] + passes * SECONDS[Step.PASS]

    def once_s(self) -> float:
        """Return the seconds of what is made once for all drives of a table: chances to end in time."""
        legs, counts = self._kinds
        fine = (self.nt - 1) * (self.ng - 1) * self._fine**2
        once = legs * (ENDS + RAISES * counts) * fine if self.model.penalty else 0
        return once * SECONDS[Step.ELEMENT]

    def corner(self, t_s: float, g_j: float) -> tuple[slice, slice, Floats]:
        """Return where a point lies; behind the last energy all is as there."""
        return super().corner(t_s, min(g_j, float(self.g[-1])))

    def open_until(self, closes_s: float) -> Floats:
        """Return 1 for time nodes up to the one behind the end of a window, else 0; (nt, 1)."""
        before = np.concatenate([[-math.inf], self.t[:-1]])
        last = closes_s * (1.0 + 1e-12)
        return np.where((self.t <= last) | (before < closes_s), 1.0, 0.0)[:, None]

    # ------------------------------------------------------------------------------------- kernels

    def _kernel(
        self, nodes: int, step: float, mu: float, sigma: float, shift: float = 0.0, opens: float = 0.0
    ) -> tuple[Floats, tuple[int, int, int]]:
        """Return a kernel [3, nodes] and its span (low, high, early).

        From a node on, the chance of each node ahead [0], and what the cell behind the node needs for a kink
        of each [1]; both but for `TAIL` are from `low` to `high` nodes ahead. Up to the node `early`, if it
        is not 0, the rover waits: the chances of the nodes themselves are [2]. Else that holds the chance
        that the amount leads past the last node.
        """
        kernel = np.zeros((3, nodes))
        kernel[0] = weights_from(0.0, nodes, step, mu, sigma, shift, Rounding.MID)
        kernel[1] = _bulges(nodes, step, mu, sigma, shift)
        some = np.flatnonzero((kernel[:2] > TAIL).any(axis=0))
        low, high = (int(some[0]), int(some[-1]) + 1) if len(some) else (0, 0)
        early = 0
        kernel[2] = np.maximum(1.0 - np.cumsum(kernel[0])[::-1], 0.0)
        if opens > 0.0:
            early = int(np.searchsorted(np.arange(nodes) * step, opens))
            kernel[2] = weights_from(opens, nodes, step, mu, sigma, shift, Rounding.MID)
        return kernel, (low, high, early)

    def _drive(self, a: int, to: int, tracked: int) -> Action | None:
        """Return what there is to know of a drive; None where no leg leads to it."""
        if not self.model.has_leg[a, to]:
            return None
        within = self.leg_within(a, to, tracked) if self.model.penalty else np.zeros(self.shape)
        return Action(self.model.leg_ln[a, to], within, tracked * self.model.track_leg_s)

    def _actions(self, rows: list[Action | None]) -> Actions:
        """Return the kernels of actions; zeros where there is none."""
        n = len(rows)
        times, energies = np.zeros((n, 3, self.nt), self.dtype), np.zeros((n, 3, self.ng), self.dtype)
        spans_t, spans_g = np.zeros((n, 3), np.int64), np.zeros((n, 3), np.int64)
        within = np.zeros((n, *self.shape), self.dtype)
        for k, row in enumerate(rows):
            if row is not None:
                within[k] = row.within
                mu, sigma, mu_g, sigma_g = map(float, row.ln)
                times[k], spans_t[k] = self._kernel(self.nt, self.step_t, mu, sigma, row.shift_s, row.opens_s)
                energies[k], spans_g[k] = self._kernel(self.ng, self.step_g, mu_g, sigma_g)
        return Actions(times, spans_t, energies, spans_g, within)

    # ------------------------------------------------------------------------- ending within the budgets

    def _ends(self, ln: Floats) -> tuple[Floats, float]:
        """Return the chance that an action ends within both budgets at the fine nodes, not rounded down, and
        how far it may bulge between them.

        Between fine nodes a distribution function bulges by max |f'| / 8 of a cell squared, f the density,
        and the chance is one of the time with the room for energy fixed, and the other way round.
        """
        nt, ng = (self.nt - 1) * self._fine + 1, (self.ng - 1) * self._fine + 1
        step_t, step_g = self.step_t / self._fine, self.step_g / self._fine
        mu, sigma, mu_g, sigma_g = map(float, ln)
        t, g = np.arange(nt) * step_t, np.arange(ng) * step_g
        room = self.model.e_max_j * (1.0 + 1e-12) - self.model.hotel_w * t - g[:, None]
        cheap = np.where(room < 0.0, 0.0, probability_below(room, mu_g, sigma_g))
        steep, steep_g = _steepest(mu, sigma), _steepest(mu_g, sigma_g)
        hats = np.append(weights_from(0.0, nt, step_t, mu, sigma, 0.0, Rounding.MID), 0.0)
        size = 1 << (2 * nt - 1).bit_length()
        spread = np.fft.rfft(cheap, size)
        spend(Step.ELEMENT, ENDS * nt * ng)

        def ended(masses: Floats) -> Floats:
            found = np.fft.irfft(np.fft.rfft(masses[:nt], size).conj() * spread, size)
            return np.asarray(found[:, :nt]) + 1e-12

        down = ended(weights_from(0.0, nt, step_t, mu, sigma, 0.0, Rounding.DOWN))
        # the last hat is cut where the time ends, and cut off sharply there
        left = np.asarray(np.arange(nt)[::-1] * step_t, np.float64)
        low, high = _below(left - step_t, mu, sigma), _below(left, mu, sigma)
        half = probability_below(left, mu, sigma) - (high - low) / step_t
        middle = ended(hats) + cheap[:, -1:] * (half - hats[:nt][::-1])
        middle += steep_g * (self.model.hotel_w * step_t) ** 2 / 8.0
        found = np.clip(np.fmin(down, middle).T, 0.0, 1.0)
        if self.model.hotel_w > 0.0:  # the hotel load of an uncertain time scatters the energy too
            dense = _densest(mu, sigma) * _densest(mu_g, sigma_g) / self.model.hotel_w
            steep_g = min(steep_g, dense + steep / self.model.hotel_w**2)
        # it falls in both, so what rises is rounding
        found = np.maximum.accumulate(np.maximum.accumulate(found[::-1, ::-1], 0), 1)[::-1, ::-1]
        return (found + 1e-7).astype(np.float32), (steep * step_t**2 + steep_g * step_g**2) / 8.0

    def _least_above(self, fine: Any, bulge: float) -> Any:
        """Return the nodes of a function above one that falls, given at the fine nodes, and bulges so much
        between them.
        """
        spend(Step.ELEMENT, RAISES * fine.size)
        return least_above(fine, bulge, self._fine).astype(self.dtype)

    def leg_within(self, a: int, b: int, tracked: int) -> Any:
        """Return the chance that a drive ends within both budgets: nodes of a function above it, (nt, ng)."""
        key = (a, b, tracked)
        if key not in self._leg_within:
            if (a, b) not in self._leg_p:
                self._leg_p[a, b] = self._ends(self.model.leg_ln[a, b])
            fine, bulge = self._leg_p[a, b]
            moved = np.zeros_like(fine)
            late, part = divmod(tracked * self.model.track_leg_s * self._fine / self.step_t, 1.0)
            if late < len(fine):  # else the tracks alone take longer than the day
                moved[: len(fine) - int(late)] = fine[int(late) :]
                # between nodes chances are below their chord and bulge, and below those at the node before
                behind = np.append(moved[1:], moved[-1:], axis=0)
                chord = moved + (part * (1.0 - LITTLE)) * (behind - moved) + 4.0 * part * (1.0 - part) * bulge
                moved = np.fmin(moved, chord).astype(np.float32)
            self._leg_within[key] = self._least_above(moved, bulge)
        return self._leg_within[key]

    def obs_within(self, m: int) -> Any:
        """Return the same of an observation."""
        if m not in self._obs_within:
            fine, bulge = self._ends(self.model.obs_ln[m])
            opens = float(self.model.window[m, 0])
            if opens > 0.0:
                until = min(int(opens * self._fine / self.step_t), len(fine) - 1)
                fine[:until] = fine[until]
            self._obs_within[m] = self._least_above(fine, bulge)
        return self._obs_within[m]

    # ------------------------------------------------------------------------------------- one action

    def _before(self, actions: Actions, chosen: list[int], after: Any, won: float) -> Any:
        """Return nodes of functions above the values [k, nt, ng] before the chosen actions, given those after
        them and what each wins by ending within the budgets, beside the penalty that it saves.
        """
        earned = np.array([self.model.penalty + won, self.model.penalty], self.dtype)
        goes_on = (False, self._cut)
        return _above_both(after, np.array(chosen), *actions, earned, self._widths, self._heights, goes_on)

    def before_legs(
        self, origins: list[int], to: int, tracked: int, after: Any
    ) -> Iterator[tuple[list[int], Any]]:
        """Yield origins, and values before drives from them to one place, given those after them."""
        key = (to, tracked)
        if key not in self._stacks:
            self._stacks[key] = self._actions([self._drive(a, to, tracked) for a in range(self.model.n + 1)])
        yield origins, self._before(self._stacks[key], origins, after, 0.0)

    def before_observation(self, m: int, after: Any, utility: float) -> Any:
        """Return the value before an observation that is carried out."""
        self.count()
        opens = float(self.model.window[m, 0])
        if opens > 0.0:
            after = np.maximum.accumulate(after[::-1], axis=0)[::-1]  # waiting is looked at where it ends
        if m not in self._observed:
            action = Action(self.model.obs_ln[m], self.obs_within(m), opens_s=opens)
            self._observed[m] = self._actions([action])
        return self._before(self._observed[m], [0], np.ascontiguousarray(after)[None], utility)[0]
