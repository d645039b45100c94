"""Ids and references: E013-E018, E020-E025, E027, E090, E100."""

from __future__ import annotations

from collections.abc import Iterator

from executive.crl.checks.index import Entry, Index, Named, label
from executive.crl.lexer import is_symbol
from executive.crl.nodes import Alternate, Branch, FloatingContingency, Option, Task, end_temporals
from executive.crl.reader import MAX_DEPTH, MAX_NODES
from executive.crl.values import (
    And,
    Comparison,
    Condition,
    Known,
    Not,
    Operator,
    Or,
    Point,
    Reference,
    Temporal,
)

RESERVED_NODE_KEYS = {"outcome": 1, "reason": 1, "attempts": 1, "result": 2}
"""Keys kept by the executive whose first argument is a node, with their number of arguments."""

RESERVED_KEYS = frozenset({"time", *RESERVED_NODE_KEYS})


def check_names(index: Index) -> None:
    """Check ids, required contents and size."""
    _unique_ids(index)
    for entry in index.entries:
        node = entry.node
        if isinstance(node, Task):
            if node.source is None and not is_symbol(node.action):
                index.add(
                    "E013" if not node.action else "E014", node, f'":action" is not a symbol: {node.action!r}'
                )
        elif isinstance(node, Branch):
            if not node.options and _was_given(node, "options"):
                index.add("E017", node, "a branch needs at least one option", at="options")
        elif not node.node_list and _was_given(node, "node-list"):
            index.add("E016", node, 'the ":node-list" is empty', at="node-list")
        if entry.depth == MAX_DEPTH + 1 and node.source is None:
            index.add("E090", node, f"nodes are nested deeper than {MAX_DEPTH}")
    if len(index.entries) > MAX_NODES and index.plan.source is None:
        index.add("E090", index.plan, f"the plan has {len(index.entries)} nodes, more than {MAX_NODES}")
    for contingency in index.plan.floating:
        if not contingency.trigger_conditions:
            index.add(
                "E100", contingency, 'a contingency needs ":trigger-conditions"', at="trigger-conditions"
            )
        if contingency.max_insertions < 1:
            index.add("E101", contingency, '":max-insertions" must be at least 1', at="max-insertions")
        if contingency.scope is not None and index.scope_of(contingency) is None:
            if contingency.scope in index.by_id:
                reason = f'":scope" names "{contingency.scope}", which is not in the main tree'
                index.add("E023", contingency, reason, at="scope")
            elif contingency.scope not in index.words:
                index.add(
                    "E023",
                    contingency,
                    f'unknown node "{contingency.scope}" in :scope',
                    at="scope",
                    hint=index.suggest(contingency.scope),
                )


def _was_given(node: Named, field: str) -> bool:
    """Tell whether a field stands in the text; what is missing there was reported by the reader."""
    return node.source is None or field in node.source.fields


def named(index: Index) -> Iterator[Named]:
    """Yield all that has an id, in text order within each tree."""
    for entry in index.entries:
        if (option := index.option_of(entry.number)) is not None:
            yield option
        elif entry.parent < 0 and (holder := index.holder(entry.tree)) is not None:
            yield holder
        yield entry.node


def _unique_ids(index: Index) -> None:
    first: dict[str, Named] = {}
    repeated: list[tuple[Named, Named]] = []
    for owner in named(index):
        identifier = owner.id
        if not identifier:
            if owner.source is None:
                index.add("E013", owner, 'field ":id" is missing')
            continue
        other = first.setdefault(identifier, owner)
        if other is not owner:
            repeated.append((other, owner))
        if owner.source is None and (not is_symbol(identifier) or identifier == "nil"):
            index.add("E014", owner, f'":id" is not a symbol: {identifier!r}')
    for other, owner in repeated:
        if other.source is not None and owner.source is not None:
            places = other.source.position("id"), owner.source.position("id")
            if places[1] < places[0]:
                other, owner = owner, other
                places = places[1], places[0]
            message = f'id "{owner.id}" at line {places[1][0]} was already used at line {places[0][0]}'
        else:
            message = f'id "{owner.id}" is used twice, by {label(other)} and by {label(owner)}'
        index.add("E015", owner, message, at="id", prefix=False)


# --- temporal references --------------------------------------------------------


def check_references(index: Index) -> None:
    """Check what temporal conditions refer to."""
    for entry in index.entries:
        node = entry.node
        for temporal in node.start_temporal_conditions:
            if isinstance(temporal, Reference):
                _reference(index, entry, temporal, "start")
        if node.end_temporal_conditions or node.duration is not None:
            for temporal in end_temporals(node):
                if isinstance(temporal, Reference):
                    _reference(index, entry, temporal, "end")


def waits(temporal: Temporal) -> bool:
    """Tell whether a condition keeps its node waiting for the point it refers to (lower bound >= 0)."""
    lo = temporal.interval.lo_ms
    return lo is not None and lo >= 0


def _reference(index: Index, entry: Entry, temporal: Reference, side: str) -> None:
    node = entry.node
    where = f":{side}-temporal-conditions"
    target = index.by_id.get(temporal.node)
    if target is None:
        other = index.others.get(temporal.node)
        if other is not None:
            message = f'"{temporal.node}" in {where} is an {label(other).split()[0]}, not a node'
            if isinstance(other, FloatingContingency):
                message = f'"{temporal.node}" in {where} is a floating-contingency, not a node'
            index.add("E020", node, message, at=temporal.source, hint=f'its node is "{other.node.id}"')
        elif temporal.node not in index.words:
            message = f'unknown node "{temporal.node}" in {where}'
            index.add("E020", node, message, at=temporal.source, hint=index.suggest(temporal.node))
        return
    other_entry = index.entries[target]
    if target == entry.number:
        if side == "start" or temporal.point is Point.END:
            message = f"refers to its own {temporal.point} in {where}"
            index.add(
                "E021", node, message, at=temporal.source, hint="(:relative (lo hi)) counts from activation"
            )
        return
    if other_entry.tree != entry.tree:
        _across_trees(index, entry, other_entry, temporal, where)
        return
    if other_entry.covers(entry.number):
        if side == "start" and temporal.point is Point.END and waits(temporal):
            message = f"waits in {where} for the end of {temporal.node}, which it is a part of"
            index.add("E022", node, message, at=temporal.source)
        return
    if entry.covers(target):
        return
    top = index.meeting(entry.number, target)
    if isinstance(index.entries[top].node, Branch):
        message = f"{node.id} and {temporal.node} never run in the same execution"
        hint = f"they belong to two options of branch {index.entries[top].node.id}"
        index.add("E025", node, message, at=temporal.source, hint=hint)


def _across_trees(index: Index, entry: Entry, target: Entry, temporal: Reference, where: str) -> None:
    node = entry.node
    if entry.tree == 0:
        holder = index.holder(target.tree)
        assert holder is not None
        message = f"refers in {where} to {temporal.node}, a node of {label(holder)}"
        hint = "a node that is not inserted has no time"
        index.add("E027", node, message, at=temporal.source, hint=hint)
        return
    holder = index.holder(entry.tree)
    if target.tree != 0 or not isinstance(holder, FloatingContingency) or not waits(temporal):
        return
    scope = index.scope_of(holder)
    if scope is None:
        return
    scope_entry = index.entries[scope]
    if target.covers(scope):
        if temporal.point is Point.END:
            message = (
                f"waits in {where} for the end of {temporal.node}, which cannot end before {label(holder)}"
            )
            index.add("E027", node, message, at=temporal.source)
    elif scope_entry.covers(target.number):
        message = f"waits in {where} for {temporal.node}, which {label(holder)} keeps from starting"
        index.add("E027", node, message, at=temporal.source)


# --- keys of the executive ------------------------------------------------------


def leaves(condition: Condition) -> Iterator[Comparison | Known]:
    """Yield the lookups of a condition."""
    stack = [condition]
    while stack:
        top = stack.pop()
        if isinstance(top, (Comparison, Known)):
            yield top
        elif isinstance(top, Not):
            stack.append(top.part)
        elif isinstance(top, (And, Or)):
            stack.extend(reversed(top.parts))


def all_conditions(index: Index) -> Iterator[tuple[Named, str, Condition]]:
    """Yield every condition with its owner and the name of its field."""
    for owner in named(index):
        if isinstance(owner, (Option, Alternate)):
            for condition in owner.eligible_conditions:
                yield owner, "eligible-conditions", condition
        elif isinstance(owner, FloatingContingency):
            for condition in owner.trigger_conditions:
                yield owner, "trigger-conditions", condition
        else:
            for condition in owner.start_conditions:
                yield owner, "start-conditions", condition
            for condition in owner.wait_for_conditions:
                yield owner, "wait-for-conditions", condition
            for condition in owner.maintain_conditions:
                yield owner, "maintain-conditions", condition
            for condition in owner.end_conditions:
                yield owner, "end-conditions", condition


def _orders_non_number(leaf: Comparison | Known) -> bool:
    return (
        isinstance(leaf, Comparison)
        and leaf.operator not in (Operator.EQ, Operator.NE)
        and isinstance(leaf.value, (str, bool))
    )


def check_keys(index: Index) -> None:
    """Check lookups: the executive's own keys, and ordering of non-numbers."""
    for owner, field, condition in all_conditions(index):
        for leaf in leaves(condition):
            if _orders_non_number(leaf):
                message = f'":{field}" orders {leaf.key} against what is not a number'
                index.add("E041", owner, message, at=leaf.source or field)
            count = RESERVED_NODE_KEYS.get(leaf.key)
            if leaf.key == "time" and leaf.arguments:
                index.add("E040", owner, '":time" takes no arguments', at=leaf.source or field)
            if count is None:
                continue
            if len(leaf.arguments) != count:
                form = "(:result node name)" if count == 2 else f"(:{leaf.key} node)"
                index.add("E040", owner, f'":{field}" needs the form {form}', at=leaf.source or field)
                continue
            name = leaf.arguments[0]
            if name not in index.by_id and name not in index.words:
                message = f'unknown node "{name}" in :{leaf.key} of :{field}'
                index.add("E024", owner, message, at=leaf.source or field, hint=index.suggest(str(name)))
