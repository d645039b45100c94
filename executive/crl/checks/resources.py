"""Resources: E060-E063, and W086 for holders that can block each other for ever."""

from __future__ import annotations

from collections import defaultdict

from executive.crl.checks.index import Entry, Index, Owner, label
from executive.crl.checks.names import named
from executive.crl.nodes import Alternate, ConcurrentBlock, FloatingContingency, Node, Option, Task
from executive.crl.reader import nearest
from executive.crl.trees import number_text
from executive.crl.values import Amount, CapacityResource, ConsumableResource, Resource, UnitResource

MAX_PAIRS = 20_000
"""How many pairs of holders are compared for W086 before it is left undecided."""


def check_resources(index: Index) -> None:
    """Check every use and requirement of a resource."""
    plan = index.plan
    declared: dict[str, Resource] = {}
    for resource in plan.resources:
        if resource.name in declared:
            message = f'resource "{resource.name}" is declared twice'
            index.add("E014", plan, message, at=resource.source or "resources")
        declared.setdefault(resource.name, resource)
        if isinstance(resource, CapacityResource) and resource.capacity < 0:
            message = f'the capacity of "{resource.name}" is negative'
            index.add("E014", plan, message, at=resource.source or "resources")
    for budget in plan.budgets:
        resource_of = declared.get(budget.resource)
        if budget.resource != "time" and not isinstance(resource_of, ConsumableResource):
            message = f'":budgets" names "{budget.resource}", which is neither time nor a consumable'
            index.add("E060", plan, message, at=budget.source or "budgets")
    for owner in named(index):
        if isinstance(owner, FloatingContingency):
            continue
        if owner.requires:
            _requires(index, owner, declared)
        if not isinstance(owner, (Option, Alternate)) and owner.uses:
            _uses(index, owner, owner.uses, declared)
    if any(entry.node.uses for entry in index.entries):
        _asked_again(index)
        _deadlocks(index, declared)


def _undeclared(
    index: Index, owner: Owner, amount: Amount, field: str, declared: dict[str, Resource]
) -> None:
    message = f'undeclared resource "{amount.resource}" in :{field}'
    hint = nearest(amount.resource, declared) or "resources are declared in the header of the plan"
    index.add("E060", owner, message, at=amount.source or field, hint=hint)


def _requires(index: Index, owner: Node | Option | Alternate, declared: dict[str, Resource]) -> None:
    for amount in owner.requires:
        resource = declared.get(amount.resource)
        at = amount.source or "requires"
        if resource is None:
            _undeclared(index, owner, amount, "requires", declared)
        elif not isinstance(resource, ConsumableResource):
            message = f'":requires" asks for "{amount.resource}", which is not a consumable'
            index.add("E063", owner, message, at=at, hint='unit and capacity resources stand in ":uses"')
        if amount.amount < 0:
            message = f'":requires" asks for {number_text(amount.amount)} of "{amount.resource}"'
            index.add("E014", owner, message, at=at, hint="an amount is not negative")


def _uses(index: Index, owner: Owner, uses: tuple[Amount, ...], declared: dict[str, Resource]) -> None:
    totals: dict[str, float] = defaultdict(float)
    for amount in uses:
        resource = declared.get(amount.resource)
        at = amount.source or "uses"
        if resource is None:
            _undeclared(index, owner, amount, "uses", declared)
            continue
        if isinstance(resource, ConsumableResource):
            message = f'":uses" asks for "{amount.resource}", which is a consumable'
            index.add("E063", owner, message, at=at, hint='consumables stand in ":requires"')
            continue
        if amount.amount < 0:
            message = f'":uses" asks for {number_text(amount.amount)} of "{amount.resource}"'
            index.add("E014", owner, message, at=at, hint="an amount is not negative")
        totals[amount.resource] += amount.amount
        capacity = 1 if isinstance(resource, UnitResource) else resource.capacity
        if totals[amount.resource] > capacity:
            asked = number_text(totals[amount.resource])
            message = f'":uses" asks for {asked} of "{amount.resource}"; there is {number_text(capacity)}'
            index.add("E061", owner, message, at=at)


def _asked_again(index: Index) -> None:
    """E062: what an ancestor holds, or for a contingency what its scope holds, is asked again."""
    held: list[dict[str, int]] = []
    """For each node, what is held around it: resource -> holder."""
    entries = index.entries
    for entry in entries:
        if entry.parent < 0:
            around = _held_at_insertion(index, entry)
        else:
            above = entries[entry.parent]
            around = held[entry.parent]
            if above.node.uses:
                around = {**around, **{a.resource: above.number for a in above.node.uses}}
        held.append(around)
        for amount in entry.node.uses:
            holder = around.get(amount.resource)
            if holder is not None:
                message = f'asks for "{amount.resource}", which {label(entries[holder].node)} holds'
                index.add("E062", entry.node, message, at=amount.source or "uses")


def _held_at_insertion(index: Index, root: Entry) -> dict[str, int]:
    contingency = index.holder(root.tree)
    if not isinstance(contingency, FloatingContingency):
        return {}
    scope = index.scope_of(contingency)
    if scope is None:
        return {}
    inside = [
        n
        for n in range(scope, index.entries[scope].end)
        if n == scope or not isinstance(index.entries[n].node, Task)
    ]
    holders = [*index.ancestors(scope), *inside]
    return {a.resource: n for n in holders for a in index.entries[n].node.uses}


# --- W086 -----------------------------------------------------------------------


def _wants(index: Index, declared: dict[str, Resource]) -> dict[tuple[str, str], list[tuple[int, int]]]:
    """Return, by (held, wanted) unit, the holders and the nodes below them that want."""
    units = {name for name, r in declared.items() if isinstance(r, UnitResource)}
    entries = index.entries
    wants: dict[tuple[str, str], list[tuple[int, int]]] = defaultdict(list)
    for entry in entries:
        wanted = [a.resource for a in entry.node.uses if a.resource in units]
        if not wanted:
            continue
        for above in index.ancestors(entry.number):
            for amount in entries[above].node.uses:
                if amount.resource in units:
                    for resource in wanted:
                        if resource != amount.resource:
                            wants[amount.resource, resource].append((above, entry.number))
    return wants


def _deadlocks(index: Index, declared: dict[str, Resource]) -> None:
    """Look for nodes that may run at the same time, each holding a unit that something in the other needs."""
    entries = index.entries
    wants = _wants(index, declared)
    budget = MAX_PAIRS
    reported: set[frozenset[str]] = set()
    after: dict[str, set[str]] = defaultdict(set)
    for held, wanted_ in wants:
        after[held].add(wanted_)
    for cycle in _simple_cycles(after):
        chain: list[tuple[int, int]] = []
        edges = [wants[a, b] for a, b in zip(cycle, [*cycle[1:], cycle[0]], strict=True)]
        stack: list[list[tuple[int, int]]] = [[pair] for pair in edges[0]]
        while stack and not chain:
            partial = stack.pop()
            budget -= 1
            if budget < 0:
                message = f"not decided whether holders can block each other ({MAX_PAIRS} cases tried)"
                index.add("W086", index.plan, message, at="resources")
                return
            if len(partial) == len(edges):
                chain = partial
                break
            stack += [
                [*partial, pair]
                for pair in edges[len(partial)]
                if all(_concurrent(index, pair[0], other[0]) for other in partial)
            ]
        if chain and frozenset(cycle) not in reported:
            reported.add(frozenset(cycle))
            parts = [
                f'{entries[holder].node.id} holds "{resource}" while {entries[below].node.id} in it waits'
                f' for "{following}"'
                for (holder, below), resource, following in zip(
                    chain, cycle, [*cycle[1:], cycle[0]], strict=True
                )
            ]
            first = entries[min(holder for holder, _ in chain)].node
            hint = "take all units in the outermost node, or everywhere in the same order"
            index.add("W086", first, f"may block for ever: {'; '.join(parts)}", at="uses", hint=hint)


def _concurrent(index: Index, a: int, b: int) -> bool:
    """Tell whether two nodes may run at the same time without one being part of the other."""
    if index.entries[a].tree != index.entries[b].tree:
        return True
    if index.entries[a].covers(b) or index.entries[b].covers(a):
        return False
    return isinstance(index.entries[index.meeting(a, b)].node, ConcurrentBlock)


def _simple_cycles(after: dict[str, set[str]]) -> list[list[str]]:
    """Return cycles of up to four resources; longer ones need more arms than a rover has."""
    cycles: list[list[str]] = []
    for first in sorted(after):
        paths = [[first]]
        while paths:
            path = paths.pop()
            for following in sorted(after.get(path[-1], ())):
                if following == first and len(path) > 1:
                    cycles.append(path)
                elif following > first and following not in path and len(path) < 4:
                    paths.append([*path, following])
    return cycles
