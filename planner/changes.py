"""What is changed of a day in a what-if, and the planning problem of the changed day."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import field

from mission.codec import Codec
from mission.values import value
from planner.errors import ChangeError
from planner.problem import Leg, Observation, Problem


@value
class Changes:
    """What is changed. Budgets are what may be used in all (seconds, joules); a late start costs time and
    hotel energy and moves the windows; each chance `p` to lose a track becomes `1 - (1 - p) ** loss_factor`.
    `keep_outs` are polygons (east, north) in metres that stand in the place of the mission's.
    """

    exclude: tuple[str, ...] = ()
    force: tuple[str, ...] = ()
    values: Mapping[str, float] = field(default_factory=dict)
    time_budget_s: float | None = None
    energy_budget_j: float | None = None
    start_delay_s: float = 0.0
    loss_factor: float = 1.0
    keep_outs: tuple[tuple[tuple[float, float], ...], ...] | None = None

    def as_dict(self) -> dict[str, object]:
        """Return the changes as they are kept; what is not changed is left away."""
        document = CHANGES.document(self)
        changed = (
            f.name for f in dataclasses.fields(self) if getattr(self, f.name) != getattr(UNCHANGED, f.name)
        )
        return {name: document[name] for name in changed}

    def in_words(self) -> str:
        """Return the changes as a line for people."""
        words = []
        if self.exclude:
            words.append(f"{counted(len(self.exclude), 'request')} taken away")
        if self.force:
            words.append(f"{counted(len(self.force), 'request')} demanded")
        if self.values:
            words.append(f"{counted(len(self.values), 'value')} changed")
        if self.time_budget_s is not None:
            words.append(f"time budget {self.time_budget_s / 3600:.2f} h")
        if self.energy_budget_j is not None:
            words.append(f"energy budget {self.energy_budget_j / 3600:.0f} Wh")
        if self.start_delay_s:
            words.append(f"start {self.start_delay_s / 60:.0f} min later")
        if self.loss_factor != 1.0:
            words.append(f"tracks lost {self.loss_factor:g} times as readily")
        if self.keep_outs is not None:
            words.append(f"{counted(len(self.keep_outs), 'keep-out')} in place of the mission's")
        return ", ".join(words) or "nothing changed"


UNCHANGED = Changes()
CHANGES = Codec(Changes, "changes/1", "changes")


def counted(number: int, what: str) -> str:
    """Return a number with its noun."""
    return f"{number} {what}{'' if number == 1 else 's'}"


def changes_of(document: Mapping[str, object]) -> Changes:
    """Return changes as `as_dict` wrote them; raises FormatError where they are none."""
    return CHANGES.from_document({"format": CHANGES.format, **document})


def changed_problem(problem: Problem, changes: Changes) -> Problem:
    """Return the problem of the changed day, of the same shape: what is excluded is worth nothing.

    Raises
    ------
    ChangeError
        If a request is not in the problem, or is both excluded and demanded.
    """
    known = {str(o.id) for o in problem.observations}
    for name, asked in (("exclude", changes.exclude), ("force", changes.force), ("values", changes.values)):
        for request in asked:
            if request not in known:
                raise ChangeError(f"request {request} is not in the plan's problem", member=name)
    if both := set(changes.exclude) & set(changes.force):
        raise ChangeError(f"request {min(both)} is both excluded and demanded", member="force")
    delay = changes.start_delay_s

    def observed(o: Observation) -> Observation:
        utility = 0.0 if o.id in changes.exclude else changes.values.get(o.id, o.utility)
        window = o.window_s
        if window is not None and delay:
            window = (window[0] - delay, window[1] - delay)
        return dataclasses.replace(
            o,
            utility=utility,
            window_s=window,
            must_do=(o.must_do or o.id in changes.force) and utility > 0.0,
        )

    def driven(leg: Leg) -> Leg:
        if changes.loss_factor == 1.0:
            return leg
        lost = {t: 1.0 - (1.0 - p) ** changes.loss_factor for t, p in leg.p_lose.items()}
        return dataclasses.replace(leg, p_lose=lost)

    budget = problem.budget
    time_s = budget.time_s if changes.time_budget_s is None else changes.time_budget_s
    usable = budget.usable_energy_j if changes.energy_budget_j is None else changes.energy_budget_j
    usable = max(0.0, usable - problem.hotel_w * delay)
    return dataclasses.replace(
        problem,
        targets=tuple(
            dataclasses.replace(t, observations=tuple(map(observed, t.observations))) for t in problem.targets
        ),
        legs=tuple(map(driven, problem.legs)),
        budget=dataclasses.replace(
            budget, time_s=max(0.0, time_s - delay), energy_j=budget.energy_floor_j + usable
        ),
    )
