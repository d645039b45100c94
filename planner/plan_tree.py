"""Contingent plans as trees of steps, and their JSON forms `plan-tree/1` and `plan-tree/2`.

Steps are carried out in order. At a `Branch` the first option whose conditions all hold is run *instead of*
the rest of its plan; if none holds the plan goes on. A step that cannot be carried out (target lost, window
closed, rover elsewhere, done already) fails: `STOP` ends the plan there, `SKIP` goes on with the next step.
Branches are counted as options in the whole tree.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, TypeAlias

from planner.errors import PlanTreeError
from planner.problem import ObservationId, Problem, TargetId

MAX_DEPTH = 60


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
    """Yield, for every way through the plan, the observations on it: what is made there if nothing fails."""
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


# ----------------------------------------------------------------------------------------------- JSON


def _condition_dict(condition: Condition, legacy: bool) -> dict[str, Any]:
    match condition:
        case TimeCondition(comparison, value):
            return {"var": "time_s", comparison.value: value}
        case EnergyCondition(comparison, value):
            return {"var": "energy_j", comparison.value: value}
        case TrackedCondition(target, truth):
            return {"var": "tracked", "target": target, "is": truth}
        case DoneCondition(observation, truth):
            return {"var": "done", "target" if legacy else "observation": observation, "is": truth}


def _step_dict(
    step: Step, path: Path, tree: PlanTree, legacy: bool, waits: Mapping[ObservationId, float]
) -> dict[str, Any]:
    d: dict[str, Any]
    match step:
        case TrackStart(target, _):
            d = {"op": "track_start", "target": target}
        case TrackStop(target, _):
            d = {"op": "track_stop", "target": target}
        case Navigate(to, require_tracked, _):
            d = {"op": "navigate", "to": to, "require_tracked": require_tracked}
        case Observe(observation, target, _) | Visit(observation, target, _):
            d = {"op": "observe" if isinstance(step, Observe) else "visit", "target": target}
            if not legacy:
                d["observation"] = observation
                if observation in waits:
                    d["wait_until_s"] = waits[observation]
        case Stop():
            d = {"op": "stop"}
        case Branch(options):
            d = {"op": "branch"}
            rows = []
            for k, option in enumerate(options):
                row: dict[str, Any] = {"when": [_condition_dict(c, legacy) for c in option.when]}
                if not legacy:
                    notes = tree.option_notes.get((*path, k))
                    if option.id:
                        row = {"id": option.id, **row}
                    if notes is not None:
                        row["p_taken"], row["gain"] = notes.p_taken, notes.gain
                        row["utility_table"] = [list(p) for p in notes.utility_table]
                row["plan"] = [
                    _step_dict(s, (*path, k, j), tree, legacy, waits) for j, s in enumerate(option.plan)
                ]
                rows.append(row)
            d["options"] = rows
    if not isinstance(step, Branch | Stop):
        d["on_fail"] = step.on_fail.value
    if not legacy and path in tree.step_notes:
        note = tree.step_notes[path]
        d["p_reached"] = note.p_reached
        if note.quantiles:
            d["quantiles"] = {
                "p": list(note.quantiles),
                "time_s": list(note.time_s),
                "energy_j": list(note.energy_j),
            }
    return d


def plan_tree_to_dict(tree: PlanTree, problem: Problem) -> dict[str, Any]:
    """Return `plan-tree/1` for a problem read from `contingency/1`, else `plan-tree/2`."""
    legacy = problem.source_format == "contingency/1"
    waits = {
        o.id: o.window_s[0] for o in problem.observations if o.window_s is not None and o.window_s[0] > 0
    }
    d: dict[str, Any] = {"format": "plan-tree/1" if legacy else "plan-tree/2", "instance": tree.instance}
    if tree.method:
        d["method"] = tree.method
    if not legacy:
        d["problem_sha256"] = problem.digest()
    d["plan"] = [_step_dict(step, (k,), tree, legacy, waits) for k, step in enumerate(tree.plan)]
    return d


class _TreeReader:
    def __init__(self, problem: Problem) -> None:
        self.targets = {t.id: t for t in problem.targets}
        self.observations = {o.id: o for o in problem.observations}

    def target(self, row: Mapping[str, Any], key: str, what: str) -> TargetId:
        name = row.get(key)
        if name not in self.targets:
            raise PlanTreeError(f'{what}: "{key}" is {name!r}; the problem has no such target')
        return TargetId(str(name))

    def observation(self, row: Mapping[str, Any], what: str) -> ObservationId:
        name = row.get("observation")
        if name is None:
            target = self.targets[self.target(row, "target", what)]
            if len(target.observations) != 1:
                raise PlanTreeError(
                    f'{what}: target "{target.id}" has {len(target.observations)} observations; '
                    'name one in "observation"'
                )
            return target.observations[0].id
        if name not in self.observations:
            raise PlanTreeError(f'{what}: "observation" is {name!r}; the problem has no such observation')
        return ObservationId(str(name))

    def condition(self, row: Any, what: str) -> Condition:
        if not isinstance(row, Mapping):
            raise PlanTreeError(f"{what}: a condition must be an object, found {row!r}")
        var = row.get("var")
        if var in ("time_s", "energy_j"):
            for comparison in Comparison:
                value = row.get(comparison.value)
                if isinstance(value, int | float) and not isinstance(value, bool):
                    if var == "time_s":
                        return TimeCondition(comparison, float(value))
                    return EnergyCondition(comparison, float(value))
            raise PlanTreeError(f'{what}: a condition on {var} needs a number in "ge" or "lt"')
        truth = row.get("is")
        if var not in ("tracked", "done") or not isinstance(truth, bool):
            raise PlanTreeError(f"{what}: unknown condition {dict(row)!r}")
        if var == "tracked":
            return TrackedCondition(self.target(row, "target", what), truth)
        return DoneCondition(self.observation(row, what), truth)

    def steps(self, rows: Any, what: str, depth: int = 0) -> Plan:
        if not isinstance(rows, list | tuple):
            raise PlanTreeError(f"{what}: a plan must be an array, found {type(rows).__name__}")
        if depth > MAX_DEPTH:
            raise PlanTreeError(f"{what}: branches are nested deeper than {MAX_DEPTH}")
        return tuple(self.step(row, f"{what}, step {k + 1}", depth) for k, row in enumerate(rows))

    def step(self, row: Any, what: str, depth: int) -> Step:
        if not isinstance(row, Mapping):
            raise PlanTreeError(f"{what} must be an object, found {row!r}")
        op = row.get("op")
        try:
            on_fail = OnFail(row.get("on_fail", "stop"))
        except ValueError as err:
            found = row.get("on_fail")
            raise PlanTreeError(f'{what}: "on_fail" is {found!r}; it must be "stop" or "skip"') from err
        match op:
            case "track_start":
                return TrackStart(self.target(row, "target", what), on_fail)
            case "track_stop":
                return TrackStop(self.target(row, "target", what), on_fail)
            case "navigate":
                tracked = bool(row.get("require_tracked", False))
                return Navigate(self.target(row, "to", what), tracked, on_fail)
            case "observe" | "visit":
                oid = self.observation(row, what)
                target = self.observations[oid].target
                return Observe(oid, target, on_fail) if op == "observe" else Visit(oid, target, on_fail)
            case "stop":
                return Stop()
            case "branch":
                options = row.get("options")
                if not isinstance(options, list | tuple):
                    raise PlanTreeError(f'{what}: "options" must be an array')
                return Branch(
                    tuple(self.option(o, f"{what}, option {k + 1}", depth) for k, o in enumerate(options))
                )
        raise PlanTreeError(f'{what}: "op" is {op!r}, which is no step')

    def option(self, row: Any, what: str, depth: int) -> Option:
        if not isinstance(row, Mapping) or not isinstance(row.get("when"), list | tuple):
            raise PlanTreeError(f'{what} must be an object with "when" and "plan"')
        when = tuple(self.condition(c, what) for c in row["when"])
        return Option(when, self.steps(row.get("plan"), what, depth + 1), str(row.get("id", "")))


def plan_tree_from_dict(data: Any, problem: Problem) -> PlanTree:
    """Return the plan tree in a `plan-tree/1` or `plan-tree/2` document, checked against its problem.

    Notes on steps and options (odds, gains, quantiles) are not read back: they follow from plan and problem.

    Raises
    ------
    PlanTreeError
        If the document is malformed or names a target or observation that the problem does not have.
    """
    if not isinstance(data, Mapping):
        raise PlanTreeError(f"a plan tree must be an object, found {type(data).__name__}")
    if data.get("format") not in ("plan-tree/1", "plan-tree/2"):
        raise PlanTreeError(
            f'plan tree: "format" is {data.get("format")!r}; it must be "plan-tree/1" or "plan-tree/2"'
        )
    plan = _TreeReader(problem).steps(data.get("plan"), "plan")
    return PlanTree(str(data.get("instance", problem.name)), plan, str(data.get("method", "")))


def planned_observations(plan: Plan) -> set[ObservationId]:
    """Return the observations that some path through the plan carries out."""
    return {step.observation for _, step in walk(plan) if isinstance(step, Observe | Visit)}
