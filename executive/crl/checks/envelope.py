"""The resource envelope: W064, where mean - 2 deviations of a consumable falls below its floor on some path.

The level of a consumable at the start of the plan is taken from what the caller knows, else from the
header's metadata under the key of the consumable, else from its entry in `:budgets` (then the plan may use as
much as the budget above the floor). Expectations of a composite describe it as a whole and replace those
inside it. Means and variances add up along a path; members of a concurrent block may take effect in any
order, so what they consume counts before what they give.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from executive.crl.checks.index import Index
from executive.crl.nodes import Block, Branch, Node, Task, children
from executive.crl.trees import number_text
from executive.crl.values import ConsumableResource, Spread

DEVIATIONS = 2.0
MAX_PATHS = 64
"""How many different (mean, variance) pairs are kept apart behind a branch."""


@dataclass(frozen=True, slots=True)
class State:
    """What has happened to one consumable on a path: mean change, variance, and the options taken."""

    mean: float = 0.0
    variance: float = 0.0
    options: tuple[str, ...] = ()

    def worst(self) -> float:
        return self.mean - DEVIATIONS * math.sqrt(self.variance)


@dataclass(slots=True)
class Envelope:
    """Outcome of one subtree: final states by path, and the lowest point on the way to each."""

    finals: list[State] = field(default_factory=list)
    lowest: State = field(default_factory=State)
    lowest_node: Node | None = None


def check_envelope(index: Index, levels: Mapping[str, float] | None) -> None:
    """Walk every tree once for each consumable of known level."""
    plan = index.plan
    budgets = {b.resource: b.amount for b in plan.budgets}
    variance = plan.expectation_spread is Spread.VARIANCE
    for resource in plan.resources:
        if not isinstance(resource, ConsumableResource):
            continue
        if not any(e.name == resource.name for entry in index.entries for e in entry.node.expectations):
            continue
        level, origin = _level(index, resource, levels, budgets)
        for number in index.roots:
            _requirements(index, number, resource, variance)
        if level is None:
            continue
        root = index.entries[index.roots[0]].node
        envelope = _walk(root, resource.name, variance)
        bottom = level + envelope.lowest.worst()
        if bottom < resource.floor and envelope.lowest_node is not None:
            path = f" by way of {', '.join(envelope.lowest.options)}" if envelope.lowest.options else ""
            message = (
                f"{resource.name} may fall to {number_text(round(bottom, 3))}, below its floor"
                f" {number_text(resource.floor)}{path}: {number_text(level)} {origin},"
                f" {number_text(round(envelope.lowest.mean, 3))} expected,"
                f" deviation {number_text(round(math.sqrt(envelope.lowest.variance), 3))}"
            )
            index.add("W064", envelope.lowest_node, message, at="expectations")


def _level(
    index: Index,
    resource: ConsumableResource,
    levels: Mapping[str, float] | None,
    budgets: Mapping[str, float],
) -> tuple[float | None, str]:
    if levels is not None and resource.key in levels:
        return levels[resource.key], "at the start"
    stated = index.plan.metadata.get(resource.key)
    if isinstance(stated, (int, float)) and not isinstance(stated, bool):
        return stated, "at the start by the header"
    if resource.name in budgets:
        return resource.floor + budgets[resource.name], "with the budget"
    return None, ""


def _own(node: Node, name: str, variance: bool) -> tuple[float, float] | None:
    """Return mean and variance of the change a node states itself."""
    found = [e for e in node.expectations if e.name == name]
    if not found:
        return None
    spread = sum(abs(e.spread) if variance else e.spread * e.spread for e in found)
    return sum(e.mean for e in found), spread


def _requirements(index: Index, root: int, resource: ConsumableResource, variance: bool) -> None:
    """Look for nodes that consume more than they ask for: the test at their start then protects nothing."""
    entries = index.entries
    for number in range(root, entries[root].end):
        node = entries[number].node
        asked = [a.amount for a in node.requires if a.resource == resource.name]
        if not asked:
            continue
        envelope = _walk(node, resource.name, variance)
        need = -envelope.lowest.worst()
        if need > max(asked) + 1e-9:
            amount, floor = number_text(max(asked)), number_text(resource.floor)
            message = (
                f'requires {amount} of "{resource.name}" and may consume {number_text(round(need, 3))},'
                f" so it may fall below its floor {floor}"
            )
            index.add("W064", node, message, at="requires")


def _walk(root: Node, name: str, variance: bool) -> Envelope:
    """Return the envelope of a node; children first, without recursion."""
    order: list[Node] = []
    stack = [root]
    while stack:
        node = stack.pop()
        order.append(node)
        if isinstance(node, Task) or _own(node, name, variance) is not None:
            continue
        stack.extend(children(node))
    done: dict[int, Envelope] = {}
    for node in reversed(order):
        own = _own(node, name, variance)
        if own is not None:
            final = State(*own)
            done[id(node)] = Envelope([final], final if final.worst() < 0 else State(), node)
        elif isinstance(node, Task):
            done[id(node)] = Envelope([State()], State(), node)
        elif isinstance(node, Branch):
            done[id(node)] = _choice(node, done)
        elif isinstance(node, Block):
            done[id(node)] = _sequence(node, [done[id(child)] for child in node.node_list])
        else:
            done[id(node)] = _together(node, [done[id(child)] for child in node.node_list])
    return done[id(root)]


def _plus(a: State, b: State) -> State:
    return State(a.mean + b.mean, a.variance + b.variance, a.options + b.options)


def _front(states: list[State]) -> list[State]:
    """Keep the states that may still turn out worst: lower mean or larger variance than any other."""
    states.sort(key=lambda s: (s.mean, -s.variance))
    kept: list[State] = []
    largest = -1.0
    for state in states:
        if state.variance > largest:
            kept.append(state)
            largest = state.variance
    return kept[:MAX_PATHS]


def _sequence(node: Node, parts: list[Envelope]) -> Envelope:
    out = Envelope([State()], State(), node)
    for part in parts:
        candidates = [_plus(before, part.lowest) for before in out.finals]
        worst = min(candidates, key=State.worst)
        if worst.worst() < out.lowest.worst():
            out.lowest, out.lowest_node = worst, part.lowest_node
        if len(part.finals) == 1 and len(out.finals) == 1:
            out.finals = [_plus(out.finals[0], part.finals[0])]
        else:
            out.finals = _front([_plus(a, b) for a in out.finals for b in part.finals])
    return out


def _together(node: Node, parts: list[Envelope]) -> Envelope:
    out = _sequence(node, parts)
    low = State()
    lowest_node: Node | None = node
    for part in parts:
        if part.lowest.worst() < 0:
            low = _plus(low, part.lowest)
            lowest_node = part.lowest_node
    if low.worst() < out.lowest.worst():
        out.lowest, out.lowest_node = low, lowest_node
    return out


def _choice(branch: Branch, done: dict[int, Envelope]) -> Envelope:
    out = Envelope([], State(), branch)
    finals: list[State] = []
    for option in branch.options:
        part = done[id(option.node)]
        chosen = State(options=(option.id,))
        finals += [_plus(chosen, final) for final in part.finals]
        low = _plus(chosen, part.lowest)
        if low.worst() < out.lowest.worst():
            out.lowest, out.lowest_node = low, part.lowest_node
    out.finals = _front(finals) or [State()]
    return out
