"""The database of a run and those who watch it."""

from __future__ import annotations

import math
from bisect import bisect_left, insort
from collections.abc import Iterable

from executive.engine.agenda import Agenda
from executive.engine.conditions import TIME_KEY, Guard, is_number
from executive.engine.instance import Floating, Instance, Watch
from executive.engine.spec import INFINITY
from executive.ports import Value


class Watchers:
    """Those who watch one key: on every change, or where a number passes a limit."""

    __slots__ = ("always", "limits")

    def __init__(self) -> None:
        self.always: dict[Instance, int] = {}
        self.limits: list[tuple[float, int, Instance]] = []
        """Limit, serial number and node, in order."""

    def concerned(self, old: Value | None, new: Value | None) -> list[Instance]:
        """Return whom a change from one value to another can concern."""
        limits = self.limits
        found = list(self.always)
        if limits and is_number(old) and is_number(new):
            lo, hi = (old, new) if old < new else (new, old)
            limits = limits[bisect_left(limits, (lo,)) : bisect_left(limits, (hi, INFINITY))]
        found += [node for _, _, node in limits]
        return found

    def nodes(self) -> list[Instance]:
        """Return all nodes, in the order in which they came."""
        entries = [(serial, node) for node, serial in self.always.items()]
        entries += [(serial, node) for _, serial, node in self.limits]
        entries.sort(key=lambda entry: entry[0])
        return list(dict.fromkeys(node for _, node in entries))


class Board:
    """Values by key; whoever watches a key is woken when it says something new."""

    def __init__(self, agenda: Agenda) -> None:
        self.agenda = agenda
        self.values: dict[str, Value] = {TIME_KEY: 0.0}
        self.watchers: dict[str, Watchers] = {}
        self._serial = 0
        self.triggers: dict[str, list[Floating]] = {}
        """Contingencies by the keys of their triggers."""
        self.stale: list[Floating] = []
        """Contingencies whose triggers are to be asked again."""

    def set_value(self, key: str, value: Value) -> None:
        """Write a key and look at those who watch it, if it says something new."""
        old = self.values.get(key)
        if old == value and type(old) is type(value):
            return
        self.values[key] = value
        if key in self.watchers or key in self.triggers:
            self._changed(key, old, value)

    def forget(self, key: str) -> None:
        """Make a key unknown."""
        old = self.values.pop(key, None)
        if old is not None:
            self._changed(key, old, None)

    def _changed(self, key: str, old: Value | None, new: Value | None) -> None:
        watchers = self.watchers.get(key)
        if watchers is not None:
            for node in watchers.concerned(old, new):
                self.agenda.wake(node)
        triggers = self.triggers.get(key)
        if triggers:
            self.stale.extend(triggers)

    def watch(self, node: Instance, *guards: Guard | None, keys: Iterable[str] = ()) -> None:
        """Replace what the node watches: keys, and the instants at which `:time` changes an answer."""
        if node.watching:
            self.unwatch(node)
        wanted: dict[str, tuple[float, ...] | None] = dict.fromkeys(keys)
        for guard in guards:
            if guard is None:
                continue
            for key, limits in guard.limits.items():
                before = wanted.get(key, ())
                wanted[key] = None if before is None or limits is None else (*before, *limits)
            for instant in guard.instants_ms():
                self.agenda.set_timer(instant, node)
        node.watching = tuple(
            self._enter(node, key, None if limits is None else tuple(set(limits)))
            for key, limits in wanted.items()
        )

    def _enter(self, node: Instance, key: str, limits: tuple[float, ...] | None) -> Watch:
        watchers = self.watchers.get(key)
        if watchers is None:
            watchers = self.watchers[key] = Watchers()
        self._serial += 1
        if limits is None:
            watchers.always[node] = self._serial
        else:
            # a node that only asks whether the key is known hears of its coming and going at no limit
            for limit in limits or (math.inf,):
                insort(watchers.limits, (limit, self._serial, node))
        return key, self._serial, limits

    def unwatch(self, node: Instance) -> None:
        """Let the node watch nothing."""
        for key, serial, limits in node.watching:
            watchers = self.watchers[key]
            if limits is None:
                watchers.always.pop(node, None)
            else:
                for limit in limits or (math.inf,):
                    del watchers.limits[bisect_left(watchers.limits, (limit, serial))]
            if not watchers.always and not watchers.limits:
                del self.watchers[key]
        node.watching = ()

    def watch_triggers(self, contingencies: Iterable[Floating]) -> None:
        """Index the contingencies by the keys of their triggers; all are to be looked at."""
        self.triggers = {}
        self.stale = list(contingencies)
        for floating in self.stale:
            for key in floating.spec.trigger.limits:
                self.triggers.setdefault(key, []).append(floating)
