"""The life of a node: the transitions of CRL.md 4.3, numbered as there."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from executive.crl.nodes import IfNone, utility_at
from executive.engine import windows
from executive.engine.instance import ACTIVE, Instance, Outcome, State, UtilityUsed
from executive.engine.spec import END, START, Kind, OptionSpec

if TYPE_CHECKING:
    from executive.engine.core import Engine


# --- activation, start, resumption ------------------------------------------------


def activate(engine: Engine, node: Instance) -> None:
    """Row 1: INACTIVE -> WAITING."""
    node.state = State.WAITING
    node.activation = engine.t
    engine.waiting[node] = None
    spec = node.spec
    windows.open_start(engine, node)
    if spec.wait_for is not None:
        engine.watch(node, spec.wait_for)
    engine.network.activated(node)
    engine.consider(node)


def try_start(engine: Engine, node: Instance) -> bool:
    """Rows 2, 3 and 18: start, fail or resume a node if it is its time; tell whether it was."""
    spec = node.spec
    if node.state is State.SUSPENDED:
        missing = engine.ledger.missing(spec.uses)
        if missing is not None:
            engine.ledger.wait(missing, node)
            return False
        resume(engine, node)
        return True
    t = engine.t
    if node.start_blocked or t < node.start_lo or t > node.start_hi:
        return False
    database = engine.database
    if spec.wait_for is not None and spec.wait_for.ask(database) is not True:
        return False
    if not engine.network.may_start(node):
        return False
    missing = engine.ledger.missing(spec.uses)
    if missing is not None:
        engine.ledger.wait(missing, node)
        return False
    if spec.start is not None and spec.start.ask(database) is not True:
        finish(engine, node, Outcome.FAILED, "start-condition")
    elif spec.requires and not engine.ledger.met(spec.requires, node, database):
        finish(engine, node, Outcome.FAILED, "resource")
    elif spec.maintain is not None and spec.maintain.ask(database) is False:
        finish(engine, node, Outcome.FAILED, "maintain-violated")
    else:
        start(engine, node)
    return True


def start(engine: Engine, node: Instance) -> None:
    """Row 2: WAITING -> EXECUTING."""
    spec = node.spec
    node.state = State.EXECUTING
    node.start = engine.t
    engine.waiting.pop(node, None)
    engine.record("start", node.id)
    if spec.uses or spec.requires:
        engine.ledger.take(node)
        if spec.requires:
            engine.reservations_changed()
    windows.open_end(engine, node)
    if node.kind is Kind.BRANCH:
        engine.undecided[node] = None
        watch_options(engine, node)
    elif spec.maintain is not None:
        engine.watch(node, spec.maintain)
    elif node.watching:
        engine.unwatch(node)
    engine.point_settled(node, START)
    if node.kind is Kind.TASK:
        engine.issue(node)
    elif node.kind is Kind.BLOCK:
        activate(engine, node.below[0])
    elif node.kind is Kind.CONCURRENT:
        for child in node.below:
            activate(engine, child)
    engine.touch(node)


def resume(engine: Engine, node: Instance) -> None:
    """Row 18: SUSPENDED -> EXECUTING."""
    spec = node.spec
    engine.waiting.pop(node, None)
    if spec.maintain is not None and spec.maintain.ask(engine.database) is False:
        fail(engine, node, Outcome.FAILED, "maintain-violated")
        return
    node.state = State.EXECUTING
    engine.record("resume", node.id)
    if spec.uses or spec.requires:
        engine.ledger.take(node)
        if spec.requires:
            engine.reservations_changed()
    if spec.maintain is not None:
        engine.watch(node, spec.maintain)
    engine.issue(node)
    engine.touch(node)


def watch_options(engine: Engine, node: Instance) -> None:
    """Watch what an undecided branch depends on, beside its own maintain conditions."""
    spec = node.spec
    keys = [
        resource.key
        for option in spec.options
        for name, _ in option.requires
        if (resource := engine.ledger.resources.get(name)) is not None and resource.key is not None
    ]
    engine.watch(node, spec.maintain, *(option.eligible for option in spec.options), keys=keys)


# --- phase E ----------------------------------------------------------------------


def transition(engine: Engine, node: Instance) -> bool:
    """Let the node take its first enabled transition of phase E; tell whether there was one."""
    state = node.state
    if state is State.FAILING:
        if not settled(node):
            return False
        assert node.final is not None
        finish(engine, node, node.final, node.final_reason)  # row 15
        return True
    if state is State.EXECUTING or state is State.ENDING:
        spec = node.spec
        if spec.maintain is not None and spec.maintain.ask(engine.database) is False:
            fail(engine, node, Outcome.FAILED, "maintain-violated")  # row 11
            return True
        if state is State.EXECUTING:
            if node.kind is Kind.TASK:
                taken, complete = run_task(engine, node)
            elif node.kind is Kind.BRANCH:
                taken, complete = run_branch(engine, node)
            else:
                taken, complete = run_block(engine, node)
            if taken:
                return True
        else:
            complete = True
        return complete and not node.extra and end(engine, node)
    if state is State.SUSPENDING and node.command is None:
        suspended(engine, node)  # row 17
        return True
    return False


def extras_finished(node: Instance) -> bool:
    return all(other.state is State.FINISHED for other in node.extra)


def settled(node: Instance) -> bool:
    """Tell whether all that a FAILING node waits for is over."""
    return node.command is None and node.remaining == 0 and (not node.extra or extras_finished(node))


def run_task(engine: Engine, node: Instance) -> tuple[bool, bool]:
    """Rows 6 and 7; return (transition taken, complete)."""
    result = node.result
    if result is False:
        if node.retries_used >= node.spec.retries:
            finish(engine, node, Outcome.FAILED, "action-failed")  # row 6
            return True, False
        node.retries_used += 1
        engine.retry_from(node, engine.t + node.spec.retry_delay_ms)  # row 7
        return True, False
    if node.retry_at is not None:
        if node.retry_at > engine.t or engine.paused or (engine.hold is not None and engine.hold.stops(node)):
            return False, False
        engine.record("retry", node.id)
        engine.issue(node)
        return True, False
    return False, result is True


def run_block(engine: Engine, node: Instance) -> tuple[bool, bool]:
    """Rows 12 and 1 of a block or concurrent block."""
    if node.fatal:
        fail(engine, node, Outcome.FAILED, "child-failed")  # row 12
        return True, False
    if node.remaining == 0:
        return False, True
    if node.kind is Kind.BLOCK:
        below = node.below
        while below[node.cursor].state is State.FINISHED:
            node.cursor += 1
        child = below[node.cursor]
        if child.state is State.INACTIVE:
            activate(engine, child)  # row 1
            return True, False
    return False, False


def run_branch(engine: Engine, node: Instance) -> tuple[bool, bool]:
    """Rows 16, 16b and 12 of a branch."""
    spec = node.spec
    if node.chosen is None:
        if choose(engine, node):  # row 16
            return True, False
        if spec.if_none is IfNone.WAIT:
            return False, False
        outcome = Outcome.SKIPPED if spec.if_none is IfNone.SKIP else Outcome.FAILED
        finish(engine, node, outcome, "no-eligible-option")  # row 16b
        return True, False
    child = node.below[node.chosen]
    if child.state is not State.FINISHED:
        return False, False
    if child.failed_fatally():
        if not (spec.next_on_failure and choose(engine, node)):
            fail(engine, node, Outcome.FAILED, "child-failed")  # row 12
        return True, False
    return False, True


def end(engine: Engine, node: Instance) -> bool:
    """Rows 8, 9 and 10 of a complete node."""
    if engine.t < node.end_lo or node.end_held:
        if node.state is State.EXECUTING:
            node.state = State.ENDING  # row 8
            return True
        return False
    spec = node.spec
    if spec.end is not None and spec.end.ask(engine.database) is not True:
        finish(engine, node, Outcome.FAILED, "end-condition")
    elif engine.t > node.end_hi:
        finish(engine, node, Outcome.FAILED, "end-window-missed")
    else:
        finish(engine, node, Outcome.SUCCEEDED, "")
    return True


def suspended(engine: Engine, node: Instance) -> None:
    """Row 17, second half: SUSPENDING -> SUSPENDED."""
    node.state = State.SUSPENDED
    node.result = None
    node.retry_at = None
    engine.retrying.pop(node, None)
    node.awaiting_restart = False
    engine.record("suspend", node.id)
    release(engine, node)
    engine.waiting[node] = None
    engine.consider(node)


# --- choice -----------------------------------------------------------------------


def choose(engine: Engine, node: Instance) -> bool:
    """Choose the eligible untried option of highest utility, if there is one (CRL.md 5)."""
    best: OptionSpec | None = None
    best_index, best_utility = 0, -math.inf
    for index, option in enumerate(node.spec.options):
        if option.id in node.tried:
            continue
        if option.eligible is not None and option.eligible.ask(engine.database) is not True:
            continue
        if option.requires and not engine.ledger.met(option.requires, node, engine.database):
            continue
        utility = option_utility(engine, option)
        if best is None or utility > best_utility:
            best, best_index, best_utility = option, index, utility
    if best is None:
        return False
    node.chosen = best_index
    node.tried.add(best.id)
    engine.undecided.pop(node, None)
    engine.record("choose", node.id, best.id)
    engine.watch(node, node.spec.maintain)
    if not node.spec.next_on_failure:
        for index, other in enumerate(node.below):
            if index != best_index:
                skip(engine, other, "not-chosen")
    engine.network.planted(node.below[best_index])
    activate(engine, node.below[best_index])
    return True


def option_utility(engine: Engine, option: OptionSpec) -> float:
    """Return the utility of an option now: a better estimate where there is one, else that of the plan."""
    if engine.utilities is not None:
        estimate = engine.utilities(option.id, engine.t, engine.database)
        if estimate is not None:
            if isinstance(estimate, bool) or not isinstance(estimate, int | float) or math.isnan(estimate):
                engine.note("ignored", f"the utility source gave {estimate!r}", option.id)
            else:
                engine.out.append(UtilityUsed(engine.t, option.id, estimate))
                return float(estimate)
    return utility_at(option.utility, engine.t)


# --- endings ----------------------------------------------------------------------


def release(engine: Engine, node: Instance) -> None:
    """Give back what the node holds and wake who can use it."""
    for name in engine.ledger.give_back(node):
        engine.ask_waiters(name)
    if node.spec.requires and engine.ledger.unreserve(node):
        engine.reservations_changed()


def finish(engine: Engine, node: Instance, outcome: Outcome, reason: str) -> None:
    """Let the node become FINISHED, with its `end` event (which a node SKIPPED before its start has not)."""
    if node.start is not None:
        node.end = engine.t
    else:
        node.void = True
    if node is engine.root:
        engine.end_ms = engine.t
    arguments = (
        (node.id, outcome.value, reason) if outcome is not Outcome.SUCCEEDED else (node.id, outcome.value)
    )
    engine.record("end", *arguments)
    if node.kind is not Kind.TASK and node.remaining:
        by_choice = node.chosen is not None and node.final is None
        for child in node.below:
            if child.state is not State.FINISHED:
                skip(engine, child, "not-chosen" if by_choice else "parent-ended")
    elif outcome is Outcome.SUCCEEDED:
        engine.reward += node.spec.reward if node.kind is Kind.TASK else 0.0
    close(engine, node, outcome, reason)


def close(engine: Engine, node: Instance, outcome: Outcome, reason: str) -> None:
    """What every entry to FINISHED does."""
    node.state = State.FINISHED
    node.outcome = outcome
    node.reason = reason
    engine.waiting.pop(node, None)
    engine.retrying.pop(node, None)
    engine.undecided.pop(node, None)
    if node.watching:
        engine.unwatch(node)
    release(engine, node)
    if engine.instances.get(node.id) is node:
        engine.set_value(f"outcome {node.id}", outcome.value.lower())
        if reason:
            engine.set_value(f"reason {node.id}", reason)
    if node.void:
        engine.point_settled(node, START)
    engine.point_settled(node, END)
    parent = node.parent
    if parent is not None and parent.state is not State.FINISHED:
        if node.index >= 0 and parent.below[node.index] is node:
            parent.remaining -= 1
            if parent.kind is not Kind.BRANCH and node.failed_fatally():
                parent.fatal = True
        elif node in engine.stopping:
            parent.extra.remove(node)
        engine.touch(parent)
    engine.stopping.discard(node)


def skip(engine: Engine, top: Instance, reason: str) -> None:
    """Row 5: the node and all below it that have not started become SKIPPED, without events."""
    for node in top.walk():
        if node.state in (State.INACTIVE, State.WAITING):
            node.void = True
            close(engine, node, Outcome.SKIPPED, reason)


def fail(engine: Engine, top: Instance, outcome: Outcome, reason: str) -> None:
    """Rows 11 to 14: the node goes to FAILING, and everything below it is terminated (CRL.md 4.7)."""
    begin_failing(engine, top, outcome, reason)
    stack = list(reversed(top.children()))
    while stack:
        node = stack.pop()
        if node.state in (State.INACTIVE, State.WAITING):
            skip(engine, node, "parent-ended")
            continue
        if node.state in ACTIVE:
            begin_failing(engine, node, Outcome.ABORTED, "parent-failed")
            stack.extend(reversed(node.children()))


def begin_failing(engine: Engine, node: Instance, outcome: Outcome, reason: str) -> None:
    node.state = State.FAILING
    node.final = outcome
    node.final_reason = reason
    node.retry_at = None
    node.awaiting_restart = False
    engine.retrying.pop(node, None)
    engine.undecided.pop(node, None)
    engine.waiting.pop(node, None)
    if node.watching:
        engine.unwatch(node)
    engine.ask_abort(node)
    engine.touch(node)


def abort_root(engine: Engine) -> None:
    """Operator abort: the root is terminated (CRL.md 7.2)."""
    root = engine.root
    if root.state in ACTIVE:
        fail(engine, root, Outcome.ABORTED, "operator")
    elif root.state in (State.INACTIVE, State.WAITING):
        finish(engine, root, Outcome.ABORTED, "operator")
