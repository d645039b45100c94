"""The engine: events of one time stamp in, effects out. It drives a run and touches nothing else.

A macro step (CRL.md 4.2) is `step`: ingest the events, then let the tree come to rest (phases E, F, S).
Deadlines (phase D) are taken one at a time by `deadline`, because each may have consequences at the same
instant that come first. `next_wakeup` tells when the clock must stop next if no event comes earlier.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from executive.crl.values import OnResume
from executive.engine import contingencies, lifecycle, replacement
from executive.engine.conditions import TIME_KEY, is_number
from executive.engine.instance import (
    ACTIVE,
    EXECUTING,
    FAILED,
    FINISHED,
    SKIPPED,
    SUSPENDED,
    SUSPENDING,
    WAITING,
    Effect,
    Instance,
)
from executive.engine.lifecycle import crossed
from executive.engine.run import Loader, Run
from executive.engine.spec import PlanSpec
from executive.ports import (
    Acknowledgement,
    Event,
    Operation,
    Operator,
    Product,
    Result,
    Update,
    UtilitySource,
    Value,
)

RESERVED = ("outcome ", "reason ", "attempts ")
"""Beginnings of the keys that the executive keeps itself."""


def no_replacement(_text: str) -> PlanSpec | str:
    """Reject every replacement."""
    return "this run takes no replacement"


class Engine:
    """Drives one run of one plan. Single-owner: nobody else changes what `run` holds.

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
        self.run = Run(plan, run_id, loader, utilities, risks)
        self.agenda = self.run.agenda
        self.begun = False
        self.initial_levels: dict[str, float] = {}

    # --- macro steps ----------------------------------------------------------------

    @property
    def t(self) -> int:
        """The plan clock, milliseconds."""
        return self.agenda.now

    @property
    def over(self) -> bool:
        """Whether the last root is FINISHED and nothing is left to try."""
        return self.run.over

    def step(self, t_ms: int, events: Sequence[Event] = ()) -> list[Effect]:
        """Ingest the events of one time stamp, come to rest and return what must leave, in order.

        `t_ms` never goes back: an earlier time counts as the present one.
        """
        run = self.run
        if run.over:
            return []
        self.move_to(t_ms)
        if not self.begun:
            self.begun = True
            lifecycle.activate(run, run.root)
            for known in run.contingencies:
                contingencies.set_timers(run, known)
        if events:
            self._ingest(events)
        while (target := run.agenda.ringing()) is not None:
            if isinstance(target, Instance):
                run.agenda.wake(target)
            else:
                run.board.stale.append(target)
        if run.network.delayed:
            run.network.changed()
        self.quiesce()
        return self._take_effects()

    def deadline(self, t_ms: int) -> list[Effect] | None:
        """Let the first node with an expired upper bound take its transition; None if there is none.

        To be called only when no event with a time stamp up to `t_ms` is left.
        """
        run = self.run
        if run.over or not self.begun:
            return None
        self.move_to(t_ms)
        for node in run.agenda.expired():
            if node.state is WAITING and node.start_hi <= run.t:
                lifecycle.finish(run, node, FAILED, "start-window-missed")
            elif node.state in ACTIVE and node.end_hi <= run.t:
                lifecycle.fail(run, node, FAILED, "end-window-missed")
            else:
                continue
            self.quiesce()
            return self._take_effects()
        return None

    def restart(self, t_ms: int) -> list[Effect]:
        """Come back after a crash: deal with running actions as their tasks say (CRL.md 10)."""
        run = self.run
        if run.over:
            return []
        self.move_to(t_ms)
        run.record("restart")
        for node in sorted(run.commands.values(), key=lambda n: n.order):
            policy = node.spec.on_resume
            if policy is OnResume.FAIL:
                run.action_over(node)
                if node.state is EXECUTING:
                    node.result = False
                run.agenda.touch(node)
            elif policy is OnResume.RESTART and node.state is EXECUTING and not node.abort_asked:
                node.awaiting_restart = True
                run.ask_abort(node)
        return self._take_effects()

    def next_wakeup(self) -> int | None:
        """Return the next lower bound, upper bound, retry time or change of a `:time` condition."""
        return None if self.run.over else self.run.agenda.next_time()

    def move_to(self, t_ms: int) -> None:
        """Set the plan clock; it never goes back."""
        if t_ms > self.agenda.now:
            self.agenda.now = t_ms
            self.run.board.values[TIME_KEY] = t_ms / 1000

    def _take_effects(self) -> list[Effect]:
        out, self.run.out = self.run.out, []
        return out

    # --- ingest ---------------------------------------------------------------------

    def _ingest(self, events: Iterable[Event]) -> None:
        orders: list[Operator] = []
        for event in events:
            match event:
                case Update():
                    self._apply(event.values)
                case Result():
                    if event.updates:
                        self._apply(event.updates)
                    self._note_result(event)
                case Acknowledgement():
                    self._apply(event.updates)
                    self._note_acknowledgement(event)
                case Operator():
                    orders.append(event)
                case Product():
                    pass
        if not self.initial_levels and self.run.plan.budgets:
            self._remember_levels()
        for order in orders:
            if self.run.over:
                return
            self._operate(order)

    def _remember_levels(self) -> None:
        for resource in self.run.plan.resources.values():
            level = self.run.database.get(resource.key) if resource.key else None
            if is_number(level):
                self.initial_levels[resource.name] = float(level)

    def _apply(self, values: Mapping[str, Value]) -> None:
        for key, value in values.items():
            if key == TIME_KEY or key.startswith(RESERVED):
                self.run.note("ignored", f"the key {key!r} is kept by the executive")
            else:
                self.run.board.set_value(key, value)

    def _note_result(self, event: Result) -> None:
        run = self.run
        node = run.commands.get(event.command)
        if node is None:
            run.note("ignored", f"result of {event.command}: no such command is running", event.command.task)
            return
        run.action_over(node)
        if event.values and run.instances.get(node.id) is node:
            for name, value in event.values.items():
                run.board.set_value(f"result {node.id} {name}", value)
        if node.awaiting_restart:
            node.awaiting_restart = False
            run.retry_from(node, run.t)
        elif node.state is EXECUTING:
            node.result = event.success
        elif node.state is SUSPENDING and event.success:
            node.state = EXECUTING
            node.result = True
        run.agenda.touch(node)

    def _note_acknowledgement(self, event: Acknowledgement) -> None:
        run = self.run
        node = run.commands.get(event.command)
        if node is None:
            run.note("ignored", f"acknowledgement of {event.command}: no such command is running")
            return
        asked = node.abort_asked
        run.action_over(node)
        if node.awaiting_restart:
            node.awaiting_restart = False
            run.retry_from(node, run.t)
        elif node.state is EXECUTING and not asked:
            run.note("unasked", f"{event.command} was stopped by the rover without being asked to", node.id)
            node.result = False
        run.agenda.touch(node)

    def _operate(self, order: Operator) -> None:
        run = self.run
        match order.operation:
            case Operation.PAUSE:
                run.record("pause")
                run.paused = True
            case Operation.RESUME:
                run.record("resume-plan")
                run.paused = False
                run.release_retries()
            case Operation.ABORT:
                run.record("abort")
                run.aborted = True
                lifecycle.abort_root(run)
            case Operation.REPLACE:
                replacement.replace(run, order.plan_text or "")

    # --- coming to rest ---------------------------------------------------------------

    def quiesce(self) -> None:
        """Let the tree come to rest: E as long as possible, else one rule of F, else one start."""
        run = self.run
        while True:
            self._run_e()
            if contingencies.phase_f(run):
                continue
            if run.over or not self._run_s():
                break
        if run.network.risks and run.network.wanted:
            run.network.report_risks()

    def _run_e(self) -> None:
        run, agenda = self.run, self.run.agenda
        while (node := agenda.next_touched()) is not None:
            if lifecycle.transition(run, node) and node.state is not FINISHED:
                agenda.touch(node)

    def _run_s(self) -> bool:
        """Start or resume the most urgent node that can; tell whether there was one."""
        run = self.run
        if run.paused or run.stopping:
            return False
        while (node := run.agenda.next_candidate()) is not None:
            taken = False
            if node.state is WAITING or node.state is SUSPENDED:
                if (run.hold is not None and run.hold.stops(node)) or (run.crossed and crossed(run, node)):
                    run.held_back.append(node)
                else:
                    taken = lifecycle.try_start(run, node)
            if node.woken_by:
                name, node.woken_by = node.woken_by, ""
                run.ask_waiters(name)
            if taken:
                return True
        return False

    # --- what came of it --------------------------------------------------------------

    def utility(self) -> float:
        """Return reward earned minus the penalty for ending over a budget (CRL.md 6.4)."""
        return self.run.reward - (self.run.plan.overrun_penalty if self.over_budget() else 0.0)

    def over_budget(self) -> bool:
        """Tell whether the run has taken more time or more of a consumable than its budgets allow."""
        return bool(self.exceeded_budgets())

    def exceeded_budgets(self) -> tuple[str, ...]:
        """Return the names of the budgets that the run has gone over, in the order of the plan."""
        run = self.run
        exceeded = []
        end_ms = run.end_ms if run.end_ms is not None else run.t
        for name, limit in run.plan.budgets:
            if name == "time":
                if end_ms / 1000 > limit:
                    exceeded.append(name)
                continue
            resource = run.plan.resources.get(name)
            level = run.database.get(resource.key) if resource is not None and resource.key else None
            before = self.initial_levels.get(name)
            if before is not None and is_number(level) and before - float(level) > limit:
                exceeded.append(name)
        return tuple(exceeded)

    def outcomes(self) -> dict[str, str | None]:
        """Return the outcome of every node of the plan; None = not finished.

        Nodes of trees never inserted count as SKIPPED; nodes that a replacement took out keep their entry.
        """
        run = self.run
        ids = [*run.former_ids, *run.plan.node_ids()] if len(run.plan.trees()) > 1 or run.former_ids else ()
        table: dict[str, str | None] = dict.fromkeys(ids, SKIPPED.value)
        for nodes in (run.old, run.instances):
            for node_id, node in nodes.items():
                table[node_id] = node.outcome._value_ if node.outcome is not None else None
        return table
