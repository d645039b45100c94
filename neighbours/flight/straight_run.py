"""Straight runs of a plan: what is carried out, one task after the other, when each branch goes one way.

A node's windows and expectations give each task a time; conditions are taken as met. What a straight run
cannot say of the plan is told by name.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields
from typing import Any

from executive.crl.nodes import Block, Branch, ConcurrentBlock, Node, Option, Plan, Task, walk, walk_plan
from executive.crl.values import UNBOUNDED_S, Absolute, IfNone, OnOptionFailure
from neighbours.flight.errors import SequenceError

NOMINAL = "nominal"
"""Names the run in which each branch takes its last option: in plans of the planner, the one that goes on."""

_WORTH = frozenset(
    {
        "id",
        "name",
        "reward",
        "probability",
        "expectations",
        "metadata",
        "source",
        "priority",
        "node_list",
        "options",
    }
)
"""Fields of a node that change nothing of what it does; its children are looked at by themselves."""

MOST_RUNS = 1000
"""Runs of one plan; every option of a planner's plan adds one, and 200 options are its most."""


@dataclass(frozen=True, slots=True)
class Step:
    """A task of a run.

    Attributes
    ----------
    start_s, time_s, energy_j
        When it is expected to begin on the plan's clock, and means of its time and the energy that it uses,
        which is below 0 where it charges; 0 where the plan expects nothing of it.
    not_before_s
        When its window opens; None where it begins as soon as it can.
    """

    task: Task
    start_s: float
    time_s: float
    energy_j: float
    not_before_s: float | None


@dataclass(frozen=True, slots=True)
class StraightRun:
    """One path through a plan: `options` are those taken, in their order."""

    options: tuple[str, ...]
    steps: tuple[Step, ...]

    @property
    def name(self) -> str:
        """Return the option that makes it: the last one taken that is not a last option, else `nominal`."""
        return self.options[-1] if self.options else NOMINAL

    @property
    def end_s(self) -> float:
        """Return when it is expected to end."""
        return max((step.start_s + step.time_s for step in self.steps), default=0.0)


@dataclass(frozen=True, slots=True)
class _Way:
    """A run on its way: nodes still to come and nodes that were, both linked lists."""

    agenda: Any
    done: Any
    options: tuple[str, ...]


def straight_runs(plan: Plan) -> tuple[StraightRun, ...]:
    """Return every run of a plan's main tree, the nominal one first.

    Raises
    ------
    SequenceError
        If there are more than 1,000.
    """
    runs = []
    ways = [_Way((plan.node, None), None, ())]
    while ways:
        way = ways.pop()
        while way.agenda is not None:
            node, rest = way.agenda
            if isinstance(node, Branch):
                chosen = [_Way((o.node, rest), way.done, _taken(way.options, node, o)) for o in choices(node)]
                ways += chosen[:-1]
                way = chosen[-1]
                continue
            if isinstance(node, Block | ConcurrentBlock):
                for child in reversed(node.node_list):
                    rest = (child, rest)
            way = _Way(rest, (node, way.done), way.options)
        runs.append(StraightRun(way.options, tuple(_steps(way.done))))
        if len(runs) + len(ways) > MOST_RUNS:
            raise SequenceError(f"the plan has more than {MOST_RUNS} runs; so many are not written")
    return tuple(runs)


def straight_run(plan: Plan, branches: Iterable[str]) -> StraightRun:
    """Return the run that takes the options named and, where none of them is, the last one of each branch.

    Raises
    ------
    SequenceError
        If an option is not known, or not taken on that way.
    """
    wanted = {name for name in branches if name != NOMINAL}
    known = {o.id for node in walk(plan.node) if isinstance(node, Branch) for o in choices(node)}
    for name in sorted(wanted - known):
        have = ", ".join(sorted(known)) or "none"
        raise SequenceError(
            f'the plan has no option "{name}"; it has {have}, and {NOMINAL} names the main line'
        )
    for run in straight_runs(plan):
        if set(run.options) == wanted:
            return run
    raise SequenceError(f"no run of the plan takes {', '.join(sorted(wanted))} together")


def choices(branch: Branch) -> tuple[Option, ...]:
    """Return the options that do different things; of those that differ in name or worth alone, the last."""
    seen: dict[object, Option] = {}
    for option in reversed(branch.options):
        seen.setdefault((option.requires, _does(option.node)), option)
    return tuple(reversed(seen.values()))


def _does(node: Node) -> tuple[object, ...]:
    """Return what a node and all below it do: every field but names, worth and what is expected."""
    return tuple(
        (type(n).__name__, *(_plain(getattr(n, f.name)) for f in fields(n) if f.name not in _WORTH))
        for n in walk(node)
    )


def _plain(value: object) -> object:
    return tuple(value.items()) if isinstance(value, Mapping) else value


def unsaid(plan: Plan) -> tuple[str, ...]:
    """Return what a straight run leaves out of a plan, each by name."""
    told = [f'floating contingency "{c.id}"' for c in plan.floating]
    told += [f'alternate plan "{a.id}"' for a in plan.library]
    told += [f"budget of {b.resource}: {b.amount:g}" for b in plan.budgets]
    for node in walk_plan(plan):
        told += _unsaid_of(node)
    return tuple(told)


def _unsaid_of(node: Node) -> list[str]:
    told = []
    if isinstance(node, Branch) and len(choices(node)) > 1:
        told.append(f'branch "{node.id}": options {", ".join(o.id for o in choices(node))}')
    if isinstance(node, ConcurrentBlock):
        told.append(f'concurrent block "{node.id}": its children go one after the other')
    conditions = {
        "start": node.start_conditions,
        "wait-for": node.wait_for_conditions,
        "maintain": node.maintain_conditions,
        "end": node.end_conditions,
    }
    told += [f'{what} conditions of "{node.id}"' for what, held in conditions.items() if held]
    for temporal in node.start_temporal_conditions:
        high = temporal.interval.hi_ms
        if not isinstance(temporal, Absolute):
            told.append(f'start of "{node.id}" relative to another node')
        elif high is not None and high < 1000 * UNBOUNDED_S:
            told.append(f'window of "{node.id}" closes at {high / 1000:g} s')
    if node.end_temporal_conditions or node.duration is not None:
        told.append(f'limits of the end of "{node.id}"')
    if node.uses or node.requires:
        told.append(f'resources of "{node.id}"')
    if node.continue_on_failure:
        told.append(f'"{node.id}" may fail, and the plan goes on')
    if isinstance(node, Task) and node.retries:
        told.append(f'{node.retries} retries of "{node.id}"')
    if isinstance(node, Branch):
        told += _unsaid_of_options(node)
    return told


def _unsaid_of_options(branch: Branch) -> list[str]:
    """Return what is asked of options, and what a branch does when none can be taken or one fails."""
    told = [f'conditions of option "{o.id}"' for o in branch.options if o.eligible_conditions]
    told += [f'resources of option "{o.id}"' for o in branch.options if o.requires]
    if branch.if_none is not IfNone.FAIL:
        told.append(f'branch "{branch.id}" without an option: {branch.if_none.value}')
    if branch.on_option_failure is not OnOptionFailure.FAIL:
        told.append(f'branch "{branch.id}" after a failed option: {branch.on_option_failure.value}')
    return told


def _taken(options: tuple[str, ...], branch: Branch, option: Option) -> tuple[str, ...]:
    return options if option is choices(branch)[-1] else (*options, option.id)


def _steps(done: Any) -> Iterator[Step]:
    nodes: list[Node] = []
    while done is not None:
        node, done = done
        nodes.append(node)
    t_s, opens_s = 0.0, None
    for node in reversed(nodes):
        for temporal in node.start_temporal_conditions:
            if isinstance(temporal, Absolute) and (temporal.interval.lo_ms or 0) > 0:
                opens_s = max(opens_s or 0.0, (temporal.interval.lo_ms or 0) / 1000)
        if isinstance(node, Task):
            start_s = max(t_s, opens_s or 0.0)
            expected = {e.name: e.mean for e in node.expectations}
            time_s = max(0.0, expected.get("time", _waits(node)))
            yield Step(node, start_s, time_s, -expected.get("energy", 0.0), opens_s)
            t_s, opens_s = start_s + time_s, None


def _waits(task: Task) -> float:
    value = task.parameters.get("duration_s", 0.0)
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else 0.0
