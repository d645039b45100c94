"""Scenarios: a plan, a scripted world and the trace that must come of it."""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypedDict, cast

from executive.crl import CrlValidationError, Finding
from executive.crl.dictionary import Dictionary
from executive.engine.spec import PlanSpec
from executive.errors import ScenarioError
from executive.ports import (
    Event,
    Operation,
    Operator,
    Update,
    Value,
)
from executive.runtime.codec import trace_line
from executive.runtime.journal import MemoryJournal
from executive.runtime.loading import load_plan
from executive.runtime.recovery import recover_session
from executive.runtime.scripted_rover import Behaviour, ScriptedRover
from executive.runtime.session import RunOutcome, Session

Updates = dict[str, Value]


class Expected(TypedDict, total=False):
    """What has to come of a scenario: any of these."""

    plan_outcome: str | None
    end_time: float | None
    events: list[list[Any]]
    outcomes: dict[str, str | None]
    errors: list[str | dict[str, str]]


# --- files --------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Crash:
    """The executive stops at `t_ms`, before acting on anything of that time, and comes back at `until_ms`."""

    t_ms: int
    until_ms: int


@dataclass(frozen=True, slots=True)
class Scenario:
    name: str
    plan: str
    initial: Mapping[str, Value]
    actions: Mapping[str, tuple[Behaviour, ...]]
    script: tuple[Event, ...]
    crashes: tuple[Crash, ...]
    expect: Expected | None


@dataclass(frozen=True, slots=True)
class ScenarioRun:
    """What running a scenario gave: a run, or the findings with which its plan was rejected."""

    scenario: Scenario
    outcome: RunOutcome | None
    findings: tuple[Finding, ...]
    differences: tuple[str, ...]

    @property
    def agrees(self) -> bool:
        return not self.differences

    def to_json(self) -> dict[str, object]:
        """Return the members of `expect` as they came out."""
        if self.outcome is None:
            return {"errors": [finding.to_json() for finding in self.findings if finding.is_error]}
        return {
            "plan_outcome": self.outcome.outcome,
            "end_time": seconds(self.outcome.end_ms),
            "events": [trace_line(record) for record in self.outcome.trace],
            "outcomes": self.outcome.outcomes,
        }


def seconds(t_ms: int | None) -> float | None:
    if t_ms is None:
        return None
    return t_ms // 1000 if t_ms % 1000 == 0 else t_ms / 1000


def load_scenario(path: Path) -> Scenario:
    """Read a scenario file.

    Raises
    ------
    ScenarioError
        Naming the file and the member that is missing or wrong.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ScenarioError(f"scenario {path} cannot be read: {error}") from error
    try:
        document = json.loads(text)
    except ValueError as error:
        raise ScenarioError(f"scenario {path} is not JSON: {error}") from error
    try:
        return parse_scenario(document, path.name)
    except ScenarioError as error:
        raise ScenarioError(f"scenario {path}: {error}") from error


def parse_scenario(document: Any, name: str) -> Scenario:
    """Return the scenario of a JSON document."""
    top = _mapping(document, "the document")
    if "plan" not in top:
        raise ScenarioError('member "plan" is missing')
    plan = top["plan"]
    if not isinstance(plan, str):
        raise ScenarioError(f'member "plan" must be CRL text, found {_short(plan)}')
    world = _mapping(top.get("world", {}), '"world"')
    initial = _updates(world.get("initial", {}), '"world.initial"')
    actions = {
        task: _behaviours(value, f'"world.actions.{task}"')
        for task, value in _mapping(world.get("actions", {}), '"world.actions"').items()
    }
    script: list[Event] = []
    crashes: list[Crash] = []
    entries = world.get("events", [])
    if not isinstance(entries, list):
        raise ScenarioError(f'"world.events" must be a list, found {_short(entries)}')
    for place, entry in enumerate(entries):
        where = f'"world.events[{place}]"'
        event = _scripted(_mapping(entry, where), where)
        if isinstance(event, Crash):
            crashes.append(event)
        else:
            script.append(event)
    expect = top.get("expect")
    return Scenario(
        name=name,
        plan=plan,
        initial=initial,
        actions=actions,
        script=tuple(script),
        crashes=tuple(sorted(crashes, key=lambda c: c.t_ms)),
        expect=None if expect is None else cast("Expected", _mapping(expect, '"expect"')),
    )


def _short(value: object) -> str:
    text = json.dumps(value, ensure_ascii=False, default=repr)
    return text if len(text) <= 60 else text[:57] + "..."


def _mapping(value: Any, where: str) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise ScenarioError(f"{where} must be an object, found {_short(value)}")
    return value


def _updates(value: Any, where: str) -> Updates:
    for key, entry in _mapping(value, where).items():
        if not isinstance(entry, str | int | float | bool):
            raise ScenarioError(
                f"{where}: the value of {key!r} must be a number, string or boolean, found {_short(entry)}"
            )
    return dict(value)


def _ms(value: Any, where: str, *, allow_none: bool = False) -> int | None:
    if value is None and allow_none:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value < 2**40:
        raise ScenarioError(f"{where} must be a time in seconds, found {_short(value)}")
    return round(value * 1000)


def _time(value: Any, where: str) -> int:
    t_ms = _ms(value, where)
    assert t_ms is not None
    return t_ms


def _behaviours(value: Any, where: str) -> tuple[Behaviour, ...]:
    if isinstance(value, list):
        if not value:
            raise ScenarioError(f"{where}: the list of behaviours is empty")
        return tuple(_behaviour(entry, f"{where}[{i}]") for i, entry in enumerate(value))
    return (_behaviour(value, where),)


def _behaviour(value: Any, where: str) -> Behaviour:
    entry = _mapping(value, where)
    unknown = set(entry) - {"duration", "result", "set", "abort_delay", "during", "values"}
    if unknown:
        raise ScenarioError(f"{where}: unknown member {sorted(unknown)[0]!r}")
    result = entry.get("result", "success")
    during: list[tuple[int, Updates]] = []
    pairs = entry.get("during", [])
    if not isinstance(pairs, list):
        raise ScenarioError(f'{where}: "during" must be a list of [offset, updates], found {_short(pairs)}')
    for pair in pairs:
        if not isinstance(pair, list) or len(pair) != 2:
            raise ScenarioError(f'{where}: "during" must hold [offset, updates], found {_short(pair)}')
        during.append((_time(pair[0], f"{where}: offset"), _updates(pair[1], f"{where}: updates")))
    return Behaviour(
        duration_ms=_ms(entry.get("duration", 1), f'{where}: "duration"', allow_none=True),
        success=result == "success",
        updates=_updates(entry.get("set", {}), f'{where}: "set"'),
        abort_delay_ms=_time(entry.get("abort_delay", 0), f'{where}: "abort_delay"'),
        during=tuple(during),
        values=_updates(entry.get("values", {}), f'{where}: "values"'),
    )


def _scripted(entry: Mapping[str, Any], where: str) -> Event | Crash:
    if "t" not in entry:
        raise ScenarioError(f'{where}: member "t" is missing')
    t_ms = _time(entry["t"], f'{where}: "t"')
    if "set" in entry:
        return Update(t_ms, _updates(entry["set"], f'{where}: "set"'))
    if "operator" in entry:
        word = entry["operator"]
        if word not in ("pause", "resume", "abort"):
            raise ScenarioError(f'{where}: "operator" must be pause, resume or abort, found {_short(word)}')
        return Operator(t_ms, Operation(word))
    if "replace" in entry:
        if not isinstance(entry["replace"], str):
            raise ScenarioError(f'{where}: "replace" must be CRL text, found {_short(entry["replace"])}')
        return Operator(t_ms, Operation.REPLACE, entry["replace"])
    if "crash_until" in entry:
        until_ms = _time(entry["crash_until"], f'{where}: "crash_until"')
        if until_ms < t_ms:
            raise ScenarioError(f'{where}: "crash_until" lies before "t"')
        return Crash(t_ms, until_ms)
    raise ScenarioError(f"{where}: needs one of set, operator, replace, crash_until")


# --- running ------------------------------------------------------------------


def run_scenario(scenario: Scenario, dictionary: Dictionary | None = None) -> ScenarioRun:
    """Run a scenario and compare what came with what it expects, if it expects anything.

    With a `dictionary` a plan that does not keep to it is rejected.
    """
    try:
        plan = load_plan(scenario.plan, dictionary=dictionary)
    except CrlValidationError as error:
        findings = error.findings
        differences = () if scenario.expect is None else _compare_errors(findings, scenario.expect)
        return ScenarioRun(scenario, None, findings, differences)
    outcome = play(scenario, plan)
    differences = () if scenario.expect is None else compare(outcome, scenario.expect)
    return ScenarioRun(scenario, outcome, (), differences)


def play(scenario: Scenario, plan: PlanSpec) -> RunOutcome:
    """Run the plan of a scenario against its world; a crash rebuilds the executive from its journal."""
    rover = ScriptedRover(scenario.initial, scenario.actions, scenario.script)
    journal = MemoryJournal()
    session = Session(plan, rover, run_id=scenario.name, journal=journal)
    for crash in scenario.crashes:
        if session.started and crash.t_ms <= session.now_ms:
            continue
        if crash.t_ms > 0:
            session.step(crash.t_ms - 1)
        else:
            session.open_journal()
        if session.over:
            break
        rover.wait_until(crash.until_ms)
        session = recover_session(plan, rover, journal, now_ms=crash.until_ms)
    return session.run()


def compare(outcome: RunOutcome, expect: Expected) -> tuple[str, ...]:
    """Return how a run differs from what was expected; nothing if the traces agree."""
    if "errors" in expect:
        return (f"the plan was accepted, expected errors {expect['errors']}",)
    differences: list[str] = []
    events = [trace_line(record) for record in outcome.trace]
    if "plan_outcome" in expect and expect["plan_outcome"] != outcome.outcome:
        differences.append(f"plan_outcome is {outcome.outcome}, expected {expect['plan_outcome']}")
    if "end_time" in expect and not _same_time(expect["end_time"], outcome.end_ms):
        differences.append(f"end_time is {seconds(outcome.end_ms)}, expected {expect['end_time']}")
    if "events" in expect:
        differences += _compare_events(events, expect["events"])
    for node, wanted in dict(expect.get("outcomes", {})).items():
        found = outcome.outcomes.get(node)
        if found != wanted:
            differences.append(f"outcome of {node} is {found}, expected {wanted}")
    return tuple(differences)


def _same_time(wanted: Any, t_ms: int | None) -> bool:
    if wanted is None or t_ms is None:
        return wanted is None and t_ms is None
    return bool(round(wanted * 1000) == t_ms)


def _compare_events(found: Sequence[Sequence[Any]], wanted: Sequence[Sequence[Any]]) -> list[str]:
    differences: list[str] = []

    def by_time(events: Sequence[Sequence[Any]]) -> dict[int, Counter[tuple[Any, ...]]]:
        table: dict[int, Counter[tuple[Any, ...]]] = defaultdict(Counter)
        for event in events:
            table[round(event[0] * 1000)][tuple(event[1:])] += 1
        return table

    def by_id(events: Sequence[Sequence[Any]]) -> dict[str, list[tuple[Any, ...]]]:
        table: dict[str, list[tuple[Any, ...]]] = defaultdict(list)
        for event in events:
            table[str(event[2]) if len(event) > 2 else ""].append((round(event[0] * 1000), *event[1:]))
        return table

    found_at, wanted_at = by_time(found), by_time(wanted)
    for t_ms in sorted({*found_at, *wanted_at}):
        unexpected, missing = found_at[t_ms] - wanted_at[t_ms], wanted_at[t_ms] - found_at[t_ms]
        differences += (f"at {seconds(t_ms)}: unexpected {list(event)}" for event in unexpected.elements())
        differences += (f"at {seconds(t_ms)}: missing {list(event)}" for event in missing.elements())
    if not differences:
        found_of, wanted_of = by_id(found), by_id(wanted)
        differences += (
            f"events of {name or 'the plan'} come in another order"
            for name in sorted({*found_of, *wanted_of})
            if found_of[name] != wanted_of[name]
        )
    return differences


def _compare_errors(findings: Sequence[Finding], expect: Expected) -> tuple[str, ...]:
    codes = {finding.code for finding in findings if finding.is_error}
    if "errors" not in expect:
        return ("the plan was rejected: " + "; ".join(str(f) for f in findings if f.is_error),)
    wanted = [e["code"] if isinstance(e, dict) else e for e in expect["errors"]]
    return tuple(
        f"error {code} is not reported, found {sorted(codes)}" for code in wanted if code not in codes
    )
