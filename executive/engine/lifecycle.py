"""The life of a node: the transitions of CRL.md 4.3, numbered as there."""

from __future__ import annotations

import math

from executive.crl.values import IfNone, utility_at
from executive.engine import windows
from executive.engine.instance import (
    ABORTED,
    ACTIVE,
    ENDING,
    EXECUTING,
    FAILED,
    FAILING,
    FINISHED,
    INACTIVE,
    SKIPPED,
    STARTED,
    SUCCEEDED,
    SUSPENDED,
    SUSPENDING,
    WAITING,
    Instance,
    Outcome,
    UtilityUsed,
)
from executive.engine.run import Run
from executive.engine.spec import BLOCK, BRANCH, CONCURRENT, END, START, TASK, OptionSpec

# --- activation, start, resumption ------------------------------------------------


def activate(run: Run, node: Instance) -> None:
    """Row 1: INACTIVE -> WAITING; a node that a replacement has kept goes on as it is."""
    if node.state is not INACTIVE:
        return
    node.state = WAITING
    node.activation = run.agenda.now
    spec = node.spec
    if spec.start_windows:
        windows.open_start(run, node)
    if spec.wait_for is not None:
        run.board.watch(node, spec.wait_for)
    if run.network.wanted:
        run.network.activated(node)
    run.agenda.consider(node)


def try_start(run: Run, node: Instance) -> bool:
    """Rows 2, 3 and 18: start, fail or resume a node if it is its time; tell whether it was."""
    spec = node.spec
    if node.state is SUSPENDED:
        missing = run.ledger.missing(spec.uses)
        if missing is not None:
            run.ledger.wait(missing, node)
            return False
        resume(run, node)
        return True
    t = run.agenda.now
    if node.start_blocked or t < node.start_lo or t > node.start_hi:
        return False
    database = run.database
    if spec.wait_for is not None and spec.wait_for.ask(database) is not True:
        return False
    if run.network.needed and not run.network.may_start(node):
        return False
    if spec.uses and (missing := run.ledger.missing(spec.uses)) is not None:
        run.ledger.wait(missing, node)
        return False
    if spec.start is not None and spec.start.ask(database) is not True:
        finish(run, node, FAILED, "start-condition")
    elif spec.requires and not run.ledger.met(spec.requires, node, database):
        finish(run, node, FAILED, "resource")
    elif spec.maintain is not None and spec.maintain.ask(database) is False:
        finish(run, node, FAILED, "maintain-violated")
    else:
        start(run, node)
    return True


def start(run: Run, node: Instance) -> None:
    """Row 2: WAITING -> EXECUTING."""
    spec = node.spec
    node.state = EXECUTING
    node.blocked_on = ""
    node.start = run.agenda.now
    run.record("start", node.id)
    if spec.uses or spec.requires:
        run.ledger.take(node)
        if spec.requires:
            run.reservations_changed()
    if spec.end_windows:
        windows.open_end(run, node)
    if node.kind is BRANCH:
        run.undecided[node] = None
        watch_options(run, node)
    elif spec.maintain is not None:
        run.board.watch(node, spec.maintain)
    elif node.watching:
        run.board.unwatch(node)
    windows.point_settled(run, node, START)
    if node.kind is TASK:  # it is looked at when its action returns or its conditions say something new
        run.issue(node)
        return
    if node.kind is BLOCK:
        activate(run, node.below[0])
    elif node.kind is CONCURRENT:
        for child in node.below:
            activate(run, child)
    run.agenda.touch(node)


def resume(run: Run, node: Instance) -> None:
    """Row 18: SUSPENDED -> EXECUTING."""
    spec = node.spec
    if spec.maintain is not None and spec.maintain.ask(run.database) is False:
        fail(run, node, FAILED, "maintain-violated")
        return
    node.state = EXECUTING
    node.blocked_on = ""
    run.record("resume", node.id)
    if spec.uses or spec.requires:
        run.ledger.take(node)
        if spec.requires:
            run.reservations_changed()
    if spec.maintain is not None:
        run.board.watch(node, spec.maintain)
    run.issue(node)
    run.agenda.touch(node)


def watch_options(run: Run, node: Instance) -> None:
    """Watch what an undecided branch depends on, beside its own maintain conditions."""
    spec = node.spec
    keys = [
        resource.key
        for option in spec.options
        for name, _ in option.requires
        if (resource := run.ledger.resources.get(name)) is not None and resource.key is not None
    ]
    run.board.watch(node, spec.maintain, *(option.eligible for option in spec.options), keys=keys)


# --- phase E ----------------------------------------------------------------------


def transition(run: Run, node: Instance) -> bool:
    """Let the node take its first enabled transition of phase E; tell whether there was one."""
    state = node.state
    if state is FAILING:
        if not settled(node):
            return False
        assert node.final is not None
        finish(run, node, node.final, node.final_reason)  # row 15
        return True
    if state is EXECUTING or state is ENDING:
        spec = node.spec
        if spec.maintain is not None and spec.maintain.ask(run.database) is False:
            fail(run, node, FAILED, "maintain-violated")  # row 11
            return True
        if state is EXECUTING:
            if node.kind is TASK:
                taken, complete = run_task(run, node)
            elif node.kind is BRANCH:
                taken, complete = run_branch(run, node)
            else:
                taken, complete = run_block(run, node)
            if taken:
                return True
        else:
            complete = True
        if not complete or node.extra or (node.remaining and occupied(node)):
            return False
        return end(run, node)
    if state is SUSPENDING and node.command is None:
        suspended(run, node)  # row 17
        return True
    return False


def extras_finished(node: Instance) -> bool:
    return all(other.state is FINISHED for other in node.extra)


def occupied(node: Instance) -> bool:
    """Tell whether a tree beside those that decide about the node keeps it from ending (CRL.md 7.1, 7.4).

    An inserted contingency, what a replacement stops, and what it lets run on below an option not chosen.
    """
    if node.extra:
        return True
    return node.kind is BRANCH and node.remaining > 0 and any(k.state in STARTED for k in node.below)


def crossed(run: Run, node: Instance) -> bool:
    """Tell whether what still runs below another option of a branch keeps the node from starting (7.4).

    Options are alternatives: their nodes never command the rover side by side (`docs/concepts/decisions.md`).
    """
    child = node
    for above in node.ancestors():
        others = above.below if above in run.crossed and above.choice() is child else ()
        if any(other.state in STARTED for other in others if other is not child):
            return True
        child = above
    return False


def settled(node: Instance) -> bool:
    """Tell whether all that a FAILING node waits for is over."""
    return node.command is None and node.remaining == 0 and (not node.extra or extras_finished(node))


def run_task(run: Run, node: Instance) -> tuple[bool, bool]:
    """Rows 6 and 7; return (transition taken, complete)."""
    result = node.result
    if result is False:
        if node.retries_used >= node.spec.retries:
            finish(run, node, FAILED, "action-failed")  # row 6
            return True, False
        node.retries_used += 1
        run.retry_from(node, run.t + node.spec.retry_delay_ms)  # row 7
        return True, False
    if node.retry_at is not None:
        if node.retry_at > run.t or run.paused or (run.hold is not None and run.hold.stops(node)):
            return False, False
        run.record("retry", node.id)
        run.issue(node)
        return True, False
    return False, result is True


def run_block(run: Run, node: Instance) -> tuple[bool, bool]:
    """Rows 12 and 1 of a block or concurrent block."""
    if node.fatal:
        fail(run, node, FAILED, "child-failed")  # row 12
        return True, False
    if node.remaining == 0:
        return False, True
    if node.kind is BLOCK:
        below = node.below
        while below[node.cursor].state is FINISHED:
            node.cursor += 1
        child = below[node.cursor]
        if child.state is INACTIVE:
            activate(run, child)  # row 1; nothing more follows for the block before the child is over
    return False, False


def run_branch(run: Run, node: Instance) -> tuple[bool, bool]:
    """Rows 16, 16b and 12 of a branch."""
    spec = node.spec
    if node.chosen is None:
        if choose(run, node):  # row 16
            return True, False
        if spec.if_none is IfNone.WAIT or occupied(node):
            return False, False
        outcome = SKIPPED if spec.if_none is IfNone.SKIP else FAILED
        finish(run, node, outcome, "no-eligible-option")  # row 16b
        return True, False
    child = node.choice()
    if child is None or child.state is not FINISHED:
        return False, False
    if child.failed_fatally():
        if not (spec.next_on_failure and choose(run, node)):
            fail(run, node, FAILED, "child-failed")  # row 12
        return True, False
    return False, True


def end(run: Run, node: Instance) -> bool:
    """Rows 8, 9 and 10 of a complete node."""
    if run.agenda.now < node.end_lo or node.end_held:
        if node.state is EXECUTING:
            node.state = ENDING  # row 8
            return True
        return False
    spec = node.spec
    if spec.end is not None and spec.end.ask(run.database) is not True:
        finish(run, node, FAILED, "end-condition")
    elif run.t > node.end_hi:
        finish(run, node, FAILED, "end-window-missed")
    else:
        finish(run, node, SUCCEEDED, "")
    return True


def suspended(run: Run, node: Instance) -> None:
    """Row 17, second half: SUSPENDING -> SUSPENDED."""
    node.state = SUSPENDED
    node.result = None
    node.retry_at = None
    run.retrying.pop(node, None)
    node.awaiting_restart = False
    run.record("suspend", node.id)
    release(run, node)
    run.agenda.consider(node)


# --- choice -----------------------------------------------------------------------


def choose(run: Run, node: Instance) -> bool:
    """Choose the eligible untried option of highest utility, if there is one (CRL.md 5)."""
    best = best_option(run, node)
    if best is None:
        return False
    best_index, chosen = best
    node.chosen = best_index
    if node.tried is None:
        node.tried = set()
    node.tried.add(chosen.id)
    run.undecided.pop(node, None)
    run.record("choose", node.id, chosen.id)
    run.board.watch(node, node.spec.maintain)
    if not node.spec.next_on_failure:
        for index, other in enumerate(node.below):
            if index != best_index:
                skip(run, other, "not-chosen")
    run.network.planted(node.below[best_index])
    activate(run, node.below[best_index])
    return True


def best_option(run: Run, node: Instance) -> tuple[int, OptionSpec] | None:
    """Return number and value of the option that wins now, None if no untried one is eligible."""
    if node.untried is None:
        ranked = node.spec.ranked_options()
        node.untried = [n for n in ranked if n[1].id not in (node.tried or ())]
    constant = run.utilities is None and node.spec.constant_utilities
    best, best_utility = -1, -math.inf
    for place, (_, option) in enumerate(node.untried):
        if option.eligible is not None and option.eligible.ask(run.database) is not True:
            continue
        if option.requires and not run.ledger.met(option.requires, node, run.database):
            continue
        if constant:  # the first eligible one of the ranking
            best = place
            break
        utility = option_utility(run, option)
        if best < 0 or utility > best_utility:
            best, best_utility = place, utility
    return node.untried.pop(best) if best >= 0 else None


def option_utility(run: Run, option: OptionSpec) -> float:
    """Return the utility of an option now: a better estimate where there is one, else that of the plan."""
    if run.utilities is not None:
        estimate = run.utilities(option.id, run.t, run.database)
        if estimate is not None:
            if isinstance(estimate, bool) or not isinstance(estimate, int | float) or math.isnan(estimate):
                run.note("ignored", f"the utility source gave {estimate!r}", option.id)
            else:
                run.out.append(UtilityUsed(run.t, option.id, estimate))
                return float(estimate)
    return utility_at(option.utility, run.t)


OUTCOME_VALUES = {outcome: outcome.lower() for outcome in Outcome}
"""What stands under `outcome <node>` in the database."""


# --- endings ----------------------------------------------------------------------


def release(run: Run, node: Instance) -> None:
    """Give back what the node holds and wake who can use it."""
    if node.held:
        for name in run.ledger.give_back(node):
            run.ask_waiters(name)
    if node.spec.requires and run.ledger.unreserve(node):
        run.reservations_changed()


def finish(run: Run, node: Instance, outcome: Outcome, reason: str) -> None:
    """Let the node become FINISHED, with its `end` event (a node SKIPPED before its start has none)."""
    if node.start is not None:
        node.end = run.agenda.now
    else:
        node.void = True
    if node is run.root:
        run.end_ms = run.agenda.now
    if outcome is SUCCEEDED:
        run.record("end", node.id, outcome._value_)
    else:
        run.record("end", node.id, outcome._value_, reason)
    if node.kind is not TASK and node.remaining:
        by_choice = node.chosen is not None and node.final is None
        for child in node.below:
            if child.state is not FINISHED:
                skip(run, child, "not-chosen" if by_choice else "parent-ended")
    elif outcome is SUCCEEDED:
        run.reward += node.spec.reward if node.kind is TASK else 0.0
    close(run, node, outcome, reason)


def close(run: Run, node: Instance, outcome: Outcome, reason: str) -> None:
    """What every entry to FINISHED does."""
    node.state = FINISHED
    node.blocked_on = ""
    node.outcome = outcome
    node.reason = reason
    if node.kind is TASK:
        run.retrying.pop(node, None)
    else:
        run.undecided.pop(node, None)
    if node.watching:
        run.board.unwatch(node)
    if node.held or node.spec.requires:
        release(run, node)
    if run.instances.get(node.id) is node:
        run.board.set_value(f"outcome {node.id}", OUTCOME_VALUES[outcome])
        if reason:
            run.board.set_value(f"reason {node.id}", reason)
    if node.void:
        windows.point_settled(run, node, START)
    windows.point_settled(run, node, END)
    parent = node.parent
    if parent is not None and parent.state is not FINISHED:
        if node.index >= 0 and parent.below[node.index] is node:
            parent.remaining -= 1
            if outcome is FAILED and parent.kind is not BRANCH and node.failed_fatally():
                parent.fatal = True
        elif node in run.stopping:
            parent.detach(node)
        if parent.kind is not CONCURRENT or not parent.remaining or parent.fatal:
            run.agenda.touch(parent)
        if parent in run.crossed:
            run.release_held()
    if run.stopping:
        run.stopping.discard(node)


def skip(run: Run, top: Instance, reason: str) -> None:
    """Row 5: the node and all below it that have not started become SKIPPED, without events."""
    for node in top.walk():
        if node.state in (INACTIVE, WAITING):
            node.void = True
            close(run, node, SKIPPED, reason)


def fail(run: Run, top: Instance, outcome: Outcome, reason: str) -> None:
    """Rows 11 to 14: the node goes to FAILING, and everything below it is terminated (CRL.md 4.7)."""
    begin_failing(run, top, outcome, reason)
    stack = list(reversed(top.children()))
    while stack:
        node = stack.pop()
        if node.state in (INACTIVE, WAITING):
            skip(run, node, "parent-ended")
            continue
        if node.state in ACTIVE:
            begin_failing(run, node, ABORTED, "parent-failed")
            stack.extend(reversed(node.children()))


def begin_failing(run: Run, node: Instance, outcome: Outcome, reason: str) -> None:
    node.state = FAILING
    node.final = outcome
    node.final_reason = reason
    node.retry_at = None
    node.awaiting_restart = False
    run.retrying.pop(node, None)
    run.undecided.pop(node, None)
    if node.watching:
        run.board.unwatch(node)
    run.ask_abort(node)
    run.agenda.touch(node)


def abort_root(run: Run) -> None:
    """Operator abort: the root is terminated (CRL.md 7.2)."""
    root = run.root
    if root.state in ACTIVE:
        fail(run, root, ABORTED, "operator")
    elif root.state in (INACTIVE, WAITING):
        finish(run, root, ABORTED, "operator")
