"""Several main lines that branches are grown from side by side; the best one is changed and grown again.

The best plan without branches is seldom the best one with them: on 15 targets of seed 4792860 four branches
on the best of 16 lines earned 3 % more than on the line that was best without. How good a line becomes shows
after a few branches, so few lines get more (successive halving: Jamieson and Talwalkar 2016). Options that
are chosen one after the other are not the best together either (large neighbourhood search: Shaw 1998), and
growing hardly changes the targets of a main line, so these are exchanged for others: on 15 targets of seed
7243621 all lines track T15; with T3 instead, worth 0.3 % less without branches, the plan earns 1.5 % more.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import combinations

from planner.contingency.sampled.branches import TOLERANCE, Curve, Growing, better_by_branches
from planner.contingency.sampled.endings import Endings
from planner.contingency.sampled.futures import FITTED, SCANNED, Growth, Sampler
from planner.contingency.sampled.promised_options import Promises
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import simulate
from planner.plan_edits import exchanged, options_of, without_option
from planner.plan_tree import Navigate, Plan, count_branches

KEPT, PROMISING = (4, 3, 3, 2), (6, 6, 6, 6, 6, 3, 2)
"""Lines that get a first, a second, a third option and so on; and of lines that a table says to promise
much. By hand: on days of 10 targets the lines that are best in the end lead from five or six branches on; on
four days of 15 six lines and more time to begin them came to the same plans, later."""

BEGUN_BY, RACED_BY, REGROWN_BY = 0.15, 0.5, 0.8
"""Shares of the time by which the last line is begun, from which on the best is grown alone, and up to which
it is changed and grown again: the rest is for options that many futures tell. By hand."""

TRIES, TAKEN_OUT = 16, (2, 3, 4)
"""How often options are taken out of the best plan and grown again at most, and how many of them. By hand: on
10 targets of seed 5349984 eight tries with two to five won 0.4 %, sixteen more 0.03 %."""

PROMISED_BY = 0.95
"""Share of the time up to which the best plan is changed where a table of the policy says how. By hand."""

RACED = 6
"""Options up to which lines are raced where a table of the policy says how they are changed then. By hand: on
10 targets of seed 8613702 no line gained by further ones."""

NEAR = 2e-3
"""Share of its value by which a changed plan may fall behind the best one to be changed further: some changes
win only together (record-to-record travel: Dueck 1993). By hand."""

MORE, PATIENCE = 4, 2
"""How many options more than allowed a promised one is grown to, of which those that win least are taken out,
and how many promises in a row may win nothing before other changes are tried too. By hand."""

JUDGED_FROM, BEHIND = 5, 0.01
"""Branches from which a line is given up when it is behind another with as many by so much of its value. By
hand: from there on lines on 15 targets gained within 0.5 % of each other."""

FAR_BEHIND = 0.02
"""Share of its value by which a plan may fall behind when two targets take each other's place, for it to be
grown anew. By hand: on 15 targets of seed 7243621 one that was even with the plan came to 1.5 % more, one
that was 0.5 % behind to 0.3 % more, and none that was 2 % behind came near."""

CLOSER, OTHERS = 4, 101
"""How many times the usual futures further branches are fitted on, and lines are compared in, and what each
further kind of futures adds to the seed. By hand: on 15 targets of seed 758923 they won 0.28 % with two
branches more, twice as many 0.09 % with one."""

AT_RACE, AT_LAST, AT_EXCHANGES = 1001, 1002, 1003
"""Kinds of futures in which lines are compared, the best is grown further, and exchanges are valued; those of
changes are below."""


def raced(
    model: Model,
    beginnings: Iterable[Plan],
    limits: Growth,
    *,
    used: Callable[[], float] = lambda: 0.0,
    should_stop: Callable[[], bool] = lambda: False,
    told: Callable[[Plan, float], None] = lambda plan, value: None,
    kept: Sequence[int] = KEPT,
    tries: int = TRIES,
    promises: Promises | None = None,
) -> Curve:
    """Return the best plans with at most 0, 1, 2, ... branches of several lines; none without a beginning.

    All are grown on the futures that they share (`limits.seed`), so many lines to each number of branches as
    `kept` says (further ones as its last); one more is begun. With `tries` options are then taken out of the
    best plan and grown again on other futures, every second time with two targets in each other's place; what
    wins is kept. With `promises` one of them is grown in between, to some options more than allowed, of which
    those that win least are then taken out. At last the best is grown further on more futures, which tell
    what wins little; values are of yet other futures. Where time is short the first beginning is grown alone:
    `used` tells the share of it that is used up. Plans that have branches already are begun with as they are.
    """
    race = _Race(model, limits.seed + AT_RACE * OTHERS, kept, used, told)
    sampler, endings = Sampler(model, limits, should_stop), Endings(model)
    for plan in beginnings:
        if race.lines and (sampler.over() or used() > BEGUN_BY or len(race.lines) > kept[0]):
            break
        race.enter(Growing(sampler, endings, plan, race.see, least=TOLERANCE))
    going = race.lines
    for branches in range(limits.max_branches if promises is None else min(RACED, limits.max_branches)):
        going = race.kept(going, branches)
        for line in going:
            late = line is not going[0] and used() > RACED_BY  # one option may take as long as all others
            # an ending that wins under any condition replaces the rest, and is no branch more
            if line.branches <= branches and not line.ended and not late:
                line.grow()
    if going:
        max(going, key=lambda line: race.worth(line.curve[-1][1])).finish()
    curve = better_by_branches(*(line.curve for line in race.lines))
    if not tries or not curve or limits.iterations is not None:
        return curve
    curves = [curve]
    regrown = _Regrown(model, limits, endings, should_stop, promises)
    plan = best = curve[-1][1]
    for _ in range(tries):
        if sampler.over() or used() > (REGROWN_BY if promises is None else PROMISED_BY):
            break
        curve = regrown.next(plan, best)
        curves.append(curve)
        plan = best = race.best_of(curves)[-1][1]
        if promises is not None and curve and race.worth(curve[-1][1]) >= (1.0 - NEAR) * race.worth(best):
            plan = curve[-1][1]
    if count_branches(best) < limits.max_branches and not sampler.over():
        last = replace(limits, seed=limits.seed + AT_LAST * OTHERS)
        closer = Sampler(model, last, should_stop, fitted=CLOSER * FITTED)
        curves.append(Growing(closer, endings, best).finish())
    found = race.best_of(curves)
    told(found[-1][1], found[-1][0])
    return found


class _Regrown:
    """Plans that come of another one by a change, grown each time on other futures."""

    def __init__(
        self,
        model: Model,
        limits: Growth,
        endings: Endings,
        should_stop: Callable[[], bool],
        promises: Promises | None,
    ) -> None:
        self.model, self.limits, self.endings, self.should_stop = model, limits, endings, should_stop
        self.promises, self.draw = promises, random.Random(limits.seed)
        self.exchanges = _Exchanges(model, limits.seed + AT_EXCHANGES * OTHERS, should_stop)
        self.tries = self.others = self.in_vain = 0
        self.best: Plan = ()

    def next(self, plan: Plan, best: Plan) -> Curve:
        """Return plans that come of a plan by the next change; none where nothing can be changed.

        Options that the optimal policy promises much of come first. When some in a row have won nothing,
        every second change is another one: two targets exchanged, or some options taken out, in turn.
        """
        self.tries += 1
        self.in_vain = self.in_vain + 1 if best == self.best else 0
        self.best = best
        if self.promises is not None and (self.in_vain < PATIENCE or self.in_vain % 2):
            made = self.promises.next(plan)
            if made is not None:
                return self._grown(made, MORE)
        self.others += 1
        other = self.exchanges.best(plan) if self.others % 2 else None
        if other is None and count_branches(plan) < TAKEN_OUT[0]:
            return []
        return self._grown(_without_some(plan if other is None else other, self.draw), 0)

    def _grown(self, begun: Plan, more: int) -> Curve:
        """Return the best plans with few enough options, of those grown to some more."""
        most = self.limits.max_branches
        seed = self.limits.seed + self.tries * OTHERS
        limits = replace(self.limits, seed=seed, max_branches=most + more)
        sampler = Sampler(self.model, limits, self.should_stop)
        curve = Growing(sampler, self.endings, begun, least=TOLERANCE).finish()
        few, last = curve[: most + 1], curve[-1][1]
        if count_branches(last) <= most:
            return few

        def worth(plan: Plan) -> float:
            return _earned(self.model, plan, FITTED, limits.seed)

        while count_branches(last) > most and not sampler.over():
            last = max((without_option(last, path) for path, _ in options_of(last)), key=worth)
        if count_branches(last) > most:
            return few
        return better_by_branches(few, [*few[:-1], (worth(last), last)])


def _earned(model: Model, plan: Plan, futures: int, seed: int) -> float:
    return simulate(model, plan, futures, seed=seed).estimate().mean


def _without_some(plan: Plan, draw: random.Random) -> Plan:
    """Return a plan without some of its options, those counted that others hold."""
    left = max(0, count_branches(plan) - draw.choice(TAKEN_OUT))
    while count_branches(plan) > left:
        fewer = (without_option(plan, path) for path, _ in options_of(plan))
        plan = draw.choice([made for made in fewer if count_branches(made) >= left])
    return plan


class _Exchanges:
    """Plans with two targets in each other's place, one of which the main line drives to; each once."""

    def __init__(self, model: Model, seed: int, over: Callable[[], bool]) -> None:
        self.model, self.seed, self.over = model, seed, over
        self.tried: set[Plan] = set()

    def best(self, plan: Plan) -> Plan | None:
        """Return the one that is worth most as it is; None where all are far behind the plan."""
        driven = {step.to for step in plan if isinstance(step, Navigate)}
        best, most = None, (1.0 - FAR_BEHIND) * self._worth(plan)
        for one, other in combinations(self.model.target_ids, 2):
            if self.over():
                return None
            if not driven & {one, other}:
                continue
            found = exchanged(self.model, plan, one, other)
            if found is None or found in self.tried:
                continue
            worth = self._worth(found)
            if worth > most:
                best, most = found, worth
        if best is not None:
            self.tried.add(best)
        return best

    def _worth(self, plan: Plan) -> float:
        return _earned(self.model, plan, SCANNED, self.seed)


class _Race:
    """The lines of a race; `told` hears of plans that are better than all before.

    Lines are compared in futures that none was fitted on: they differ by the luck of their tracks.
    """

    def __init__(
        self,
        model: Model,
        seed: int,
        counts: Sequence[int],
        used: Callable[[], float],
        told: Callable[[Plan, float], None],
    ) -> None:
        self.model, self.seed, self.counts, self.used, self.told = model, seed, counts, used, told
        self.lines: list[Growing] = []
        self.most = 0.0
        self._known: dict[Plan, float] = {}

    def worth(self, plan: Plan) -> float:
        """Return what a plan earns in those futures."""
        if plan not in self._known:
            self._known[plan] = _earned(self.model, plan, CLOSER * FITTED, self.seed) if plan else 0.0
        return self._known[plan]

    def best_of(self, curves: list[Curve]) -> Curve:
        """Return for each number of branches the plan of the curves that is worth most."""
        return better_by_branches(*([(self.worth(plan), plan) for _, plan in curve] for curve in curves))

    def enter(self, line: Growing) -> None:
        """Take a line that no other is like: what two that differ earn in these futures is never the same."""
        value = line.curve[line.begun][0]
        if all(line.begun != other.begun or value != other.curve[line.begun][0] for other in self.lines):
            self.lines.append(line)

    def see(self, plan: Plan, value: float) -> None:
        if value > self.most:
            self.most = value
            self.told(plan, value)

    def kept(self, lines: list[Growing], branches: int) -> list[Growing]:
        """Return the lines that go on to one branch more than so many, the best first where some are given
        up; those that were begun with more wait.
        """
        count = self.counts[min(branches, len(self.counts) - 1)] if self.used() < RACED_BY else 1
        if len(lines) == 1 or (branches < JUDGED_FROM and len(lines) <= count):
            return lines
        waiting = [line for line in lines if line.begun > branches]
        worth = {line: self.worth(line.best(branches)) for line in lines if line.begun <= branches}
        ranked = sorted(worth, key=lambda line: -worth[line])
        if branches >= JUDGED_FROM and ranked:
            least = worth[ranked[0]] - BEHIND * abs(worth[ranked[0]])
            ranked = [line for line in ranked if worth[line] >= least]
        return [*ranked[:count], *waiting]
