"""The temporal network of section 8.1, as it stands before the plan runs: E031 and W034.

The mainline goes in first; then, as trials on top of it, each option with the options around it. So every
node is put into the network once, and never for each combination.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import accumulate
from typing import NamedTuple, Protocol

from executive.crl.checks.index import Entry, Index, label
from executive.crl.nodes import Block, Branch, Node, Task, end_temporals
from executive.crl.printer import flat, temporal_text
from executive.crl.trees import interval_tree, ms_text
from executive.crl.values import Absolute, Reference, Relative, Source, Temporal
from executive.stn import ORIGIN, Conflict, Link, TemporalNetwork

MAX_COMBINATIONS = 2_000
"""How many options are put into the network for W034 before it is left undecided."""


class Put(Protocol):
    """`TemporalNetwork.declare` or `TemporalNetwork.add`."""

    def __call__(
        self, source: int, target: int, lo_ms: int | None, hi_ms: int | None, label: object
    ) -> int: ...


class Why(NamedTuple):
    """Where a constraint of the network comes from."""

    kind: str
    node: Node
    side: str = ""
    temporal: Temporal | None = None


class PlanNetwork:
    """Puts nodes of one tree of a plan into a temporal network."""

    def __init__(self, index: Index, tree: int) -> None:
        self.index = index
        self.tree = tree
        self.network = TemporalNetwork()
        self.start: dict[int, int] = {}
        self.end: dict[int, int] = {}
        self._waiting: dict[int, list[tuple[int, str, Temporal]]] = {}
        """References to nodes that are not in the network (yet), by the node they wait for."""

    def insert(self, root: int, *, parent: int | None, incremental: bool) -> list[int]:
        """Put a node in, with all below it but options; return the branches met. Points go in text order."""
        entries = self.index.entries
        network = self.network
        put = network.add if incremental else network.declare
        branches: list[int] = []
        order: list[int] = []
        stack: list[tuple[int, bool]] = [(root, False)]
        while stack:
            number, leaving = stack.pop()
            entry = entries[number]
            if leaving:
                self.end[number] = network.add_point()
                continue
            self.start[number] = network.add_point()
            order.append(number)
            stack.append((number, True))
            if isinstance(entry.node, Branch):
                branches.append(number)
                continue
            child = number + 1
            below = []
            while child < entry.end:
                below.append((child, False))
                child = entries[child].end
            stack.extend(reversed(below))
        for number in order:
            self._structure(entries[number], parent if number == root else None, put)
        for number in order:
            self._conditions(entries[number], put)
        for number in order:
            for other, side, temporal in self._waiting.get(number, ()):
                if other in self.start:
                    self._temporal(entries[other], side, temporal, put)
        return branches

    def forget(self, numbers: range) -> None:
        """Take nodes out of the books after the trial that brought them in was taken back."""
        for number in numbers:
            self.start.pop(number, None)
            self.end.pop(number, None)

    def _structure(self, entry: Entry, parent: int | None, put: Put) -> None:
        number, node = entry.number, entry.node
        start, end = self.start[number], self.end[number]
        put(start, end, 0, None, Why("in", node))
        above = parent if parent is not None else entry.parent
        if above is None or above < 0 or above not in self.start:
            put(ORIGIN, start, 0, None, Why("plan", node))
            return
        put(self.end[number], self.end[above], 0, None, Why("part", node))
        previous = self._previous(entry)
        if previous is not None:
            put(self.end[previous], start, 0, None, Why("next", node))
        else:
            put(self.start[above], start, 0, None, Why("part", node))

    def _previous(self, entry: Entry) -> int | None:
        """Return the node before this one in its block."""
        if entry.parent < 0 or not isinstance(self.index.entries[entry.parent].node, Block):
            return None
        if entry.number == entry.parent + 1:
            return None
        before = entry.number - 1
        entries = self.index.entries
        while entries[before].parent != entry.parent:
            before = entries[before].parent
        return before

    def _conditions(self, entry: Entry, put: Put) -> None:
        node = entry.node
        for temporal in node.start_temporal_conditions:
            self._temporal(entry, "start", temporal, put)
        if node.end_temporal_conditions or node.duration is not None:
            for temporal in end_temporals(node):
                self._temporal(entry, "end", temporal, put)

    def _temporal(self, entry: Entry, side: str, temporal: Temporal, put: Put) -> None:
        interval = temporal.interval
        lo, hi = interval.lo_ms, interval.hi_ms
        if lo is not None and hi is not None and lo > hi:
            return  # E030
        number = entry.number
        point = self.start[number] if side == "start" else self.end[number]
        if isinstance(temporal, Absolute):
            if hi is None or hi >= 0:  # else E032
                put(ORIGIN, point, lo, hi, Why("when", entry.node, side, temporal))
            return
        if isinstance(temporal, Relative):
            put(self._base(entry, side), point, lo, hi, Why("when", entry.node, side, temporal))
            return
        other = self.index.by_id.get(temporal.node)
        if other is None or self.index.entries[other].tree != self.tree:
            return
        if other == number and (side == "start" or temporal.point == "end"):
            return  # E021
        points = self.start if temporal.point == "start" else self.end
        if other not in points:
            waiting = self._waiting.setdefault(other, [])
            if (number, side, temporal) not in waiting:
                waiting.append((number, side, temporal))
            return
        put(points[other], point, lo, hi, Why("when", entry.node, side, temporal))

    def _base(self, entry: Entry, side: str) -> int:
        if side == "end":
            return self.start[entry.number]
        previous = self._previous(entry)
        if previous is not None:
            return self.end[previous]
        return self.start.get(entry.parent, ORIGIN)

    # -- explanation -------------------------------------------------------------

    def explain(self, link: Link) -> str:
        """Return a link of a conflict in words, with the condition it comes from."""
        names = {p: f"start({self.index.entries[n].node.id})" for n, p in self.start.items()}
        names |= {p: f"end({self.index.entries[n].node.id})" for n, p in self.end.items()}
        names[ORIGIN] = "0"
        before, after = names[link.from_], names[link.to]
        gap = ms_text(abs(link.weight_ms))
        sign = "+" if link.weight_ms >= 0 else "-"
        if link.is_upper_bound:
            bound = f"{before} <= {after} {'+' if link.weight_ms <= 0 else '-'} {gap}"
        else:
            bound = f"{after} >= {before} {sign} {gap}" if link.weight_ms else f"{after} >= {before}"
        return f"{bound} ({self._origin(link)})"

    def _origin(self, link: Link) -> str:
        if link.constraint is None:
            return "not before the plan starts"
        why = link.constraint.label
        assert isinstance(why, Why)
        node = why.node
        if why.temporal is not None:
            stated = why.side == "start" or why.temporal in node.end_temporal_conditions
            field = f"{why.side}-temporal-conditions" if stated else "duration"
            interval = why.temporal.interval
            text = temporal_text(why.temporal) if stated else flat(interval_tree(interval))
            line = f", line {why.temporal.source.line}" if why.temporal.source is not None else ""
            return f":{field} {text} of {label(node)}{line}"
        return {
            "in": f"{node.id} ends after it starts",
            "next": f"{node.id} follows in its block",
            "part": f"{node.id} lies within its parent",
        }.get(why.kind, "not before the plan starts")

    def report(self, code: str, conflict: Conflict, what: str) -> None:
        """Report a conflict at the first condition that takes part in it."""
        index = self.index
        owner: Node | None = None
        source: Source | None = None
        for link in conflict.links:
            why = link.constraint.label if link.constraint is not None else None
            if isinstance(why, Why) and why.temporal is not None:
                owner, source = why.node, why.temporal.source
                break
        if owner is None:
            owner = index.entries[index.roots[self.tree]].node
        cycle = "; ".join(self.explain(link) for link in conflict.links)
        message = f"{what} is inconsistent by {ms_text(conflict.deficit_ms)} s: {cycle}"
        index.add(code, owner, message, at=source)


def check_network(index: Index, sound: Callable[[Index, int, PlanNetwork], None]) -> None:
    """Check every tree: its mainline, and each option with the options around it.

    `sound` is told of every tree with a consistent mainline, which the network then holds.
    """
    for tree, root in enumerate(index.roots):
        holder = index.holder(tree)
        name = "the temporal network" if holder is None else f"the temporal network of {label(holder)}"
        network = PlanNetwork(index, tree)
        branches = network.insert(root, parent=None, incremental=False)
        conflict = network.network.check()
        if conflict is not None:
            network.report("E031", conflict, name)
            continue
        sound(index, tree, network)
        before = len(index.findings)
        _options(network, branches, name)
        if len(index.findings) == before and len(branches) > 1:
            _combinations(network, branches, name)


def _insert_option(network: PlanNetwork, branch: int, child: int) -> list[int]:
    network.network.push()
    network.network.mark_points()
    return network.insert(child, parent=branch, incremental=True)


def _remove_option(network: PlanNetwork, child: int) -> None:
    network.network.pop()
    network.forget(range(child, network.index.entries[child].end))


def option_children(index: Index, branch: int) -> list[int]:
    """Return the nodes of a branch's options."""
    entries = index.entries
    children = []
    child = branch + 1
    while child < entries[branch].end:
        children.append(child)
        child = entries[child].end
    return children


def _harmless(index: Index, tree: int) -> Callable[[int], bool]:
    """Return a test of options that cannot be inconsistent, so that they need no trial.

    In a tree without upper bounds, but for the durations of tasks, time is never short; then only a reference
    to another node can close a cycle.
    """
    root = index.roots[tree]
    size = index.entries[root].end - root
    touched = [0] * size
    """How many references begin or end at each node."""
    bounded = False
    for number in range(root, root + size):
        node = index.entries[number].node
        temporals = (*node.start_temporal_conditions, *node.end_temporal_conditions)
        for temporal in temporals:
            if isinstance(temporal, Reference):
                touched[number - root] += 1
                other = index.by_id.get(temporal.node, -1)
                if root <= other < root + size:
                    touched[other - root] += 1
        bounded = bounded or any(t.interval.hi_ms is not None for t in temporals)
        if node.duration is not None and node.duration.hi_ms is not None and not isinstance(node, Task):
            bounded = True

    before = [0, *accumulate(touched)]

    def harmless(child: int) -> bool:
        return not bounded and before[index.entries[child].end - root] == before[child - root]

    return harmless


def _options(network: PlanNetwork, branches: list[int], name: str) -> None:
    """Try each option on the mainline and the options around it; depth first, without recursion."""
    index = network.index
    harmless = _harmless(index, network.tree)
    # Work items: enter an option, or leave it.
    stack: list[tuple[int, int, bool]] = []

    def plan_visits(found: list[int]) -> None:
        for branch in reversed(found):
            stack.extend(
                (branch, child, False)
                for child in reversed(option_children(index, branch))
                if not harmless(child)
            )

    plan_visits(branches)
    while stack:
        branch, child, leaving = stack.pop()
        if leaving:
            _remove_option(network, child)
            continue
        inner = _insert_option(network, branch, child)
        conflict = network.network.conflict
        if conflict is not None:
            option = index.option_of(child)
            assert option is not None
            network.report("E031", conflict, f"{name} with option {option.id}")
            _remove_option(network, child)
            continue
        stack.append((branch, child, True))
        plan_visits(inner)


def _combinations(network: PlanNetwork, branches: list[int], name: str) -> None:
    """Look for a combination of options of different branches that cannot hold together."""
    index = network.index
    budget = MAX_COMBINATIONS
    # A state is the list of branches still to decide; depth first over the choices.
    todo: list[tuple[str, int, int, tuple[int, ...]]] = []

    harmless = _harmless(index, network.tree)

    def visit(pending: tuple[int, ...]) -> None:
        while pending and all(map(harmless, option_children(index, pending[0]))):
            pending = pending[1:]
        if pending:
            children = reversed(option_children(index, pending[0]))
            todo.extend(("enter", pending[0], child, pending[1:]) for child in children)

    visit(tuple(branches))
    chosen: list[str] = []
    while todo:
        action, branch, child, pending = todo.pop()
        if action == "leave":
            _remove_option(network, child)
            chosen.pop()
            continue
        budget -= 1
        option = index.option_of(child)
        assert option is not None
        if budget < 0:
            message = (
                f"not decided whether all combinations of options are consistent ({MAX_COMBINATIONS} tried)"
            )
            index.add("W034", index.entries[index.roots[network.tree]].node, message)
            for _, _, entered, _ in (t for t in reversed(todo) if t[0] == "leave"):
                _remove_option(network, entered)
            return
        inner = _insert_option(network, branch, child)
        chosen.append(option.id)
        conflict = network.network.conflict
        if conflict is not None:
            network.report("W034", conflict, f"{name} with options {', '.join(chosen)}")
            _remove_option(network, child)
            for _, _, entered, _ in (t for t in reversed(todo) if t[0] == "leave"):
                _remove_option(network, entered)
            return
        todo.append(("leave", branch, child, ()))
        visit((*inner, *pending))
