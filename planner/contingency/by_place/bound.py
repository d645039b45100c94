"""Upper bounds where no table of all live sets fits: multipliers, and at each place a memory of its own."""

from __future__ import annotations

import math

import numpy as np

from planner.contingency.by_place.bundle import Bundle
from planner.contingency.by_place.layout import Memory, Size, Wanted
from planner.contingency.by_place.memories import Credits
from planner.contingency.by_place.relaxation import Actions, NgRelaxation
from planner.contingency.priced_relaxation import Weights
from planner.evaluate.model import Floats, Model
from planner.tally import now_s

COARSE = 128
"""Nodes on which multipliers are found."""

FIRST_STEPS, FIRST_AIM = 20, 0.1
"""Points looked at for energy and for time with no memory but a place's own, and how far the first step aims
below the bound. By hand."""

STAGES = (1 / 1000, 1 / 600, 1 / 400, 1 / 250, 1 / 160, 1 / 100, 1 / 70, 1 / 50)
"""Share of the limit that a question takes for the closer of the two: before each stage the policy so far is
followed, and what it forgets is remembered as far as that goes. By hand, on 15 and 30 targets of seed 5."""

STEPS, AIM = 14, 0.02
"""Points looked at in a stage, and how far its first step aims: it begins near the best. By hand."""

LARGER = 1.25
"""What a question must take more than one of the stage before; else the stage is left out. By hand."""

LAST, ROOM = (384, 320, 256, 192), 0.95
"""Nodes of the bound itself, from the closest on: the first for which the limit has time. What is left of it
then, but for a part, is for more memory. By hand: 512 nodes take 0.03 % from 384, 256 add 0.5 %."""

MOST_COUNTED = 15
"""Tracks counted: with none that is two registers (`kernels.LANES`). By hand."""

LARGEST_MB = 900.0
"""Largest relaxation, MB. By hand, as `bounds.TABLE_MB`."""

MARGIN = 2e-5
"""Relative allowance for single precision, of all that is summed."""


def ng_bound(model: Model, *, limit_s: float) -> float:
    """Return what no policy earns more than; infinite where the limit allows no relaxation.

    `limit_s` are seconds of a processor as `planner.tally` reckons them.
    """
    model.require_one_kind("a bound by places")
    until = now_s() + limit_s
    wanted = Wanted.of(model)
    count = len(wanted.number)
    if not count or not model.has_leg[:, 1:].any():
        return math.inf
    own = Memory.of((np.nonzero(wanted.place == p)[0].tolist() for p in range(model.n + 1)), {})
    size = Size.of(model, own, MOST_COUNTED, COARSE)
    if FIRST_STEPS * size.seconds > limit_s or size.table_mb > LARGEST_MB:
        return math.inf
    first = []
    for share in (0.0, 1.0):
        actions = Actions.of(model, Weights.of(model, share), COARSE, MOST_COUNTED)
        relaxation = NgRelaxation(model, actions, own)
        first.append(
            (relaxation, _lowered(relaxation, Bundle(np.zeros(count)), FIRST_STEPS, FIRST_AIM, until))
        )
    relaxation, bundle = min(first, key=lambda one: one[1].value)
    value = bundle.value
    credits = Credits(model)
    for part in STAGES:
        if part * limit_s < LARGER * relaxation.size.seconds:
            continue
        relaxation.bound(bundle.point)  # the last one looked at may be far from it
        credits.follow(relaxation)
        memory = credits.enlarged(relaxation.memory, MOST_COUNTED, COARSE, part * limit_s)
        size = Size.of(model, memory, MOST_COUNTED, COARSE)
        if now_s() + STEPS / 2 * size.seconds > until or size.table_mb > LARGEST_MB:
            break
        relaxation = NgRelaxation(model, relaxation.actions, memory)
        bundle.forget()
        bundle = _lowered(relaxation, bundle, STEPS, AIM, until)
        value = min(value, bundle.value)
    relaxation.bound(bundle.point)
    credits.follow(relaxation)
    for nodes in LAST:
        size = Size.of(model, relaxation.memory, MOST_COUNTED, nodes)
        if size.seconds <= ROOM * (until - now_s()) and size.table_mb <= LARGEST_MB:
            actions = Actions.of(model, relaxation.weights, nodes, MOST_COUNTED)
            left = ROOM * min(until - now_s(), size.seconds * LARGEST_MB / size.table_mb)
            memory = credits.enlarged(relaxation.memory, MOST_COUNTED, nodes, left)
            value = min(value, NgRelaxation(model, actions, memory, followed=False).bound(bundle.point))
            break
    summed = abs(value) + model.penalty + float(bundle.point @ wanted.chance)
    return value + MARGIN * summed + 1e-9


def _lowered(relaxation: NgRelaxation, bundle: Bundle, steps: int, aim: float, until: float) -> Bundle:
    """Return a bundle after so many questions of a relaxation."""

    def look(prices: Floats) -> tuple[float, Floats]:
        return relaxation.bound(prices), relaxation.slope()

    return bundle.lowered(look, steps, first=aim, should_stop=lambda: now_s() > until)
