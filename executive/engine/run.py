"""All state of a run, owned in one place, and the few things that every rule does with it.

The rules stand beside it, each kind in its own module: `windows`, `dispatch`, `lifecycle`, `contingencies`,
`replacement`. They are functions over a `Run` and call each other downwards only; `core.Engine` drives them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from executive.engine.agenda import Agenda
from executive.engine.board import Board
from executive.engine.dispatch import DispatchNetwork
from executive.engine.instance import Abort, Effect, Floating, Hold, Instance, Note, Outcome
from executive.engine.resources import Ledger
from executive.engine.spec import TASK, AlternateSpec, NodeSpec, PlanSpec
from executive.ports import Command, CommandId, TraceRecord, UtilitySource, Value

Loader = Callable[[str], PlanSpec | str]
"""Reads the text of a replacing plan: what the engine runs, or why it is rejected."""


_quickly = tuple.__new__
"""Makes a named tuple in a third of the time that its own class takes."""


class Run:
    """One run of one plan.

    Attributes
    ----------
    agenda, board, ledger, network
        Owned parts: what is to be looked at and the clock, the database, resources, dispatch bounds.
    instances
        Latest instance by node id.
    former_ids, old
        Ids of all nodes of plans that were replaced; nodes that a replacement took out of the plan.
    stopping
        Nodes stopped by a replacement and not yet FINISHED; nothing starts before the last of them.
    used_alternates, of_alternates
        Ids of alternates that have been in force; all nodes of theirs.
    retrying, undecided
        Tasks that wait for a retry; branches that have not chosen.
    held_back
        Nodes that a hold has kept from starting.
    crossed
        Branches below which a replacement lets something run that is not of the choice.
    out
        Effects that have not left yet.
    """

    def __init__(
        self, plan: PlanSpec, run_id: str, loader: Loader, utilities: UtilitySource | None, risks: bool
    ) -> None:
        self.plan = plan
        self.run_id = run_id
        self.loader = loader
        self.utilities = utilities
        self.agenda = Agenda()
        self.board = Board(self.agenda)
        self.database: Mapping[str, Value] = self.board.values
        self.ledger = Ledger(plan.resources)
        self.paused = False
        self.aborted = False
        self.over = False
        self.end_ms: int | None = None
        self.reward = 0.0
        self.out: list[Effect] = []
        self.instances: dict[str, Instance] = {}
        self.former_ids: dict[str, None] = {}
        self.old: dict[str, Instance] = {}
        self.stopping: set[Instance] = set()
        self.commands: dict[CommandId, Instance] = {}
        self.issued: dict[str, int] = {}
        self.dependents: dict[tuple[str, int], list[Instance]] = {}
        self.undecided: dict[Instance, None] = {}
        self.retrying: dict[Instance, None] = {}
        self.held_back: list[Instance] = []
        self.crossed: set[Instance] = set()
        self.next_order = 0
        self.hold: Hold | None = None
        self.root = self.plant(plan.root, None)
        self.root_alternate: AlternateSpec | None = None
        self.contingencies = [Floating(c, i) for i, c in enumerate(plan.contingencies)]
        self.board.watch_triggers(self.contingencies)
        self.used_alternates: set[str] = set()
        self.of_alternates: set[Instance] = set()
        self.network = DispatchNetwork(self, risks=risks)

    @property
    def t(self) -> int:
        """The plan clock, milliseconds."""
        return self.agenda.now

    @property
    def outcome(self) -> Outcome | None:
        """Outcome of the plan, or None while it is not over."""
        return self.root.outcome if self.over else None

    # --- trees ----------------------------------------------------------------------

    def plant(self, spec: NodeSpec, parent: Instance | None) -> Instance:
        """Make the instances of a tree, INACTIVE, after everything that is there; return its root."""
        root = Instance(spec, parent, 0, self.next_order)
        stack = [root]
        while stack:
            node = stack.pop()
            node.order = self.next_order
            self.next_order += 1
            self.register(node)
            if node.kind is not TASK:
                below = enumerate(node.spec.children)
                node.below = tuple([Instance(child, node, index, 0) for index, child in below])
                node.remaining = len(node.below)
                stack.extend(reversed(node.below))
        return root

    def register(self, node: Instance) -> None:
        """Make a new instance the one that its id means from now on."""
        board = self.board
        if node.id in self.instances:
            for key in ("outcome", "reason"):
                board.forget(f"{key} {node.id}")
            prefix = f"result {node.id} "
            for key in [k for k in board.values if k.startswith(prefix)]:
                board.forget(key)
        self.instances[node.id] = node
        board.set_value(f"attempts {node.id}", 0)
        self.register_windows(node)

    def register_windows(self, node: Instance) -> None:
        """Let the node hear of the time points to which its windows refer."""
        spec = node.spec
        if not (spec.start_windows or spec.end_windows):
            return
        for window in spec.start_windows + spec.end_windows:
            if window.ref and window.ref[0] != ":":
                self.dependents.setdefault((window.ref, window.point), []).append(node)

    # --- waking ---------------------------------------------------------------------

    def ask_waiters(self, name: str) -> None:
        """Some of a resource is free: ask the first of those who wait for it and fit."""
        node = self.ledger.next_waiter(name)
        if node is not None:
            node.woken_by = name
            self.agenda.consider(node)

    def release_retries(self) -> None:
        """A pause or a hold is over: due retries may be issued."""
        for node in list(self.retrying):
            self.agenda.touch(node)

    def release_held(self) -> None:
        """A hold is over: look again at those it kept back."""
        held, self.held_back = self.held_back, []
        for node in held:
            self.agenda.consider(node)
        self.release_retries()

    def reservations_changed(self) -> None:
        """What is available of a consumable has changed: undecided branches look again."""
        for node in self.undecided:
            self.agenda.touch(node)

    # --- effects --------------------------------------------------------------------

    def record(self, event: str, *arguments: str) -> None:
        """Add an event to the trace."""
        self.out.append(_quickly(TraceRecord, (self.agenda.now, event, arguments)))

    def note(self, kind: str, text: str, node: str = "") -> None:
        """Add something for the journal that is not of the trace."""
        self.out.append(Note(self.agenda.now, kind, text, node))

    def issue(self, node: Instance) -> None:
        """Send the command of a task, with the next attempt number of its id in this run."""
        node.attempts += 1
        number = self.issued.get(node.id, 0) + 1
        self.issued[node.id] = number
        command = _quickly(CommandId, (self.run_id, node.id, number))
        node.command = command
        node.abort_asked = False
        node.result = None
        node.retry_at = None
        self.retrying.pop(node, None)
        self.commands[command] = node
        if self.instances.get(node.id) is node:
            self.board.set_value(f"attempts {node.id}", node.attempts)
        self.out.append(command_of(node))

    def ask_abort(self, node: Instance) -> None:
        """Ask the rover to stop the node's action, once."""
        if node.command is not None and not node.abort_asked:
            node.abort_asked = True
            self.out.append(Abort(node.command))

    def action_over(self, node: Instance) -> None:
        """The rover has nothing to do with the node's command any more."""
        if node.command is not None:
            self.commands.pop(node.command, None)
        node.command = None
        node.abort_asked = False

    def retry_from(self, node: Instance, t_ms: int) -> None:
        """The next command of an executing task is due at `t_ms`."""
        node.result = None
        node.retry_at = t_ms
        self.retrying[node] = None
        self.agenda.set_timer(t_ms, node)


def command_of(node: Instance) -> Command:
    """Return the command that is with the rover, as it was sent."""
    assert node.command is not None
    spec = node.spec
    return _quickly(Command, (node.command, spec.action, spec.parameters, spec.metadata, node.attempts))
