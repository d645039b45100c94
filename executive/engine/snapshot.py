"""A picture of a run for people and programs: plain dicts, nothing that can change the run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from executive.engine.instance import INACTIVE, WAITING, Instance
from executive.engine.run import Run
from executive.engine.spec import INFINITY


def snapshot(
    run: Run, *, pending_events: Sequence[Mapping[str, object]] = (), sequence: int = 0
) -> dict[str, object]:
    """Return the state of a run.

    `nodes` are in text order, each with its parent, so that a reader needs no recursion; times are
    milliseconds on the plan clock, None is unbounded or not yet.
    """
    roots = [run.instances[run.plan.root.id]]
    if run.root is not roots[0]:
        roots.append(run.root)
    nodes = [_node(run, node) for root in roots for node in root.walk()]
    hold = run.hold
    return {
        "t": run.t,
        "sequence": sequence,
        "paused": run.paused,
        "over": run.over,
        "outcome": run.outcome.value if run.outcome is not None else None,
        "root": run.root.id,
        "plan": run.plan.id,
        "digest": run.plan.digest,
        "next_wakeup": None if run.over else run.agenda.next_time(),
        "nodes": nodes,
        "watched": {key: [node.id for node in w.nodes()] for key, w in sorted(run.board.watchers.items())},
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
            for f in run.contingencies
        ],
        "alternates": [{"id": a.id, "used": a.id in run.used_alternates} for a in run.plan.alternates],
        "commands": [
            {"task": c.task, "attempt": c.attempt, "abort_asked": node.abort_asked}
            for c, node in run.commands.items()
        ],
        "resources": run.ledger.levels(run.database),
        "database": dict(run.database),
        "pending_events": list(pending_events),
        "reward": run.reward,
    }


def _bound(t_ms: int) -> int | None:
    return None if abs(t_ms) >= INFINITY else t_ms


def _node(run: Run, node: Instance) -> dict[str, object]:
    chosen = node.spec.options[node.chosen].id if node.chosen is not None else None
    waiting = node.state is WAITING
    return {
        "id": node.id,
        "kind": node.kind.name.lower(),
        "parent": node.parent.id if node.parent is not None else None,
        "state": node.state.name,
        "outcome": node.outcome.value if node.outcome is not None else None,
        "reason": node.reason,
        "activation": node.activation if node.state is not INACTIVE and not node.void else None,
        "start": node.start,
        "end": node.end,
        "window": [_bound(node.start_lo), _bound(node.start_hi)]
        if waiting
        else [_bound(node.end_lo), _bound(node.end_hi)],
        "attempts": node.attempts,
        "chosen": chosen,
        "action": node.spec.action,
        "held": run.hold is not None and run.hold.stops(node),
    }
