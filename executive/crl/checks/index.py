"""A plan laid out for checking: every node with its place in the tree, found by number or by id."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from executive.crl.errors import Finding, Severity
from executive.crl.nodes import (
    KIND_OF,
    Alternate,
    Branch,
    FloatingContingency,
    Node,
    Option,
    Plan,
    children,
)
from executive.crl.reader import nearest
from executive.crl.values import Source

Named = Node | Option | FloatingContingency | Alternate
Owner = Named | Plan


def label(owner: Owner) -> str:
    """Return how messages call a thing: its kind and its id."""
    kind = KIND_OF[type(owner)]
    return f"{kind} {owner.id}" if owner.id else kind


@dataclass(slots=True)
class Entry:
    """One node. Entries are numbered in text order, so a subtree is the range `number` .. `end`."""

    node: Node
    number: int
    parent: int
    tree: int
    depth: int
    option: int
    """Position of the option in the branch above, -1 if the parent is not a branch."""
    end: int = 0

    def covers(self, number: int) -> bool:
        return self.number <= number < self.end


@dataclass(slots=True)
class Index:
    """All nodes of a plan, in text order: main tree (0), contingencies (1 ..), alternates."""

    plan: Plan
    words: frozenset[str] = frozenset()
    """Ids that stand in the text but not in the plan, since their forms could not be read."""
    entries: list[Entry] = field(default_factory=list)
    by_id: dict[str, int] = field(default_factory=dict)
    others: dict[str, Option | FloatingContingency | Alternate] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)
    roots: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        for tree, root in enumerate(self.plan.trees()):
            self.roots.append(len(self.entries))
            self._lay_out(root, tree)
        for entry in self.entries:
            self.by_id.setdefault(entry.node.id, entry.number)
            if isinstance(entry.node, Branch):
                for option in entry.node.options:
                    self.others.setdefault(option.id, option)
        for contingency in self.plan.floating:
            self.others.setdefault(contingency.id, contingency)
        for alternate in self.plan.library:
            self.others.setdefault(alternate.id, alternate)
        self.by_id.pop("", None)

    def _lay_out(self, root: Node, tree: int) -> None:
        entries = self.entries
        stack: list[tuple[Node, int, int, int]] = [(root, -1, 1, -1)]
        while stack:
            node, parent, depth, option = stack.pop()
            number = len(entries)
            entries.append(Entry(node, number, parent, tree, depth, option))
            chosen = isinstance(node, Branch)
            below = enumerate(children(node))
            stack.extend(reversed([(n, number, depth + 1, at if chosen else -1) for at, n in below]))
        for entry in reversed(entries[self.roots[-1] :]):
            entry.end = max(entry.end, entry.number + 1)
            if entry.parent >= 0:
                parent_entry = entries[entry.parent]
                parent_entry.end = max(parent_entry.end, entry.end)

    # -- findings ----------------------------------------------------------------

    def add(
        self,
        code: str,
        owner: Owner,
        message: str,
        *,
        at: Source | str | None = None,
        hint: str = "",
        prefix: bool = True,
    ) -> None:
        """Report something about `owner`, at a source of its own or at the owner's field `at`."""
        line, column = 0, 0
        if isinstance(at, Source):
            line, column = at.position()
        elif owner.source is not None:
            line, column = owner.source.position(at)
        severity = Severity.WARNING if code.startswith("W") else Severity.ERROR
        node = "" if isinstance(owner, Plan) else owner.id
        text = f"{label(owner)}: {message}" if prefix else message
        self.findings.append(Finding(code, severity, text, node, line, column, hint))

    def suggest(self, name: str) -> str:
        """Return a hint with the most similar id of a node."""
        return nearest(name, self.by_id)

    # -- structure ---------------------------------------------------------------

    def ancestors(self, number: int) -> Iterable[int]:
        """Yield the nodes around a node, from its parent to the root of its tree."""
        parent = self.entries[number].parent
        while parent >= 0:
            yield parent
            parent = self.entries[parent].parent

    def meeting(self, a: int, b: int) -> int:
        """Return the lowest node that holds both, -1 if they stand in different trees."""
        entries = self.entries
        if entries[a].tree != entries[b].tree:
            return -1
        while not entries[a].covers(b):
            a = entries[a].parent
        return a

    def scope_of(self, contingency: FloatingContingency) -> int | None:
        """Return the node a contingency belongs to, None if it is not in the main tree."""
        if contingency.scope is None:
            return 0
        number = self.by_id.get(contingency.scope)
        return None if number is None or self.entries[number].tree != 0 else number

    def holder(self, tree: int) -> FloatingContingency | Alternate | None:
        """Return the contingency or alternate a tree belongs to, None for the main tree."""
        if tree == 0:
            return None
        floating = self.plan.floating
        return floating[tree - 1] if tree <= len(floating) else self.plan.library[tree - 1 - len(floating)]

    def option_of(self, number: int) -> Option | None:
        """Return the option whose node this is."""
        entry = self.entries[number]
        if entry.option < 0:
            return None
        branch = self.entries[entry.parent].node
        assert isinstance(branch, Branch)
        return branch.options[entry.option]
