"""The kernel that carries plans out: in futures hashed as they are met, or in those of a table of draws."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit, uint64

from planner.evaluate.hashing import mix, normal, uniform
from planner.evaluate.model import Floats, Ints, Model, Sols, Truths
from planner.evaluate.program import Program


class Rows(NamedTuple):
    """A program: row k does `op[k]` on `arg[k]` (threshold `value[k]`), then goes to `go[k]` or `fail[k]`."""

    op: Ints
    arg: Ints
    value: Floats
    go: Ints
    fail: Ints
    entry: int

    @staticmethod
    def of(program: Program) -> Rows:
        """Return a program as the kernel takes it."""
        return Rows(program.op, program.arg, program.value, program.go, program.fail, program.entry)


class Costs(NamedTuple):
    """Budgets, costs and windows; times in ticks, of which `per_s` make a second."""

    per_s: float
    t_max: float
    e_max: float
    hotel: float
    penalty: float
    track_t: float
    track_e: float
    track_leg: float
    window: Floats  # (m, 2)

    @staticmethod
    def of(model: Model, per_s: int = 0) -> Costs:
        """Return a model's: in whole ticks where there are some `per_s`, else in seconds."""
        ticks = float(per_s or 1)

        def told(seconds: float) -> float:
            return float(round(seconds * per_s)) if per_s else seconds

        window = np.round(np.clip(model.window, -1e12, 1e12) * ticks) if per_s else model.window
        return Costs(
            ticks, told(model.t_max_s), model.e_max_j, model.hotel_w, model.penalty, told(model.track_t_s),
            model.track_e_j, told(model.track_leg_s), window,
        )  # fmt: skip


class World(NamedTuple):
    """Drives, observations and what may be observed when; the members are those of `Model`."""

    n: int
    leg_ln: Floats
    has_leg: Truths
    loss: Floats
    fails: Floats
    obs_ln: Floats
    obs_place: Ints
    worth: Floats  # (m,) what an observation earns
    p_success: Floats
    is_place: Truths
    predecessors: Ints
    trackable: Truths
    place_bits: Ints
    target_bits: Ints
    diminishing: Floats
    sols: Sols

    @staticmethod
    def of(model: Model, worth: Floats) -> World:
        """Return a model as the kernel takes it; `worth` [m] is what each observation earns, in utility."""
        return World(
            model.n, model.leg_ln, model.has_leg, model.loss, model.fail, model.obs_ln, model.obs_place,
            worth, model.p_success, model.is_place, model.predecessors, model.trackable, model.place_bits,
            model.target_bits, model.diminishing, model.sols,
        )  # fmt: skip


class Odds(NamedTuple):
    """The seed of all draws, and what breaks their independence (`monte_carlo.Correlation`)."""

    seed: int
    day_sd: float = 0.0
    keep: float = 0.0
    p_recover: float = 0.0


class Draws(NamedTuple):
    """A table of draws, row f of each for future f: times in ticks, energies, uniforms; empty where none.

    Amounts are as they come out on that sol; `energy` is the factor of its kind on the hotel load and on the
    starts of tracks.
    """

    leg_t: Floats  # (N, n + 1, n + 1)
    leg_g: Floats
    leg_u: Floats  # (N, n + 1, n + 1, n + 1)
    leg_fail_u: Floats  # (N, n + 1, n + 1)
    obs_t: Floats  # (N, m)
    obs_g: Floats
    obs_u: Floats
    energy: Floats  # (N,)

    @staticmethod
    def none() -> Draws:
        """Return the table of a run whose draws are hashes."""
        legs, observations = np.zeros((0, 0, 0)), np.zeros((0, 0))
        losses = np.zeros((0, 0, 0, 0))
        return Draws(legs, legs, losses, legs, observations, observations, observations, np.zeros(0))


class Outcome(NamedTuple):
    """What each future earned and used, to be filled; shapes (N,)."""

    utility: Floats
    time_s: Floats
    energy_j: Floats
    overrun: Truths

    @staticmethod
    def empty(count: int) -> Outcome:
        """Return room for so many futures."""
        return Outcome(np.empty(count), np.empty(count), np.empty(count), np.empty(count, np.bool_))

    def part(self, low: int, high: int) -> Outcome:
        """Return the room of some of the futures."""
        at = slice(low, high)
        return Outcome(self.utility[at], self.time_s[at], self.energy_j[at], self.overrun[at])


class Passages(NamedTuple):
    """Time, energy, what was earned, place, tracks, what was done and where no drive leads any more, with
    which each future came to each row.

    Arrays of shape (futures, rows); the time is NaN where a future never came to a row.
    """

    time_s: Floats
    energy_j: Floats
    earned: Floats
    place: Ints
    tracked: Ints
    done: Ints
    closed: Ints

    @staticmethod
    def empty(futures: int, rows: int) -> Passages:
        """Return room for so many; none of either where no row is watched."""
        shape = futures, rows
        amounts = (np.full(shape, np.nan) for _ in range(3))
        return Passages(*amounts, *(np.zeros(shape, np.int64) for _ in range(4)))

    def part(self, low: int, high: int) -> Passages:
        """Return the room of some of the futures."""
        at = slice(low, high)
        return Passages(
            self.time_s[at], self.energy_j[at], self.earned[at],
            self.place[at], self.tracked[at], self.done[at], self.closed[at],
        )  # fmt: skip

    def at(self, row: int, futures: int) -> Standing:
        """Return those of the first `futures` that came to a row, as they stood there."""
        there = np.flatnonzero(~np.isnan(self.time_s[:futures, row]))
        return Standing(there, *(values[there, row] for values in self))


class Standing(NamedTuple):
    """Where some futures stand at one row: their numbers, and time, energy, what was earned, place, tracks
    (bits of places), what was done (bits of observations) and to where no drive leads any more (bits of
    places) there. Arrays of one length.
    """

    number: Ints
    time_s: Floats
    energy_j: Floats
    earned: Floats
    place: Ints
    tracked: Ints
    done: Ints
    closed: Ints

    @staticmethod
    def at_start() -> Standing:
        """Return that of a run in which every future begins at the start."""
        amounts, bits = np.zeros(0), np.zeros(0, np.int64)
        return Standing(bits, amounts, amounts, amounts, bits, bits, bits, bits)


SOL_COUNTER = 2
"""Of the draw of a future's kind of sol; counter 1 is the factor of `Correlation.day_factor_sd`."""


@njit(inline="always")
def kind_of(below: Floats, u: float) -> int:
    """Return the kind of sol of a number between 0 and 1, for chances `below` [K]."""
    kind, total = 0, 0.0
    for k in range(below.shape[0] - 1):
        total += below[k]
        if u >= total:
            kind = k + 1
    return kind


@njit(cache=True)
def kinds_of(chance: Floats, seed: int, number: Ints) -> Ints:
    """Return the kind of sol that each of some futures of a seed has, for chances `chance` [K], K > 0.

    `number` and what is returned have the shape (count,).
    """
    found = np.empty(number.shape[0], np.int64)
    for f in range(number.shape[0]):
        found[f] = kind_of(chance, uniform(key_of(seed, number[f]), SOL_COUNTER))
    return found


@njit(inline="always")
def key_of(seed: int, which: int) -> Any:
    """Return the key of all draws of a future of a seed."""
    key = mix(uint64(seed) * uint64(0xD1342543DE82EF95) + uint64(which) + uint64(0x2545F4914F6CDD1D))
    return mix(key ^ uint64(0x9E3779B97F4A7C15))


@njit(nogil=True, cache=True)
def roll(
    program: Rows,
    costs: Costs,
    world: World,
    odds: Odds,
    first: int,
    count: int,
    drawn: bool,
    draws: Draws,
    outcome: Outcome,
    visits: Ints,
    visited: Truths,
    seen: Passages,
    begin: Standing,
) -> None:
    """Fill the outcome of `count` futures, and the rows that they went through.

    Times are in ticks, of which `per_s` make a second: whole milliseconds where `drawn`, so sums are exact.
    Where `drawn`, future f takes its amounts and uniforms from row f of the tables, and the success coin is
    tossed; else they are hashes of (seed, `first` + f, action), and an observation earns its mean, `worth`.
    `visits` counts passages per row, `visited` marks rows per future, `seen` holds how a future came to a
    row; each may be empty. Where `begin` is not empty, future f is number `begin.number[f]` and goes on from
    where it stands instead of from the start. Where the kind of sol is hidden, it is a draw of the future.

    No fast mathematics: in tables of draws every comparison must fall as the executive's does.

    Shapes: `visits` [rows] or [0], `visited` [count, rows] or [0, 0]; the others are given with their types.
    """
    op, arg, value, go, fail, entry = program
    per_s, t_max, e_max, usual_hotel, penalty, track_t, usual_track_e, track_leg, window = costs
    (
        n, leg_ln, has_leg, loss, fails, obs_ln, obs_place, worth, p_success, is_place, predecessors,
        trackable, place_bits, target_bits, diminishing, sols,
    ) = world  # fmt: skip
    seed, day_sd, keep, p_recover = odds
    leg_t, leg_g, leg_u, leg_fail_u, obs_t, obs_g, obs_u, drawn_energy = draws
    utility, time_used, energy_used, over = outcome
    seen_t, seen_e, seen_u, seen_place, seen_tracked, seen_done, seen_closed = seen
    number, begin_t, begin_e, begin_u, begin_place, begin_tracked, begin_done, begin_closed = begin
    resumed = number.shape[0] > 0
    hidden = sols.chance.shape[0] > 0
    hotel, track_e, leg_s, leg_j, obs_j = usual_hotel, usual_track_e, 1.0, 1.0, 1.0
    n1 = n + 1
    day_sigma = math.sqrt(math.log1p(day_sd * day_sd))
    fresh = math.sqrt(max(0.0, 1.0 - keep * keep))
    counting, marking, watching = visits.shape[0] > 0, visited.shape[0] > 0, seen_t.shape[0] > 0
    for f in range(count):
        which = number[f] if resumed else first + f
        key = key_of(seed, which)
        if hidden:
            if drawn:
                obs_j = drawn_energy[f]
            else:
                kind = kind_of(sols.chance, uniform(key, SOL_COUNTER))
                obs_j = sols.energy[kind]
                leg_s, leg_j = sols.drive_time[kind], sols.drive_energy[kind] * obs_j
            hotel, track_e = usual_hotel * obs_j, usual_track_e * obs_j
        t = 0.0
        g = 0.0
        u = 0.0
        ended_over = False
        loc = 0
        tracked = 0
        ever = 0
        ntrk = 0
        done = 0
        closed = 0
        pc = entry
        if resumed:
            t, u, loc = begin_t[f] * per_s, begin_u[f], begin_place[f]
            g = begin_e[f] - hotel * begin_t[f]
            tracked, done, closed = begin_tracked[f], begin_done[f], begin_closed[f]
            ever = tracked
            for k in range(1, n1):
                ntrk += (tracked >> k) & 1
        last_z = 0.0
        factor = 1.0
        if day_sigma > 0.0:
            factor = math.exp(day_sigma * normal(key, 1) - 0.5 * day_sigma * day_sigma)
        while True:
            o = op[pc]
            if counting:
                visits[pc] += 1
            if marking:
                visited[f, pc] = True
            if watching:
                seen_t[f, pc] = t / per_s
                seen_e[f, pc] = g + hotel * (t / per_s)
                seen_u[f, pc] = u
                seen_place[f, pc] = loc
                seen_tracked[f, pc] = tracked
                seen_done[f, pc] = done
                seen_closed[f, pc] = closed
            if o == 0:
                break
            i = arg[pc]
            if o == 3:
                if loc != i:
                    if not has_leg[loc, i] or (closed >> i) & 1:
                        pc = fail[pc]
                        continue
                    base = 16 + (loc * n1 + i) * (n1 + 2)
                    if drawn:
                        t += leg_t[f, loc, i] + track_leg * ntrk
                        g += leg_g[f, loc, i]
                    else:
                        z = normal(key, base)
                        if keep > 0.0:
                            z = keep * last_z + fresh * z
                            last_z = z
                        took = leg_s * factor * math.exp(leg_ln[loc, i, 0] + leg_ln[loc, i, 1] * z)
                        t += took + track_leg * ntrk
                        g += leg_j * math.exp(leg_ln[loc, i, 2] + leg_ln[loc, i, 3] * normal(key, base + 1))
                    if t > t_max or g + hotel * (t / per_s) > e_max:
                        ended_over = True
                        break
                    if tracked != 0 or (p_recover > 0.0 and ever != 0):
                        for k in range(1, n1):
                            if (tracked >> k) & 1:
                                p = loss[loc, i, k]
                                if p > 0.0:
                                    chance = leg_u[f, loc, i, k] if drawn else uniform(key, base + 1 + k)
                                    if chance < p:
                                        tracked &= ~(1 << k)
                                        ntrk -= 1
                            elif (
                                p_recover > 0.0 and (ever >> k) & 1 and uniform(key, base + 1 + k) < p_recover
                            ):
                                tracked |= 1 << k
                                ntrk += 1
                    p = fails[loc, i]
                    if p > 0.0:
                        chance = leg_fail_u[f, loc, i] if drawn else uniform(key, base + n1 + 1)
                        if chance < p:
                            closed |= 1 << i
                            pc = fail[pc]
                            continue
                    loc = i
                pc = go[pc]
            elif o == 4:
                place = obs_place[i]
                if (
                    loc != place
                    or (done >> i) & 1
                    or t > window[i, 1]
                    or (is_place[i] and not (tracked >> place) & 1)
                    or (predecessors[i] & ~done) != 0
                ):
                    pc = fail[pc]
                    continue
                if t < window[i, 0]:
                    t = window[i, 0]
                if drawn:
                    t += obs_t[f, i]
                    g += obs_g[f, i]
                else:
                    base = 16 + n1 * n1 * (n1 + 2) + 2 * i
                    t += factor * math.exp(obs_ln[i, 0] + obs_ln[i, 1] * normal(key, base))
                    g += obs_j * math.exp(obs_ln[i, 2] + obs_ln[i, 3] * normal(key, base + 1))
                if t > t_max or g + hotel * (t / per_s) > e_max:
                    ended_over = True
                    break
                if not drawn or obs_u[f, i] < p_success[i]:
                    w = worth[i]
                    if diminishing[place] != 1.0:
                        before = done & target_bits[place]
                        while before != 0:
                            w *= diminishing[place]
                            before &= before - 1
                    u += w
                done |= 1 << i
                if is_place[i] and (place_bits[place] & ~done) == 0 and (tracked >> place) & 1:
                    tracked &= ~(1 << place)
                    ntrk -= 1
                    ever &= ~(1 << place)
                pc = go[pc]
            elif o == 5:
                pc = go[pc] if (not trackable[i]) or (tracked >> i) & 1 else fail[pc]
            elif o == 6:
                pc = go[pc] if t / per_s >= value[pc] else fail[pc]
            elif o == 7:
                pc = go[pc] if g + hotel * (t / per_s) >= value[pc] else fail[pc]
            elif o == 8:
                pc = go[pc] if (tracked >> i) & 1 else fail[pc]
            elif o == 9:
                pc = go[pc] if (done >> i) & 1 else fail[pc]
            elif o == 1:
                if loc != 0 or closed != 0 or not trackable[i] or (tracked >> i) & 1:
                    pc = fail[pc]
                    continue
                t += track_t
                g += track_e
                if t > t_max or g + hotel * (t / per_s) > e_max:
                    ended_over = True
                    break
                tracked |= 1 << i
                ever |= 1 << i
                ntrk += 1
                pc = go[pc]
            else:
                if (tracked >> i) & 1:
                    tracked &= ~(1 << i)
                    ntrk -= 1
                ever &= ~(1 << i)
                pc = go[pc]
        utility[f] = u - penalty if ended_over else u
        time_used[f] = t / per_s
        energy_used[f] = g + hotel * (t / per_s)
        over[f] = ended_over
