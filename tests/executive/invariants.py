"""What must hold of every run, whatever the plan and the world."""

from __future__ import annotations

from collections.abc import Sequence

from executive.engine.core import Engine
from executive.engine.instance import State
from executive.engine.spec import Kind, NodeSpec, PlanSpec
from executive.ports import Command, TraceRecord


def parents_of(plan: PlanSpec) -> dict[str, str]:
    """Return the parent of each node; the root of a contingency has its scope."""
    parents: dict[str, str] = {}
    trees: list[tuple[NodeSpec, str]] = [(plan.root, "")]
    trees += [(c.node, c.scope) for c in plan.contingencies]
    trees += [(a.node, "") for a in plan.alternates]
    for root, above in trees:
        if above:
            parents[root.id] = above
        for node in root.walk():
            for child in node.children:
                parents[child.id] = node.id
    return parents


def check_trace(plan: PlanSpec, trace: Sequence[TraceRecord], *, over: bool) -> None:
    """Times never go back, every start has one end, and a node runs only while its parent does."""
    parents = parents_of(plan)
    open_nodes: dict[str, int] = {}
    last = 0
    for record in trace:
        assert record.t_ms >= last, record
        last = record.t_ms
        if record.event == "start":
            (node,) = record.arguments
            assert node not in open_nodes, f"{node} started twice"
            parent = parents.get(node)
            assert parent is None or parent in open_nodes, f"{node} started outside {parent}"
            open_nodes[node] = record.t_ms
        elif record.event == "end":
            node = record.arguments[0]
            open_nodes.pop(node, None)
            still_open = [child for child in open_nodes if parents.get(child) == node]
            assert not still_open, f"{node} ended before {still_open}"
        elif record.event in ("retry", "suspend", "resume", "choose"):
            assert record.arguments[0] in open_nodes, record
    assert not (over and open_nodes), f"never ended: {sorted(open_nodes)}"


def check_commands(sent: Sequence[Command]) -> None:
    """No command is issued twice for one attempt, and attempts count up from 1."""
    attempts: dict[str, int] = {}
    for command in sent:
        task = command.id.task
        assert command.id.attempt == attempts.get(task, 0) + 1, command.id
        attempts[task] = command.id.attempt


def check_resources(engine: Engine) -> None:
    """What is taken never exceeds what there is, and only started nodes hold anything."""
    ledger = engine.run.ledger
    for name, resource in ledger.resources.items():
        if resource.capacity is None:
            continue
        held = ledger.holders.get(name, {})
        assert sum(held.values()) <= resource.capacity + 1e-6, (name, held)
        for node in held:
            assert node.state in (State.EXECUTING, State.ENDING, State.SUSPENDING, State.FAILING), node
    for node in engine.run.instances.values():
        if node.state is State.FINISHED:
            assert node.command is None
            assert not node.held
        if node.kind is not Kind.TASK:
            assert node.command is None
