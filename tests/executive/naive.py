"""The engine without any of its indexes: it looks at everything, all the time, in the order of the rules.

It shares the transitions with the engine but none of what decides *when* a node is looked at, and it keeps
the temporal network whether it is needed or not; so the two agree only if nothing is ever overlooked.
"""

from __future__ import annotations

from executive.engine import contingencies, lifecycle
from executive.engine.core import Engine
from executive.engine.instance import Instance, State


class NaiveEngine(Engine):
    """An engine that finds what can happen by looking at every node."""

    def everything(self) -> list[Instance]:
        run = self.run
        nodes: dict[Instance, None] = {}
        for top in [run.root, *run.stopping, *run.instances.values()]:
            nodes[top] = None
        return sorted(nodes, key=lambda n: n.order)

    def take_e(self) -> None:
        while any(lifecycle.transition(self.run, node) for node in self.everything()):
            pass

    def take_s(self) -> bool:
        run = self.run
        if run.paused or run.stopping:
            return False
        ready = [n for n in self.everything() if n.state in (State.WAITING, State.SUSPENDED)]
        ready.sort(key=lambda n: (n.spec.priority, n.activation, n.order))
        ready = [n for n in ready if run.hold is None or not run.hold.stops(n)]
        return any(lifecycle.try_start(run, n) for n in ready if not lifecycle.crossed(run, n))

    def quiesce(self) -> None:
        run = self.run
        run.network.needed = run.network.wanted = True
        while True:
            self.take_e()
            run.board.stale = list(run.contingencies)
            if contingencies.phase_f(run):
                continue
            if run.over or not self.take_s():
                return
