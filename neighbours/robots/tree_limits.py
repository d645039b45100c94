"""What of a plan a behaviour tree of BehaviorTree.CPP cannot say, each construct with its place and reason.

The rule is exactness: what is not listed here keeps its meaning in the exported tree, start for start and end
for end. So a construct is listed when the tree would do the same only sometimes.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from executive.crl.nodes import (
    Branch,
    ConcurrentBlock,
    Node,
    Option,
    Plan,
    Task,
    children,
    end_temporals,
    walk,
    walk_plan,
)
from executive.crl.values import (
    Amount,
    And,
    CapacityResource,
    Comparison,
    Condition,
    Conditions,
    IfNone,
    Known,
    Not,
    OnOptionFailure,
    OnResume,
    Or,
    Source,
    UtilityTable,
)
from executive.engine.compile_plan import compile_node
from executive.engine.dispatch import ties
from executive.engine.spec import INFINITY, NodeSpec, Window

_Amounts = Callable[[Node], tuple[Amount, ...]]

FORBIDDEN = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that XML 1.0 cannot hold, not even as a reference (XML 1.0, 2.2)."""
MOST_ORDERS = 24
"""Orders in which options may be tried that are written out, 4! of four options."""


@dataclass(frozen=True, slots=True)
class Lacking:
    """A construct that does not fit: the node or other form that has it, its place in the text, and why."""

    node: str
    line: int
    column: int
    construct: str
    why: str

    def __str__(self) -> str:
        place = f"line {self.line}, column {self.column}: " if self.line else ""
        return f"{place}{self.node}: {self.construct}: {self.why}"


@dataclass(frozen=True, slots=True)
class _Held:
    """Something with an id and a source: a node, an option, a contingency."""

    id: str
    source: Source | None


def leaves(conditions: Conditions) -> Iterator[Comparison | Known]:
    """Yield the comparisons and `known` tests of a list of conditions."""
    stack: list[Condition] = list(conditions)
    while stack:
        match stack.pop():
            case And(parts) | Or(parts):
                stack.extend(parts)
            case Not(part):
                stack.append(part)
            case Comparison() | Known() as leaf:
                yield leaf


def node_conditions(node: Node) -> Iterator[tuple[str, Conditions]]:
    """Yield the lists of conditions of a node with the words of their fields."""
    yield "start-conditions", node.start_conditions
    yield "wait-for-conditions", node.wait_for_conditions
    yield "maintain-conditions", node.maintain_conditions
    yield "end-conditions", node.end_conditions


@dataclass(slots=True)
class Family:
    """Where each node of a plan stands: its parent, and the tree it belongs to."""

    nodes: dict[str, Node]
    parents: dict[str, str | None]

    @classmethod
    def of(cls, plan: Plan) -> Family:
        """Return the family of all trees of a plan."""
        nodes = {node.id: node for node in walk_plan(plan)}
        parents: dict[str, str | None] = dict.fromkeys(nodes)
        for node in nodes.values():
            parents.update((child.id, node.id) for child in children(node))
        return cls(nodes, parents)

    def line(self, node: str) -> list[str]:
        """Return a node and its ancestors, the root first."""
        found: list[str] = []
        at: str | None = node
        while at is not None:
            found.append(at)
            at = self.parents[at]
        return found[::-1]

    def side_by_side(self, one: str, other: str) -> bool:
        """Tell whether two nodes may run at the same time, neither being below the other."""
        a, b = self.line(one), self.line(other)
        if a[0] != b[0]:
            return False
        for place, (x, y) in enumerate(zip(a, b, strict=False)):
            if x != y:
                return isinstance(self.nodes[a[place - 1]], ConcurrentBlock)
        return False


def lacking_of(plan: Plan) -> tuple[Lacking, ...]:
    """Return all that keeps a plan from being said exactly, in the order of its text."""
    family = Family.of(plan)
    found = [*_header(plan, family)]
    for tree in (plan.node, *(a.node for a in plan.library)):
        for node in walk(tree):
            found += _of_node(node, family)
    found += _shared(plan, family)
    if isinstance(plan.node, Branch) and plan.node.if_none is IfNone.SKIP:
        why = "a plan may end SKIPPED, a tree ends with SUCCESS or FAILURE"
        found.append(_at(plan.node, ":if-none :skip of the root", "if-none", why))
    return tuple(sorted(found, key=lambda one: (one.line, one.column)))


def _at(held: Node | Option | _Held, construct: str, word: str | None, why: str) -> Lacking:
    line, column = held.source.position(word) if held.source is not None else (0, 0)
    return Lacking(held.id, line, column, construct, why)


def _header(plan: Plan, family: Family) -> Iterator[Lacking]:
    for one in plan.floating:
        why = "a tree has no place at which a node may come in between, or interrupt, whatever runs"
        yield _at(_Held(one.id, one.source), "floating-contingency", None, why)
    for alternate in plan.library:
        if isinstance(alternate.utility, UtilityTable):
            yield _table(_Held(alternate.id, alternate.source))
        held = _Held(alternate.id, alternate.source)
        yield from _conditions(held, "eligible-conditions", alternate.eligible_conditions, family)
    library = [(a.utility, bool(a.eligible_conditions or a.requires)) for a in plan.library]
    if orders(library) > MOST_ORDERS:
        held = _Held(plan.library[0].id, plan.library[0].source)
        yield _at(held, "alternates", None, f"they may be tried in more than {MOST_ORDERS} orders")


def _table(held: Option | _Held) -> Lacking:
    why = "what is tried next after a failure would depend on the time of the failure"
    return _at(held, ":utility table", "utility", why)


def orders(options: Sequence[tuple[object, bool]]) -> int:
    """Return in how many orders options may be tried; each is (utility, has a condition), best first.

    An option without a condition is the last that is looked at before something is chosen.
    """
    total = 0
    for place, (_, conditional) in enumerate(options):
        total += max(1, orders([*options[:place], *options[place + 1 :]])) if len(options) <= 7 else 10**6
        if not conditional:
            break
    return total


def _of_node(node: Node, family: Family) -> Iterator[Lacking]:
    for word, conditions in node_conditions(node):
        yield from _conditions(node, word, conditions, family)
    if _delays(node, family):
        why = "its bounds may delay another start (CRL 8.3), and a tree propagates no times"
        yield _at(node, "windows that tie nodes", "start-temporal-conditions", why)
    if isinstance(node, Task):
        yield from _of_task(node)
    elif isinstance(node, Branch):
        yield from _of_branch(node, family)


def _of_task(task: Task) -> Iterator[Lacking]:
    if task.on_resume is not OnResume.REATTACH:
        why = "a tree keeps no journal, so there is nothing to resume after a crash"
        yield _at(task, f":on-resume :{task.on_resume}", "on-resume", why)
    for name, value in task.parameters.items():
        if isinstance(value, str) and value.startswith("{") and value.endswith("}"):
            why = f"parameter {name}: BehaviorTree.CPP reads {value} as the name of a blackboard entry"
            yield _at(task, "text in braces", "parameters", why)
        if isinstance(value, str):
            yield from _no_xml(task, "parameters", f"parameter {name}", value)


def _no_xml(held: Node | Option | _Held, word: str, what: str, text: str) -> Iterator[Lacking]:
    for found in sorted(set(FORBIDDEN.findall(text))):
        why = f"{what} has the character U+{ord(found):04X}, which XML cannot hold"
        yield _at(held, "text with a forbidden character", word, why)


def _of_branch(branch: Branch, family: Family) -> Iterator[Lacking]:
    for option in branch.options:
        if isinstance(option.utility, UtilityTable) and branch.on_option_failure is OnOptionFailure.NEXT:
            yield _table(option)
        yield from _conditions(option, "eligible-conditions", option.eligible_conditions, family)
    if branch.if_none is IfNone.SKIP and (end_temporals(branch) or branch.end_conditions):
        why = "a skipped branch is over at once, and what a tree asks at the end it asks of success too"
        yield _at(branch, ":if-none :skip with conditions on the end", "if-none", why)
    if branch.on_option_failure is OnOptionFailure.NEXT:
        listed = [(o.utility, bool(o.eligible_conditions or o.requires)) for o in branch.options]
        if orders(listed) > MOST_ORDERS:
            why = f"its options may be tried in more than {MOST_ORDERS} orders, each a tree of its own"
            yield _at(branch, ":on-option-failure :next", "on-option-failure", why)


def _conditions(
    held: Node | Option | _Held, word: str, conditions: Conditions, family: Family
) -> Iterator[Lacking]:
    for leaf in leaves(conditions):
        values = (*leaf.arguments, *((leaf.value,) if isinstance(leaf, Comparison) else ()))
        for value in values:
            yield from _no_xml(held, word, f"condition on :{leaf.key}", str(value))
        if leaf.key in ("reason", "attempts", "result"):
            why = "a node of a tree leaves SUCCESS or FAILURE behind and nothing else"
            yield _at(held, f"condition on :{leaf.key}", word, why)
        elif leaf.key == "outcome":
            about = family.nodes.get(str(leaf.arguments[0])) if leaf.arguments else None
            if isinstance(about, Branch) and about.if_none is IfNone.SKIP:
                why = f"that {about.id} was skipped is neither failure nor success, which a tree cannot tell"
                yield _at(held, "condition on :outcome", word, why)


# --- times that push other times ----------------------------------------------------


def _delays(node: Node, family: Family) -> bool:
    """Tell whether windows of a node may delay a start, in the node or elsewhere, beyond own windows."""
    if not (node.start_temporal_conditions or node.end_temporal_conditions or node.duration):
        return False
    spec = compile_node(node)
    if not ties(spec):
        return False
    if any(w.hi < INFINITY or w.lo < 0 for w in spec.end_windows if w.ref in family.nodes):
        return True
    return ties(replace(spec, start_windows=_without_harmless(node, spec, family)))


def _without_harmless(node: Node, spec: NodeSpec, family: Family) -> tuple[Window, ...]:
    """Return the start windows without the upper bounds that can delay nothing.

    Such a bound counts from a node behind which this one comes directly, or beside which it starts, and no
    other window pushes this one.
    """
    refs = {w.ref for w in spec.start_windows}
    if len(refs) != 1 or node.end_temporal_conditions:
        return spec.start_windows
    ref = refs.pop()
    parent = family.parents[node.id]
    if ref not in family.nodes or parent is None or family.parents[ref] != parent:
        return spec.start_windows
    held = family.nodes[parent]
    siblings = [child.id for child in children(held)]
    directly = siblings.index(node.id) == siblings.index(ref) + 1
    if not (isinstance(held, ConcurrentBlock) or directly) or any(w.lo < 0 for w in spec.start_windows):
        return spec.start_windows
    return ()


# --- what nodes share -----------------------------------------------------------------


def contested(plan: Plan, family: Family) -> Mapping[str, float]:
    """Return the capacities of the resources that nodes which may run side by side could exhaust."""
    capacities = {r.name: r.capacity for r in plan.resources if isinstance(r, CapacityResource)}
    found: dict[str, float] = {}
    for name, held in _users(plan, lambda node: node.uses).items():
        room = capacities.get(name, 1.0)
        beside = any(family.side_by_side(a.id, b.id) for a, _ in held for b, _ in held)
        if beside and sum(amount for _, amount in held) > room:
            found[name] = room
    return found


def _shared(plan: Plan, family: Family) -> Iterator[Lacking]:
    """Yield requirements of nodes that may run side by side; without those nobody reserves for others."""
    for name, held in _users(plan, _required).items():
        for node, _ in held:
            if any(family.side_by_side(node.id, other.id) for other, _ in held):
                why = f"nodes that may run side by side reserve {name}, and a tree keeps no account"
                yield _at(node, ":requires", "requires", why)


def _required(node: Node) -> tuple[Amount, ...]:
    options = node.options if isinstance(node, Branch) else ()
    return (*node.requires, *(amount for option in options for amount in option.requires))


def _users(plan: Plan, amounts: _Amounts) -> Mapping[str, list[tuple[Node, float]]]:
    found: dict[str, list[tuple[Node, float]]] = {}
    for tree in (plan.node, *(a.node for a in plan.library)):
        for node in walk(tree):
            for one in amounts(node):
                found.setdefault(one.resource, []).append((node, one.amount))
    return found
