"""Replacement of the running plan (CRL.md 7.4)."""

from __future__ import annotations

from collections.abc import Mapping

from executive.engine import contingencies, lifecycle, windows
from executive.engine.instance import (
    ABORTED,
    ACTIVE,
    ENDING,
    EXECUTING,
    FAILING,
    FINISHED,
    INACTIVE,
    RUNNING,
    SKIPPED,
    STARTED,
    SUCCEEDED,
    SUSPENDED,
    WAITING,
    Floating,
    Instance,
)
from executive.engine.run import Run
from executive.engine.spec import BLOCK, BRANCH, CONCURRENT, INFINITY, TASK, NodeSpec, PlanSpec

KEPT_TASK_STATES = (FINISHED, ENDING, EXECUTING)


def replace(run: Run, text: str) -> None:
    """Let the plan in `text` take the place of the running one, or note why it cannot."""
    loaded = run.loader(text)
    if isinstance(loaded, str):
        run.note("rejected", loaded)
        return
    if run.hold is not None and run.hold.root is not None:
        run.note("rejected", f"E111: contingency {run.hold.floating.spec.id} is active")
        return
    keeping = keep(run, loaded)
    wrong = "" if run.root_alternate is not None else out_of_order(loaded, keeping)
    if wrong:
        run.note("rejected", f"E110: {wrong}")
        return
    run.record("replace")
    exchange(run, loaded, keeping)


def keep(run: Run, plan: PlanSpec) -> dict[str, Instance]:
    """Return the old nodes with which the new main tree goes on, by id.

    A composite that is FINISHED or FAILING takes nobody in: what is not over cannot go on below it.
    """
    keeping: dict[str, Instance] = {}
    stack: list[tuple[NodeSpec, Instance | None]] = [(plan.root, None)]
    while stack:
        spec, above = stack.pop()
        old = kept(run, plan, spec)
        closed = above is not None and above.state in (FINISHED, FAILING)
        if old is not None and closed and old.state is not FINISHED and old.parent is not above:
            old = None
        if old is not None:
            keeping[spec.id] = old
        stack.extend((child, old) for child in spec.children)
    return keeping


def kept(run: Run, plan: PlanSpec, spec: NodeSpec) -> Instance | None:
    """Return the node of the running plan that the new one may go on with, if there is one.

    Nodes of alternates are never kept; while one is in force, only tasks that SUCCEEDED are.
    """
    old = run.instances.get(spec.id)
    if old is None or old.kind is not spec.kind or old in run.of_alternates or run.old.get(spec.id) is old:
        return None
    if spec.kind is not TASK:
        return old if old.start is not None and run.root_alternate is None else None
    if old.state not in KEPT_TASK_STATES or (old.outcome is SKIPPED and old.start is None):
        return None
    if run.root_alternate is not None and old.outcome is not SUCCEEDED:
        return None
    same = old.spec is spec or run.plan.identity(spec.id) == plan.identity(spec.id)
    return old if same else None


def out_of_order(plan: PlanSpec, keeping: Mapping[str, Instance]) -> str:
    """Return what E110 forbids in the new main tree, or nothing."""
    stack: list[tuple[NodeSpec, str]] = [(plan.root, "")]
    while stack:
        spec, barrier = stack.pop()
        is_kept = spec.id in keeping
        if is_kept and barrier:
            return f"{spec.id} has started, {barrier}"
        if spec.kind is BLOCK and is_kept:
            waits = ""
            for child in spec.children:
                stack.append((child, waits and f"but would follow {waits}, which has not started"))
                if not waits and child.id not in keeping:
                    waits = child.id
            continue
        below = "" if is_kept else f"but lies below {spec.id}, which has not started"
        stack.extend((child, barrier or below) for child in spec.children)
    return ""


def exchange(run: Run, plan: PlanSpec, keeping: dict[str, Instance]) -> None:
    """Keep what may be kept, stop or skip the rest, and open the new nodes."""
    former_nodes = list(run.instances.values())
    if run.root_alternate is not None and run.root.state is not FINISHED:
        run.used_alternates.discard(run.root_alternate.id)
    run.root_alternate = None
    run.former_ids.update(dict.fromkeys(run.plan.node_ids()))
    run.plan = plan
    run.ledger.redeclare(plan.resources)
    run.network.rebuild()
    run.hold = None
    run.crossed.clear()
    run.release_held()
    exchange_contingencies(run, plan)
    run.dependents = {}
    run.root = rebuild(run, plan.root, keeping)
    known = (keeping, run.old)  # an earlier replacement may have taken a node out that is still stopping
    gone = [node for node in former_nodes if all(ids.get(node.id) is not node for ids in known)]
    for node in gone:
        run.old[node.id] = node
    separate(gone, set(keeping.values()))
    for node in gone:
        retire(run, node)
    reopen(run)
    run.agenda.sort_again()


def exchange_contingencies(run: Run, plan: PlanSpec) -> None:
    """Take over the contingencies of the new plan; those with a known id keep count and armed state."""
    former = {f.spec.id: f for f in run.contingencies}
    run.contingencies = []
    for place, contingency in enumerate(plan.contingencies):
        fresh = Floating(contingency, place)
        if contingency.id in former:
            fresh.armed = former[contingency.id].armed
            fresh.insertions = former[contingency.id].insertions
        run.contingencies.append(fresh)
        contingencies.set_timers(run, fresh)
    run.board.watch_triggers(run.contingencies)


def rebuild(run: Run, top: NodeSpec, keeping: dict[str, Instance]) -> Instance:
    """Make the new main tree out of kept and new nodes, in the text order of the new plan."""
    root: Instance | None = None
    below: dict[Instance, list[Instance]] = {}
    stack: list[tuple[NodeSpec, Instance | None, int]] = [(top, None, 0)]
    while stack:
        spec, parent, index = stack.pop()
        node = keeping.get(spec.id)
        if node is None:
            node = Instance(spec, parent, index, 0)
            run.register(node)
        else:
            adopt(run, node, spec, parent, index)
        node.order = run.next_order
        run.next_order += 1
        if parent is None:
            root = node
        else:
            below[parent].append(node)
        below[node] = []
        stack.extend((child, node, i) for i, child in reversed(list(enumerate(spec.children))))
    assert root is not None
    for node, children in below.items():
        node.below = tuple(children)
        node.remaining = sum(child.state is not FINISHED for child in node.below)
        node.fatal = node.kind is not BRANCH and any(
            child.state is FINISHED and child.failed_fatally() for child in node.below
        )
        node.cursor = 0
    return root


def adopt(run: Run, node: Instance, spec: NodeSpec, parent: Instance | None, index: int) -> None:
    """Let a kept node live on under the new definition."""
    chosen = node.spec.options[node.chosen].id if node.chosen is not None else None
    run.ledger.unreserve(node)
    node.spec = spec
    node.untried = None
    node.parent = parent
    node.index = index
    if node.start is not None and node.state in RUNNING:
        run.ledger.reserve(node)
    if chosen is not None:
        node.chosen = next((i for i, o in enumerate(spec.options) if o.id == chosen), None)
    run.register_windows(node)


def separate(gone: list[Instance], keeping: set[Instance]) -> None:
    """Let the nodes that go keep only children that go too; under kept parents they become extra children."""
    for node in gone:
        node.below = tuple(child for child in node.below if child not in keeping)
        node.remaining = 0
        for index, child in enumerate(node.below):
            child.index = index
            node.remaining += child.state is not FINISHED
    for node in gone:
        parent = node.parent
        if parent is None or parent not in keeping:
            continue
        node.index = -1
        if node.state in (INACTIVE, WAITING, FINISHED):
            node.parent = None
        else:
            parent.extra += (node,)


def retire(run: Run, node: Instance) -> None:
    """Stop an old node that is not kept, or skip it."""
    if node.state in (INACTIVE, WAITING):
        node.void = True
        lifecycle.close(run, node, SKIPPED, "replaced")
    elif node.state is not FINISHED:
        run.stopping.add(node)
        if node.state in ACTIVE:
            lifecycle.begin_failing(run, node, ABORTED, "replaced")
        run.agenda.touch(node)


def reopen(run: Run) -> None:
    """Open what follows from the kept nodes: activate new children, skip those of nodes that are over.

    A root that is not kept is activated by phase F, when the last old node is FINISHED.
    """
    for node in list(run.root.walk()):
        if node.kind is TASK and node.state in ACTIVE:
            refresh(run, node)
        elif node.state in (FINISHED, FAILING):
            for child in node.below:
                lifecycle.skip(run, child, "parent-ended")
        elif node.state in ACTIVE:
            if node.state is ENDING and not is_complete(node):
                node.state = EXECUTING  # row 8b
            if node.kind is CONCURRENT:
                for child in node.below:
                    lifecycle.activate(run, child)
            elif node.kind is BRANCH:
                reopen_branch(run, node)
            refresh(run, node)


def is_complete(node: Instance) -> bool:
    """Tell whether a composite is complete (CRL.md 4.6)."""
    if node.kind is BRANCH:
        child = node.choice()
        return child is not None and child.state is FINISHED and not child.failed_fatally()
    return node.remaining == 0 and not node.fatal


def refresh(run: Run, node: Instance) -> None:
    """Look at everything of a node again: its definition or its surroundings have changed."""
    node.end_lo, node.end_hi, node.end_held = 0, INFINITY, False
    windows.open_end(run, node)
    if node.kind is BRANCH and node.chosen is None:
        lifecycle.watch_options(run, node)
        run.undecided[node] = None
    elif node.state is not SUSPENDED:
        run.board.watch(node, node.spec.maintain)
    run.agenda.wake(node)


def reopen_branch(run: Run, node: Instance) -> None:
    """Open the chosen option of a kept branch; skip the others unless they may still be tried."""
    if any(child.state in STARTED for index, child in enumerate(node.below) if index != node.chosen):
        run.crossed.add(node)
    if node.chosen is None:
        return
    for index, child in enumerate(node.below):
        if index == node.chosen:
            lifecycle.activate(run, child)
        elif not node.spec.next_on_failure:
            lifecycle.skip(run, child, "not-chosen")
