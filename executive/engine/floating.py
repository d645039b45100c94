"""Phase F: floating contingencies (CRL.md 7.1), alternates (7.3) and the end of the plan."""

from __future__ import annotations

from typing import TYPE_CHECKING

from executive.crl.nodes import utility_at
from executive.engine import lifecycle
from executive.engine.instance import ACTIVE, Instance, Outcome, State, is_running_task
from executive.engine.spec import AlternateSpec, ContingencySpec, Kind

if TYPE_CHECKING:
    from executive.engine.core import Engine


class Floating:
    """A contingency and what has become of it: armed or not, how often inserted, the truth of its trigger."""

    __slots__ = ("armed", "insertions", "place", "spec", "state", "triggered")

    def __init__(self, spec: ContingencySpec, place: int) -> None:
        self.spec = spec
        self.place = place
        self.armed = True
        self.insertions = 0
        self.triggered = False
        self.state: State | None = None
        """Always None: a timer of a contingency never runs out of date."""


class Hold:
    """The contingency that is pending (not yet inserted) or active, and what it keeps from starting."""

    __slots__ = ("blockers", "floating", "root", "scope")

    def __init__(self, floating: Floating, scope: Instance) -> None:
        self.floating = floating
        self.scope = scope
        self.root: Instance | None = None
        self.blockers: list[Instance] = []

    def stops(self, node: Instance) -> bool:
        """Tell whether the node is of the scope, and not of the inserted tree."""
        at: Instance | None = node
        while at is not None:
            if at is self.root:
                return False
            if at is self.scope:
                return True
            at = at.parent
        return False


def watch_triggers(engine: Engine) -> None:
    """Index the contingencies by the keys of their triggers; all are to be looked at."""
    engine.trigger_watch = {}
    for floating in engine.floating:
        for key in floating.spec.trigger.keys:
            engine.trigger_watch.setdefault(key, []).append(floating)
    engine.stale = list(engine.floating)


def set_timers(engine: Engine, floating: Floating) -> None:
    for instant in floating.spec.trigger.instants_ms():
        engine.set_timer(instant, floating)


def phase_f(engine: Engine) -> bool:
    """Apply one rule of phase F; tell whether one applied."""
    root = engine.root
    if root.state is State.FINISHED and not engine.stopping:
        return next_alternate(engine)
    if engine.stale:
        stale, engine.stale = engine.stale, []
        for floating in stale:
            floating.triggered = floating.spec.trigger.ask(engine.database) is True
    hold = engine.hold
    if hold is not None:
        if hold.root is not None:
            return release(engine, hold, hold.root)
        if hold.scope.state in (State.FAILING, State.FINISHED):
            engine.hold = None
            engine.release_held()
            return True
        while hold.blockers and not is_running_task(hold.blockers[-1]):
            hold.blockers.pop()
        if hold.blockers:
            return False
        insert(engine, hold)
        return True
    if not engine.floating:
        return False
    return trigger(engine)


def trigger(engine: Engine) -> bool:
    """Arm again what may be armed again, then let the best triggered contingency become pending."""
    best: Floating | None = None
    best_utility = 0.0
    for floating in engine.floating:
        spec = floating.spec
        if not floating.triggered:
            floating.armed = True
            continue
        if engine.paused or not floating.armed or floating.insertions >= spec.max_insertions:
            continue
        scope = engine.instances.get(spec.scope)
        if scope is None or scope.state is not State.EXECUTING:
            continue
        utility = utility_at(spec.utility, engine.t)
        if best is None or utility > best_utility:
            best, best_utility = floating, utility
    if best is None:
        return False
    scope = engine.instances[best.spec.scope]
    best.armed = False
    hold = engine.hold = Hold(best, scope)
    engine.record("trigger", best.spec.id)
    running = [n for n in scope.walk() if is_running_task(n)]
    if best.spec.interrupt:
        for node in running:
            if node.state is State.EXECUTING and node.spec.interruptible:
                interrupt(engine, node)
    hold.blockers = running
    return True


def interrupt(engine: Engine, node: Instance) -> None:
    """Row 17, first half; a task whose action is over is SUSPENDED at once."""
    node.state = State.SUSPENDING
    if node.watching:
        engine.unwatch(node)
    engine.ask_abort(node)
    if node.command is None:
        lifecycle.suspended(engine, node)


def insert(engine: Engine, hold: Hold) -> None:
    floating = hold.floating
    floating.insertions += 1
    engine.record("insert", floating.spec.id)
    root = engine.plant(floating.spec.node, hold.scope)
    root.index = -1
    hold.root = root
    hold.scope.extra.append(root)
    engine.network.planted(root)
    lifecycle.activate(engine, root)


def release(engine: Engine, hold: Hold, root: Instance) -> bool:
    """The inserted tree is FINISHED: the scope goes on, or fails with it."""
    if root.state is not State.FINISHED:
        return False
    engine.hold = None
    scope = hold.scope
    if root in scope.extra:
        scope.extra.remove(root)
    if (
        root.outcome is Outcome.FAILED
        and not hold.floating.spec.continue_on_failure
        and scope.state in ACTIVE
    ):
        lifecycle.fail(engine, scope, Outcome.FAILED, "contingency-failed")
    engine.touch(scope)
    engine.release_held()
    return True


def next_alternate(engine: Engine) -> bool:
    """The root is FINISHED: take the best alternate, if the root failed and there is one; else it is over."""
    best: AlternateSpec | None = None
    best_utility = 0.0
    if engine.root.outcome is Outcome.FAILED and not engine.aborted:
        for alternate in engine.plan.alternates:
            if alternate.id in engine.used_alternates:
                continue
            if alternate.eligible is not None and alternate.eligible.ask(engine.database) is not True:
                continue
            if alternate.requires and not engine.ledger.met(alternate.requires, None, engine.database):
                continue
            utility = utility_at(alternate.utility, engine.t)
            if best is None or utility > best_utility:
                best, best_utility = alternate, utility
    if best is None:
        engine.finish_run()
        return False
    engine.used_alternates.add(best.id)
    engine.record("alternate", best.id)
    engine.hold = None
    engine.root_alternate = best
    engine.root = engine.plant(best.node, None)
    engine.network.planted(engine.root)
    lifecycle.activate(engine, engine.root)
    return True


__all__ = ["Floating", "Hold", "Kind", "phase_f", "set_timers", "watch_triggers"]
