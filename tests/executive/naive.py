"""The engine without any of its indexes: it looks at everything, all the time, in the order of the rules.

It shares the transitions with the engine but none of what decides *when* a node is looked at, and it keeps
the temporal network whether it is needed or not; so the two agree only if nothing is ever overlooked.
"""

from __future__ import annotations

from executive.engine import floating, lifecycle
from executive.engine.core import Engine
from executive.engine.instance import Instance, State


class NaiveEngine(Engine):
    """An engine that finds what can happen by looking at every node."""

    def everything(self) -> list[Instance]:
        nodes: dict[Instance, None] = {}
        for top in [self.root, *self.stopping, *self.instances.values()]:
            nodes[top] = None
        return sorted(nodes, key=lambda n: n.order)

    def run_e(self) -> None:
        moved = True
        while moved:
            moved = False
            for node in self.everything():
                if lifecycle.transition(self, node):
                    moved = True
                    break

    def run_s(self) -> bool:
        if self.paused or self.stopping:
            return False
        ready = [n for n in self.everything() if n.state in (State.WAITING, State.SUSPENDED)]
        ready.sort(key=lambda n: (n.spec.priority, n.activation, n.order))
        for node in ready:
            if self.hold is not None and self.hold.stops(node):
                continue
            if lifecycle.try_start(self, node):
                return True
        return False

    def quiesce(self) -> None:
        self.network.needed = self.network.wanted = True
        while True:
            self.run_e()
            self.stale = list(self.floating)
            if floating.phase_f(self):
                continue
            if self.over or not self.run_s():
                return
