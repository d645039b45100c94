"""Phase F: floating contingencies (CRL.md 7.1), alternates (7.3) and the end of the plan."""

from __future__ import annotations

from executive.crl.values import utility_at
from executive.engine import lifecycle
from executive.engine.instance import (
    ACTIVE,
    EXECUTING,
    FAILED,
    FAILING,
    FINISHED,
    INACTIVE,
    SUSPENDING,
    Floating,
    Hold,
    Instance,
    is_running_task,
)
from executive.engine.run import Run
from executive.engine.spec import AlternateSpec


def set_timers(run: Run, floating: Floating) -> None:
    for instant in floating.spec.trigger.instants_ms():
        run.agenda.set_timer(instant, floating)


def phase_f(run: Run) -> bool:
    """Apply one rule of phase F; tell whether one applied."""
    root = run.root
    if not run.stopping:
        if root.state is FINISHED:
            return next_alternate(run)
        if root.state is INACTIVE:  # the root of a replacing plan, when the old one is over
            lifecycle.activate(run, root)
            return True
    if run.board.stale:
        stale, run.board.stale = run.board.stale, []
        for floating in stale:
            floating.triggered = floating.spec.trigger.ask(run.database) is True
    hold = run.hold
    if hold is not None:
        if hold.root is not None:
            return release(run, hold, hold.root)
        if hold.scope.state in (FAILING, FINISHED):
            run.hold = None
            run.release_held()
            return True
        while hold.blockers and not is_running_task(hold.blockers[-1]):
            hold.blockers.pop()
        if hold.blockers:
            return False
        insert(run, hold)
        return True
    if not run.contingencies:
        return False
    return trigger(run)


def trigger(run: Run) -> bool:
    """Arm again what may be armed again, then let the best triggered contingency become pending."""
    best: Floating | None = None
    best_utility = 0.0
    for floating in run.contingencies:
        spec = floating.spec
        if not floating.triggered:
            floating.armed = True
            continue
        if run.paused or not floating.armed or floating.insertions >= spec.max_insertions:
            continue
        scope = run.instances.get(spec.scope)
        if scope is None or scope.state is not EXECUTING:
            continue
        utility = utility_at(spec.utility, run.t)
        if best is None or utility > best_utility:
            best, best_utility = floating, utility
    if best is None:
        return False
    scope = run.instances[best.spec.scope]
    best.armed = False
    hold = run.hold = Hold(best, scope)
    run.record("trigger", best.spec.id)
    running = [n for n in scope.walk() if is_running_task(n)]
    if best.spec.interrupt:
        for node in running:
            if node.state is EXECUTING and node.spec.interruptible:
                interrupt(run, node)
    hold.blockers = running
    return True


def interrupt(run: Run, node: Instance) -> None:
    """Row 17, first half; a task whose action is over is SUSPENDED at once."""
    node.state = SUSPENDING
    if node.watching:
        run.board.unwatch(node)
    run.ask_abort(node)
    if node.command is None:
        lifecycle.suspended(run, node)


def insert(run: Run, hold: Hold) -> None:
    floating = hold.floating
    floating.insertions += 1
    run.record("insert", floating.spec.id)
    root = run.plant(floating.spec.node, hold.scope)
    root.index = -1
    hold.root = root
    hold.scope.extra += (root,)
    run.network.planted(root)
    lifecycle.activate(run, root)


def release(run: Run, hold: Hold, root: Instance) -> bool:
    """The inserted tree is FINISHED: the scope goes on, or fails with it."""
    if root.state is not FINISHED:
        return False
    run.hold = None
    scope = hold.scope
    scope.detach(root)
    if root.outcome is FAILED and not hold.floating.spec.continue_on_failure and scope.state in ACTIVE:
        lifecycle.fail(run, scope, FAILED, "contingency-failed")
    run.agenda.touch(scope)
    run.release_held()
    return True


def next_alternate(run: Run) -> bool:
    """The root is FINISHED: take the best alternate, if the root failed and there is one; else it is over."""
    best: AlternateSpec | None = None
    best_utility = 0.0
    if run.root.outcome is FAILED and not run.aborted:
        for alternate in run.plan.alternates:
            if alternate.id in run.used_alternates:
                continue
            if alternate.eligible is not None and alternate.eligible.ask(run.database) is not True:
                continue
            if alternate.requires and not run.ledger.met(alternate.requires, None, run.database):
                continue
            utility = utility_at(alternate.utility, run.t)
            if best is None or utility > best_utility:
                best, best_utility = alternate, utility
    if best is None:
        run.over = True
        run.stopping.clear()
        return False
    run.used_alternates.add(best.id)
    run.record("alternate", best.id)
    run.hold = None
    run.root_alternate = best
    run.root = run.plant(best.node, None)
    run.of_alternates.update(run.root.walk())
    run.network.planted(run.root)
    lifecycle.activate(run, run.root)
    return True
