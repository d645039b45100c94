"""The optimal closed-loop policy by dynamic programming, and rigorous bounds on what any policy can earn.

State: place, what can still be gained (live observations: not done, its target tracked where that is
needed, its predecessors done or live), elapsed time and drive energy. One backward pass over the subsets of
live observations in order of size; each drive and each observation is two small matrix products. With
consumption rounded down to the grid the result bounds every policy from above (value falls in both
resources, since a rover can always wait); rounded up it is earned by a real policy; with the mean kept it
is an estimate good to about 0.1 %.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
from numba import njit

from planner.evaluate.grid import Grid
from planner.evaluate.model import Model
from planner.evaluate.propagate import State
from planner.tally import SECONDS, Step, spend

MAX_STATES = 40_000
"""Largest number of live sets for which a table is made."""


MOST_ROUNDS = 60
"""Drives in a row without an observation that a table of `Moves.ALL` follows; each takes time, so values that
still rise after so many are a table given up. By hand: three to five rounds are usual."""


class Moves(StrEnum):
    """Which policies a table is made of.

    `TO_WORK` drives only from where nothing is left to do, and only to where something is. `ONE_STAY` also
    makes all it wants of a target in one stay. `ALL` leaves nothing out: it goes through places, waits for
    the light elsewhere and comes back.
    """

    TO_WORK = "to work"
    ONE_STAY = "one stay"
    ALL = "all"


class TooLargeError(Exception):
    """The problem has more live sets than a table may hold."""


@dataclass(frozen=True, slots=True)
class Live:
    """What can still be gained: live observations, and what is done that bears on their worth or room (bits).

    Of what is done, the observations of targets of fading value count, and, while what is live may exceed the
    downlink volume that is left, all that used some of it.
    """

    bits: int
    memory: int = 0


class LiveSets:
    """The live sets of a model and the moves between them."""

    def __init__(self, model: Model, candidates: int):
        self.model = model
        self.candidates = candidates
        self.dependents = [0] * model.m
        for m in range(model.m):
            before = int(model.predecessors[m])
            for k in range(model.m):
                if (before >> k) & 1:
                    self.dependents[k] |= 1 << m
        self.fading = 0
        for place in range(1, model.n + 1):
            if model.diminishing[place] != 1.0 and int(model.target_bits[place]).bit_count() > 1:
                self.fading |= int(model.target_bits[place])
        self.voluminous = 0
        if not model.admits(candidates):
            for rule in model.limits:
                self.voluminous |= 0 if rule.admits(model, candidates) else rule.counted(model) & candidates
        self.remembered = self.fading | self.voluminous

    def without(self, live: Live, bits: int) -> Live:
        """Return what is left when observations are given up undone, and with them all that depends on
        them.
        """
        return self.normal(self._remaining(live.bits, bits), live.memory)

    def _remaining(self, live: int, bits: int) -> int:
        left = live & ~bits
        queue = bits & live
        while queue:
            low = queue & -queue
            queue ^= low
            fall = self.dependents[low.bit_length() - 1] & left
            left &= ~fall
            queue |= fall
        return left

    def after(self, live: Live, m: int) -> Live:
        """Return what is left after observation m."""
        return self.normal(live.bits & ~(1 << m), live.memory | ((1 << m) & self.remembered))

    def normal(self, bits: int, memory: int) -> Live:
        if not memory:
            return Live(bits)
        kept = 0
        if memory & self.voluminous:
            too_large = sum(
                1 << m
                for m in range(self.model.m)
                if (bits >> m) & 1 and not self.model.admits(memory & self.voluminous | (1 << m))
            )
            bits = self._remaining(bits, too_large)
            if not self.model.admits(memory & self.voluminous | bits):
                kept = memory & self.voluminous
        for place in range(1, self.model.n + 1):
            target = int(self.model.target_bits[place]) & self.fading
            if target & memory and target & bits:
                kept |= target & memory
        return Live(bits, kept)

    def open(self, live: Live, m: int) -> bool:
        """Return whether an observation is live and waits for no other."""
        return bool((live.bits >> m) & 1) and not int(self.model.predecessors[m]) & live.bits

    def of(self, state: State) -> Live:
        """Return what can still be gained in a state of the evaluator, among the candidates."""
        model = self.model
        bits = self.candidates & ~state.done
        for place in range(1, model.n + 1) if state.closed else ():
            if state.closed >> place & 1 and place != state.place:
                bits &= ~int(model.target_bits[place])
        for m in range(model.m):
            if not model.admits(1 << m):
                bits &= ~(1 << m)
            if (bits >> m) & 1 and model.is_place[m] and not (state.tracked >> int(model.obs_place[m])) & 1:
                bits &= ~(1 << m)
        changed = True
        while changed:
            changed = False
            for m in range(model.m):
                missing = int(model.predecessors[m]) & ~state.done & ~bits
                if (bits >> m) & 1 and missing:
                    bits &= ~(1 << m)
                    changed = True
        return self.normal(bits, state.done & self.remembered)

    def images(self) -> int:
        return sum(1 << m for m in range(self.model.m) if not self.model.is_place[m]) & self.candidates

    def initial(self, tracked: int) -> Live:
        """Return what can be gained from the start when these targets (bits of places) are tracked."""
        return self.of(State(0, 0, tracked))

    def all_from(self, starts: list[Live]) -> list[Live]:
        """Return every live set that can be reached, those with fewer observations first."""
        seen = set(starts)
        queue = list(seen)
        while queue:
            live = queue.pop()
            spend(Step.SET)
            steps = []
            for m in range(self.model.m):
                if (live.bits >> m) & 1:
                    if self.open(live, m):
                        steps.append(self.after(live, m))
                    if not self.model.is_place[m]:
                        steps.append(self.without(live, 1 << m))
            for place in range(1, self.model.n + 1):
                placed = int(self.model.place_bits[place]) & live.bits
                if placed:
                    steps.append(self.without(live, placed))
                    if placed & (placed - 1):
                        steps += [
                            self.without(live, 1 << m) for m in range(self.model.m) if (placed >> m) & 1
                        ]
            for step in steps:
                if step not in seen:
                    seen.add(step)
                    queue.append(step)
                    if len(seen) > MAX_STATES:
                        raise TooLargeError(f"more than {MAX_STATES} live sets")
        return sorted(seen, key=lambda s: (s.bits.bit_count(), s.bits, s.memory))

    def once_from(self, starts: list[Live]) -> tuple[list[Live], dict[Live, set[int]]]:
        """Return the live sets of policies that make all they want of a target in one stay there.

        The second part holds, for sets that occur during a stay only, the places where.
        """
        clean = set(starts)
        during: dict[Live, set[int]] = {}
        queue: list[tuple[Live, int]] = [(live, 0) for live in clean]
        while queue:
            live, stay = queue.pop()
            spend(Step.SET)
            steps: list[tuple[Live, int]] = []
            for place in range(1, self.model.n + 1) if stay == 0 else (stay,):
                here = int(self.model.target_bits[place]) & live.bits
                if not here:
                    continue
                steps.append((self.without(live, here), 0))
                placed = int(self.model.place_bits[place]) & here
                if placed and stay == 0:
                    steps.append((self.without(live, placed), 0))
                for m in range(self.model.m):
                    if (here >> m) & 1 and self.open(live, m):
                        after = self.after(live, m)
                        staying = int(self.model.target_bits[place]) & after.bits
                        steps.append((after, place if staying else 0))
            for step, place in steps:
                if step in clean:
                    continue
                if place == 0:
                    clean.add(step)
                    during.pop(step, None)
                elif place in during.get(step, ()):
                    continue
                else:
                    during.setdefault(step, set()).add(place)
                queue.append((step, place))
                if len(clean) + len(during) > MAX_STATES:
                    raise TooLargeError(f"more than {MAX_STATES} live sets")
        every = sorted([*clean, *during], key=lambda s: (s.bits.bit_count(), s.bits, s.memory))
        return every, during


@njit(cache=True, nogil=True)
def _raised(table: Any, places: Any, s: int, values: Any) -> Any:
    """Let values [k, nt, ng] compete at places [k] for those of live set s in a table [places, sets, nt, ng];
    return for each whether it won at some node, [k].
    """
    won = np.zeros(len(places), np.bool_)
    for k in range(len(places)):
        for i in range(values.shape[1]):
            for j in range(values.shape[2]):
                if values[k, i, j] > table[places[k], s, i, j]:
                    table[places[k], s, i, j] = values[k, i, j]
                    won[k] = True
    return won


class Policy:
    """Table of the optimal value V[place][live set] over one grid."""

    def __init__(
        self,
        grid: Grid,
        *,
        candidates: int | None = None,
        moves: Moves = Moves.TO_WORK,
        should_stop: Callable[[], bool] = lambda: False,
    ):
        """Make the table.

        `candidates` are the observations to be considered (bits, default all). Only a table of `Moves.ALL`
        bounds every policy; the others are filled in a part of the time. A stop leaves `complete` False.
        """
        model = grid.model
        self.grid, self.model, self.moves = grid, model, moves
        self.sets = LiveSets(model, (1 << model.m) - 1 if candidates is None else candidates)
        trackable = [
            place for place in range(1, model.n + 1) if int(model.place_bits[place]) & self.sets.candidates
        ]
        if len(trackable) > 16:
            raise TooLargeError(f"{len(trackable)} targets to track")
        self.trackings = [
            sum(1 << trackable[k] for k in range(len(trackable)) if (choice >> k) & 1)
            for choice in range(1 << len(trackable))
        ]
        starts = {tracked: self.sets.initial(tracked) for tracked in self.trackings}
        ordered = sorted(set(starts.values()), key=lambda s: (s.bits, s.memory))
        self.during: dict[Live, set[int]] = {}
        if moves is Moves.ONE_STAY:
            self.lives, self.during = self.sets.once_from(ordered)
        else:
            self.lives = self.sets.all_from(ordered)
        self.index = {live: k for k, live in enumerate(self.lives)}
        self.starts = {tracked: self.index[live] for tracked, live in starts.items()}
        self._drives: dict[tuple[int, int, int], Any] = {}
        self._chances: dict[tuple[int, tuple[int, ...], tuple[int, ...]], Any] = {}
        self._indices: dict[State, int | None] = {}
        self._actions: dict[tuple[int, int], tuple[tuple[int, ...], Any]] = {}
        self.table = np.zeros((model.n + 1, len(self.lives), grid.nt, grid.ng), grid.dtype)
        self.complete = self._fill(set(self.starts.values()), should_stop)

    def _worth(self, live: Live, m: int) -> float:
        return self.model.expected_utility_of(m, live.memory)

    def observation(self, live: Live, m: int, after: Any, rest: Any) -> Any:
        """Return the value of carrying out observation m now; where its window is over, of giving it up: the
        `rest`. In the cell where the window ends, it is over in a share of the days.
        """
        value = self.grid.before_observation(m, after, self._worth(live, m))
        closes = float(self.model.window[m, 1])
        if closes < self.model.t_max_s:
            share = self.grid.open_until(closes).astype(self.grid.dtype)
            value = share * value + (1.0 - share) * rest
        return value

    def tracked_in(self, live: Live) -> list[int]:
        return [p for p in range(1, self.model.n + 1) if int(self.model.place_bits[p]) & live.bits]

    def outcomes(self, live: Live, tracked: list[int], given_up: int = 0) -> list[int]:
        """Return, per subset of the tracked targets that is lost (bit k = k-th), what is left; observations
        may be given up besides.
        """
        out = []
        for lost in range(1 << len(tracked)):
            bits = given_up
            for k, place in enumerate(tracked):
                if (lost >> k) & 1:
                    bits |= int(self.model.place_bits[place])
            out.append(self.index[self.sets.without(live, bits)] if bits else self.index[live])
        return out

    def chances(self, origins: list[int], to: int, tracked: list[int]) -> Any:
        """Return P[origin, subset lost] for a drive to `to`."""
        chance = np.ones((len(origins), 1))
        for place in tracked:
            p = self.model.loss[origins, to, place][:, None]
            chance = np.concatenate([chance * (1.0 - p), chance * p], axis=1)
        return chance.astype(self.grid.dtype)

    def _fill(self, start_sets: set[int], should_stop: Callable[[], bool]) -> bool:
        model, table = self.model, self.table
        comes_back = bool(model.fail[0].any())
        for s, live in enumerate(self.lives):
            if should_stop():
                return False
            stays = self.during.get(live)
            if stays is not None:
                for place in stays:
                    rest = self.index[self.sets.without(live, int(model.target_bits[place]))]
                    table[place, s] = table[place, rest]
                    self._observe_here(s, live, place)
                continue
            tracked = self.tracked_in(live)
            smaller = self._smaller(live, tracked)
            if smaller:
                np.max(table[1:, smaller], axis=1, out=table[1:, s])
            here = [p for p in range(1, model.n + 1) if int(model.target_bits[p]) & live.bits]
            for place in here:
                self._observe_here(s, live, place)
            start = [0] if s in start_sets or comes_back else []
            if self.moves is Moves.ALL:
                if not self._drive_anywhere(s, live, tracked, here, [*start, *range(1, model.n + 1)]):
                    return False
                continue
            away = [*start, *(p for p in range(1, model.n + 1) if p not in here)]
            if here and away:
                self._drive(s, live, tracked, here, away)
        return True

    def _smaller(self, live: Live, tracked: list[int]) -> list[int]:
        """Return the numbers of the live sets that giving up one thing leads to."""
        model = self.model
        left = [self.sets.without(live, int(model.place_bits[place])) for place in tracked]
        for m in range(model.m):
            place = int(model.obs_place[m])
            if (live.bits >> m) & 1 and (
                not model.is_place[m] or (int(model.place_bits[place]) & live.bits).bit_count() > 1
            ):
                left.append(self.sets.without(live, 1 << m))
        if self.during:
            left += [
                self.sets.without(live, int(model.target_bits[p]))
                for p in range(1, model.n + 1)
                if int(model.target_bits[p]) & live.bits
            ]
            return [self.index[x] for x in left if x in self.index and x not in self.during]
        return [self.index[x] for x in left]

    def _observe_here(self, s: int, live: Live, place: int) -> None:
        """Let the observations that can be made at a place compete for its value."""
        table = self.table
        for m in range(self.model.m):
            if int(self.model.obs_place[m]) == place and self.sets.open(live, m):
                after = table[place, self.index[self.sets.after(live, m)]]
                value = self.observation(live, m, after, table[place, s])
                np.maximum(table[place, s], value, out=table[place, s])

    def _drive(self, s: int, live: Live, tracked: list[int], here: list[int], away: list[int]) -> None:
        """Let the drives from places where nothing is live to those where something is compete."""
        table, rows = self.table, self.outcomes(live, tracked)
        for place in here:
            origins = [a for a in away if self.model.has_leg[a, place]]
            for chosen, values in self._departures(place, origins, live, rows, tracked):
                _raised(table, np.array(chosen), s, values)

    def _drive_anywhere(
        self, s: int, live: Live, tracked: list[int], here: list[int], origins: list[int]
    ) -> bool:
        """Let all drives compete, several in a row, until none wins any more; return whether that came.

        The first drive goes to where something is live: what a place is worth else, smaller sets are worth
        there, and the drives to it stand in their values already. Not so for the start, whose smaller sets
        nobody asks for: it is tried for every place at the end.
        """
        table, rows = self.table, self.outcomes(live, tracked)
        risen = set(here)
        for _ in range(MOST_ROUNDS):
            if not risen:
                break
            following: set[int] = set()
            for place in sorted(risen):
                others = [a for a in origins if a != place and self.model.has_leg[a, place]]
                for chosen, values in self._departures(place, others, live, rows, tracked):
                    better = _raised(table, np.array(chosen), s, values)
                    following.update(a for a, rose in zip(chosen, better, strict=True) if rose and a)
            risen = following
        if origins[0] == 0:
            for place in (p for p in origins[1:] if p not in here and self.model.has_leg[0, p]):
                for chosen, values in self._departures(place, [0], live, rows, tracked):
                    _raised(table, np.array(chosen), s, values)
        return not risen or not self.grid.bounds  # only a bound needs the last digit

    def _departures(
        self, place: int, origins: list[int], live: Live, rows: list[int], tracked: list[int]
    ) -> Iterator[tuple[list[int], Any]]:
        """Yield origins, and the values of driving to a place from each of them, (origins, nt, ng)."""
        if not origins:
            return
        grid, count = self.grid, len(tracked)
        spend(Step.DRIVE)
        spend(Step.LOST, len(rows))
        spend(Step.PASS, len(rows) * grid.nt * grid.ng)
        spend(Step.CELL, len(origins) * grid.drive_s / SECONDS[Step.CELL])
        chances = self._odds(origins, place, tracked)
        yield from grid.before_legs(
            origins, place, count, self._after(place, origins, live, rows, tracked, chances)
        )

    def _odds(self, origins: list[int], to: int, tracked: list[int]) -> Any:
        """Return `chances`, kept for the next time."""
        key = (to, tuple(origins), tuple(tracked))
        chances = self._chances.get(key)
        if chances is None:
            chances = self._chances[key] = self.chances(origins, to, tracked)
        return chances

    def _after(
        self, place: int, origins: list[int], live: Live, rows: list[int], tracked: list[int], chances: Any
    ) -> Any:
        """Return the values after drives to a place, by how they may end, (origins, nt, ng).

        A drive that fails gives up what is live at the place, and the rover is back. One to a place where
        nothing is live never fails here, which is worth no less: who is as well off at the origin could have
        stayed there.
        """
        grid = self.grid
        mixed = (chances @ self.table[place][rows].reshape(len(rows), -1)).reshape(-1, *grid.shape)
        wanted = int(self.model.target_bits[place]) & live.bits
        if wanted and self.model.fail[origins, place].any():
            others = [p for p in tracked if p != place]  # its own track is worth nothing then
            left = self.outcomes(live, others, wanted)
            spend(Step.LOST, len(left))
            spend(Step.PASS, (1 + len(left)) * len(origins) * grid.nt * grid.ng)
            odds = self._odds(origins, place, others)
            for k, a in enumerate(origins):
                p = grid.dtype.type(self.model.fail[a, place])
                back = odds[k] @ self.table[a][left].reshape(len(left), -1)
                mixed[k] += p * (back.reshape(grid.shape) - mixed[k])
        return mixed

    # ------------------------------------------------------------------------------------- questions

    def value(self, state: State) -> Any:
        """Return the optimal value still to come in a state of the evaluator, over the grid."""
        index = self.index_of(state)
        if index is None:
            return np.zeros(self.grid.shape, self.grid.dtype)
        return self.table[state.place, index]

    def index_of(self, state: State) -> int | None:
        """Return the number of the live set of a state; None where the table does not reach."""
        if state not in self._indices:
            self._indices[state] = self.index.get(self.sets.of(state))
        return self._indices[state]

    def actions(self, place: int, s: int) -> tuple[tuple[int, ...], Any]:
        """Return what can be gone for next (observations) and the optimal values, (count, cells)."""
        key = (place, s)
        known = self._actions.get(key)
        if known is None:
            live, names, values = self.lives[s], [], []
            for m in range(self.model.m):
                to = int(self.model.obs_place[m])
                if not (live.bits >> m) & 1:
                    continue
                if to == place:
                    if not self.sets.open(live, m) or self.sets.after(live, m) not in self.index:
                        continue
                    values.append(self.observation_value(place, s, m))
                elif hops := self.model.hops(place, to):
                    values.append(self.drive_value(place, s, hops[0]))
                else:
                    continue
                names.append(m)
            table = np.array(values, np.float64).reshape(len(names), self.grid.nt * self.grid.ng)
            known = self._actions[key] = (tuple(names), table)
        return known

    def drive_value(self, place: int, s: int, to: int) -> Any:
        """Return the optimal value of driving to a target now; kept for the next time."""
        key = (place, s, to)
        value = self._drives.get(key)
        if value is None:
            live = self.lives[s]
            tracked = self.tracked_in(live)
            rows, chances = self.outcomes(live, tracked), self.chances([place], to, tracked)
            mixed = self._after(to, [place], live, rows, tracked, chances)[0]
            value = self._drives[key] = self.grid.before_leg(place, to, len(tracked), mixed)
        return value

    def observation_value(self, place: int, s: int, m: int) -> Any:
        """Return the optimal value of making an observation now, at its place."""
        key = (place, s, -1 - m)
        value = self._drives.get(key)
        if value is None:
            live = self.lives[s]
            after = self.table[place, self.index[self.sets.after(live, m)]]
            rest = self.index.get(self.sets.without(live, 1 << m))
            given_up = 0.0 if rest is None else self.table[place, rest]
            value = self._drives[key] = self.observation(live, m, after, given_up)
        return value

    def start_point(self, tracked: int) -> tuple[float, float]:
        """Return time, s, and energy, J, used once these targets are tracked."""
        count = tracked.bit_count()
        return count * self.model.track_t_s, count * self.model.track_e_j

    def start_values(self) -> dict[int, float]:
        """Return, per set of targets tracked from the start, the optimal value of the plan (bonus
        included).
        """
        values = {}
        for tracked, index in self.starts.items():
            t_s, g_j = self.start_point(tracked)
            if t_s > self.model.t_max_s or g_j + self.model.hotel_w * t_s > self.model.e_max_j:
                continue
            values[tracked] = self.grid.at(self.table[0, index], t_s, g_j)
        return values

    def best(self) -> float:
        """Return the optimal value of the problem; never below 0, the value of doing nothing."""
        return max(0.0, *self.start_values().values())
