"""What changes during a run: one `Instance` per node, and the effects that leave the engine."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum, StrEnum

from executive.engine.spec import INFINITY, TASK, ContingencySpec, NodeSpec, OptionSpec
from executive.ports import Command, CommandId, TraceRecord


class State(IntEnum):
    INACTIVE = 0
    WAITING = 1
    EXECUTING = 2
    ENDING = 3
    SUSPENDING = 4
    SUSPENDED = 5
    FAILING = 6
    FINISHED = 7


class Outcome(StrEnum):
    SUCCEEDED = "SUCCEEDED"
    FAILED = "FAILED"
    ABORTED = "ABORTED"
    SKIPPED = "SKIPPED"


INACTIVE, WAITING, EXECUTING, ENDING, SUSPENDING, SUSPENDED, FAILING, FINISHED = State
SUCCEEDED, FAILED, ABORTED, SKIPPED = Outcome
# The rules use these names: finding a member through its class takes Python 3.11 as long as a call, and some
# 40 of them for each task took a tenth of a run and more.

Watch = tuple[str, int, tuple[float, ...] | None]
"""A watched key, a serial number, and the limits at which it matters (None = wherever it changes)."""

ACTIVE = (EXECUTING, ENDING, SUSPENDING, SUSPENDED)
"""States of a node that has started and is not yet ending badly."""

STARTED = (*ACTIVE, FAILING)
"""States of a node that has started and is not over."""

RUNNING = (EXECUTING, ENDING, FAILING, SUSPENDING)
"""States in which a node counts for the reservation of consumables (CRL.md 6.2)."""


class Instance:
    """One node of a tree that takes part in the run; a contingency inserted again makes new ones."""

    __slots__ = (
        "abort_asked",
        "activation",
        "attempts",
        "awaiting_restart",
        "below",
        "blocked_on",
        "candidate",
        "chosen",
        "command",
        "cursor",
        "end",
        "end_held",
        "end_hi",
        "end_lo",
        "extra",
        "fatal",
        "final",
        "final_reason",
        "held",
        "id",
        "index",
        "kind",
        "order",
        "outcome",
        "parent",
        "queued",
        "reason",
        "remaining",
        "result",
        "retries_used",
        "retry_at",
        "spec",
        "start",
        "start_blocked",
        "start_hi",
        "start_lo",
        "state",
        "tried",
        "untried",
        "void",
        "watching",
        "woken_by",
    )  # fmt: skip

    def __init__(self, spec: NodeSpec, parent: Instance | None, index: int, order: int) -> None:
        self.spec = spec
        self.id = spec.id
        self.kind = spec.kind
        self.parent = parent
        self.index = index
        """Place among the children of the parent (of a branch: number of the option)."""
        self.order = order
        """Place in the text; trees inserted at run time come last."""
        self.below: tuple[Instance, ...] = ()
        self.extra: tuple[Instance, ...] = ()
        """Further trees that count as children: an inserted contingency, nodes that a replacement stops."""
        self.state = INACTIVE
        self.outcome: Outcome | None = None
        self.reason = ""
        self.activation = 0
        self.start: int | None = None
        self.end: int | None = None
        self.void = False
        self.start_lo = 0
        self.start_hi = INFINITY
        self.start_blocked = False
        self.end_lo = 0
        self.end_hi = INFINITY
        self.end_held = False
        self.queued = False
        self.candidate = False
        self.woken_by = ""
        self.blocked_on = ""
        """Resource in whose queue the node stands."""
        self.watching: tuple[Watch, ...] = ()
        self.held: tuple[tuple[str, float], ...] = ()
        """Unit and capacity resources taken."""
        self.remaining = 0
        """Children not yet FINISHED (blocks and concurrent blocks)."""
        self.fatal = False
        """A child finished FAILED without `:continue-on-failure`."""
        self.cursor = 0
        """First child of a block that may not be FINISHED."""
        self.final: Outcome | None = None
        """Outcome fixed on entry to FAILING; published at the end."""
        self.final_reason = ""
        self.chosen: int | None = None
        """Number of the chosen option in the definition of a branch; its node is `choice()`."""
        self.tried: set[str] | None = None
        """Ids of the options of a branch that have been chosen."""
        self.untried: list[tuple[int, OptionSpec]] | None = None
        """Options of a branch not yet tried, with their numbers; made at the first choice."""
        self.command: CommandId | None = None
        """The command that is with the rover; None when the action is over."""
        self.abort_asked = False
        self.awaiting_restart = False
        self.result: bool | None = None
        self.attempts = 0
        self.retries_used = 0
        self.retry_at: int | None = None

    def __repr__(self) -> str:
        return f"<{self.id} {self.state.name}>"

    def ancestors(self) -> Iterator[Instance]:
        """Yield the parent, its parent and so on."""
        node = self.parent
        while node is not None:
            yield node
            node = node.parent

    def choice(self) -> Instance | None:
        """Return the node of the chosen option of a branch.

        None before the choice, and where a replacement has put that node elsewhere: a branch that it stops
        keeps only nodes that go too, so its nodes no longer stand beside its options.
        """
        if self.chosen is None:
            return None
        wanted = self.spec.children[self.chosen].id
        if self.chosen < len(self.below) and self.below[self.chosen].id == wanted:
            return self.below[self.chosen]
        return next((child for child in self.below if child.id == wanted), None)

    def children(self) -> tuple[Instance, ...]:
        """Return all nodes one level down, inserted and detached ones included."""
        return self.below + self.extra if self.extra else self.below

    def walk(self) -> Iterator[Instance]:
        """Yield the node and all its descendants, in text order."""
        stack = [self]
        while stack:
            node = stack.pop()
            yield node
            stack.extend(reversed(node.children()))

    def detach(self, child: Instance) -> None:
        """Let a tree among the extra ones no longer count."""
        self.extra = tuple(other for other in self.extra if other is not child)

    def failed_fatally(self) -> bool:
        """Tell whether the node finished FAILED and its parent must not go on."""
        return self.outcome is FAILED and not self.spec.continue_on_failure


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


@dataclass(frozen=True, slots=True)
class Abort:
    """Effect: ask the rover to stop this command."""

    command: CommandId


@dataclass(frozen=True, slots=True)
class Note:
    """Effect: something for the journal that is not of the trace (a risk, an event without a use, ...)."""

    t_ms: int
    kind: str
    text: str
    node: str = ""


@dataclass(frozen=True, slots=True)
class UtilityUsed:
    """Effect: a utility that did not come from the plan was used at a choice."""

    t_ms: int
    option: str
    value: float


Effect = Command | Abort | Note | UtilityUsed | TraceRecord
"""What leaves the engine; a command is to be sent to the rover."""


def is_running_task(node: Instance) -> bool:
    """Tell whether a task keeps a pending contingency waiting (CRL.md 7.1)."""
    return node.kind is TASK and node.state in (EXECUTING, SUSPENDING, FAILING)
