"""Who holds what: unit and capacity resources, reservations of consumables (CRL.md 6.1, 6.2)."""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterable, Mapping

from executive.engine.conditions import is_number
from executive.engine.instance import Instance
from executive.engine.spec import ResourceSpec
from executive.ports import Value

TOLERANCE = 1e-9
"""Rounding allowed in a sum of fractional amounts."""


Waiting = tuple[float, int, int, Instance]
"""Priority, activation, place in the text, node."""


class Ledger:
    """Holders of unit and capacity resources, those who wait for them, and reservations of consumables."""

    def __init__(self, resources: Mapping[str, ResourceSpec]) -> None:
        self.resources = dict(resources)
        self.holders: dict[str, dict[Instance, float]] = {}
        self.reserved: dict[str, dict[Instance, float]] = {}
        self.taken: dict[str, float] = {}
        self.waiters: dict[str, dict[float, list[Waiting]]] = {}
        """By resource and amount, the most urgent first."""

    def redeclare(self, resources: Mapping[str, ResourceSpec]) -> None:
        """Take over the declarations of a replacing plan; what is held stays held."""
        self.resources = dict(resources)

    def free(self, name: str) -> float:
        """Return how much of a unit or capacity resource is free."""
        resource = self.resources.get(name)
        capacity = resource.capacity if resource is not None else None
        return (1.0 if capacity is None else capacity) - self.taken.get(name, 0.0)

    def missing(self, uses: Iterable[tuple[str, float]]) -> str | None:
        """Return the first resource of which not enough is free, or None if all can be taken at once."""
        for name, amount in uses:
            if self.free(name) + TOLERANCE < amount:
                return name
        return None

    def take(self, node: Instance) -> None:
        """Give the node all it uses."""
        uses = node.spec.uses
        if uses:
            for name, amount in uses:
                self.holders.setdefault(name, {})[node] = amount
                self.taken[name] = self.taken.get(name, 0.0) + amount
            node.held = uses
        self.reserve(node)

    def reserve(self, node: Instance) -> None:
        for name, amount in node.spec.requires:
            held = self.reserved.setdefault(name, {})
            held[node] = held.get(node, 0.0) + amount

    def unreserve(self, node: Instance) -> bool:
        """Drop the reservations of a node; tell whether there were any."""
        found = False
        for name, _ in node.spec.requires:
            found |= self.reserved.get(name, {}).pop(node, None) is not None
        return found

    def give_back(self, node: Instance) -> tuple[str, ...]:
        """Take back what the node holds; return the names of what became free."""
        held = node.held
        if not held:
            return ()
        node.held = ()
        for name, amount in held:
            holders = self.holders[name]
            holders.pop(node, None)
            self.taken[name] = self.taken[name] - amount if holders else 0.0
        return tuple(name for name, _ in held)

    def wait(self, name: str, node: Instance) -> None:
        """Remember that the node could start if only it got this resource."""
        if node.blocked_on == name:
            return
        node.blocked_on = name
        amount = next(amount for used, amount in node.spec.uses if used == name)
        entry = (node.spec.priority, node.activation, node.order, node)
        heapq.heappush(self.waiters.setdefault(name, {}).setdefault(amount, []), entry)

    def next_waiter(self, name: str) -> Instance | None:
        """Return the most urgent of those that wait for a resource and fit into what is free of it.

        The next one is asked after it: so a release costs as much as the number of different amounts that
        are waited for, whatever the number of those who wait.
        """
        queues = self.waiters.get(name)
        if not queues:
            return None
        room = self.free(name) + TOLERANCE
        best: list[Waiting] | None = None
        emptied: list[float] = []
        for amount, queue in queues.items():
            if amount > room:
                continue
            while queue and queue[0][3].blocked_on != name:
                heapq.heappop(queue)
            if not queue:
                emptied.append(amount)
            elif best is None or queue[0] < best[0]:
                best = queue
        for amount in emptied:
            del queues[amount]
        if best is None:
            return None
        node = heapq.heappop(best)[3]
        node.blocked_on = ""
        return node

    def met(
        self,
        requires: Iterable[tuple[str, float]],
        asking: Instance | None,
        database: Mapping[str, Value],
    ) -> bool:
        """Tell whether each requirement is met by what is available to the asking node (CRL.md 6.2)."""
        exempt: set[Instance] = set()
        if asking is not None:
            exempt = {asking, *asking.ancestors()}
        for name, amount in requires:
            available = self.available(name, exempt, database)
            if available is None or available < amount:
                return False
        return True

    def available(self, name: str, exempt: set[Instance], database: Mapping[str, Value]) -> float | None:
        """Return level - floor - reservations of others, or None if the level is not known."""
        resource = self.resources.get(name)
        if resource is None or resource.key is None:
            return None
        level = database.get(resource.key)
        if not is_number(level):
            return None
        others = math.fsum(a for node, a in self.reserved.get(name, {}).items() if node not in exempt)
        return float(level) - resource.floor - others

    def levels(self, database: Mapping[str, Value]) -> dict[str, dict[str, Value | None]]:
        """Return what a display needs: capacity or level, what is taken or reserved, by whom."""
        table: dict[str, dict[str, Value | None]] = {}
        for name, resource in self.resources.items():
            if resource.key is None:
                table[name] = {
                    "capacity": resource.capacity,
                    "taken": self.taken.get(name, 0.0),
                    "holders": " ".join(node.id for node in self.holders.get(name, {})),
                }
            else:
                table[name] = {
                    "key": resource.key,
                    "level": database.get(resource.key),
                    "floor": resource.floor,
                    "reserved": math.fsum(self.reserved.get(name, {}).values()),
                }
        return table
