"""What a problem with kinds of sols comes to where the kind is known, and where only its odds are."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from planner.problem import Amount, Problem
from planner.sol_kind import SolKind, all_kinds

Change = Callable[[Amount], Amount]


def on_kind(problem: Problem, kind: SolKind) -> Problem:
    """Return the problem of a sol that is known to be of a kind: its amounts multiplied, no kind hidden."""
    whole = kind.energy_factor
    return _changed(
        problem,
        lambda time_s: _times(time_s, kind.drive_time_factor),
        lambda energy_j: _times(energy_j, kind.drive_energy_factor * whole),
        lambda energy_j: _times(energy_j, whole),
        whole,
    )


def mixed(problem: Problem, odds: Sequence[float] | None = None) -> Problem:
    """Return the problem with the mean and the deviation of each amount over the kinds, no kind hidden.

    Amounts are then independent of each other, which they are not: plans are proposed from it and valued with
    the kinds. `odds` are those of `all_kinds`, the problem's own when absent. A problem without kinds is
    returned as it is.
    """
    if not problem.sol_kinds:
        return problem
    kinds = all_kinds(problem.sol_kinds)
    chances = [kind.p for kind in kinds] if odds is None else list(odds)
    drive_s = [kind.drive_time_factor for kind in kinds]
    drive_j = [kind.drive_energy_factor * kind.energy_factor for kind in kinds]
    every_j = [kind.energy_factor for kind in kinds]
    return _changed(
        problem,
        lambda time_s: _mixture(time_s, chances, drive_s),
        lambda energy_j: _mixture(energy_j, chances, drive_j),
        lambda energy_j: _mixture(energy_j, chances, every_j),
        _mean(chances, every_j),
    )


def _times(amount: Amount, factor: float) -> Amount:
    return amount if factor == 1.0 else Amount(amount.mean * factor, amount.sd * factor)


def _mean(chances: Sequence[float], values: Sequence[float]) -> float:
    return math.fsum(p * v for p, v in zip(chances, values, strict=True))


def _mixture(amount: Amount, chances: Sequence[float], factors: Sequence[float]) -> Amount:
    """Return mean and deviation of an amount times a factor that is independent of it."""
    mean = amount.mean * _mean(chances, factors)
    square = (amount.mean**2 + amount.sd**2) * _mean(chances, [f * f for f in factors])
    return Amount(mean, math.sqrt(max(0.0, square - mean * mean)))


def _changed(
    problem: Problem, drive_s: Change, drive_j: Change, other_j: Change, hotel_factor: float
) -> Problem:
    return replace(
        problem,
        targets=tuple(
            replace(t, observations=tuple(replace(o, energy_j=other_j(o.energy_j)) for o in t.observations))
            for t in problem.targets
        ),
        legs=tuple(
            replace(leg, time_s=drive_s(leg.time_s), energy_j=drive_j(leg.energy_j)) for leg in problem.legs
        ),
        hotel_w=problem.hotel_w * hotel_factor,
        track_start_energy_j=problem.track_start_energy_j * hotel_factor,
        sol_kinds=(),
    )
