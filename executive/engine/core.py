"""The engine: events of one time stamp in, effects out. It owns all state of a run and touches nothing else.

A macro step (CRL.md 4.2) is `step`: ingest the events, then let the tree come to rest (phases E, F, S).
Deadlines (phase D) are taken one at a time by `deadline`, because each may have consequences at the same
instant that come first. `next_wakeup` tells when the clock must stop next if no event comes earlier.

Only what can have changed is looked at: nodes are kept in heaps by text order (phase E) and by urgency (phase
S), and get there when their own state, a child, a watched key, a time point they refer to or a timer says so.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Mapping, Sequence

from executive.crl.nodes import OnResume
from executive.engine import floating, lifecycle, replacement, windows
from executive.engine.conditions import TIME_KEY, Guard, is_number
from executive.engine.dispatch import DispatchNetwork
from executive.engine.instance import ACTIVE, Abort, Effect, Instance, Note, Outcome, Send, State
from executive.engine.resources import Ledger
from executive.engine.spec import END, INFINITY, START, AlternateSpec, Kind, NodeSpec, PlanSpec
from executive.ports import (
    Acknowledgement,
    Command,
    CommandId,
    Event,
    Operation,
    Operator,
    Product,
    Result,
    TraceRecord,
    Update,
    UtilitySource,
    Value,
)

Loader = Callable[[str], PlanSpec | str]
"""Reads the text of a replacing plan: what the engine runs, or why it is rejected."""

RESERVED = ("outcome ", "reason ", "attempts ")
"""Beginnings of the keys that the executive keeps itself."""


def no_replacement(text: str) -> PlanSpec | str:
    """Reject every replacement."""
    return "this run takes no replacement"


class Engine:
    """One run of one plan. Single-owner: nobody else changes what it holds.

    Parameters
    ----------
    plan
        A valid plan, compiled.
    run_id
        Names the run in every command.
    loader
        Validates and compiles the text of a replacement.
    utilities
        Better estimates of the utility of options than the table in the plan; what is used is an effect.
    risks
        Whether to note windows that can no longer all be kept.
    """

    def __init__(
        self,
        plan: PlanSpec,
        *,
        run_id: str = "run",
        loader: Loader = no_replacement,
        utilities: UtilitySource | None = None,
        risks: bool = False,
    ) -> None:
        self.plan = plan
        self.run_id = run_id
        self.loader = loader
        self.utilities = utilities
        self.t = 0
        self.database: dict[str, Value] = {TIME_KEY: 0.0}
        self.begun = False
        self.paused = False
        self.aborted = False
        self.over = False
        self.end_ms: int | None = None
        self.reward = 0.0
        self.initial_levels: dict[str, float] = {}
        self.out: list[Effect] = []
        self.ledger = Ledger(plan.resources)
        self.instances: dict[str, Instance] = {}
        """Latest instance by node id."""
        self.former_ids: dict[str, None] = {}
        """Ids of all nodes of plans that were replaced."""
        self.old: dict[str, Instance] = {}
        """Nodes that a replacement took out of the plan."""
        self.stopping: set[Instance] = set()
        """Nodes stopped by a replacement and not yet FINISHED; nothing starts before the last of them."""
        self.commands: dict[CommandId, Instance] = {}
        self.issued: dict[str, int] = {}
        self.dependents: dict[tuple[str, int], list[Instance]] = {}
        self.watchers: dict[str, dict[Instance, None]] = {}
        self.undecided: dict[Instance, None] = {}
        self.waiting: dict[Instance, None] = {}
        """Nodes WAITING or SUSPENDED."""
        self.retrying: dict[Instance, None] = {}
        self.held_back: list[Instance] = []
        self.next_order = 0
        self.trigger_watch: dict[str, list[floating.Floating]] = {}
        self.stale: list[floating.Floating] = []
        self._touched: list[tuple[int, Instance]] = []
        self._candidates: list[tuple[float, int, int, Instance]] = []
        self._timers: list[tuple[int, int, Instance | floating.Floating]] = []
        self._deadlines: list[tuple[int, int, Instance]] = []
        self._expired: list[tuple[int, int, Instance]] = []
        self._serial = 0
        self.hold: floating.Hold | None = None
        self.root = self.plant(plan.root, None)
        self.root_alternate: AlternateSpec | None = None
        self.floating = [floating.Floating(c, i) for i, c in enumerate(plan.contingencies)]
        floating.watch_triggers(self)
        self.used_alternates: set[str] = set()
        self.network = DispatchNetwork(self, risks=risks)

    # --- trees ----------------------------------------------------------------

    def plant(self, spec: NodeSpec, parent: Instance | None) -> Instance:
        """Make the instances of a tree, INACTIVE, after everything that is there; return its root."""
        root = Instance(spec, parent, 0, self.next_order)
        stack = [root]
        while stack:
            node = stack.pop()
            node.order = self.next_order
            self.next_order += 1
            self.register(node)
            for index, child in enumerate(node.spec.below()):
                node.below.append(Instance(child, node, index, 0))
            node.remaining = len(node.below)
            stack.extend(reversed(node.below))
        return root

    def register(self, node: Instance) -> None:
        """Make a new instance the one that its id means from now on."""
        if node.id in self.instances:
            for key in ("outcome", "reason"):
                self.forget(f"{key} {node.id}")
            prefix = f"result {node.id} "
            for key in [k for k in self.database if k.startswith(prefix)]:
                self.forget(key)
        self.instances[node.id] = node
        self.set_value(f"attempts {node.id}", 0)
        self.register_windows(node)

    def register_windows(self, node: Instance) -> None:
        """Let the node hear of the time points to which its windows refer."""
        spec = node.spec
        if not (spec.start_windows or spec.end_windows):
            return
        for window in spec.start_windows + spec.end_windows:
            if window.ref and window.ref[0] != ":":
                self.dependents.setdefault((window.ref, window.point), []).append(node)

    # --- macro steps ------------------------------------------------------------

    def step(self, t_ms: int, events: Sequence[Event] = ()) -> list[Effect]:
        """Ingest the events of one time stamp, come to rest and return what must leave, in order.

        `t_ms` never goes back: an earlier time counts as the present one.
        """
        if self.over:
            return []
        self.move_to(t_ms)
        if not self.begun:
            self.begun = True
            lifecycle.activate(self, self.root)
            for known in self.floating:
                floating.set_timers(self, known)
        if events:
            self.ingest(events)
        self.ring_timers()
        self.network.changed()
        self.quiesce()
        return self.take_effects()

    def deadline(self, t_ms: int) -> list[Effect] | None:
        """Let the first node with an expired upper bound take its transition; None if there is none.

        To be called only when no event with a time stamp up to `t_ms` is left.
        """
        if self.over or not self.begun:
            return None
        self.move_to(t_ms)
        while self._deadlines and self._deadlines[0][0] <= self.t:
            _, _, node = heapq.heappop(self._deadlines)
            self._serial += 1
            heapq.heappush(self._expired, (node.order, self._serial, node))
        while self._expired:
            _, _, node = heapq.heappop(self._expired)
            if node.state is State.WAITING and node.start_hi <= self.t:
                lifecycle.finish(self, node, Outcome.FAILED, "start-window-missed")
            elif node.state in ACTIVE and node.end_hi <= self.t:
                lifecycle.fail(self, node, Outcome.FAILED, "end-window-missed")
            else:
                continue
            self.quiesce()
            return self.take_effects()
        return None

    def restart(self, t_ms: int) -> list[Effect]:
        """Come back after a crash: deal with running actions as their tasks say (CRL.md 10)."""
        if self.over:
            return []
        self.move_to(t_ms)
        self.record("restart")
        for node in sorted(self.commands.values(), key=lambda n: n.order):
            policy = node.spec.on_resume
            command = node.command
            assert command is not None
            if policy is OnResume.FAIL:
                self.action_over(node)
                if node.state is State.EXECUTING:
                    node.result = False
                self.touch(node)
            elif policy is OnResume.RESTART and node.state is State.EXECUTING and not node.abort_asked:
                node.awaiting_restart = True
                self.ask_abort(node)
        return self.take_effects()

    def next_wakeup(self) -> int | None:
        """Return the next lower bound, upper bound, retry time or change of a `:time` condition."""
        if self.over:
            return None
        timers, deadlines = self._timers, self._deadlines
        while timers and timers[0][2].state is State.FINISHED:
            heapq.heappop(timers)
        while deadlines and deadlines[0][2].state in (State.FINISHED, State.FAILING):
            heapq.heappop(deadlines)
        if timers and deadlines:
            return min(timers[0][0], deadlines[0][0])
        if timers:
            return timers[0][0]
        return deadlines[0][0] if deadlines else None

    def begin_at(self, t_ms: int) -> None:
        """Set the plan clock before the first step (a plan with an epoch that starts late)."""
        self.move_to(t_ms)

    def move_to(self, t_ms: int) -> None:
        if t_ms > self.t:
            self.t = t_ms
            self.database[TIME_KEY] = t_ms / 1000

    def take_effects(self) -> list[Effect]:
        out, self.out = self.out, []
        return out

    # --- ingest -----------------------------------------------------------------

    def ingest(self, events: Iterable[Event]) -> None:
        orders: list[Operator] = []
        for event in events:
            match event:
                case Update():
                    self.apply(event.values)
                case Result():
                    self.apply(event.updates)
                    self.note_result(event)
                case Acknowledgement():
                    self.apply(event.updates)
                    self.note_acknowledgement(event)
                case Operator():
                    orders.append(event)
                case Product():
                    pass
        if not self.initial_levels and self.plan.budgets:
            self.remember_levels()
        for order in orders:
            if self.over:
                return
            self.operate(order)

    def remember_levels(self) -> None:
        for resource in self.plan.resources.values():
            level = self.database.get(resource.key) if resource.key else None
            if isinstance(level, int | float) and not isinstance(level, bool):
                self.initial_levels[resource.name] = float(level)

    def apply(self, values: Mapping[str, Value]) -> None:
        for key, value in values.items():
            if key == TIME_KEY or key.startswith(RESERVED):
                self.note("ignored", f"the key {key!r} is kept by the executive")
                continue
            self.set_value(key, value)

    def set_value(self, key: str, value: Value) -> None:
        """Write a key and look at those who watch it, if it says something new."""
        database = self.database
        old = database.get(key)
        if old == value and type(old) is type(value):
            return
        database[key] = value
        self.changed(key)

    def forget(self, key: str) -> None:
        if self.database.pop(key, None) is not None:
            self.changed(key)

    def changed(self, key: str) -> None:
        watchers = self.watchers.get(key)
        if watchers:
            for node in watchers:
                self.wake(node)
        triggers = self.trigger_watch.get(key)
        if triggers:
            self.stale.extend(triggers)

    def note_result(self, event: Result) -> None:
        node = self.commands.get(event.command)
        if node is None or node.command != event.command:
            self.note("ignored", f"result of {event.command}: no such command is running", event.command.task)
            return
        self.action_over(node)
        if self.instances.get(node.id) is node:
            for name, value in event.values.items():
                self.set_value(f"result {node.id} {name}", value)
        if node.awaiting_restart:
            node.awaiting_restart = False
            self.retry_from(node, self.t)
        elif node.state is State.EXECUTING:
            node.result = event.success
        elif node.state is State.SUSPENDING and event.success:
            node.state = State.EXECUTING
            node.result = True
        self.touch(node)

    def note_acknowledgement(self, event: Acknowledgement) -> None:
        node = self.commands.get(event.command)
        if node is None or node.command != event.command:
            self.note("ignored", f"acknowledgement of {event.command}: no such command is running")
            return
        asked = node.abort_asked
        self.action_over(node)
        if node.awaiting_restart:
            node.awaiting_restart = False
            self.retry_from(node, self.t)
        elif node.state is State.EXECUTING and not asked:
            self.note("unasked", f"{event.command} was stopped by the rover without being asked to", node.id)
            node.result = False
        self.touch(node)

    def action_over(self, node: Instance) -> None:
        """The rover has nothing to do with the node's command any more."""
        if node.command is not None:
            self.commands.pop(node.command, None)
        node.command = None
        node.abort_asked = False

    def operate(self, order: Operator) -> None:
        match order.operation:
            case Operation.PAUSE:
                self.record("pause")
                self.paused = True
            case Operation.RESUME:
                self.record("resume-plan")
                self.paused = False
                self.release_retries()
            case Operation.ABORT:
                self.record("abort")
                self.aborted = True
                lifecycle.abort_root(self)
            case Operation.REPLACE:
                replacement.replace(self, order.plan_text or "")

    # --- coming to rest -----------------------------------------------------------

    def quiesce(self) -> None:
        """Let the tree come to rest: E as long as possible, else one rule of F, else one start."""
        while True:
            self.run_e()
            if floating.phase_f(self):
                continue
            if self.over or not self.run_s():
                break
        self.network.report_risks()

    def run_e(self) -> None:
        heap = self._touched
        while heap:
            _, node = heapq.heappop(heap)
            if not node.queued:
                continue
            node.queued = False
            if lifecycle.transition(self, node) and node.state is not State.FINISHED:
                self.touch(node)

    def run_s(self) -> bool:
        """Start or resume the most urgent node that can; tell whether there was one."""
        if self.paused or self.stopping:
            return False
        heap = self._candidates
        while heap:
            node = heapq.heappop(heap)[3]
            if not node.candidate:
                continue
            node.candidate = False
            taken = False
            if node.state is State.WAITING or node.state is State.SUSPENDED:
                if self.hold is not None and self.hold.stops(node):
                    self.held_back.append(node)
                else:
                    taken = lifecycle.try_start(self, node)
            if node.woken_by:
                name, node.woken_by = node.woken_by, ""
                if self.ledger.resources[name].capacity == 1.0 and self.ledger.free(name) > 0:
                    self.ask_waiters(name)
            if taken:
                return True
        return False

    # --- waking -------------------------------------------------------------------

    def touch(self, node: Instance) -> None:
        """Look at the node in phase E."""
        if not node.queued:
            node.queued = True
            heapq.heappush(self._touched, (node.order, node))

    def consider(self, node: Instance) -> None:
        """Look at a WAITING or SUSPENDED node in phase S."""
        if not node.candidate:
            node.candidate = True
            heapq.heappush(self._candidates, (node.spec.priority, node.activation, node.order, node))

    def wake(self, node: Instance) -> None:
        if node.state is State.WAITING or node.state is State.SUSPENDED:
            self.consider(node)
        elif node.state is not State.FINISHED:
            self.touch(node)

    def ask_waiters(self, name: str) -> None:
        """Some of a resource is free: ask those who wait for it."""
        for node in self.ledger.next_waiters(name):
            node.woken_by = name
            self.consider(node)

    def release_retries(self) -> None:
        """A pause or a hold is over: due retries may be issued."""
        for node in list(self.retrying):
            self.touch(node)

    def release_held(self) -> None:
        held, self.held_back = self.held_back, []
        for node in held:
            self.consider(node)
        self.release_retries()

    def set_timer(self, t_ms: int, target: Instance | floating.Floating) -> None:
        if t_ms > self.t:
            self._serial += 1
            heapq.heappush(self._timers, (t_ms, self._serial, target))

    def set_deadline(self, t_ms: int, node: Instance) -> None:
        self._serial += 1
        heapq.heappush(self._deadlines, (t_ms, self._serial, node))

    def ring_timers(self) -> None:
        timers = self._timers
        while timers and timers[0][0] <= self.t:
            target = heapq.heappop(timers)[2]
            if isinstance(target, Instance):
                self.wake(target)
            else:
                self.stale.append(target)

    def sort_again(self) -> None:
        """Put what is to be looked at in phase E in the text order of a new plan."""
        self._touched = [(node.order, node) for _, node in self._touched if node.queued]
        heapq.heapify(self._touched)

    def refresh(self, node: Instance) -> None:
        """Look at everything of a node again: its definition or its surroundings have changed."""
        if node.state in ACTIVE:
            node.end_lo, node.end_hi, node.end_held = 0, INFINITY, False
            windows.open_end(self, node)
            if node.kind is Kind.BRANCH and node.chosen is None:
                lifecycle.watch_options(self, node)
                self.undecided[node] = None
            elif node.state is not State.SUSPENDED:
                self.watch(node, node.spec.maintain)
        self.wake(node)

    def watch(self, node: Instance, *guards: Guard | None, keys: Iterable[str] = ()) -> None:
        """Replace what the node watches: keys, and the instants at which `:time` changes an answer."""
        self.unwatch(node)
        wanted = dict.fromkeys(keys)
        for guard in guards:
            if guard is not None:
                wanted.update(dict.fromkeys(guard.keys))
                for instant in guard.instants_ms():
                    self.set_timer(instant, node)
        if wanted:
            node.watching = tuple(wanted)
            for key in node.watching:
                self.watchers.setdefault(key, {})[node] = None

    def unwatch(self, node: Instance) -> None:
        for key in node.watching:
            watchers = self.watchers[key]
            watchers.pop(node, None)
            if not watchers:
                del self.watchers[key]
        node.watching = ()

    def reservations_changed(self) -> None:
        """What is available of a consumable has changed: undecided branches look again."""
        for node in self.undecided:
            self.touch(node)

    def point_settled(self, node: Instance, point: int) -> None:
        """A time point has occurred or is void: look at those whose windows refer to it."""
        self.network.settled(node, point)
        dependents = self.dependents.get((node.id, point))
        if dependents and self.instances.get(node.id) is node:
            for other in dependents:
                windows.reference_settled(self, other, node, point)

    # --- effects ------------------------------------------------------------------

    def record(self, event: str, *arguments: str) -> None:
        self.out.append(TraceRecord(self.t, event, arguments))

    def note(self, kind: str, text: str, node: str = "") -> None:
        self.out.append(Note(self.t, kind, text, node))

    def issue(self, node: Instance) -> None:
        """Send the command of a task, with the next attempt number of its id in this run."""
        node.attempts += 1
        number = self.issued.get(node.id, 0) + 1
        self.issued[node.id] = number
        command = CommandId(self.run_id, node.id, number)
        node.command = command
        node.abort_asked = False
        node.result = None
        node.retry_at = None
        self.retrying.pop(node, None)
        self.commands[command] = node
        if self.instances.get(node.id) is node:
            self.set_value(f"attempts {node.id}", node.attempts)
        self.out.append(Send(self.command_of(node)))

    def command_of(self, node: Instance) -> Command:
        """Return the command that is with the rover, as it was sent."""
        assert node.command is not None
        spec = node.spec
        return Command(node.command, spec.action, spec.parameters, spec.metadata, node.attempts)

    def ask_abort(self, node: Instance) -> None:
        """Ask the rover to stop the node's action, once."""
        if node.command is not None and not node.abort_asked:
            node.abort_asked = True
            self.out.append(Abort(node.command))

    def retry_from(self, node: Instance, t_ms: int) -> None:
        """The next command of an executing task is due at `t_ms`."""
        node.result = None
        node.retry_at = t_ms
        self.retrying[node] = None
        self.set_timer(t_ms, node)

    # --- what came of it ------------------------------------------------------------

    def finish_run(self) -> None:
        """The last root is FINISHED and nothing is left to try."""
        self.over = True
        self.stopping.clear()

    @property
    def outcome(self) -> Outcome | None:
        """Outcome of the plan, or None while it is not over."""
        return self.root.outcome if self.over else None

    def utility(self) -> float:
        """Return reward earned minus the penalty for ending over a budget (CRL.md 6.4)."""
        return self.reward - (self.plan.overrun_penalty if self.over_budget() else 0.0)

    def over_budget(self) -> bool:
        end_ms = self.end_ms if self.end_ms is not None else self.t
        for name, limit in self.plan.budgets:
            if name == "time":
                if end_ms / 1000 > limit:
                    return True
                continue
            resource = self.plan.resources.get(name)
            level = self.database.get(resource.key) if resource is not None and resource.key else None
            before = self.initial_levels.get(name)
            if before is not None and is_number(level) and before - float(level or 0.0) > limit:
                return True
        return False

    def outcomes(self) -> dict[str, str | None]:
        """Return the outcome of every node of the plan; None = not finished.

        Nodes of trees never inserted count as SKIPPED; nodes that a replacement took out keep their entry.
        """
        ids = [*self.former_ids, *self.plan.node_ids()]
        table: dict[str, str | None] = dict.fromkeys(ids, Outcome.SKIPPED.value)
        for node_id, node in [*self.old.items(), *self.instances.items()]:
            table[node_id] = node.outcome.value if node.outcome is not None else None
        return table


__all__ = ["END", "START", "Engine", "Kind", "Loader"]
