"""Plans with a part put in, replaced or taken out; a plan itself never changes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from planner.evaluate.model import Model
from planner.plan_tree import (
    Branch,
    Comparison,
    Condition,
    DoneCondition,
    Navigate,
    Observe,
    Option,
    Path,
    Plan,
    Step,
    TimeCondition,
    TrackedCondition,
    TrackStart,
    TrackStop,
    Visit,
    planned_observations,
)
from planner.problem import ObservationId, Problem, TargetId


def steps_at(plan: Plan, path: Path) -> Plan:
    """Return the list of steps that holds the step at a path, from that step on."""
    steps = plan
    for k in range(0, len(path) - 1, 2):
        branch = steps[path[k]]
        assert isinstance(branch, Branch)
        steps = branch.options[path[k + 1]].plan
    return steps[path[-1] :]


def steps_to(plan: Plan, path: Path) -> Plan:
    """Return the steps on the way to the step at a path, without what branches off."""
    found: list[Step] = []
    for depth in range(0, len(path), 2):
        found += (step for step in plan[: path[depth]] if not isinstance(step, Branch))
        if depth + 2 < len(path):
            branch = plan[path[depth]]
            assert isinstance(branch, Branch)
            plan = branch.options[path[depth + 1]].plan
    return tuple(found)


def with_steps(plan: Plan, path: Path, change: Callable[[Plan, int], Plan]) -> Plan:
    """Return the plan with the list of steps around `path` replaced by `change(list, position)`."""
    if len(path) == 1:
        return change(plan, path[0])
    branch = plan[path[0]]
    assert isinstance(branch, Branch)
    options = list(branch.options)
    options[path[1]] = replace(options[path[1]], plan=with_steps(options[path[1]].plan, path[2:], change))
    return (*plan[: path[0]], Branch(tuple(options)), *plan[path[0] + 1 :])


def lists_of(plan: Plan, path: Path = ()) -> Iterator[tuple[Path, Plan]]:
    """Yield every list of steps with the path of its owner."""
    yield path, plan
    for k, step in enumerate(plan):
        if isinstance(step, Branch):
            for j, option in enumerate(step.options):
                yield from lists_of(option.plan, (*path, k, j))


def options_of(plan: Plan, path: Path = ()) -> Iterator[tuple[Path, Option]]:
    """Yield every option with its path, an option before those within its plan."""
    for k, step in enumerate(plan):
        if isinstance(step, Branch):
            for j, option in enumerate(step.options):
                yield (*path, k, j), option
                yield from options_of(option.plan, (*path, k, j))


def put_option(plan: Plan, path: Path, option: Option) -> Plan:
    """Return the plan with an option at a point; one without condition replaces what follows."""

    def change(steps: Plan, k: int) -> Plan:
        if not option.when:
            return (*steps[:k], *option.plan)
        if k > 0 and isinstance(steps[k - 1], Branch):
            before = steps[k - 1]
            assert isinstance(before, Branch)
            return (*steps[: k - 1], Branch((*before.options, option)), *steps[k:])
        return (*steps[:k], Branch((option,)), *steps[k:])

    return with_steps(plan, path, change)


def with_tail(plan: Plan, path: Path, tail: Plan) -> Plan:
    """Return the plan with the steps of a list from a path on replaced."""
    return with_steps(plan, path, lambda steps, k: (*steps[:k], *tail))


def change_step(plan: Plan, path: Path, step: Step) -> Plan:
    """Return the plan with the step at a path replaced."""
    return with_steps(plan, path, lambda steps, k: (*steps[:k], step, *steps[k + 1 :]))


def without_step(plan: Plan, path: Path) -> Plan:
    """Return the plan without the step at a path."""
    return with_steps(plan, path, lambda steps, k: (*steps[:k], *steps[k + 1 :]))


def replace_option(plan: Plan, path: Path, option: Option) -> Plan:
    """Return the plan with the option at a path replaced."""

    def change(steps: Plan, k: int) -> Plan:
        branch = steps[k]
        assert isinstance(branch, Branch)
        options = (*branch.options[: path[-1]], option, *branch.options[path[-1] + 1 :])
        return (*steps[:k], Branch(options), *steps[k + 1 :])

    return with_steps(plan, path[:-1], change)


def neutral_option(plan: Plan, path: Path) -> Plan:
    """Return the plan with an option that is never taken."""
    never = (TimeCondition(Comparison.LT, -1e12),)
    option = dict(options_of(plan))[path]
    return replace_option(plan, path, Option(never, option.plan))


def without_option(plan: Plan, path: Path) -> Plan:
    """Return the plan with the option at a path taken out, and its branch with it if that was the
    only one.
    """
    step = plan[path[0]]
    assert isinstance(step, Branch)
    if len(path) == 2:
        left = step.options[: path[1]] + step.options[path[1] + 1 :]
        return (*plan[: path[0]], *([Branch(left)] if left else []), *plan[path[0] + 1 :])
    option = step.options[path[1]]
    option = replace(option, plan=without_option(option.plan, path[2:]))
    options = (*step.options[: path[1]], option, *step.options[path[1] + 1 :])
    return (*plan[: path[0]], Branch(options), *plan[path[0] + 1 :])


def without_unused_tracks(model: Model, plan: Plan) -> Plan:
    """Return the plan without tracking of targets that no path of it places an instrument on."""
    used = {
        model.target_ids[int(model.obs_place[m]) - 1]
        for m in (model.number_of[o] for o in planned_observations(plan))
        if model.is_place[m]
    }

    def lean(steps: Plan) -> Plan:
        kept: list[Step] = []
        for step in steps:
            if isinstance(step, TrackStart | TrackStop) and step.target not in used:
                continue
            if isinstance(step, Branch):
                step = Branch(tuple(replace(o, plan=lean(o.plan)) for o in step.options))
            kept.append(step)
        return tuple(kept)

    return lean(plan)


def fitted(problem: Problem, plan: Plan) -> Plan:
    """Return a plan without the targets and observations that a problem does not have."""
    targets: set[TargetId] = {t.id for t in problem.targets}
    observations = {o.id for o in problem.observations}

    def known(step: Step) -> bool:
        match step:
            case TrackStart(target=target) | TrackStop(target=target):
                return target in targets
            case Navigate(to=to):
                return to in targets
            case Observe(observation=observation) | Visit(observation=observation):
                return observation in observations
            case _:
                return True

    def lean(steps: Plan) -> Plan:
        kept: list[Step] = []
        for step in steps:
            if not known(step):
                continue
            if isinstance(step, Branch):
                options = tuple(
                    replace(o, plan=lean(o.plan))
                    for o in step.options
                    if all(
                        (not isinstance(c, TrackedCondition) or c.target in targets)
                        and (not isinstance(c, DoneCondition) or c.observation in observations)
                        for c in o.when
                    )
                )
                if options:
                    kept.append(Branch(options))
                continue
            kept.append(step)
        return tuple(kept)

    return lean(plan)


def exchanged(model: Model, plan: Plan, one: TargetId, other: TargetId) -> Plan | None:
    """Return the plan with two targets in each other's place, in every list and condition; None where they
    do not offer the same, where no leg leads there, or where the model does not admit it.

    The observations of a target that ask for its track, and those that do not, are matched in their order.
    """
    names = _matched(model, one, other)
    if names is None:
        return None
    renamed = _renamed(plan, {one: other, other: one}, names)
    return renamed if model.admits_plan(renamed) and drivable(model, renamed) else None


def _matched(model: Model, one: TargetId, other: TargetId) -> dict[ObservationId, ObservationId] | None:
    """Return for each observation of two targets that of the other one; None where they offer other ones."""
    at = [np.flatnonzero(model.obs_place == model.place_of[target]).tolist() for target in (one, other)]
    kinds = [sorted(own, key=lambda m: (bool(model.is_place[m]), m)) for own in at]
    alike = [[bool(model.is_place[m]) for m in own] for own in kinds]
    if alike[0] != alike[1]:
        return None
    ids = [[model.observation_ids[m] for m in own] for own in kinds]
    return dict(zip(ids[0] + ids[1], ids[1] + ids[0], strict=True))


def _renamed(
    plan: Plan, targets: dict[TargetId, TargetId], observations: dict[ObservationId, ObservationId]
) -> Plan:
    """Return the plan with other targets and observations for those that are named."""

    def condition(c: Condition) -> Condition:
        match c:
            case TrackedCondition():
                return replace(c, target=targets.get(c.target, c.target))
            case DoneCondition():
                return replace(c, observation=observations.get(c.observation, c.observation))
            case _:
                return c

    def step(s: Step) -> Step:
        match s:
            case Branch():
                options = (
                    replace(o, when=tuple(map(condition, o.when)), plan=tuple(map(step, o.plan)))
                    for o in s.options
                )
                return Branch(tuple(options))
            case Navigate():
                return replace(s, to=targets.get(s.to, s.to))
            case Observe() | Visit():
                name = observations.get(s.observation, s.observation)
                return replace(s, observation=name, target=targets.get(s.target, s.target))
            case TrackStart() | TrackStop():
                return replace(s, target=targets.get(s.target, s.target))
            case _:
                return s

    return tuple(map(step, plan))


def drivable(model: Model, plan: Plan, place: int = 0) -> bool:
    """Return whether a leg leads to each stop of a plan from the one before, wherever it goes."""
    for step in plan:
        if isinstance(step, Navigate):
            to = model.place_of[step.to]
            if to != place and not model.has_leg[place, to]:
                return False
            place = to
        if isinstance(step, Branch) and not all(drivable(model, o.plan, place) for o in step.options):
            return False
    return True
