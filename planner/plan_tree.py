"""Contingent plans as trees of steps, made from their documents and turned into them again.

Steps are carried out in order. At a `Branch` the first option whose conditions all hold is run *instead of*
the rest of its plan; if none holds the plan goes on. A step that cannot be carried out (target lost, window
closed, rover elsewhere, done already) fails: `STOP` ends the plan there, `SKIP` goes on with the next step.
Branches are counted as options in the whole tree.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, TypeAlias, assert_never, cast

from planner.errors import PlanTreeError
from planner.plan_tree_document import (
    TREES,
    TREES_1,
    ConditionDocument,
    DoneDocument,
    ObserveDocument,
    OptionDocument,
    StepDocument,
    TreeDocument,
)
from planner.problem import ObservationId, Problem, TargetId
from planner.problem_document import CONTINGENCY


class OnFail(StrEnum):
    """What happens when a step cannot be carried out."""

    STOP = "stop"
    SKIP = "skip"


class Comparison(StrEnum):
    """How a threshold is compared: `GE` is at least, `LT` is less than."""

    GE = "ge"
    LT = "lt"


@dataclass(frozen=True, slots=True)
class TimeCondition:
    """Elapsed time, in whole milliseconds written as seconds, compared with `value_s`."""

    comparison: Comparison
    value_s: float


@dataclass(frozen=True, slots=True)
class EnergyCondition:
    """Energy used since the start compared with `value_j`."""

    comparison: Comparison
    value_j: float


@dataclass(frozen=True, slots=True)
class TrackedCondition:
    """The track of a target is alive, or is not."""

    target: TargetId
    value: bool


@dataclass(frozen=True, slots=True)
class DoneCondition:
    """Whether an observation has been carried out (whatever its success coin showed)."""

    observation: ObservationId
    value: bool


Condition: TypeAlias = TimeCondition | EnergyCondition | TrackedCondition | DoneCondition


@dataclass(frozen=True, slots=True)
class TrackStart:
    """Begin to track. In the model it never fails; where it does, the plan goes on without."""

    target: TargetId
    on_fail: OnFail = OnFail.STOP


@dataclass(frozen=True, slots=True)
class TrackStop:
    """Give up the track of a target."""

    target: TargetId
    on_fail: OnFail = OnFail.STOP


@dataclass(frozen=True, slots=True)
class Navigate:
    """Drive to a target's observation point; with `require_tracked` it fails before leaving if the target
    is lost.
    """

    to: TargetId
    require_tracked: bool = False
    on_fail: OnFail = OnFail.STOP


@dataclass(frozen=True, slots=True)
class Observe:
    """Make an observation where the rover stands."""

    observation: ObservationId
    target: TargetId
    on_fail: OnFail = OnFail.STOP


@dataclass(frozen=True, slots=True)
class Visit:
    """Check that the target is tracked, drive, check again, observe; any failure is the step's failure."""

    observation: ObservationId
    target: TargetId
    on_fail: OnFail = OnFail.STOP


@dataclass(frozen=True, slots=True)
class Stop:
    """End the plan here."""


@dataclass(frozen=True, slots=True)
class Option:
    """An alternative. `id` names it in the emitted plan; it is unique in the tree once `with_ids` was
    called.
    """

    when: tuple[Condition, ...]
    plan: tuple[Step, ...]
    id: str = ""


@dataclass(frozen=True, slots=True)
class Branch:
    """A choice: the first option whose conditions hold takes the place of the rest of the plan."""

    options: tuple[Option, ...]


Step: TypeAlias = TrackStart | TrackStop | Navigate | Observe | Visit | Branch | Stop
Plan: TypeAlias = tuple[Step, ...]


@dataclass(frozen=True, slots=True)
class StepNotes:
    """What is expected at a step: chance that it is reached, and quantiles of time and energy used when it
    begins.
    """

    p_reached: float
    quantiles: tuple[float, ...] = ()
    time_s: tuple[float, ...] = ()
    energy_j: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class OptionNotes:
    """What is expected of an option: chance to be taken, what it wins, utility still to come over time."""

    p_taken: float
    gain: float
    utility_table: tuple[tuple[float, float], ...] = ()


Path: TypeAlias = tuple[int, ...]
"""Where a step or option stands: (step,) in the main line, (step, option, step, ...) below."""


@dataclass(frozen=True, slots=True)
class PlanTree:
    """A contingent plan for the problem named `instance`, with what is known about its parts."""

    instance: str
    plan: Plan
    method: str = ""
    step_notes: Mapping[Path, StepNotes] = field(default_factory=dict)
    option_notes: Mapping[Path, OptionNotes] = field(default_factory=dict)

    @property
    def branches(self) -> int:
        return count_branches(self.plan)


def count_branches(plan: Plan) -> int:
    """Return the number of options in the whole tree."""
    return sum(
        len(step.options) + sum(count_branches(o.plan) for o in step.options)
        for step in plan
        if isinstance(step, Branch)
    )


def ways(plan: Plan, before: frozenset[ObservationId] = frozenset()) -> Iterator[frozenset[ObservationId]]:
    """Yield, for every path through the plan, the observations on it: what is made there if nothing fails."""
    for step in plan:
        match step:
            case Observe(observation=observation) | Visit(observation=observation):
                before |= {observation}
            case Branch(options):
                for option in options:
                    yield from ways(option.plan, before)
            case Stop():
                break
            case _:
                pass
    yield before


def walk(plan: Plan, path: Path = ()) -> Iterator[tuple[Path, Step]]:
    """Yield every step with its path, in the order of the text."""
    for k, step in enumerate(plan):
        here = (*path, k)
        yield here, step
        if isinstance(step, Branch):
            for j, option in enumerate(step.options):
                yield from walk(option.plan, (*here, j))


def with_ids(plan: Plan, prefix: str = "option") -> Plan:
    """Return the plan with its options named `option-1`, `option-2`, ... in the order of the text."""
    counter = iter(range(1, 1_000_000))

    def renamed(steps: Plan) -> Plan:
        out: list[Step] = []
        for step in steps:
            if isinstance(step, Branch):
                options = []
                for option in step.options:
                    name = f"{prefix}-{next(counter)}"
                    options.append(Option(option.when, renamed(option.plan), name))
                out.append(Branch(tuple(options)))
            else:
                out.append(step)
        return tuple(out)

    return renamed(plan)


# ----------------------------------------------------------------------------------------------- documents


def _condition_document(condition: Condition, legacy: bool) -> ConditionDocument:
    match condition:
        case TimeCondition(Comparison.GE, value):
            return {"var": "time_s", "ge": value}
        case TimeCondition(_, value):
            return {"var": "time_s", "lt": value}
        case EnergyCondition(Comparison.GE, value):
            return {"var": "energy_j", "ge": value}
        case EnergyCondition(_, value):
            return {"var": "energy_j", "lt": value}
        case TrackedCondition(target, truth):
            return {"var": "tracked", "target": target, "is": truth}
        case DoneCondition(observation, truth):
            if legacy:
                return {"var": "done", "target": observation, "is": truth}
            return {"var": "done", "observation": observation, "is": truth}


class _Writer:
    """Turns steps into documents; `plan-tree/1` holds no notes, and one observation per target."""

    def __init__(self, tree: PlanTree, problem: Problem) -> None:
        self.tree, self.legacy = tree, problem.source_format == CONTINGENCY.format
        windows = {o.id: o.window_s for o in problem.observations if o.window_s is not None}
        self.waits = {o: window[0] for o, window in windows.items() if window[0] > 0}

    def steps(self, plan: Plan, path: Path) -> tuple[StepDocument, ...]:
        found = []
        for k, step in enumerate(plan):
            row = self.step(step, (*path, k))
            notes = None if self.legacy else self.tree.step_notes.get((*path, k))
            if notes is not None:
                row["p_reached"] = notes.p_reached
                if notes.quantiles:
                    row["quantiles"] = {
                        "p": notes.quantiles,
                        "time_s": notes.time_s,
                        "energy_j": notes.energy_j,
                    }
            found.append(row)
        return tuple(found)

    def step(self, step: Step, path: Path) -> StepDocument:
        match step:
            case TrackStart(target, on_fail):
                return {"op": "track_start", "target": target, "on_fail": on_fail.value}
            case TrackStop(target, on_fail):
                return {"op": "track_stop", "target": target, "on_fail": on_fail.value}
            case Navigate(to, require_tracked, on_fail):
                return {
                    "op": "navigate", "to": to, "require_tracked": require_tracked, "on_fail": on_fail.value
                }  # fmt: skip
            case Observe(observation, target, on_fail):
                return self.observing({"op": "observe", "target": target}, observation, on_fail)
            case Visit(observation, target, on_fail):
                return self.observing({"op": "visit", "target": target}, observation, on_fail)
            case Stop():
                return {"op": "stop"}
            case Branch(options):
                return {
                    "op": "branch",
                    "options": tuple(self.option(o, (*path, k)) for k, o in enumerate(options)),
                }
            case _:
                assert_never(step)

    def observing(self, row: ObserveDocument, observation: ObservationId, on_fail: OnFail) -> ObserveDocument:
        if not self.legacy:
            row["observation"] = observation
            if observation in self.waits:
                row["wait_until_s"] = self.waits[observation]
        row["on_fail"] = on_fail.value
        return row

    def option(self, option: Option, path: Path) -> OptionDocument:
        when = tuple(_condition_document(c, self.legacy) for c in option.when)
        plan = self.steps(option.plan, path)
        row: dict[str, object] = {"when": when}
        if not self.legacy:
            notes = self.tree.option_notes.get(path)
            if option.id:
                row = {"id": option.id, "when": when}
            if notes is not None:
                row |= {"p_taken": notes.p_taken, "gain": notes.gain, "utility_table": notes.utility_table}
        return cast("OptionDocument", row | {"plan": plan})


def plan_tree_to_dict(tree: PlanTree, problem: Problem) -> dict[str, Any]:
    """Return `plan-tree/1` for a problem read from `contingency/1`, else `plan-tree/2`."""
    writer = _Writer(tree, problem)
    d: dict[str, object] = {"instance": tree.instance}
    if tree.method:
        d["method"] = tree.method
    if not writer.legacy:
        d["problem_sha256"] = problem.digest()
    d["plan"] = writer.steps(tree.plan, ())
    return (TREES_1 if writer.legacy else TREES).document(cast("TreeDocument", d))


class _Reader:
    """Turns documents into steps, checked against the problem."""

    def __init__(self, problem: Problem) -> None:
        self.targets = {t.id: t for t in problem.targets}
        self.observations = {o.id: o for o in problem.observations}

    def target(self, name: str | None, what: str) -> TargetId:
        if name not in self.targets:
            raise PlanTreeError(f"{what} is {name!r}; the problem has no such target")
        return TargetId(name)

    def observation(self, row: ObserveDocument | DoneDocument, what: str) -> ObservationId:
        name = row.get("observation")
        if name is None:
            target = self.targets[self.target(row.get("target"), f"{what}.target")]
            if len(target.observations) != 1:
                raise PlanTreeError(
                    f"{what}: target {target.id} has {len(target.observations)} observations; "
                    "name one in observation"
                )
            return target.observations[0].id
        if name not in self.observations:
            raise PlanTreeError(f"{what}.observation is {name!r}; the problem has no such observation")
        return ObservationId(name)

    def condition(self, row: ConditionDocument, what: str) -> Condition:
        match row["var"]:
            case "tracked":
                return TrackedCondition(self.target(row["target"], f"{what}.target"), row["is"])
            case "done":
                return DoneCondition(self.observation(row, what), row["is"])
            case var:
                kind = TimeCondition if var == "time_s" else EnergyCondition
                if "ge" in row:
                    return kind(Comparison.GE, row["ge"])
                if "lt" in row:
                    return kind(Comparison.LT, row["lt"])
                raise PlanTreeError(f"{what}: a condition on {var} needs a number in ge or lt")

    def steps(self, rows: tuple[StepDocument, ...], what: str) -> Plan:
        return tuple(self.step(row, f"{what}[{k}]") for k, row in enumerate(rows))

    def step(self, row: StepDocument, what: str) -> Step:
        if row["op"] == "stop":
            return Stop()
        if row["op"] == "branch":
            options = enumerate(row["options"])
            return Branch(tuple(self.option(o, f"{what}.options[{k}]") for k, o in options))
        on_fail = OnFail(row.get("on_fail", "stop"))
        match row["op"]:
            case "track_start":
                return TrackStart(self.target(row["target"], f"{what}.target"), on_fail)
            case "track_stop":
                return TrackStop(self.target(row["target"], f"{what}.target"), on_fail)
            case "navigate":
                return Navigate(
                    self.target(row["to"], f"{what}.to"), row.get("require_tracked", False), on_fail
                )
            case op:
                oid = self.observation(row, what)
                target = self.observations[oid].target
                return Observe(oid, target, on_fail) if op == "observe" else Visit(oid, target, on_fail)

    def option(self, row: OptionDocument, what: str) -> Option:
        when = tuple(self.condition(c, f"{what}.when[{k}]") for k, c in enumerate(row["when"]))
        return Option(when, self.steps(row["plan"], f"{what}.plan"), row.get("id", ""))


def plan_tree_from_dict(data: object, problem: Problem) -> PlanTree:
    """Return the plan tree in a `plan-tree/1` or `plan-tree/2` document, checked against its problem.

    Notes on steps and options (odds, gains, quantiles) are not read back: they follow from plan and problem.

    Raises
    ------
    PlanTreeError
        If the document is malformed or names a target or observation that the problem does not have.
    """
    document = TREES.from_document(data)
    plan = _Reader(problem).steps(document["plan"], "plan")
    return PlanTree(document.get("instance", problem.name), plan, document.get("method", ""))


def planned_observations(plan: Plan) -> set[ObservationId]:
    """Return the observations that some path through the plan carries out."""
    return {step.observation for _, step in walk(plan) if isinstance(step, Observe | Visit)}
