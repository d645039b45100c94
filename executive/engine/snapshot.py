"""A picture of a run for people and programs: plain dicts, nothing that can change the run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from executive.engine.instance import Instance, State
from executive.engine.spec import INFINITY

if TYPE_CHECKING:
    from executive.engine.core import Engine

Snapshot = dict[str, Any]


def snapshot(engine: Engine, *, pending_events: Sequence[dict[str, Any]] = (), sequence: int = 0) -> Snapshot:
    """Return the state of a run.

    `nodes` are in text order, each with its parent, so that a reader needs no recursion; times are
    milliseconds on the plan clock, None is unbounded or not yet.
    """
    roots = [engine.instances[engine.plan.root.id]]
    if engine.root is not roots[0]:
        roots.append(engine.root)
    nodes = [_node(engine, node) for root in roots for node in root.walk()]
    hold = engine.hold
    return {
        "t": engine.t,
        "sequence": sequence,
        "paused": engine.paused,
        "over": engine.over,
        "outcome": engine.outcome.value if engine.outcome is not None else None,
        "root": engine.root.id,
        "plan": engine.plan.id,
        "digest": engine.plan.digest,
        "next_wakeup": engine.next_wakeup(),
        "nodes": nodes,
        "watched": {key: [node.id for node in nodes_] for key, nodes_ in sorted(engine.watchers.items())},
        "contingencies": [
            {
                "id": f.spec.id,
                "armed": f.armed,
                "triggered": f.triggered,
                "insertions": f.insertions,
                "phase": ""
                if hold is None or hold.floating is not f
                else "active"
                if hold.root is not None
                else "pending",
            }
            for f in engine.floating
        ],
        "alternates": [{"id": a.id, "used": a.id in engine.used_alternates} for a in engine.plan.alternates],
        "commands": [
            {"task": c.task, "attempt": c.attempt, "abort_asked": node.abort_asked}
            for c, node in engine.commands.items()
        ],
        "resources": engine.ledger.levels(engine.database),
        "database": dict(engine.database),
        "pending_events": list(pending_events),
        "reward": engine.reward,
    }


def _bound(t_ms: int) -> int | None:
    return None if abs(t_ms) >= INFINITY else t_ms


def _node(engine: Engine, node: Instance) -> dict[str, Any]:
    chosen = node.spec.options[node.chosen].id if node.chosen is not None else None
    waiting = node.state is State.WAITING
    return {
        "id": node.id,
        "kind": node.kind.name.lower(),
        "parent": node.parent.id if node.parent is not None else None,
        "state": node.state.name,
        "outcome": node.outcome.value if node.outcome is not None else None,
        "reason": node.reason,
        "activation": node.activation if node.state is not State.INACTIVE and not node.void else None,
        "start": node.start,
        "end": node.end,
        "window": [_bound(node.start_lo), _bound(node.start_hi)]
        if waiting
        else [_bound(node.end_lo), _bound(node.end_hi)],
        "attempts": node.attempts,
        "chosen": chosen,
        "action": node.spec.action,
        "held": engine.hold is not None and engine.hold.stops(node),
    }
