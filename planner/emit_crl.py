"""A contingent plan as CRL that means exactly what the evaluators assumed.

- A list of steps is a block; a branch ends its block, and its last option holds "go on". Eligible
conditions are
  mutually exclusive: each option also asks that no earlier one holds. Utilities inform and decide nothing.
- `:continue-on-failure` on a drive or on the frame of an observation is `on_fail: skip`. The observation
task itself
  always carries it, because a lost success coin is not a failed step; what the evaluators treat as failure
  (track lost, not there, done already, a predecessor missing, window closed) is tested by the frame around
  it.
- A `trackstart` always carries it: in the model none fails, and what needs the track asks for it anyway.
- Time and energy budgets are maintain conditions of the root: the first action that would end over one is
the last. - Early for a window = the frame waits for its start window.

Every node's metadata holds `step`, the path of the plan tree's step ("2.0.1" = first option of step 2, its
step 1).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import assert_never

from executive.crl.nodes import Block, Branch, Node, Option, Plan, Task
from executive.crl.values import (
    Absolute,
    Amount,
    And,
    Comparison,
    Condition,
    ConsumableResource,
    Expectation,
    IfNone,
    Not,
    Operator,
    Or,
    Utility,
    UtilityTable,
    Value,
    bounds,
    seconds_to_ms,
)
from planner import plan_tree as tree_of
from planner.amounts_of_sol import mixed
from planner.constraints.overrun import Overrun, plain
from planner.constraints.track import tracked
from planner.evaluate.model import Model
from planner.plan_tree import OnFail, Path, PlanTree, with_ids
from planner.problem import Amount as Random
from planner.problem import Kind, Observation, ObservationId, Problem, TargetId

BATTERY_STEP_J = 0.001
"""Resolution of energies in tables of draws; the energy budget of the header is less by it."""

TRUE: Condition = And(())
FALSE: Condition = Or(())


def _both(*parts: Condition) -> Condition:
    kept = [p for p in parts if p != TRUE]
    if FALSE in kept:
        return FALSE
    return kept[0] if len(kept) == 1 else And(tuple(kept))


def _either(*parts: Condition) -> Condition:
    kept = [p for p in parts if p != FALSE]
    if TRUE in kept:
        return TRUE
    return kept[0] if len(kept) == 1 else Or(tuple(kept))


_OPPOSITE = {
    Operator.EQ: Operator.NE,
    Operator.NE: Operator.EQ,
    Operator.LT: Operator.GE,
    Operator.GE: Operator.LT,
    Operator.LE: Operator.GT,
    Operator.GT: Operator.LE,
}


def negated(condition: Condition) -> Condition:
    """Return a condition that is TRUE where the other is FALSE and the reverse; UNKNOWN stays UNKNOWN."""
    match condition:
        case Comparison():
            return replace(condition, operator=_OPPOSITE[condition.operator])
        case And(parts=parts):
            return _either(*(negated(p) for p in parts))
        case Or(parts=parts):
            return _both(*(negated(p) for p in parts))
        case Not(part=part):
            return part
        case _:
            return Not(condition)


def _outcome(node: str, value: str) -> Comparison:
    return Comparison("outcome", (node,), Operator.EQ, value)


@dataclass(frozen=True, slots=True)
class _Drive:
    """A drive on the way to a point of the plan; `task` is its node."""

    task: str
    to: TargetId
    may_fail: bool


@dataclass(frozen=True, slots=True)
class _Past:
    """What may have happened before a point of the plan, as far as the text tells."""

    drives: tuple[_Drive, ...] = ()
    observed: tuple[tuple[ObservationId, tuple[str, ...]], ...] = ()
    started: frozenset[TargetId] = field(default_factory=frozenset)

    def standing_at(self, target: TargetId) -> Condition:
        """Return the condition that the rover is at a target: its last successful drive went there."""
        condition = FALSE
        for drive in self.drives:
            there = drive.to == target
            if not drive.may_fail:
                condition = TRUE if there else FALSE
            else:
                gone = _outcome(drive.task, "succeeded")
                condition = _either(gone, condition) if there else _both(negated(gone), condition)
        return condition

    def done(self, observation: ObservationId) -> Condition:
        """Return the condition that an observation was carried out, whatever its coin showed."""
        return _either(*(_any_carried_out(tasks) for name, tasks in self.observed if name == observation))


def _any_carried_out(tasks: tuple[str, ...]) -> Condition:
    """Return the condition that one of the tasks that stand for an observation was carried out."""
    return _either(*(_carried_out(task) for task in tasks))


def _carried_out(task: str) -> Condition:
    failed = Comparison("reason", (task,), Operator.EQ, "action-failed")
    return _either(_outcome(task, "succeeded"), _both(_outcome(task, "failed"), failed))


def _spread(name: str, amount: Random, sign: float) -> Expectation:
    return Expectation(name, plain(sign * round(amount.mean, 3)), plain(round(amount.sd, 3)))


class _Emitter:
    def __init__(self, problem: Problem, tree: PlanTree) -> None:
        problem = mixed(problem)  # expectations are over all kinds of sols
        self.problem, self.tree = problem, tree
        self.model = Model.of(problem)
        self.observations = {o.id: o for o in problem.observations}
        self.targets = {t.id: t for t in problem.targets}
        self.legs = {(leg.origin, leg.to): leg for leg in problem.legs}
        self.used: set[str] = {"root"}

    def name(self, *parts: str) -> str:
        """Return an id made of parts, with a number where it is taken already."""
        base = "-".join(parts)
        chosen, k = base, 2
        while chosen in self.used:
            chosen = f"{base}-{k}"
            k += 1
        self.used.add(chosen)
        return chosen

    def metadata(self, path: Path, **more: Value) -> dict[str, Value]:
        return {"step": ".".join(map(str, path)), **more}

    # ------------------------------------------------------------------------------------- steps

    def block(self, steps: tree_of.Plan, path: Path, past: _Past, first: int = 0) -> list[Node]:
        """Return the nodes of a list of steps; a branch and what follows it are the last of them.

        `path` is that of the list, `first` the number in it of the first step given.
        """
        nodes: list[Node] = []
        for k, step in enumerate(steps):
            here = (*path, first + k)
            match step:
                case tree_of.Stop():
                    return nodes
                case tree_of.Branch(options):
                    nodes.append(self.branch(options, steps[k + 1 :], here, past))
                    return nodes
                case tree_of.TrackStart(target, _):
                    node_id = self.name("trackstart", target)
                    nodes.append(
                        Task(
                            id=node_id,
                            action="trackstart",
                            parameters={"target": str(target)},
                            continue_on_failure=True,
                            expectations=(
                                _spread("time", Random(self.problem.track_start_time_s), 1.0),
                                _spread("energy", Random(self.problem.track_start_energy_j), -1.0),
                            ),
                            metadata=self.metadata(here, target=str(target), **self.target_refs(target)),
                        )
                    )
                    past = replace(past, started=past.started | {target})
                case tree_of.TrackStop(target, on_fail):
                    nodes.append(
                        Task(
                            id=self.name("trackstop", target),
                            action="trackstop",
                            parameters={"target": str(target)},
                            continue_on_failure=on_fail is OnFail.SKIP,
                            metadata=self.metadata(here, target=str(target)),
                        )
                    )
                case tree_of.Navigate(to, require_tracked, on_fail):
                    nodes.append(self.drive(to, require_tracked, on_fail is OnFail.SKIP, here, past))
                    if (
                        isinstance(nodes[-1], Task)
                        and not self.certain_drive(to, require_tracked, past)
                        and on_fail is OnFail.SKIP
                    ):
                        past = replace(past, drives=(*past.drives, _Drive(nodes[-1].id, to, True)))
                    else:
                        past = replace(past, drives=(_Drive(nodes[-1].id, to, False),))
                case tree_of.Observe(observation, _, on_fail):
                    made = self.observe(observation, on_fail is OnFail.SKIP, here, past)
                    if made is None:
                        if on_fail is OnFail.STOP:
                            return nodes
                        continue
                    node, tasks = made
                    nodes.append(node)
                    past = replace(past, observed=(*past.observed, (observation, tasks)))
                case tree_of.Visit(observation, target, on_fail):
                    node, past = self.visit(observation, target, on_fail is OnFail.SKIP, here, past)
                    nodes.append(node)
                case _:
                    assert_never(step)
        return nodes

    def trackable(self, target: TargetId) -> bool:
        """Return whether some observation of a target needs it tracked."""
        return bool(self.model.trackable[self.model.place_of[target]])

    def certain_drive(self, to: TargetId, require_tracked: bool, past: _Past) -> bool:
        """Return whether a drive can neither be refused before it starts nor fail."""
        if require_tracked and self.trackable(to):
            return False
        origins = {d.to for d in past.drives} | ({"start"} if all(d.may_fail for d in past.drives) else set())
        legs = (self.legs.get((origin, to)) for origin in origins if origin != to)
        return all(leg is not None and leg.p_fail == 0.0 for leg in legs)

    def target_refs(self, target: TargetId) -> dict[str, Value]:
        return {f"target-{key}": value for key, value in self.targets[target].refs.items()}

    def drive(self, to: TargetId, require_tracked: bool, skip: bool, path: Path, past: _Past) -> Task:
        guard: tuple[Condition, ...] = ()
        if require_tracked and self.trackable(to):
            guard = (tracked(to),)
        origin = past.drives[-1].to if past.drives else "start"
        leg = self.legs.get((origin, to))
        expectations: tuple[Expectation, ...] = ()
        if leg is not None:
            expectations = (_spread("time", leg.time_s, 1.0), _spread("energy", leg.energy_j, -1.0))
        return Task(
            id=self.name("navigate", to),
            action="navigate",
            parameters={"target": str(to)},
            start_conditions=guard,
            continue_on_failure=skip,
            expectations=expectations,
            metadata=self.metadata(path, target=str(to), **self.target_refs(to)),
        )

    def observe(
        self, observation: ObservationId, skip: bool, path: Path, past: _Past
    ) -> tuple[Node, tuple[str, ...]] | None:
        """Return the node of an observation and the id of its task; None if it can never be made."""
        what = self.observations[observation]
        checks = [past.standing_at(what.target), negated(past.done(observation))]
        spans: list[tuple[float, float]] = []
        for rule in self.model.rules:
            emitted = rule.emit(self.model, self.model.number_of[observation], what, past)
            checks += emitted.guards
            spans += [emitted.window_s] if emitted.window_s is not None else []
        guard = _both(*checks)
        if guard == FALSE:
            return None
        task_id = self.name("observe", observation)
        node, tasks = self.rewarded(what, task_id, path, past)
        meta = self.metadata(path)
        for opens_s, closes_s in spans:
            node = Block(
                id=self.name("window", observation),
                start_temporal_conditions=(Absolute(bounds(opens_s, closes_s)),),
                continue_on_failure=skip and guard == TRUE,
                metadata=meta,
                node_list=(node,),
            )
        if guard != TRUE:
            node = Block(
                id=self.name("at", observation),
                start_conditions=guard.parts if isinstance(guard, And) else (guard,),
                continue_on_failure=skip,
                metadata=meta,
                node_list=(node,),
            )
        return node, tasks

    def rewarded(
        self, what: Observation, task_id: str, path: Path, past: _Past
    ) -> tuple[Node, tuple[str, ...]]:
        """Return the observation task; where its worth depends on what was done before, a branch of such
        tasks.
        """
        fading = self.targets[what.target].diminishing
        before = [t for name, t in past.observed if self.observations[name].target == what.target]
        if fading == 1.0 or not before:
            return self.task(what, task_id, what.utility, path), (task_id,)
        options = []
        names = []
        for count in range(len(before) + 1):
            ways = [
                _both(*(_any_carried_out(t) if t in chosen else negated(_any_carried_out(t)) for t in before))
                for chosen in combinations(before, count)
            ]
            name = task_id if count == 0 else self.name(task_id, f"after-{count}")
            names.append(name)
            options.append(
                Option(
                    id=self.name("worth", task_id, str(count)),
                    eligible_conditions=(_either(*ways),),
                    node=self.task(what, name, what.utility * fading**count, path),
                )
            )
        choice = Branch(id=self.name("choose", task_id), options=tuple(options), metadata=self.metadata(path))
        return choice, tuple(names)

    def task(self, what: Observation, task_id: str, reward: float, path: Path) -> Task:
        placed = what.kind is Kind.PLACE
        parameters: dict[str, Value] = {"target": str(what.target)}
        if what.instrument:
            parameters["instrument"] = what.instrument
        meta = {
            **{str(key): value for key, value in what.refs.items()},
            **self.target_refs(what.target),
            **self.metadata(path, observation=str(what.id), target=str(what.target)),
        }
        return Task(
            id=task_id,
            action=what.action or ("ipplaceinstrument" if placed else "image"),
            parameters=parameters,
            continue_on_failure=True,
            reward=plain(reward),
            probability=plain(what.p_success),
            expectations=(_spread("time", what.time_s, 1.0), _spread("energy", what.energy_j, -1.0)),
            metadata=meta,
        )

    def visit(
        self, observation: ObservationId, target: TargetId, skip: bool, path: Path, past: _Past
    ) -> tuple[Node, _Past]:
        tracks = bool(self.model.is_place[self.model.number_of[observation]])
        drive = self.drive(target, tracks, False, path, past)
        arrived = replace(past, drives=(_Drive(drive.id, target, False),))
        made = self.observe(observation, False, path, arrived)
        nodes: list[Node] = [drive] if made is None else [drive, made[0]]
        block = Block(
            id=self.name("visit", observation),
            continue_on_failure=skip,
            metadata=self.metadata(path),
            node_list=tuple(nodes),
        )
        refused = not self.certain_drive(target, tracks, past)
        drives = (*past.drives, _Drive(drive.id, target, True)) if skip and refused else arrived.drives
        observed = past.observed if made is None else (*past.observed, (observation, made[1]))
        return block, replace(past, drives=drives, observed=observed)

    # ------------------------------------------------------------------------------------- branches

    def condition(self, condition: tree_of.Condition, past: _Past) -> Condition:
        match condition:
            case tree_of.TimeCondition(comparison, value):
                sign = Operator.GE if comparison is tree_of.Comparison.GE else Operator.LT
                return Comparison("time", (), sign, plain(value))
            case tree_of.EnergyCondition(comparison, value):
                sign = Operator.GE if comparison is tree_of.Comparison.GE else Operator.LT
                return Comparison("energy-used", (), sign, plain(value))
            case tree_of.TrackedCondition(target, truth):
                if target not in past.started:
                    return FALSE if truth else TRUE
                test = tracked(target)
                return test if truth else negated(test)
            case tree_of.DoneCondition(observation, truth):
                done = past.done(observation)
                return done if truth else negated(done)
            case _:
                assert_never(condition)

    def branch(
        self, options: tuple[tree_of.Option, ...], rest: tree_of.Plan, path: Path, past: _Past
    ) -> Node:
        branch_id = self.name("branch")
        made: list[Option] = []
        none_before: list[Condition] = []
        for k, option in enumerate(options):
            own = _both(*(self.condition(c, past) for c in option.when))
            eligible = _both(*none_before, own)
            none_before.append(negated(own))
            if eligible == FALSE:
                continue
            option_id = option.id if option.id and option.id not in self.used else self.name("option")
            self.used.add(option_id)
            notes = self.tree.option_notes.get((*path, k))
            made.append(
                Option(
                    id=option_id,
                    utility=self.utility(notes),
                    probability=None
                    if notes is None or notes.p_taken <= 0
                    else round(min(notes.p_taken, 1.0), 4),
                    eligible_conditions=self.conjunction(eligible),
                    node=self.body(option.plan, (*path, k), past, option_id),
                    metadata=self.metadata((*path, k)),
                )
            )
        eligible = _both(*none_before)
        if eligible != FALSE:
            option_id = self.name("go-on")
            made.append(
                Option(
                    id=option_id,
                    eligible_conditions=self.conjunction(eligible),
                    node=self.rest(rest, path, past, option_id),
                    metadata=self.metadata(path),
                )
            )
        return Branch(
            id=branch_id,
            options=tuple(made),
            if_none=IfNone.FAIL,
            metadata=self.metadata(path),
        )

    def utility(self, notes: tree_of.OptionNotes | None) -> Utility:
        if notes is None or not notes.utility_table:
            return 0
        points = tuple((seconds_to_ms(t), plain(round(u, 4))) for t, u in notes.utility_table)
        return UtilityTable(points) if len(points) > 1 else points[0][1]

    def conjunction(self, condition: Condition) -> tuple[Condition, ...]:
        return condition.parts if isinstance(condition, And) else (condition,)

    def body(self, steps: tree_of.Plan, path: Path, past: _Past, name: str) -> Node:
        nodes = self.block(steps, path, past)
        return self.joined(nodes, path, f"plan-{name}")

    def rest(self, steps: tree_of.Plan, path: Path, past: _Past, name: str) -> Node:
        """Return the node of the steps that follow a branch in its list."""
        nodes = self.block(steps, path[:-1], past, path[-1] + 1)
        return self.joined(nodes, path, f"plan-{name}")

    def joined(self, nodes: list[Node], path: Path, name: str) -> Node:
        if not nodes:
            return Task(
                id=self.name("stop", name),
                name="nothing more to do",
                action="wait",
                parameters={"duration_s": 0},
                metadata=self.metadata(path),
            )
        return Block(id=self.name(name), node_list=tuple(nodes), metadata=self.metadata(path))


def emit(
    problem: Problem, tree: PlanTree, *, plan_id: str = "plan", metadata: Mapping[str, str] | None = None
) -> Plan:
    """Return the CRL plan of a contingent plan; an empty one becomes a wait of zero seconds.

    The references of the problem and `metadata` are kept in the plan's metadata.
    """
    emitter = _Emitter(problem, tree)
    root = emitter.joined(emitter.block(with_ids(tree.plan), (), _Past()), (), "day")
    budget = problem.budget
    # A battery is never below empty: a run that used it up would look as if it had ended within the budget.
    limit_j = max(0.0, budget.usable_energy_j - BATTERY_STEP_J)
    return Plan(
        id=plan_id,
        name=problem.name,
        resources=(ConsumableResource("energy", "battery-energy", plain(budget.energy_floor_j)),),
        overrun_penalty=plain(problem.overrun_penalty),
        budgets=(Amount("time", plain(budget.time_s)), Amount("energy", plain(limit_j))),
        node=replace(root, id="root", maintain_conditions=Overrun.of(problem).keep()),
        metadata={
            "problem": problem.name,
            "problem-sha256": problem.digest(),
            **({"method": tree.method} if tree.method else {}),
            **problem.refs,
            **(metadata or {}),
        },
    )
