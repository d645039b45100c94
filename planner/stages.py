"""The stages of planning that `solve` joins: each takes what is asked and returns values."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from planner.constraints.must_do import pressing
from planner.constraints.overrun import OverrunChance
from planner.constraints.rule import MAX_BITS
from planner.contingency.better_order import better_order
from planner.contingency.bounds import upper_bound
from planner.contingency.chance import keeps_to, plans_within
from planner.contingency.hidden_sol import searched_in_hidden_sol
from planner.contingency.order_in_futures import MOST_ENUMERATED, SCANNED, line_of
from planner.contingency.reduction import Reduction, held_by, mean_route_of, only, reduce_problem
from planner.contingency.sampled.branches import better_by_branches
from planner.contingency.sampled.futures import Growth
from planner.contingency.sampled.promised_options import Promises
from planner.contingency.sampled.raced_lines import PROMISING, raced
from planner.contingency.seeding import mean_seed, route_plan
from planner.contingency.selection import makeable, predecessors_of
from planner.evaluate.grid import Grid
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import Estimate, simulate
from planner.evaluate.program import compile_plan
from planner.evaluate.propagate import Backward, Evaluator
from planner.large_plans import Checked, checked, plan_large
from planner.notes import annotate, annotate_sampled
from planner.options import PlannerOptions
from planner.plan_choice import drop_rare, held_up, settled_value
from planner.plan_edits import fitted
from planner.plan_tree import Plan, PlanTree, TrackStart, count_branches, planned_observations
from planner.problem import Problem
from planner.progress import Watch
from planner.strategies import Found, Task
from planner.strategies.registry import Curve

GUIDED_FROM, GUIDE_SHARE, LEAST_GUIDE_S = 13, 0.08, 4.0
"""Targets from which on a relaxation is asked which of them matter, its share of the limit, and the least
that it takes. By hand: at 30 targets of seed 2539421 4 s tell the targets that 17 s tell, 2 s do not."""

LONG_SHARE = 0.5
"""Share of the limit that plans grown on sampled futures may use; the rest is mostly the bound's. By hand: of
60 s, 0.6 leaves the bound of 30 targets of seed 7906859 at 106.0, 0.5 at 103.9, and the plan is the same."""

TABLED_SHARE = 0.7
"""The same for more than `MANY_TARGETS` that a table holds, whose bound is close after a fifth of 60 s. By
hand: on 10 targets of seed 717680 it is 64.84 after 10 s, 64.72 after 25 and 64.74 after 60."""

LINES = 12
"""Main lines that are looked for beside the best ones, for plans grown on sampled futures. By hand."""

TABLE_SHARE = 0.25
"""Share of the limit that the table of the optimal policy may use: the rest is for branches. By hand."""

PART_SHARE, MOST_PART_S = 0.25, 60.0
"""Share of the limit for the search of a part beside a large table, and the limit up to which it grows.
By hand: a quarter of 20 s is the 5 s after which a part was found to be better."""

CONSTRAINED_SHARE = 0.3
"""Share of the limit for one such search under a chance constraint, which asks for several. By hand."""

SHORT_S = 0.5
"""Limit, in reckoned seconds, from which on a plan is compared with orders even when it is used up. By hand:
of few observations that takes 0.2 s, and where a search under a chance constraint had no plan in 1 s there
was one."""

LIVE_SET_S = 4e-4
"""Reckoned seconds of one live set of such a table. By hand: 3.3e-4 on a quick grid with ten targets."""

MANY_TARGETS = 8
"""Targets up to which `PlannerOptions.bound_s` is meant."""

LEFT_SHARE = 0.85
"""Share of what is left of the limit for the bound of many targets. By hand: linear programs come beside."""

WIDTH, AGAIN = 0.02, 1.5
"""Share of the bound by which a plan of many targets may lie below it; else the bound is asked for again,
where what is left of the limit is so many times what it took. By hand: the next grid takes 1.7 times more."""

LEAST_BOUND_S = 0.2
"""Seconds for a bound where the search has used up the limit: without one a plan says nothing. By hand."""

LEFT_TO_WIN = 0.005
"""Share of the optimal policy's value, on the grid of the search, by which its plan may lie below; else it is
grown further on sampled futures. By hand: ten times what `PlannerOptions.tolerance` says of that grid."""

PROMISES = 2
"""Lines that are grown then beside the plan that the search ended with, the most promising first. By hand."""

PROMISED_TRIES = 64
"""How often a plan is changed and grown again where a table of the policy says how: until time is over."""

FINER = 2
"""How many times the nodes of either axis a grid has where it blurs, for tables of few live sets."""


@dataclass(frozen=True, eq=False)
class Order:
    """What is asked of one planning; the members are those of `solve.solve`."""

    problem: Problem
    strategy: str
    search: Callable[[Task], Found]
    max_branches: int
    iterations: int | None
    seed: int
    least_taken: float
    warm: tuple[Plan, ...]
    quick: bool
    options: PlannerOptions
    watch: Watch
    plan_only: bool = False

    @property
    def must(self) -> set[str]:
        """Observations without which a plan is none."""
        return {str(o.id) for o in self.problem.observations if o.must_do}

    @property
    def affordable_live_sets(self) -> float:
        """Live sets of a table that leaves time for branches; a search that counts steps has no limit."""
        return TABLE_SHARE * self.watch.limit_s / LIVE_SET_S


@dataclass(frozen=True, eq=False)
class Chosen:
    """A plan that held up on fresh futures, with its check, and the values by number of branches, as the
    `evaluator` says them.
    """

    plan: Plan
    check: Estimate | None
    values: list[float]
    evaluator: str = "grid"

    @property
    def mean(self) -> float:
        return 0.0 if self.check is None else self.check.mean


def tell_route(order: Order) -> None:
    """Tell of the best route on mean values: a plan to look at before anything larger is worked out.

    It takes some hundredths of a second. Nothing is told where a plan has to hold to more than its budgets.
    """
    problem = order.problem
    if order.quick or order.must or OverrunChance.of(problem) is not None:
        return
    route = mean_route_of(problem, 1.0)
    if not route or len(route) > MAX_BITS:
        return
    model = Model.of(only(problem, set(route)))
    plan = route_plan(model, tuple(model.number_of[name] for name in route))
    if not model.admits_plan(plan):
        return
    if len(model.sols.chance):
        value = float(simulate(model, plan, SCANNED, seed=order.seed + 3).utility.mean())
    else:
        value = Backward(Grid(model, *order.options.quick_nodes), compile_plan(model, plan)).total()
    if value > 0.0:
        order.watch.told(plan, value)


def long_plan(order: Order) -> Checked | None:
    """Return a plan for more observations than a table holds, as it holds up on fresh futures."""
    found = plan_large(
        order.problem,
        _long_growth(order),
        most=order.max_branches,
        fresh_seed=order.seed + 1,
        first_price=_first_price(order, order.problem.utility_sum),
        warm=order.warm,
        guide_s=_guide_s(order),
        used=lambda: order.watch.work_s() / (LONG_SHARE * order.watch.limit_s),
        should_stop=lambda: order.watch.stop(0.6 if order.quick else LONG_SHARE),
        told=order.watch.told,
    )
    if found is not None:
        order.watch.told(found.plan, found.check.mean)
    return found


def _guide_s(order: Order) -> float:
    """Return how long a relaxation is asked which targets matter: not at all where there is little time."""
    several = _long_growth(order).lines > 0 and len(order.problem.targets) >= GUIDED_FROM
    seconds = GUIDE_SHARE * order.watch.limit_s
    return seconds if several and seconds >= LEAST_GUIDE_S and not order.warm else 0.0


def _long_growth(order: Order) -> Growth:
    """Return how far plans for long days are grown; under a chance constraint there are several growths."""
    one_line = order.quick or order.iterations is not None or OverrunChance.of(order.problem) is not None
    branches = 0 if order.quick else order.max_branches
    return Growth(branches, order.seed + 3, order.iterations, lines=0 if one_line else LINES)


def _first_price(order: Order, utility_sum: float) -> float:
    return order.options.first_price * max(1.0, utility_sum)


def pressed(model: Model) -> Model:
    """Return the model with what must be done worth more than everything else together."""
    return dataclasses.replace(model, utility=pressing(model.utility, model.must_do))


def searched(order: Order, model: Model, part: Reduction, *, quick: bool) -> Found:
    """Return the plans that the strategy finds, by number of branches.

    Where the kind of sol is hidden, the strategy is asked about each kind, and about their means and
    deviations; of the table of a policy nothing is then told.
    """
    if len(model.sols.chance):
        return _searched_in_hidden_sol(order, model, part, quick=quick)
    options = order.options
    grid = Grid(model, *(options.quick_nodes if quick else _search_nodes(model, part, options)))
    warm, watch = order.warm, order.watch
    task = Task(model, grid, order.max_branches, order.iterations, warm, quick, options, watch)
    return order.search(task)


def _search_nodes(model: Model, part: Reduction, options: PlannerOptions) -> tuple[int, int]:
    """Return the nodes in time and energy: fewer for a large table, more where a grid blurs certain ends.

    Three constant observations earned 8.71 of 8.96 on the usual nodes and 8.96 on finer and on coarser ones.
    """
    if part.live_sets > options.many_live_sets:
        return options.coarse_nodes
    nt, ng = options.search_nodes
    small = FINER**2 * part.live_sets <= options.many_live_sets
    return (FINER * nt, FINER * ng) if small and _blurred(model, (nt, ng)) else (nt, ng)


def _searched_in_hidden_sol(order: Order, model: Model, part: Reduction, *, quick: bool) -> Found:
    if order.strategy != "optimal":
        found = searched(order, model.mixed(), part, quick=quick)
        return dataclasses.replace(found, optimum=None)

    def ask(known: Model, alone: Watch) -> tuple[Curve, float]:
        found = searched(dataclasses.replace(order, watch=alone), known, part, quick=quick)
        return found.curve, found.done

    constrained = OverrunChance.of(order.problem) is not None
    curve, done = searched_in_hidden_sol(
        model,
        ask,
        Growth(order.max_branches, order.seed + 3, order.iterations),
        order.watch,
        share=CONSTRAINED_SHARE if constrained else 1.0,
        hasty=quick and not order.quick,
    )
    return Found(curve, done=done)


def searched_with_part(order: Order, model: Model, part: Reduction) -> Found:
    """Return the plans found, by number of branches, with those of a part where the table is large.

    A large table leaves little time and is searched on a coarse grid: on the demo mission 20 s gave 44.37
    where 5 s, with ten observations only, gave 44.55. So a part is searched first, and the better plans are
    kept: a larger limit never gives less than the part's search in its share of it.
    """
    options = order.options
    large = part.exact and part.live_sets > options.many_live_sets and not len(model.sols.chance)
    if not large or order.quick or order.must or order.iterations is not None:
        return searched(order, model, part, quick=order.quick)
    smaller = reduce_problem(order.problem, most_live_sets=0.0)
    if smaller.exact:
        return searched(order, model, part, quick=False)
    seconds = PART_SHARE * min(order.watch.limit_s, MOST_PART_S)
    hurried = dataclasses.replace(options, search_s=seconds, search_s_per_target=0.0)
    first = searched(
        dataclasses.replace(order, options=hurried),
        Model.of(smaller.problem).within_reach(),
        smaller,
        quick=False,
    )
    found = searched(order, model, part, quick=False)
    return dataclasses.replace(found, curve=better_of(model, found.curve, first.curve))


def grown_further(order: Order, model: Model, found: Found) -> Found:
    """Return the plans of a search, and where they leave much to the optimal policy, better ones.

    Those are grown from the first and from the last of them on sampled futures, and their lists are polished.
    The search changes no main line that it began with: on a day of ten targets it ended by itself with 110.7
    of the 112.6 that its last plan came to in this way. With more than `MANY_TARGETS` the last one is changed
    and grown again until the share of the limit is used up, by what the policy promises too.
    """
    watch = order.watch
    counted = order.quick or order.iterations is not None or order.strategy != "optimal"
    policy, optimum = found.policy, found.optimum
    if counted or order.must or len(model.sols.chance) or not found.curve or optimum is None:
        return found
    found = dataclasses.replace(found, policy=None)  # bounds need its memory
    if order.max_branches == 0 or found.curve[-1][0] >= (1.0 - LEFT_TO_WIN) * optimum:
        return found
    limits = Growth(order.max_branches, order.seed + 7)
    few = len(order.problem.targets) <= MANY_TARGETS
    begun = (found.curve[0][1],) if few else found.lines[:PROMISES]
    share = LONG_SHARE if few else TABLED_SHARE
    since_s, until_s = watch.work_s(), share * watch.limit_s

    def used() -> float:
        return 1.0 if until_s <= since_s else (watch.work_s() - since_s) / (until_s - since_s)

    if used() >= 1.0:
        return dataclasses.replace(found, done=found.done / 2.0)
    stopped = partial(watch.stop, share)
    promises = None if few or policy is None else Promises(policy, stopped)
    more = raced(
        model,
        filter(None, dict.fromkeys((*begun, found.curve[-1][1]))),
        limits,
        used=used,
        should_stop=stopped,
        kept=PROMISING,
        tries=0 if few else PROMISED_TRIES,
        promises=promises,
    )
    curve = better_of(model, found.curve, more)
    if curve[-1][0] > watch.best_value:
        watch.told(curve[-1][1], curve[-1][0])
    return dataclasses.replace(found, curve=curve, done=found.done * (0.5 if stopped() else 1.0))


def better_of(model: Model, *curves: Curve) -> Curve:
    """Return for each number of branches the plan of the curves that is worth most, on the fine grids."""
    evaluator = Evaluator(model)
    plans = dict.fromkeys(plan for curve in curves for _, plan in curve)
    values = {plan: evaluator.value(plan).value for plan in plans}
    return better_by_branches(*([(values[plan], plan) for _, plan in curve] for curve in curves))


def searched_within(
    order: Order, model: Model, small: Model, part: Reduction, chance: OverrunChance
) -> tuple[Found, list[float]]:
    """Return the plans that keep to the chance of an overrun, and the multipliers next to the right one.

    `model` is `small` with what must be done pressed for.
    """
    shares = [1.0]

    def find(price: float, quick: bool) -> list[Plan]:
        priced = dataclasses.replace(model, penalty=model.penalty + price)
        found = searched(order, priced, part, quick=quick)
        shares.append(found.done)
        return [plan for _, plan in found.curve]

    plans, prices = plans_within(
        find,
        lambda plan: keeps_to(small, plan, chance, seed=order.seed + 2),
        first_price=_first_price(order, float(small.utility.sum())),
        should_stop=lambda: order.watch.stop(0.55),
    )
    evaluator = Evaluator(small.within_reach())
    valued = sorted(((evaluator.value(plan).value, plan) for plan in plans), key=lambda pair: pair[0])
    curve: Curve = []
    for most in range(order.max_branches + 1):
        within = [pair for pair in valued if count_branches(pair[1]) <= most]
        curve.append(within[-1] if within else (0.0, ()))
    return Found(curve, done=min(shares)), prices


def chosen(order: Order, model: Model, curve: Curve) -> Chosen:
    """Return the plan of a curve that holds up; where something must be done, one whose main line does it."""
    found = _held_up(order, model, curve)
    if order.must and not order.must <= _main_line(found.plan):
        route = mean_seed(model, must=sum(1 << m for m in range(model.m) if model.must_do[m]))
        found = _held_up(order, model, [(0.0, route_plan(model, route))])
    return _settled(order, model, _or_order(order, model, found))


def _settled(order: Order, model: Model, found: Chosen) -> Chosen:
    """Return what was found, with its value from grids that have settled, or from its check."""
    if order.quick or order.plan_only or len(model.sols.chance) or found.check is None:
        return found
    told = settled_value(model, found.plan, found.check, order.watch.work_s)
    if told is None:
        return found
    value, evaluator = told
    return Chosen(found.plan, found.check, [*(min(v, value) for v in found.values[:-1]), value], evaluator)


def _or_order(order: Order, model: Model, found: Chosen) -> Chosen:
    """Return what was found, or an order without branches where futures say that it earns more."""
    options = order.options
    blurred = _blurred(model, options.quick_nodes if order.quick else options.search_nodes)
    asked = model.m <= MOST_ENUMERATED or order.must or blurred
    late = order.watch.limit_s < SHORT_S and order.watch.stop()
    if order.plan_only or order.strategy != "optimal" or not asked or late:
        return found
    plan = better_order(
        model,
        found.plan,
        seed=order.seed + 5,
        fits=lambda plan: model.admits_plan(plan) and _does_what_must_be(model.problem, plan),
        chance=OverrunChance.of(order.problem),
        should_stop=order.watch.stop,
    )
    if plan is None:
        return found
    count = options.quick_check_futures if order.quick else options.check_futures
    check = simulate(model, plan, count, seed=order.seed + 1).estimate()
    value, evaluator = check.mean, "monte-carlo"
    if not blurred and not len(model.sols.chance):
        value, evaluator = Evaluator(model.within_reach()).value(plan).value, "grid"
    return Chosen(plan, check, [value] * len(found.values), evaluator)


def _blurred(model: Model, nodes: tuple[int, int]) -> bool:
    """Return whether a day that makes everything scatters by less than half a cell of a grid.

    Be it in time or in energy, the grid then takes ends that are nearly certain for ones that scatter.
    """
    into = np.nan_to_num(model.leg[:, :, 1::2]).max(axis=0)[model.obs_place]
    spread = np.sqrt(np.square(into).sum(axis=0) + np.square(model.obs[:, 1::2]).sum(axis=0))
    cells = np.array([model.t_max_s, model.e_max_j]) / (np.array(nodes) - 1)
    return bool(np.any(spread < cells / 2.0))


def best_warm_plan(order: Order) -> Checked | None:
    """Return the warm plan that earns most on the whole problem; None if none is allowed there.

    A search of a part of the problem sees of warm plans only that part.
    """
    problem, chance = order.problem, OverrunChance.of(order.problem)
    models: dict[Plan, Model] = {}
    for plan in (fitted(problem, warm) for warm in order.warm):
        names = planned_observations(plan)
        if not names or len(names) > MAX_BITS or makeable(problem, names) != names:
            continue
        if not _does_what_must_be(problem, plan):
            continue
        model = Model.of(held_by(problem, plan))
        if order.least_taken > 0.0 and count_branches(plan):
            plan = drop_rare(model, plan, order.least_taken)
        if count_branches(plan) > order.max_branches or not model.admits_plan(plan):
            continue
        if chance is None or keeps_to(model, plan, chance, seed=order.seed + 2):
            models[plan] = model
    return checked(models, list(models), order.max_branches, order.seed + 1)


def _does_what_must_be(problem: Problem, plan: Plan) -> bool:
    """Return whether the main line makes all that must be done, each after what comes before it."""
    line = line_of(plan)
    before = predecessors_of(problem)
    return all(
        o.id in line and before[o.id] <= set(line[: line.index(o.id)])
        for o in problem.observations
        if o.must_do
    )


def _main_line(plan: Plan) -> set[str]:
    return set(map(str, line_of(plan)))


def _held_up(order: Order, model: Model, curve: Curve) -> Chosen:
    options = order.options
    futures = options.quick_check_futures if order.quick else options.check_futures
    hidden = bool(len(model.sols.chance))
    plan, check, values = held_up(
        model,
        curve,
        futures=min(futures, options.glance_futures) if order.plan_only else futures,
        seed=order.seed + 1,
        chance=OverrunChance.of(order.problem),
        least_taken=order.least_taken,
        hasty=order.quick,
        on_fine_grids=not (order.plan_only or hidden),
    )
    if not hidden or check is None:
        return Chosen(plan, check, values)
    # what branches win is known from the futures of the search, what the plan earns from fresh ones
    values = [check.mean - (values[-1] - value) for value in values]
    return Chosen(plan, check, values, "monte-carlo")


def bounded(order: Order, model: Model, prices: Sequence[float], lower: float = math.inf) -> float:
    """Return what no policy earns more than; under a chance constraint, no policy that keeps to it.

    Any multiplier gives a bound (`OverrunChance.bound`); the least is taken. Infinity where the plan alone is
    asked for. `lower` is what the plan is certain to earn: where it lies far below with many targets, more of
    the limit is used.
    """
    if order.plan_only:
        return math.inf
    watch, options = order.watch, order.options
    more = options.bound_s_per_target * max(0, model.n - MANY_TARGETS)
    timed = order.iterations is None  # who counts steps instead has no limit of which something is left
    more = max(0.0, min(more, LEFT_SHARE * watch.left_s() - options.bound_s)) if timed else 0.0
    seconds = options.hasty_bound_s if order.quick else options.bound_s + more
    allowed_s, before_s = min(max(LEAST_BOUND_S, watch.left_s()), seconds), watch.work_s()
    upper = _least_bound(order, model, prices, allowed_s)
    again_s = LEFT_SHARE * watch.left_s()
    wanted = timed and not order.quick and model.n > MANY_TARGETS and lower < (1.0 - WIDTH) * upper
    if wanted and again_s > AGAIN * (watch.work_s() - before_s):
        upper = min(upper, _least_bound(order, model, prices, again_s))
    return upper


def _least_bound(order: Order, model: Model, prices: Sequence[float], limit_s: float) -> float:
    chance = OverrunChance.of(order.problem) or OverrunChance(0.0)
    return min(
        chance.bound(
            upper_bound(
                dataclasses.replace(model, penalty=model.penalty + price),
                limit_s=limit_s / len(prices),
            ).value,
            price,
        )
        for price in prices
    )


def annotated(order: Order, model: Model, tree: PlanTree) -> PlanTree:
    """Return the tree with notes on its steps and options, without them where the plan alone is asked for."""
    if order.plan_only:
        return tree
    tracks = sum(isinstance(step, TrackStart) for step in tree.plan)
    if tracks > order.options.most_noted_tracks or len(model.sols.chance):
        return annotate_sampled(model, tree, seed=order.seed + 4)
    model = model.within_reach()
    return annotate(model, Grid(model, *order.options.notes_nodes), tree)
