"""Dispatch bounds of starts, and risks, from the temporal network (CRL.md 8).

Most plans need no network at run time: a start can be delayed only by an upper bound that ties it to a point
which something else may push later. `needs_network` finds out, once per plan, whether there is any such tie.
Where there is, or where risks are to be reported, the network of 8.1 is kept in step with the run: points
that are not executed yet, their constraints, and executed points as constants.
"""

from __future__ import annotations

from typing import Protocol

from executive.engine.agenda import Agenda
from executive.engine.instance import INACTIVE, Instance
from executive.engine.spec import (
    BLOCK,
    BRANCH,
    END,
    INFINITY,
    PLAN_CLOCK,
    RELATIVE,
    START,
    TASK,
    NodeSpec,
    PlanSpec,
    Window,
)
from executive.stn import ORIGIN, Conflict, TemporalNetwork


def needs_network(plan: PlanSpec) -> bool:
    """Tell whether in some run of the plan the network could delay a start beyond its own window.

    An upper bound between two points delays the earlier one only if the later one can be pushed by something
    that does not start at the earlier one: a time of day, or a window on a third node.
    """
    return any(ties(node) for node in plan.windowed)


def watches_windows(plan: PlanSpec) -> bool:
    """Tell whether any window of the plan can close, so that there are risks to report."""
    return any(
        window.hi < INFINITY for node in plan.windowed for window in node.start_windows + node.end_windows
    )


def ties(node: NodeSpec) -> bool:
    """Tell whether a window of the node could delay a start beyond that start's own window."""
    if any(_is_node(w) and (w.hi < INFINITY or -INFINITY < w.lo < 0) for w in node.start_windows):
        return True
    if any(
        _is_node(w) and w.ref != node.id and (w.hi < INFINITY or -INFINITY < w.lo < 0)
        for w in node.end_windows
    ):
        return True
    if any(w.ref == RELATIVE and w.hi < INFINITY for w in node.start_windows) and any(
        _pushes(w) for w in node.start_windows
    ):
        return True
    if not any(w.ref in (RELATIVE, node.id) and w.hi < INFINITY for w in node.end_windows):
        return False
    if any(_pushes(w) and w.ref != node.id for w in node.end_windows):
        return True
    return node.kind is not TASK and any(
        _pushes(w)
        for below in node.walk()
        if below is not node
        for w in below.start_windows + below.end_windows
    )


def _is_node(window: Window) -> bool:
    return window.ref not in (PLAN_CLOCK, RELATIVE)


def _pushes(window: Window) -> bool:
    """Tell whether a window can push its point later than what stands before it in the plan."""
    if window.ref == RELATIVE:
        return False
    return window.lo > 0 if window.ref == PLAN_CLOCK else window.lo > -INFINITY


class Surroundings(Protocol):
    """What the network sees of the run that it belongs to."""

    plan: PlanSpec
    agenda: Agenda
    over: bool
    root: Instance
    stopping: set[Instance]
    instances: dict[str, Instance]
    dependents: dict[tuple[str, int], list[Instance]]

    @property
    def t(self) -> int: ...

    def note(self, kind: str, text: str, node: str = "") -> None: ...


class DispatchNetwork:
    """Tells whether a WAITING node may start now without making the network inconsistent."""

    def __init__(self, run: Surroundings, *, risks: bool) -> None:
        self.run = run
        self.risks = risks
        self.network: TemporalNetwork | None = None
        self.points: dict[tuple[Instance, int], int] = {}
        self.anchors: dict[Instance, list[int]] = {}
        """Constraints of a start that count from a point and will count from the activation."""
        self.delayed: dict[Instance, set[int]] = {}
        """Nodes that may not start yet, each with the times for which timers are set."""
        self.reported = False
        self.rebuild()

    def rebuild(self) -> None:
        """Begin anew from the present state of the run."""
        plan = self.run.plan
        self.needed = needs_network(plan)
        self.wanted = self.needed or (self.risks and watches_windows(plan))
        self.network = None
        self.changed()

    # --- keeping step -----------------------------------------------------------

    def activated(self, node: Instance) -> None:
        """The relative start window of a node counts from now on from its activation."""
        network = self.network
        start = self.points.get((node, START)) if network is not None else None
        if network is None or start is None:
            return
        for index in self.anchors.pop(node, ()):
            network.remove(index)
        for window in node.spec.start_windows:
            if window.ref == RELATIVE:
                network.add(ORIGIN, start, *_shifted(window, node.activation), label=(node.id, START, window))
        self.changed()

    def settled(self, node: Instance, point: int) -> None:
        """A point has occurred or is void."""
        network = self.network
        index = self.points.pop((node, point), None) if network is not None else None
        if network is not None and index is not None:
            time = node.start if point == START else node.end
            if time is None:
                network.void(index)
            else:
                network.advance(self.run.t)
                network.execute(index, time)
        self.changed()

    def planted(self, root: Instance) -> None:
        """A tree has come to life: the node of a chosen option, of a contingency or of an alternate."""
        if self.wanted and self.network is not None:
            self._add_tree(root)
            self.changed()

    def changed(self) -> None:
        """What a delayed start waits for may be over."""
        if self.delayed:
            for node in list(self.delayed):
                self.run.agenda.consider(node)

    # --- asking -----------------------------------------------------------------

    def may_start(self, node: Instance) -> bool:
        """Tell whether the dispatch bound of the node is reached; else see to it that it is asked again."""
        network = self._present()
        start = self.points.get((node, START))
        due = network.dispatch_time(start) if start is not None else None
        if start is None or (due is not None and due <= self.run.t):
            self.delayed.pop(node, None)
            return True
        both = (due, network.breaks_at())  # an inconsistent network delays nothing (8.3)
        times = {time for time in both if time is not None}
        known = self.delayed.get(node, set())
        for time in times - known:
            self.run.agenda.set_timer(time, node)
        self.delayed[node] = times | {time for time in known if time > self.run.t}
        return False

    def bound(self, node: Instance) -> int | None:
        """Return the dispatch bound of a start that has not occurred, None if there is none."""
        if not self.wanted:
            return None
        network = self._present()
        start = self.points.get((node, START))
        return None if start is None else network.dispatch_bound(start)

    def report_risks(self) -> None:
        """Note when the windows can no longer all be kept, once until they can."""
        if self.run.over:
            return
        network = self._present()
        if network.consistent:
            self.reported = False
        elif not self.reported:
            self.reported = True
            conflict = network.conflict
            if conflict is not None:
                text, first = describe(conflict)
                self.run.note("risk", text, first)

    # --- building ---------------------------------------------------------------

    def _present(self) -> TemporalNetwork:
        if self.network is None:
            self.network = TemporalNetwork()
            self.network.advance(self.run.t)
            self.points = {}
            self.anchors = {}
            roots = [self.run.root, *(node for node in self.run.stopping if node.parent is None)]
            for root in roots:
                self._add_tree(root, check=False)
            self.network.check()
            self.network.relax()
        self.network.advance(self.run.t)
        return self.network

    def _add_tree(self, root: Instance, *, check: bool = True) -> None:
        """Add the points and constraints of all live nodes of a tree."""
        network = self.network
        assert network is not None
        nodes = list(live(root))
        for node in nodes:
            for point in (START, END):
                if _open(node, point) and (node, point) not in self.points:
                    self.points[node, point] = network.add_point()
        for node in nodes:
            self._structure(network, node)
            self._windows(network, node)
        if check:
            self._references_to(network, nodes)
            network.check()
            network.relax()

    def _structure(self, network: TemporalNetwork, node: Instance) -> None:
        start = self._at(node, START)
        if start:
            network.declare(ORIGIN, start, 0, None)
        self._order(network, node, START, node, END)
        if node.parent is None:
            return
        self._order(network, node.parent, START, node, START)
        self._order(network, node, END, node.parent, END)
        previous = previous_sibling(node)
        if previous is not None:
            self._order(network, previous, END, node, START)

    def _order(self, network: TemporalNetwork, first: Instance, a: int, then: Instance, b: int) -> None:
        """Add that one point comes no later than another.

        The second has occurred before the first only where a replacement kept a task that had SUCCEEDED below
        composites that are fresh (CRL.md 7.4): the constraint then bounds the first (8.1).
        """
        before, after = self._at(first, a), self._at(then, b)
        if before and after:
            network.declare(before, after, 0, None)
        elif before and (time := _time(then, b)) is not None:
            network.declare(ORIGIN, before, None, time)

    def _windows(self, network: TemporalNetwork, node: Instance) -> None:
        for conditions, point in ((node.spec.start_windows, START), (node.spec.end_windows, END)):
            target = self._at(node, point)
            for window in conditions:
                self._window(network, node, point, target, window)

    def _window(
        self, network: TemporalNetwork, node: Instance, point: int, target: int, window: Window
    ) -> None:
        label = (node.id, point, window)
        if window.ref == PLAN_CLOCK:
            if target:
                network.declare(ORIGIN, target, *_shifted(window, 0), label=label)
            return
        if window.ref == RELATIVE and point == START:
            self._anchor(network, node, target, window, label)
            return
        other = node if window.ref == RELATIVE else self.run.instances.get(window.ref)
        if other is None:
            return
        place = START if window.ref == RELATIVE else window.point
        self._between(network, other, place, target, _time(node, point), window, label)

    def _between(
        self,
        network: TemporalNetwork,
        other: Instance,
        place: int,
        target: int,
        own: int | None,
        window: Window,
        label: object,
    ) -> None:
        """Add a window on a point of another node; `own` is the time of the own point if it has occurred."""
        time = _time(other, place)
        source = self._at(other, place)
        if time is not None:
            if target:
                network.declare(ORIGIN, target, *_shifted(window, time), label=label)
        elif source and target:
            network.declare(source, target, *_shifted(window, 0), label=label)
        elif source and own is not None:  # what has occurred says when the other may
            lo, hi = _shifted(window, 0)
            bounds = (None if hi is None else own - hi, None if lo is None else own - lo)
            network.declare(ORIGIN, source, *bounds, label=label)

    def _anchor(
        self, network: TemporalNetwork, node: Instance, target: int, window: Window, label: object
    ) -> None:
        """Add a relative start window: from the activation, else from what stands before the node."""
        if not target:
            return
        if node.state is not INACTIVE:
            network.declare(ORIGIN, target, *_shifted(window, node.activation), label=label)
            return
        previous = previous_sibling(node)
        other, place = (previous, END) if previous is not None else (node.parent, START)
        if other is None:
            index = network.declare(ORIGIN, target, *_shifted(window, 0), label=label)
        else:
            time = other.start if place == START else other.end
            source = self._at(other, place)
            if time is not None:
                index = network.declare(ORIGIN, target, *_shifted(window, time), label=label)
            elif source:
                index = network.declare(source, target, *_shifted(window, 0), label=label)
            else:
                return
        self.anchors.setdefault(node, []).append(index)

    def _references_to(self, network: TemporalNetwork, nodes: list[Instance]) -> None:
        """Add the windows of other live nodes that refer to nodes which have just come to life."""
        fresh = set(nodes)
        for node in nodes:
            for place in (START, END):
                for other in self.run.dependents.get((node.id, place), ()):
                    if other in fresh:
                        continue
                    for conditions, point in (
                        (other.spec.start_windows, START),
                        (other.spec.end_windows, END),
                    ):
                        target = self._at(other, point)
                        for window in conditions:
                            if window.ref == node.id and window.point == place:
                                own, label = _time(other, point), (other.id, point, window)
                                self._between(network, node, place, target, own, window, label)

    def _at(self, node: Instance, point: int) -> int:
        """Return the number of a point that has not occurred, 0 if it has no place in the network."""
        return self.points.get((node, point), 0)


def _open(node: Instance, point: int) -> bool:
    return not node.void and _time(node, point) is None


def _time(node: Instance, point: int) -> int | None:
    return node.start if point == START else node.end


def _shifted(window: Window, by: int) -> tuple[int | None, int | None]:
    return (
        None if window.lo <= -INFINITY else window.lo + by,
        None if window.hi >= INFINITY else window.hi + by,
    )


def previous_sibling(node: Instance) -> Instance | None:
    """Return the node before this one in a block."""
    parent = node.parent
    if parent is None or parent.kind is not BLOCK or node.index <= 0:
        return None
    return parent.below[node.index - 1]


def live(root: Instance) -> list[Instance]:
    """Return the nodes of a tree that have points: none below an option that is not (yet) chosen."""
    nodes: list[Instance] = []
    stack = [root]
    while stack:
        node = stack.pop()
        if node.void:
            continue
        nodes.append(node)
        if node.kind is BRANCH:
            choice = node.choice()
            others = [n for n in node.below if n is not choice and n.state is not INACTIVE]
            below = others if choice is None else [choice, *others]
        else:
            below = [*node.below]
        stack.extend(reversed([*below, *node.extra]))
    return nodes


def describe(conflict: Conflict) -> tuple[str, str]:
    """Return what a conflict is about, in words, and the first node in it."""
    names: list[str] = []
    for link in conflict.links:
        label = link.constraint.label if link.constraint is not None else None
        if isinstance(label, tuple):
            name = f"{label[0]} ({'end' if label[1] == END else 'start'})"
            if name not in names:
                names.append(name)
    first = names[0].split(" ")[0] if names else ""
    return (
        f"the windows of {', '.join(names)} cannot all be kept: {conflict.deficit_ms / 1000:g} s short",
        first,
    )
