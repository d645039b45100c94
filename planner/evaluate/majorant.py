"""Values that no policy exceeds, on a coarse grid: piecewise linear functions above the value.

Consumption that is rounded down to a grid (`Rounding.DOWN`) gives away half a cell with every action. Here a
table holds the nodes of a function W of time t and drive energy g, linear between them, that is nowhere below
the value: at each node, for each action, W is at least the expected value of W after the action, plus what
that expectation may bulge between the nodes. What is given away is of second order in the cell.

1. *Expectation.* Let w be linear between nodes u_j, and c_j the change of its slope there. For an amount X

       q(u) = E[w(u + X)] = a + b u + sum of c_j psi(u_j - u),   psi(y) = E[(y - X)+].

   psi is convex, so a term lies below its chord over a cell if c_j > 0, and above it by at most
   -c_j D if c_j < 0, with D the largest distance between psi and its chord: where psi' = P(X <= y) is the
   slope of the chord. So the chord of q(u_i) + e_i, e_i = sum over c_j < 0 of -c_j max D over both cells at
   the node, is nowhere below q.
2. *Both resources.* With g at a node the expectation over the time of an action is as in 1; between nodes of
   g it is linear in g, as w is. The expectation over the energy then is as in 1 of that bilinear function.
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
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.special import ndtri

from planner.evaluate.grid import Grid, Rounding, mean_above, probability_below, toeplitz, weights_from
from planner.evaluate.model import Floats, Model
from planner.tally import SECONDS, Step, spend

Singles = NDArray[np.float32]

FINER = 6
"""Cells to a cell of the grid on which the chance to end within the budgets is worked out. By hand."""

MOST_FINE = 400
"""Cells of time to which those are kept: more take longer than the table."""

TURNS = 16
"""Rounds in which the nodes of a chance are raised, the last of which may raise some above 1. By hand."""

LITTLE = 1e-6
"""Chance by which a node is not lowered: single precision is not finer. By hand."""

NOISE = 1e-9
"""Chance by which a chord may seem too low: a hundredth of what chances are raised by for rounding."""

ENDS, RAISES = 24, 8
"""Elements (`Step.ELEMENT`) that one fine node takes, once for each drive, and once more for each number of
tracks. By hand, by processor seconds."""


def _below(y: Floats, mu: float, sigma: float) -> Floats:
    """Return E[(y - X)+] for a log-normal or constant X."""
    mean = math.exp(mu + sigma * sigma / 2.0) if mu > -math.inf else 0.0
    return np.maximum(mean_above(y, mu, sigma) - mean + y, 0.0)


def _bulges(nodes: int, step: float, mu: float, sigma: float, shift: float) -> Floats:
    """Return by how much the chord over a cell is above E[(y - X - shift)+], in cells, (nodes,).

    The k-th is the largest over both cells at a node, of which the kink is k nodes ahead.
    """
    left = np.asarray(np.arange(-1, nodes) * step - shift, np.float64)
    right = left + step
    low, high = _below(left, mu, sigma), _below(right, mu, sigma)
    slope = np.clip((high - low) / step, 0.0, 1.0)
    if mu == -math.inf or sigma == 0.0:
        at = np.full(len(left), math.exp(mu))
    else:
        at = np.exp(mu + sigma * ndtri(slope))
    at = np.clip(at, left, right)
    bulge = np.maximum(low + slope * (at - left) - _below(at, mu, sigma), 0.0) / step
    return np.asarray(np.maximum(bulge[:-1], bulge[1:]))


def _steepest(mu: float, sigma: float) -> float:
    """Return the largest slope, up or down, of the density of a log-normal."""
    if mu == -math.inf or sigma == 0.0:
        return math.inf
    z = -1.5 * sigma + np.array([-1.0, 1.0]) * math.sqrt(1.0 + sigma * sigma / 4.0)
    density = np.exp(-z * z / 2.0 - 2.0 * (mu + sigma * z)) / (math.sqrt(2.0 * math.pi) * sigma)
    return float(np.max(density * np.abs(1.0 + z / sigma)))


@njit(cache=True, nogil=True)
def _chord(nodes: Floats, i: int, j: int, x: float, y: float) -> float:
    """Return what is between the nodes of a cell at shares of it in [0, 1]."""
    low = nodes[i, j] + y * (nodes[i, j + 1] - nodes[i, j])
    high = nodes[i + 1, j] + y * (nodes[i + 1, j + 1] - nodes[i + 1, j])
    return low + x * (high - low)


@njit(cache=True, nogil=True)
def _missing(nodes: Floats, fine: Singles, bulge: float, finer: int, i: int, j: int) -> float:
    """Return by how much the chord of a cell of nodes has to rise, at most 0 where it is above everywhere.

    On a fine cell it is above where its upper corner is above the function at the lower one, since both fall,
    or where all corners are above it and its bulge.
    """
    most = -1.0
    for a in range(finer):
        for b in range(finer):
            short = fine[i * finer + a, j * finer + b] - _chord(nodes, i, j, (a + 1) / finer, (b + 1) / finer)
            if short <= most:
                continue
            over = -1.0
            for p in range(a, a + 2):
                for q in range(b, b + 2):
                    chord = _chord(nodes, i, j, p / finer, q / finer)
                    over = max(over, fine[i * finer + p, j * finer + q] - chord)
            most = max(most, min(short, over + bulge))
    return most


@njit(cache=True, nogil=True)
def _room(
    nodes: Floats, fine: Singles, bulge: float, finer: int, cell: tuple[int, int], node: tuple[int, int]
) -> float:
    """Return by how much one node of a cell may fall and leave its chord above, by the same conditions."""
    i, j = cell
    least = np.inf
    for a in range(finer):
        for b in range(finer):
            x, y = (a + 1) / finer, (b + 1) / finer
            weight = (x if node[0] > i else 1.0 - x) * (y if node[1] > j else 1.0 - y)
            spare = _chord(nodes, i, j, x, y) - fine[i * finer + a, j * finer + b] + NOISE
            if spare >= least * weight and spare >= 0.0:
                continue
            by_corner = spare / weight if weight > 0.0 else (np.inf if spare >= 0.0 else -np.inf)
            by_all = np.inf
            for p in range(a, a + 2):
                for q in range(b, b + 2):
                    x, y = p / finer, q / finer
                    weight = (x if node[0] > i else 1.0 - x) * (y if node[1] > j else 1.0 - y)
                    spare = _chord(nodes, i, j, x, y) - fine[i * finer + p, j * finer + q] - bulge + NOISE
                    if spare < 0.0:
                        by_all = -np.inf
                    elif weight > 0.0:
                        by_all = min(by_all, spare / weight)
            least = min(least, max(by_corner, by_all))
    return least


@njit(cache=True, nogil=True)
def _asked_rise(
    nodes: Floats, fine: Singles, bulge: float, finer: int, asked: NDArray[np.bool_]
) -> tuple[Floats, bool]:
    """Return by how much each node, (nt, ng), is asked to rise by the cells beside it, and whether any is.

    A cell, (nt - 1, ng - 1), that is asked no more was found to be high enough.
    """
    rise = np.zeros(nodes.shape)
    some = False
    for i in range(asked.shape[0]):
        for j in range(asked.shape[1]):
            if not asked[i, j]:
                continue
            missing = _missing(nodes, fine, bulge, finer, i, j)
            asked[i, j] = missing > NOISE
            if asked[i, j]:
                some = True
                rise[i : i + 2, j : j + 2] = np.maximum(rise[i : i + 2, j : j + 2], missing)
    return rise, some


@njit(cache=True, nogil=True)
def _lowered(nodes: Floats, fine: Singles, bulge: float, finer: int) -> None:
    """Let each node fall as far as it may, those of the largest chances first."""
    nt, ng = nodes.shape
    for i in range(nt):
        for j in range(ng):
            room = nodes[i, j] - fine[i * finer, j * finer]
            for p in range(max(0, i - 1), min(nt - 1, i + 1)):
                for q in range(max(0, j - 1), min(ng - 1, j + 1)):
                    if room > LITTLE:
                        room = min(room, _room(nodes, fine, bulge, finer, (p, q), (i, j)))
            if room > LITTLE:
                nodes[i, j] -= room - LITTLE


@njit(cache=True, nogil=True)
def least_above(fine: Singles, bulge: float, finer: int) -> Floats:
    """Return nodes [nt, ng] whose chords are above chances that fall in both axes.

    The chances are given at `finer` fine nodes to each node, [finer nt - finer + 1, finer ng - finer + 1],
    and bulge between them by `bulge` at most. Nodes beside a chord that is too low are raised, none above 1
    while a neighbour can be raised: a node above the others would be a time and an energy that a policy gains
    by meeting. Then each falls as far as it may.
    """
    nt, ng = (fine.shape[0] - 1) // finer + 1, (fine.shape[1] - 1) // finer + 1
    nodes = fine[::finer, ::finer].astype(np.float64)
    asked = np.ones((nt - 1, ng - 1), np.bool_)
    for turn in range(TURNS):
        rise, some = _asked_rise(nodes, fine, bulge, finer, asked)
        if not some:
            break
        more = nodes + rise
        nodes = more if turn == TURNS - 1 else np.minimum(more, np.maximum(nodes, 1.0))
    _lowered(nodes, fine, bulge, finer)
    return nodes


@njit(cache=True, nogil=True)
def _with_bends_t(values: Any, out: Any) -> None:
    """Write values [k, nt, ng] and, behind them, how far each node is above its neighbours' chord, times 2,
    along the first axis of nodes. Nothing is before the first node; after the last all is 0.
    """
    count, nt, ng = values.shape
    for k in range(count):
        for i in range(nt):
            for j in range(ng):
                out[k, i, j] = values[k, i, j]
        for j in range(ng):
            out[k, nt, j] = 0.0
        for i in range(1, nt - 1):
            for j in range(ng):
                bend = 2 * values[k, i, j] - values[k, i - 1, j] - values[k, i + 1, j]
                out[k, nt + i, j] = max(bend, np.float32(0.0))
        for j in range(ng):
            bend = 2 * values[k, nt - 1, j] - values[k, nt - 2, j]
            out[k, 2 * nt - 1, j] = max(bend, np.float32(0.0))


@njit(cache=True, nogil=True)
def _with_bends_g(values: Any, out: Any) -> None:
    """Do the same along the second axis of nodes."""
    count, nt, ng = values.shape
    for k in range(count):
        for i in range(nt):
            for j in range(ng):
                out[k, i, j] = values[k, i, j]
            out[k, i, ng] = 0.0
            for j in range(1, ng - 1):
                bend = 2 * values[k, i, j] - values[k, i, j - 1] - values[k, i, j + 1]
                out[k, i, ng + j] = max(bend, np.float32(0.0))
            bend = 2 * values[k, i, ng - 1] - values[k, i, ng - 2]
            out[k, i, 2 * ng - 1] = max(bend, np.float32(0.0))


class Majorant(Grid):
    """A grid whose table holds the nodes of functions above the value (`Rounding.ABOVE`)."""

    def __init__(self, model: Model, nt: int, ng: int, dtype: Any = np.float32):
        super().__init__(model, nt, ng, Rounding.ABOVE, dtype)
        self.alive = np.ones(self.shape, self.dtype)
        self.products *= 2
        self._fine = max(2, min(FINER, MOST_FINE // (nt - 1)))
        self._leg_p: dict[tuple[int, int], tuple[Floats, float]] = {}
        self._leg_within: dict[tuple[int, int, int], Any] = {}
        self._obs_within: dict[int, Any] = {}

    @property
    def _kinds(self) -> tuple[int, int]:
        """Actions, and numbers of tracks that a drive may carry."""
        actions = int(self.model.has_leg.sum()) + self.model.m
        return actions, 1 + int(np.count_nonzero(self.model.trackable))

    @property
    def kernels_mb(self) -> float:
        """What the kernels of all drives take, MB."""
        actions, counts = self._kinds
        each = counts * (2 * self.nt**2 + 2 * self.ng**2 + self.nt * self.ng)
        return 4e-6 * actions * (each + self.nt * self.ng * self._fine**2)

    def reckoned_s(self, drives: int) -> float:
        """Return the seconds that so many drives of a table take, with what is made once for all of them."""
        each = self.products * SECONDS[Step.CELL] + 2 * self.nt * self.ng * SECONDS[Step.ELEMENT]
        legs, counts = self._kinds
        fine = (self.nt - 1) * (self.ng - 1) * self._fine**2
        once = legs * (ENDS + RAISES * counts) * fine if self.model.penalty else 0
        return drives * (each + SECONDS[Step.DRIVE]) + once * SECONDS[Step.ELEMENT]

    def open_until(self, closes_s: float) -> Floats:
        """Return 1 for time nodes up to the one behind the end of a window, else 0; (nt, 1)."""
        before = np.concatenate([[-math.inf], self.t[:-1]])
        last = closes_s * (1.0 + 1e-12)
        return np.where((self.t <= last) | (before < closes_s), 1.0, 0.0)[:, None]

    # ------------------------------------------------------------------------------------- kernels

    def _kernel(self, nodes: int, step: float, mu: float, sigma: float, shift: float) -> Floats:
        """Return expectations and, beside them, what is to be added for each kink; (nodes, 2 nodes)."""
        row = weights_from(0.0, nodes, step, mu, sigma, shift, Rounding.MID)
        return np.hstack([toeplitz(row), toeplitz(_bulges(nodes, step, mu, sigma, shift))])

    def leg_t(self, a: int, b: int, tracked: int) -> Any:
        key = (a, b, tracked)
        if key not in self._leg_t:
            shift = tracked * self.model.track_leg_s
            mu, sigma = self.model.leg_ln[a, b, :2]
            self._leg_t[key] = self._kernel(self.nt, self.step_t, mu, sigma, shift).astype(self.dtype)
        return self._leg_t[key]

    def leg_g(self, a: int, b: int) -> Any:
        if (a, b) not in self._leg_g:
            mu, sigma = self.model.leg_ln[a, b, 2:]
            self._leg_g[a, b] = self._kernel(self.ng, self.step_g, mu, sigma, 0.0).astype(self.dtype)
        return self._leg_g[a, b]

    def obs_t(self, m: int) -> Any:
        if m not in self._obs_t:
            mu, sigma = self.model.obs_ln[m, :2]
            kernel = self._kernel(self.nt, self.step_t, mu, sigma, 0.0)
            opens = float(self.model.window[m, 0])
            if opens > 0.0:
                ahead = np.zeros(2 * self.nt)
                ahead[: self.nt] = weights_from(opens, self.nt, self.step_t, mu, sigma, 0.0, Rounding.MID)
                early = int(np.searchsorted(self.t, opens))  # the first node at which it is open
                kernel[:early] = ahead
                if early < self.nt:
                    kernel[early, : self.nt] = ahead[: self.nt]
            self._obs_t[m] = kernel.astype(self.dtype)
        return self._obs_t[m]

    def obs_g(self, m: int) -> Any:
        if m not in self._obs_g:
            mu, sigma = self.model.obs_ln[m, 2:]
            self._obs_g[m] = self._kernel(self.ng, self.step_g, mu, sigma, 0.0).astype(self.dtype)
        return self._obs_g[m]

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
            late = int(tracked * self.model.track_leg_s * self._fine / self.step_t * (1.0 - 1e-12))
            late = min(late, len(fine))  # the tracks alone may take longer than the day
            moved = np.zeros_like(fine)
            moved[: len(fine) - late] = fine[late:]
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

    def _expected(self, times: Any, energies: Any, after: Any) -> Any:
        """Return nodes of a function above the expectation of one of nodes `after` [..., nt, ng]."""
        flat = after.reshape(-1, *self.shape)
        up = np.empty((len(flat), 2 * self.nt, self.ng), self.dtype)
        _with_bends_t(flat, up)
        mean = times @ up
        both = np.empty((len(flat), self.nt, 2 * self.ng), self.dtype)
        _with_bends_g(mean, both)
        return (both @ energies.swapaxes(-1, -2)).reshape(after.shape)

    def before_legs(
        self, origins: list[int], to: int, tracked: int, after: Any
    ) -> Iterator[tuple[list[int], Any]]:
        """Yield origins, and values before drives from them to one place, given those after them."""
        penalty = self.dtype.type(self.model.penalty)
        key = (to, tracked)
        if key not in self._stacks:
            n1 = self.model.n + 1
            stack = (
                np.zeros((n1, self.nt, 2 * self.nt), self.dtype),
                np.zeros((n1, self.ng, 2 * self.ng), self.dtype),
                np.zeros((n1, *self.shape), self.dtype),
            )
            for a in range(n1):
                if self.model.has_leg[a, to]:
                    stack[0][a], stack[1][a] = self.leg_t(a, to, tracked), self.leg_g(a, to)
                    if penalty:
                        stack[2][a] = self.leg_within(a, to, tracked)
            self._stacks[key] = stack
        times, energies, within = self._stacks[key]
        found = self._expected(times[origins], energies[origins], after)
        if penalty:
            found += penalty * (within[origins] - 1)
        yield origins, found

    def before_observation(self, m: int, after: Any, utility: float) -> Any:
        """Return the value before an observation that is carried out."""
        self.count()
        if self.model.window[m, 0] > 0.0:
            after = np.maximum.accumulate(after[::-1], axis=0)[::-1]  # waiting is looked at where it ends
        penalty = self.model.penalty
        earned = self.dtype.type(penalty + utility) * self.obs_within(m) - self.dtype.type(penalty)
        return self._expected(self.obs_t(m), self.obs_g(m), after) + earned
