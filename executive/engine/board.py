"""The database of a run and those who watch it."""

from __future__ import annotations

from collections.abc import Iterable

from executive.engine.agenda import Agenda
from executive.engine.conditions import TIME_KEY, Guard
from executive.engine.instance import Floating, Instance
from executive.ports import Value


class Board:
    """Values by key; whoever watches a key is woken when it says something new."""

    def __init__(self, agenda: Agenda) -> None:
        self.agenda = agenda
        self.values: dict[str, Value] = {TIME_KEY: 0.0}
        self.watchers: dict[str, dict[Instance, None]] = {}
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
        self._changed(key)

    def forget(self, key: str) -> None:
        """Make a key unknown."""
        if self.values.pop(key, None) is not None:
            self._changed(key)

    def _changed(self, key: str) -> None:
        watchers = self.watchers.get(key)
        if watchers:
            for node in watchers:
                self.agenda.wake(node)
        triggers = self.triggers.get(key)
        if triggers:
            self.stale.extend(triggers)

    def watch(self, node: Instance, *guards: Guard | None, keys: Iterable[str] = ()) -> None:
        """Replace what the node watches: keys, and the instants at which `:time` changes an answer."""
        if node.watching:
            self.unwatch(node)
        wanted = dict.fromkeys(keys)
        for guard in guards:
            if guard is not None:
                wanted.update(dict.fromkeys(guard.keys))
                for instant in guard.instants_ms():
                    self.agenda.set_timer(instant, node)
        if wanted:
            node.watching = tuple(wanted)
            for key in node.watching:
                self.watchers.setdefault(key, {})[node] = None

    def unwatch(self, node: Instance) -> None:
        """Let the node watch nothing."""
        for key in node.watching:
            watchers = self.watchers[key]
            watchers.pop(node, None)
            if not watchers:
                del self.watchers[key]
        node.watching = ()

    def watch_triggers(self, contingencies: Iterable[Floating]) -> None:
        """Index the contingencies by the keys of their triggers; all are to be looked at."""
        self.triggers = {}
        self.stale = list(contingencies)
        for floating in self.stale:
            for key in floating.spec.trigger.keys:
                self.triggers.setdefault(key, []).append(floating)
