"""Who holds what: unit and capacity resources, reservations of consumables (CRL.md 6.1, 6.2)."""

from __future__ import annotations

import heapq
import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Mapping

from executive.engine.conditions import is_number
from executive.engine.instance import Instance
from executive.engine.spec import ResourceSpec
from executive.ports import Value

TOLERANCE = 1e-9
"""Rounding allowed in a sum of fractional amounts."""


Waiting = tuple[float, int, int, float, Instance | None]
"""Priority, activation, place in the text, amount, node."""

NOBODY: Waiting = (math.inf, 0, 0, 0.0, None)


class Waiters:
    """Those who wait for some of one resource.

    The most urgent of those who fit is found in O(log k) for k different amounts: a tree holds, over the
    sorted amounts, the first of each queue and the most urgent of every range.
    """

    __slots__ = ("_amounts", "_first", "_queues")

    def __init__(self) -> None:
        self._queues: dict[float, list[Waiting]] = {}
        self._amounts: list[float] = []
        self._first: list[Waiting] = []
        """The tree, leaves in its second half; empty where a new amount has come since it was made."""

    def add(self, entry: Waiting) -> None:
        """Let a node wait."""
        queue = self._queues.get(entry[3])
        if queue is None:
            self._queues[entry[3]] = [entry]
            self._first = []
            return
        heapq.heappush(queue, entry)
        if queue[0] is entry and self._first:
            self._settle(entry[3], queue)

    def take(self, room: float) -> Instance | None:
        """Take out the most urgent node that waits for at most `room`; None if there is none."""
        if not self._first:
            self._amounts = sorted(self._queues)
            self._first = [NOBODY] * len(self._amounts) + [
                (self._queues[amount] or [NOBODY])[0] for amount in self._amounts
            ]
            for place in range(len(self._amounts) - 1, 0, -1):
                self._first[place] = min(self._first[2 * place], self._first[2 * place + 1])
        entry = self._best(bisect_right(self._amounts, room))
        if entry[4] is not None:
            queue = self._queues[entry[3]]
            heapq.heappop(queue)
            self._settle(entry[3], queue)
        return entry[4]

    def _best(self, count: int) -> Waiting:
        """Return the most urgent entry of the `count` smallest amounts."""
        first, best = self._first, NOBODY
        left, right = len(self._amounts), len(self._amounts) + count
        while left < right:
            if left & 1:
                best = min(best, first[left])
                left += 1
            if right & 1:
                right -= 1
                best = min(best, first[right])
            left >>= 1
            right >>= 1
        return best

    def _settle(self, amount: float, queue: list[Waiting]) -> None:
        """The first of a queue has changed."""
        first = self._first
        place = len(self._amounts) + bisect_left(self._amounts, amount)
        first[place] = queue[0] if queue else NOBODY
        while place > 1:
            place >>= 1
            first[place] = min(first[2 * place], first[2 * place + 1])


class Ledger:
    """Holders of unit and capacity resources, those who wait for them, and reservations of consumables."""

    def __init__(self, resources: Mapping[str, ResourceSpec]) -> None:
        self.resources = dict(resources)
        self.holders: dict[str, dict[Instance, float]] = {}
        self.reserved: dict[str, dict[Instance, float]] = {}
        self.taken: dict[str, float] = {}
        self.waiters: dict[str, Waiters] = {}

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
        waiters = self.waiters.get(name)
        if waiters is None:
            waiters = self.waiters[name] = Waiters()
        waiters.add((node.spec.priority, node.activation, node.order, amount, node))

    def next_waiter(self, name: str) -> Instance | None:
        """Return the most urgent of those that wait for a resource and fit into what is free of it.

        The next one is asked after it.
        """
        waiters = self.waiters.get(name)
        if waiters is None:
            return None
        room = self.free(name) + TOLERANCE
        while (node := waiters.take(room)) is not None:
            if node.blocked_on == name:
                node.blocked_on = ""
                return node
        return None

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
