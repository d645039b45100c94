"""Runs whose plan is replaced at random moments: what must hold whatever is sent when, beside the model."""

from __future__ import annotations

import random
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from executive.crl import Plan, canonical_text, check
from executive.engine.instance import Instance, State
from executive.engine.run import Run
from executive.ports import Operation, Operator
from executive.runtime.journal import MemoryJournal
from executive.runtime.loading import load_plan
from executive.runtime.recovery import recorded_trace, replay
from executive.runtime.scripted_rover import ScriptedRover
from executive.runtime.session import Session
from tests.executive.invariants import check_commands, check_resources
from tests.executive.model import Model
from tests.executive.replacements import EDITS, Editor
from tests.executive.worlds import Case, Maker

HORIZON_MS = 90_000


def replaced_case(seed: int, edits: Sequence[str]) -> tuple[Case, Plan] | None:
    """Return a case whose plan is replaced up to four times, each time by a plan made out of the last one."""
    rng = random.Random(seed)
    maker = Maker(rng, size=rng.randint(2, 14), temporal=seed % 3 == 0)
    case = maker.case()
    report = check(case.plan)
    if report.plan is None or not report.valid:
        return None
    editor = Editor(rng, edits)
    plan = first = editor.hold(editor.hold(report.plan))
    script = [e for e in case.script if not (isinstance(e, Operator) and e.operation is Operation.ABORT)]
    for at in sorted(rng.randint(0, 60) for _ in range(rng.randint(1, 4))):
        plan = editor.edit(plan)
        script.append(Operator(at * 500, Operation.REPLACE, canonical_text(plan)))
    for n in range(1, editor.serial + 1):
        case.actions[f"n{n}"] = tuple(maker.behaviour() for _ in range(2))
    case.script = tuple(sorted(script, key=lambda e: e.t_ms))
    return case, first


@dataclass
class Watched:
    """A session that is looked at after every macro step."""

    session: Session
    roots_seen: int = 0
    problems: list[str] = field(default_factory=list)

    def look(self) -> None:
        run = self.session.engine.run
        check_resources(self.session.engine)
        commanding = {top_of(run, node) for node in run.commands.values() if not node.abort_asked}
        if len(commanding) > 1:
            self.problems.append(f"two trees command the rover: {sorted(n.id for n in commanding)}")
        for node in every_instance(run):
            if node.state is State.FINISHED:
                waiting = [k.id for k in node.children() if k.state is not State.FINISHED]
                if waiting:
                    self.problems.append(f"{node.id} is over before {waiting}")
        for command, node in run.commands.items():
            if node.command != command or node.state in (State.FINISHED, State.INACTIVE, State.WAITING):
                self.problems.append(f"{command} has no node that waits for it")
        if self.session.over and run.commands:
            self.problems.append(f"the plan is over and {sorted(map(str, run.commands))} run")


def every_instance(run: Run) -> list[Instance]:
    found: dict[Instance, None] = {}
    for top in (run.root, *run.instances.values(), *run.old.values(), *run.commands.values()):
        for node in (top, *top.ancestors()):
            found[node] = None
    return list(found)


def top_of(run: Run, node: Instance) -> Instance:
    """Return the root of the tree to which a node belongs."""
    return [node, *node.ancestors()][-1]


def table(trace: list[tuple[int, tuple[str, ...]]]) -> dict[int, list[tuple[str, ...]]]:
    out: dict[int, list[tuple[str, ...]]] = defaultdict(list)
    for t_ms, words in trace:
        if t_ms <= HORIZON_MS:
            out[t_ms].append(words)
    return {t: sorted(events) for t, events in out.items()}


def check_seed(seed: int, edits: Sequence[str] = EDITS) -> int:
    """Hold a case to the rules and to the model; return its number of replacements (0: not valid).

    Raises
    ------
    AssertionError
        If a rule is broken or the traces differ.
    """
    made = replaced_case(seed, edits)
    if made is None:
        return 0
    case, plan = made
    check_case(case, plan)
    orders = (e.operation for e in case.script if isinstance(e, Operator))
    return sum(order is Operation.REPLACE for order in orders)


def check_case(case: Case, plan: Plan) -> None:
    """Hold a run of a plan in the world of a case to the rules and to the model, the horizon included.

    Raises
    ------
    AssertionError
        If a rule is broken or the traces differ; it names the first instant at which they do.
    """
    journal = MemoryJournal()
    rover = ScriptedRover(case.initial, case.actions, case.script)
    session = Session(load_plan(plan), rover, journal=journal)
    watched = Watched(session)
    while session.now_ms <= HORIZON_MS and session.step_once():  # an instant has up to two macro steps
        watched.look()
        assert not watched.problems, watched.problems
    check_commands(rover.sent)
    assert replay(journal.records) == recorded_trace(journal.records) == session.trace, "the replay differs"
    model = Model(plan, ScriptedRover(case.initial, case.actions, case.script))
    model.run(HORIZON_MS)
    expected = table(model.trace)
    found = table([(r.t_ms, (r.event, *r.arguments)) for r in session.trace])
    assert found == expected, difference(found, expected)


Events = Mapping[int, Sequence[tuple[str, ...]]]


def difference(found: Events, expected: Events) -> str:
    """Return the first instant at which two tables differ, and what each of them has there."""
    t = min(t for t in found.keys() | expected.keys() if found.get(t) != expected.get(t))
    return f"at {t} ms the engine has {found.get(t, [])}, the model {expected.get(t, [])}"
