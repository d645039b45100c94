"""The search for orders of observations through several sols."""

from __future__ import annotations

import numpy as np

from planner.evaluate.model import Floats, Ints
from planner.sols.order_kernels import Days, Needs, annealed
from planner.sols.path_problem import PathProblem
from planner.tally import Step, spend

FUTURES = 16
"""Drawn futures in which orders are compared. By hand: with 48 the same time ends at orders 0.5 % worse, for
the policy's own value decides between them in the end."""

CHUNK = 5_000
"""Steps of annealing between two questions whether to stop: about 0.05 s with 30 observations."""

HOT, COLD = 0.6, 0.006
"""First and last temperature, in mean utilities of an observation. By hand."""

CAUTIONS = (0.0, 0.4, -0.3)
"""Standard deviations left over by the rule, one after the other run by run. By hand."""

PER_ACTION = 0.4
"""An action by the rule takes so much of one of a plan tree, which hashes its draws (`Step.ACTION`)."""


def days_of(path: PathProblem) -> Days:
    """Return the sols as the compiled loops take them."""
    return Days(
        path.time_s,
        path.reserve_j,
        np.array([rest.gain_j for rest in path.rests]),
        np.array([rest.ceiling_j for rest in path.rests]),
        path.window,
        path.allowed,
        path.charge_j,
        path.model.hotel_w,
        path.model.penalty,
    )


def needs_of(path: PathProblem, *, seed: int, futures: int) -> Needs:
    """Return what actions take, with so many drawn futures."""
    model, rng = path.model, np.random.default_rng(seed)

    def moments(amounts: Floats) -> Floats:
        mean_t, sd_t, mean_g, sd_g = np.moveaxis(np.nan_to_num(amounts), -1, 0)
        energy = mean_g + model.hotel_w * mean_t
        return np.stack([mean_t, sd_t**2, energy, sd_g**2 + (model.hotel_w * sd_t) ** 2], axis=-1)

    def drawn(ln: Floats, k: int) -> Floats:
        normal = rng.standard_normal((futures, *ln.shape[:-1]))
        return np.nan_to_num(np.exp(ln[..., k] + ln[..., k + 1] * normal))

    return Needs(
        model.obs_place,
        model.utility * model.p_success,
        model.has_leg,
        moments(model.leg),
        moments(model.obs),
        drawn(model.leg_ln, 0),
        drawn(model.leg_ln, 2),
        drawn(model.obs_ln, 0),
        drawn(model.obs_ln, 2),
    )


def first_order(path: PathProblem) -> tuple[Ints, int]:
    """Return the observations that some sol allows, nearest first from place to place, and their number."""
    model = path.model
    wanted = (model.utility * model.p_success > 0.0) & path.allowed.any(axis=0)
    left, place, order = np.nonzero(wanted)[0].tolist(), 0, []
    time_s = np.where(model.has_leg, model.leg[:, :, 0], np.inf)
    while left:
        after = [0.0 if int(model.obs_place[m]) == place else time_s[place, model.obs_place[m]] for m in left]
        m = left.pop(int(np.argmin(after)))
        order.append(m)
        place = int(model.obs_place[m])
    return np.array(order, np.int64), len(order)


def annealed_order(
    path: PathProblem, days: Days, needs: Needs, *, run: int, seed: int, chunks: int
) -> tuple[Ints, float]:
    """Return the best order of one run of annealing, and what it earns by the rule."""
    order, length = first_order(path)
    if not length:
        return order, 0.0
    mean = float(needs.worth[order].mean())
    best, best_value = order[:0], 0.0
    for chunk in range(chunks):
        hot, cold = (mean * HOT * (COLD / HOT) ** (part / chunks) for part in (chunk, chunk + 1))
        caution = CAUTIONS[run % len(CAUTIONS)]
        draw = (seed * 7919 + run * 104_729 + chunk) % (1 << 32)
        order, length, found, size, value = annealed(
            days, needs, order, length, caution, draw, CHUNK, hot, cold
        )
        if value > best_value:
            best, best_value = found[:size].copy(), value
        spend(Step.ACTION, PER_ACTION * CHUNK * FUTURES * max(length, 1))
    return best, best_value
