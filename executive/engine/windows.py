"""Own windows: the intersection of a point's conditions with reference times that are known (CRL.md 8.2)."""

from __future__ import annotations

from executive.engine.instance import ACTIVE, WAITING, Instance
from executive.engine.run import Run
from executive.engine.spec import END, INFINITY, RELATIVE, START, Window


def occurred(node: Instance, point: int) -> int | None:
    """Return the time of a point that has occurred, else None."""
    return node.start if point == START else node.end


def intersect(run: Run, conditions: tuple[Window, ...], origin: int) -> tuple[int, int, bool]:
    """Return lower bound, upper bound and whether a point is still awaited."""
    lo, hi, awaited = 0, INFINITY, False
    for window in conditions:
        ref = window.ref
        if not ref:
            base = 0
        elif ref == RELATIVE:
            base = origin
        else:
            other = run.instances.get(ref)
            time = None if other is None else occurred(other, window.point)
            if time is None:
                if (other is None or not other.void) and window.lo >= 0:
                    awaited = True
                continue
            base = time
        if window.lo > -INFINITY and base + window.lo > lo:
            lo = base + window.lo
        if window.hi < INFINITY and base + window.hi < hi:
            hi = base + window.hi
    return lo, hi, awaited


def open_start(run: Run, node: Instance) -> None:
    """Work out the start window of a WAITING node, with its timer and deadline."""
    if not node.spec.start_windows:
        return
    lo, hi, awaited = intersect(run, node.spec.start_windows, node.activation)
    node.start_blocked = awaited
    if lo != node.start_lo:
        node.start_lo = lo
        run.agenda.set_timer(lo, node)
    if hi != node.start_hi:
        node.start_hi = hi
        run.agenda.set_deadline(hi, node)


def open_end(run: Run, node: Instance) -> None:
    """Work out the end window of a node that has started, with its timer and deadline."""
    if not node.spec.end_windows or node.start is None:
        return
    lo, hi, awaited = intersect(run, node.spec.end_windows, node.start)
    node.end_held = awaited
    if lo != node.end_lo:
        node.end_lo = lo
        run.agenda.set_timer(lo, node)
    if hi != node.end_hi:
        node.end_hi = hi
        run.agenda.set_deadline(hi, node)


def point_settled(run: Run, node: Instance, point: int) -> None:
    """A time point has occurred or is void: look at those whose windows refer to it."""
    if run.network.wanted:
        run.network.settled(node, point)
    if run.dependents and run.instances.get(node.id) is node:
        for other in run.dependents.get((node.id, point), ()):
            reference_settled(run, other, node, point)


def reference_settled(run: Run, node: Instance, other: Instance, point: int) -> None:
    """A point that the node refers to has occurred or is void."""
    if node.state is WAITING:
        open_start(run, node)
        run.agenda.consider(node)
    elif node.state in ACTIVE:
        open_end(run, node)
        run.agenda.touch(node)
    time = occurred(other, point)
    if time is None:
        return
    for conditions, own, name in (
        (node.spec.start_windows, node.start, "start"),
        (node.spec.end_windows, node.end, "end"),
    ):
        if own is None:
            continue
        for window in conditions:
            if window.ref == other.id and window.point == point and not window.lo <= own - time <= window.hi:
                run.note(
                    "risk",
                    f"{name} of {node.id} at {own / 1000:g} s lies outside its window on the "
                    f"{'end' if point == END else 'start'} of {other.id} at {time / 1000:g} s",
                    node.id,
                )
