"""Cycles of waiting: E026, and W073 where only end conditions close them.

Points stand in the order of the text: a start where its form begins, an end where it closes. Whatever the
structure of a plan demands leads forward in this order, so a cycle needs a condition that leads backward; a
plan without one is done in a single look at its conditions.
"""

from __future__ import annotations

from executive.crl.checks.index import Index
from executive.crl.checks.names import waits
from executive.crl.nodes import Block, Branch, end_temporals
from executive.crl.values import Point, Reference

Demand = tuple[int, int]
"""A point: number of the node, and 0 for its start or 1 for its end."""


def check_waiting(index: Index) -> None:
    """Report each group of nodes that wait for one another."""
    starts = _demands(index, ends=False)
    reported = _report(index, starts, "E026") if any(_leads_back(index, d) for d in starts) else False
    if not reported:
        both = starts + _demands(index, ends=True)
        if any(_leads_back(index, d) for d in both):
            _report(index, both, "W073")


def _demands(index: Index, *, ends: bool) -> list[tuple[Demand, Demand]]:
    """Return (awaited point, waiting point) of the temporal conditions with lower bound >= 0."""
    found: list[tuple[Demand, Demand]] = []
    for entry in index.entries:
        node = entry.node
        temporals = end_temporals(node) if ends else node.start_temporal_conditions
        for temporal in temporals:
            if not isinstance(temporal, Reference) or not waits(temporal):
                continue
            other = index.by_id.get(temporal.node)
            if other is None or other == entry.number or index.entries[other].tree != entry.tree:
                continue
            if not ends and temporal.point is Point.END and index.entries[other].covers(entry.number):
                continue  # E022
            top = index.meeting(other, entry.number)
            if isinstance(index.entries[top].node, Branch) and top not in (other, entry.number):
                continue  # E025
            point = 1 if temporal.point is Point.END else 0
            found.append(((other, point), (entry.number, 1 if ends else 0)))
    return found


def _leads_back(index: Index, demand: tuple[Demand, Demand]) -> bool:
    (a, a_end), (b, b_end) = demand
    return _place(index, a, a_end) > _place(index, b, b_end)


def _place(index: Index, number: int, end: int) -> tuple[int, int]:
    """Return where a point stands in the text; ends of nodes that close together go from the inside out."""
    entry = index.entries[number]
    return (entry.end, -number) if end else (number, 1)


def _report(index: Index, demands: list[tuple[Demand, Demand]], code: str) -> bool:
    after: dict[Demand, list[Demand]] = {}
    for awaited, waiting in demands:
        after.setdefault(awaited, []).append(waiting)
    for cycle in _cycles(index, after):
        nodes = list(dict.fromkeys(number for number, _ in cycle))
        texts = [f"{'end' if end else 'start'} of {index.entries[n].node.id}" for n, end in cycle]
        conditioned = {n for _, (n, _) in demands}
        first = min((n for n in nodes if n in conditioned), default=nodes[0])
        node = index.entries[first].node
        chain = " -> ".join([*texts, texts[0]])
        field = "start-temporal-conditions" if code == "E026" else "end-temporal-conditions"
        what = "waits for itself" if code == "E026" else "what waits for it can never start"
        index.add(code, node, f"{what}: {chain}", at=field)
    return any(f.code == code for f in index.findings)


def _successors(index: Index, point: Demand, after: dict[Demand, list[Demand]]) -> list[Demand]:
    number, end = point
    entries = index.entries
    entry = entries[number]
    found = list(after.get(point, ()))
    if end:
        if entry.parent >= 0:
            found.append((entry.parent, 1))
            if (
                isinstance(entries[entry.parent].node, Block)
                and entry.end < len(entries)
                and entries[entry.end].parent == entry.parent
            ):
                found.append((entry.end, 0))
    else:
        found.append((number, 1))
        child = number + 1
        concurrent = not isinstance(entry.node, Block)
        while child < entry.end:
            found.append((child, 0))
            if not concurrent:
                break
            child = entries[child].end
    return found


def _cycles(index: Index, after: dict[Demand, list[Demand]]) -> list[list[Demand]]:
    """Return one cycle for each group of points that depend on one another (Tarjan, without recursion)."""
    order: dict[Demand, int] = {}
    low: dict[Demand, int] = {}
    on_stack: set[Demand] = set()
    stack: list[Demand] = []
    cycles: list[list[Demand]] = []
    work: list[tuple[Demand, list[Demand]]] = []

    def enter(point: Demand) -> None:
        order[point] = low[point] = len(order)
        stack.append(point)
        on_stack.add(point)
        work.append((point, _successors(index, point, after)))

    for root in index.roots:
        enter((root, 0))
        while work:
            point, rest = work[-1]
            if rest:
                following = rest.pop()
                if following not in order:
                    enter(following)
                elif following in on_stack:
                    low[point] = min(low[point], order[following])
                continue
            work.pop()
            if work:
                above = work[-1][0]
                low[above] = min(low[above], low[point])
            if low[point] == order[point]:
                group: set[Demand] = set()
                while True:
                    member = stack.pop()
                    on_stack.discard(member)
                    group.add(member)
                    if member == point:
                        break
                if len(group) > 1:
                    cycles.append(_shortest(index, group, after))
    return cycles


def _shortest(index: Index, group: set[Demand], after: dict[Demand, list[Demand]]) -> list[Demand]:
    """Return a short cycle within a strongly connected group, through one of its conditions."""
    for awaited in sorted(group):
        for waiting in after.get(awaited, ()):
            if waiting not in group:
                continue
            before: dict[Demand, Demand] = {waiting: waiting}
            queue = [waiting]
            for point in queue:
                if point == awaited:
                    break
                for following in _successors(index, point, after):
                    if following in group and following not in before:
                        before[following] = point
                        queue.append(following)
            if awaited in before:
                path = [awaited]
                while path[-1] != waiting:
                    path.append(before[path[-1]])
                return path[::-1]
    return sorted(group)
