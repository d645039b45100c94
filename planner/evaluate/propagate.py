"""Backward and forward propagation of a plan over a grid.

Backward gives the value of the rest of the plan at every program row as a function of time, energy, place,
what is done and what is tracked; forward gives the distribution with which a row is met. The two are
adjoint: their product at any row that every future passes is the value of the plan.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from planner.evaluate.grid import Grid
from planner.evaluate.model import Model
from planner.evaluate.program import Op, Program, compile_plan
from planner.plan_tree import Plan
from planner.tally import Step, spend

COARSE = (61, 37)
"""Nodes in time and drive energy of the coarser grid of the evaluator. By hand."""

FINE = (91, 55)
"""Nodes of the finer one, 1.5 times as fine: the error of second order is extrapolated from both."""


class State(NamedTuple):
    """Where the rover is, which observations are done, which targets are tracked, and to which places no
    drive leads any more as one failed (as bits).
    """

    place: int
    done: int
    tracked: int
    closed: int = 0


ORIGIN = State(0, 0, 0)


def loss_outcomes(model: Model, a: int, b: int, tracked: int) -> list[tuple[float, int]]:
    """Return (chance, targets still tracked) after the leg a -> b; chances sum to one.

    Do not write to it: it is kept for the next time.
    """
    known = model.losses_known.get((a, b, tracked))
    if known is None:
        known = model.losses_known[a, b, tracked] = _loss_outcomes(model, a, b, tracked)
    return known


def _loss_outcomes(model: Model, a: int, b: int, tracked: int) -> list[tuple[float, int]]:
    outcomes = [(1.0, tracked)]
    rest = tracked
    while rest:
        bit = rest & -rest
        rest ^= bit
        p = float(model.loss[a, b, bit.bit_length() - 1])
        if p <= 0.0:
            continue
        kept = [(q * (1.0 - p), s) for q, s in outcomes] if p < 1.0 else []
        outcomes = kept + [(q * p, s & ~bit) for q, s in outcomes]
    return outcomes


def drive_outcomes(model: Model, state: State, to: int) -> list[tuple[float, State]]:
    """Return (chance, state) after a drive to a place; chances sum to one. One that failed is back."""
    a, p_fail = state.place, float(model.fail[state.place, to])
    outcomes: list[tuple[float, State]] = []
    for p, tracked in loss_outcomes(model, a, to, state.tracked):
        if p_fail < 1.0:
            outcomes.append(((1.0 - p_fail) * p, State(to, state.done, tracked, state.closed)))
        if p_fail > 0.0:
            outcomes.append((p_fail * p, State(a, state.done, tracked, state.closed | 1 << to)))
    return outcomes


def drives_ahead(program: Program) -> list[int]:
    """Return, for each row, the places (bits) to which some row that may follow, or itself, drives."""
    ahead = [0]
    for op, arg, _, go, fail in program.rows[1:]:
        own = 1 << arg if op == Op.NAVIGATE else 0
        ahead.append(own | ahead[go] | ahead[fail])  # every row comes after its successors
    return ahead


def done_read_ahead(model: Model, program: Program) -> list[int]:
    """Return, for each row, the observations (bits) of which it or some row that may follow asks whether they
    are done; the columns say what the rules ask.
    """
    ahead = [0]
    for op, arg, _, go, fail in program.rows[1:]:
        own = 0
        if op in (Op.OBSERVE, Op.IF_DONE):
            own = 1 << arg
        if op == Op.OBSERVE:
            place = int(model.obs_place[arg])
            own |= int(model.predecessors[arg])
            own |= int(model.target_bits[place]) if model.diminishing[place] != 1.0 else 0
            own |= int(model.place_bits[place]) if model.is_place[arg] else 0
        ahead.append(own | ahead[go] | ahead[fail])  # every row comes after its successors
    return ahead


def can_drive(model: Model, state: State, to: int) -> bool:
    """Return whether a drive to another place may begin."""
    return bool(model.has_leg[state.place, to]) and not state.closed >> to & 1


def after_done(model: Model, state: State, m: int) -> State:
    """Return the state after observation m: its target is no longer tracked once nothing is left to place
    there.
    """
    done = state.done | (1 << m)
    place = int(model.obs_place[m])
    tracked = state.tracked
    if model.is_place[m] and not int(model.place_bits[place]) & ~done:
        tracked &= ~(1 << place)
    return State(state.place, done, tracked, state.closed)


def can_observe(model: Model, state: State, m: int) -> bool:
    """Return whether an observation can be carried out in a state, its window aside."""
    place = int(model.obs_place[m])
    if state.place != place or (state.done >> m) & 1:
        return False
    tracked = bool((state.tracked >> place) & 1)
    return all(rule.feasible(model, m, state.done, tracked) for rule in model.gates)


@dataclass(frozen=True, slots=True)
class Beginning:
    """Where the point mass at the start is when the first random action, a branch or the end is met."""

    row: int
    state: State
    t_s: float
    g_j: float
    over: bool = False


def run_in(
    model: Model, program: Program, row: int, t_s: float = 0.0, g_j: float = 0.0, state: State = ORIGIN
) -> Beginning:
    """Follow the deterministic beginning of a plan (start of tracking, tests on known amounts) exactly."""
    while True:
        op, arg = int(program.op[row]), int(program.arg[row])
        go, fail = int(program.go[row]), int(program.fail[row])
        if op == Op.TRACK_START:
            if state.place != 0 or not model.trackable[arg] or (state.tracked >> arg) & 1:
                row = fail
                continue
            t_s += model.track_t_s
            g_j += model.track_e_j
            if t_s > model.t_max_s or g_j + model.hotel_w * t_s > model.e_max_j:
                return Beginning(row, state, t_s, g_j, over=True)
            state = state._replace(tracked=state.tracked | (1 << arg))
            row = go
        elif op == Op.IF_TIME:
            row = go if t_s >= program.value[row] else fail
        elif op == Op.IF_ENERGY:
            row = go if g_j + model.hotel_w * t_s >= program.value[row] else fail
        elif op in (Op.END, Op.NAVIGATE, Op.OBSERVE):
            return Beginning(row, state, t_s, g_j)
        else:
            row, state = step_without_time(model, program, row, state)


def step_without_time(model: Model, program: Program, row: int, state: State) -> tuple[int, State]:
    """Carry out a row that takes no time and asks for no amount: checks, tests on track or done, stop of
    tracking.
    """
    op, arg = int(program.op[row]), int(program.arg[row])
    go, fail = int(program.go[row]), int(program.fail[row])
    if op == Op.CHECK:
        return (go if not model.trackable[arg] or (state.tracked >> arg) & 1 else fail), state
    if op == Op.IF_TRACKED:
        return (go if (state.tracked >> arg) & 1 else fail), state
    if op == Op.IF_DONE:
        return (go if (state.done >> arg) & 1 else fail), state
    return go, state._replace(tracked=state.tracked & ~(1 << arg))


class TailValues:
    """Values of the ends of programs over one grid, shared by all programs that end alike.

    Rows are numbered by what they do and by the numbers of the rows that follow, so plans that differ in one
    place share everything after it. Once `limit_mb` are held, all is forgotten and computed again when asked.
    """

    def __init__(self, grid: Grid, limit_mb: float = 300.0):
        self.grid = grid
        self.known: dict[tuple[int, State], Any] = {}
        self._numbers: dict[tuple[int, int, float, int, int], int] = {}
        self._limit = max(1, int(limit_mb * 1e6 / (grid.nt * grid.ng * grid.dtype.itemsize)))

    def numbers_of(self, program: Program) -> list[int]:
        """Return the number of each row; rows of different programs with one number have the same value."""
        numbers = [0]
        for op, arg, value, go, fail in program.rows[1:]:  # every row comes after its successors
            key = (op, arg, value, numbers[go], numbers[fail])
            numbers.append(self._numbers.setdefault(key, len(self._numbers) + 1))
        return numbers

    def keep(self, number: int, state: State, value: Any) -> None:
        if len(self.known) >= self._limit:
            self.known.clear()
        self.known[number, state] = value


class Backward:
    """Value of the rest of a plan, per program row and state, as arrays over the grid; computed when asked
    for.
    """

    def __init__(self, grid: Grid, program: Program, tails: TailValues | None = None):
        self.grid, self.program, self.model = grid, program, grid.model
        self._zero = np.zeros(grid.shape, grid.dtype)
        self._tails = tails or TailValues(grid)
        spend(Step.ROW, len(program))
        self._numbers = self._tails.numbers_of(program)
        self._ahead = drives_ahead(program) if self.model.fail.any() else []
        self._read = done_read_ahead(self.model, program)

    def value(self, row: int, state: State) -> Any:
        """Return the expected utility still to come at a row, shape (nt, ng); do not write to it."""
        if row == 0:
            return self._zero
        place, done, tracked, closed = state
        if done & ~self._read[row] or closed:
            closed = closed and closed & self._ahead[row]
            state = State(place, done & self._read[row], tracked, closed)
        number = self._numbers[row]
        known = self._tails.known.get((number, state))
        if known is None:
            known = self._compute(row, state)
            self._tails.keep(number, state, known)
        return known

    def _compute(self, row: int, state: State) -> Any:
        program, model, grid = self.program, self.model, self.grid
        op, arg, value, go, fail = program.rows[row]
        spend(Step.ROW, 2)
        if op == Op.NAVIGATE:
            if state.place == arg:
                return self.value(go, state)
            if not can_drive(model, state, arg):
                return self.value(fail, state)
            outcomes = drive_outcomes(model, state, arg)
            grid.count_ways(len(outcomes))
            p, then = outcomes[0]
            after = p * self.value(go if then.place == arg else fail, then)
            part = np.empty_like(after)
            for p, then in outcomes[1:]:
                after += np.multiply(p, self.value(go if then.place == arg else fail, then), out=part)
            return grid.before_leg(state.place, arg, state.tracked.bit_count(), after)
        if op == Op.OBSERVE:
            if not can_observe(model, state, arg):
                return self.value(fail, state)
            made = grid.before_observation(
                arg,
                self.value(go, after_done(model, state, arg)),
                model.expected_utility_of(arg, state.done),
            )
            closes = float(model.window[arg, 1])
            if closes < model.t_max_s:
                share = grid.open_until(closes)
                made = share * made + (1.0 - share) * self.value(fail, state)
            return made
        if op in (Op.IF_TIME, Op.IF_ENERGY):
            spend(Step.ROW, 2)
            spend(Step.PASS, 4 * grid.nt * grid.ng)
        if op == Op.IF_TIME:
            share = grid.at_least_time(value)
            return share * self.value(go, state) + (1.0 - share) * self.value(fail, state)
        if op == Op.IF_ENERGY:
            share = grid.at_least_energy(value)
            return share * self.value(go, state) + (1.0 - share) * self.value(fail, state)
        if op == Op.TRACK_START:
            return self.value(fail, state)  # reached away from the deterministic beginning only when it fails
        return self.value(*step_without_time(model, program, row, state))

    def total(self, begin: Beginning | None = None) -> float:
        """Return the value of the whole plan."""
        begin = begin or run_in(self.model, self.program, self.program.entry)
        if begin.over:
            return -self.model.penalty
        return self.grid.at(self.value(begin.row, begin.state), begin.t_s, begin.g_j)


Flow = dict[int, dict[State, Any]]
"""Mass with which each program row is met, per state, over the grid."""


def forward(grid: Grid, program: Program, begin: Beginning | None = None) -> Flow:
    """Return the mass at every program row (the end included), from the plan's beginning or a given one."""
    begin = begin or run_in(grid.model, program, program.entry)
    if begin.over:
        return {}
    return forward_from(grid, program, begin.row, {begin.state: grid.point(begin.t_s, begin.g_j)})


def forward_from(grid: Grid, program: Program, row: int, masses: dict[State, Any]) -> Flow:
    """Return the mass at every row when the given masses meet `row`."""
    model = grid.model
    flow: Flow = {row: dict(masses)}
    ahead = drives_ahead(program) if model.fail.any() else []

    def add(target: int, state: State, mass: Any) -> None:
        states = flow.setdefault(target, {})
        states[state] = states[state] + mass if state in states else mass

    for here in range(row, 0, -1):  # every row comes after its successors
        states = flow.get(here)
        if not states:
            continue
        op, arg, value, go, fail = program.rows[here]
        spend(Step.ROW, len(states))
        for state, mass in states.items():
            if op == Op.NAVIGATE:
                if state.place == arg:
                    add(go, state, mass)
                elif not can_drive(model, state, arg):
                    add(fail, state, mass)
                else:
                    arrived = grid.after_leg(state.place, arg, state.tracked.bit_count(), mass)
                    if state.closed:  # of places no longer driven to the last one that failed is known alone
                        state = state._replace(closed=state.closed & ahead[here])
                    outcomes = drive_outcomes(model, state, arg)
                    grid.count_ways(len(outcomes))
                    for p, then in outcomes:
                        add(go if then.place == arg else fail, then, p * arrived)
            elif op == Op.OBSERVE:
                if not can_observe(model, state, arg):
                    add(fail, state, mass)
                    continue
                closes = float(model.window[arg, 1])
                if closes < model.t_max_s:
                    share = grid.open_until(closes)
                    add(fail, state, (1.0 - share) * mass)
                    mass = share * mass
                add(go, after_done(model, state, arg), grid.after_observation(arg, mass))
            elif op in (Op.IF_TIME, Op.IF_ENERGY):
                spend(Step.PASS, 4 * grid.nt * grid.ng)
                share = grid.at_least_time(value) if op == Op.IF_TIME else grid.at_least_energy(value)
                add(go, state, share * mass)
                add(fail, state, (1.0 - share) * mass)
            elif op == Op.TRACK_START:
                add(fail, state, mass)
            else:
                target, after = step_without_time(model, program, here, state)
                add(target, after, mass)
    return flow


@dataclass(frozen=True, slots=True)
class GridValue:
    """Value of a plan by grids; `error` is an estimate of what is left after the extrapolation."""

    value: float
    coarse: float
    fine: float

    @property
    def error(self) -> float:
        return abs(self.fine - self.coarse) / 4.0


class Evaluator:
    """Grids of one model, kept between plans.

    A plan does not know the kind of sol, so where that is hidden its value is the mean over the kinds of its
    values where they are known: exact, since its conditions read time and energy, which tell what they tell.
    """

    def __init__(self, model: Model, coarse: tuple[int, int] = COARSE, fine: tuple[int, int] = FINE):
        self.model = model
        self.kinds = (
            [(chance, Evaluator(known, coarse, fine)) for chance, known in model.by_kind]
            if len(model.sols.chance)
            else []
        )
        if self.kinds:
            return
        self.ratio = (fine[0] - 1) / (coarse[0] - 1)
        degenerate = model.t_max_s <= 0.0 or model.e_max_j <= 0.0
        self.grids = () if degenerate else (Grid(model, *coarse), Grid(model, *fine))

    def value(self, plan: Plan | Program) -> GridValue:
        """Return the expected utility of a plan without sampling."""
        program = plan if isinstance(plan, Program) else compile_plan(self.model, plan)
        if self.kinds:
            values = [(chance, one.value(program)) for chance, one in self.kinds]
            return GridValue(
                sum(chance * found.value for chance, found in values),
                sum(chance * found.coarse for chance, found in values),
                sum(chance * found.fine for chance, found in values),
            )
        begin = run_in(self.model, program, program.entry)
        if begin.over:
            return GridValue(-self.model.penalty, -self.model.penalty, -self.model.penalty)
        if begin.row == 0 or not self.grids:
            return GridValue(0.0, 0.0, 0.0)
        coarse, fine = (Backward(g, program).total(begin) for g in self.grids)
        return GridValue(fine + (fine - coarse) / (self.ratio**2 - 1.0), coarse, fine)
