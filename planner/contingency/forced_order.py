"""Good orders that attempt one observation, at whatever cost: a local search on a grid.

A beam that is led by what the optimal policy earns follows ways on which the observation is worth making. One
that nobody would make is often best made on another: after a single other one, or in an order turned round.
"""

from __future__ import annotations

from collections.abc import Iterable

from planner.contingency.order_in_futures import Order, changed
from planner.contingency.seeding import route_plan
from planner.evaluate.grid import Grid
from planner.evaluate.model import Model
from planner.evaluate.program import compile_plan
from planner.evaluate.propagate import Backward

VALUED, MANY, VALUED_OF_MANY = 240, 7, 80
"""Orders that are valued in all: a tenth of a second of processor time with five observations. From `MANY`
on each takes longer, and no question of 29 with eight had an order better by 0.1 % after the first 80.
"""


KEPT = 16
"""Orders that are returned: coarse grids are off by up to 6 %, and a fine one values an order in some ms."""


def forced_orders(model: Model, grid: Grid, begin: Iterable[Order], forced: int) -> list[Order]:
    """Return the best orders found that hold the observation `forced`, best first; none where none can.

    `begin` are orders to begin from, by number; those without it do not count. Orders of it alone and with
    one other are tried beside them.
    """
    values: dict[Order, float] = {}
    most = VALUED if model.m < MANY else VALUED_OF_MANY

    def value(order: Order) -> float:
        if order not in values:
            values[order] = Backward(grid, compile_plan(model, route_plan(model, order))).total()
        return values[order]

    pairs = [(forced,), *(o for m in range(model.m) for o in ((m, forced), (forced, m)) if m != forced)]
    starts = [
        order for order in dict.fromkeys((*begin, *pairs)) if forced in order and may_be_made(model, order)
    ]
    for order in sorted(starts, key=lambda o: -value(o)):
        better: Order | None = order
        while better is not None and len(values) < most:
            here, better = better, None
            for new in changed(model, here):
                if len(values) >= most:
                    break
                if (
                    forced in new
                    and new not in values
                    and may_be_made(model, new)
                    and value(new) > values[here]
                ):
                    better = new
                    break
    return sorted(values, key=lambda order: -values[order])[:KEPT]


def may_be_made(model: Model, order: Order) -> bool:
    """Return whether all that must precede an observation stands before it, for each of an order."""
    made = 0
    for m in order:
        if model.predecessors[m] & ~made:
            return False
        made |= 1 << m
    return model.admits(made)
