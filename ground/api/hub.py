"""Streams of one server: each thing that somebody follows has one reader, however many follow it."""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Callable, Sequence, Set
from dataclasses import dataclass, field
from typing import NamedTuple

from ground.errors import GroundError
from ground.gdr.notices import Watch
from ground.gdr.repository import Repository
from ground.records.lookers import CHANNEL, Lookers

logger = logging.getLogger(__name__)


class Part(NamedTuple):
    """One event: its number, what is sent of it, and whether nothing comes after it.

    A part that is `aside` has no place in the order of a stream: whoever follows now gets it, whatever its
    number.
    """

    number: int
    text: bytes
    last: bool = False
    aside: bool = False


Read = Callable[[int], Sequence[Part]]
"""Read some of what came behind a number; called in the thread that hears of changes."""
Probe = Callable[[], object]
"""Return something that is another when there is more to read, where no database tells it: a file's size."""
BACKLOG = 1000
"""Batches that a listener may be behind; one that takes nothing for so long is let go, and comes again."""
BACKLOG_BYTES = 2**22
"""The same in bytes. The batches are the same objects for all who follow, so this counts once for a topic."""


@dataclass(eq=False, slots=True)
class Listener:
    """One stream: its queue gets what is behind `since`, no event as a sign of life, None at the end."""

    since: int
    loop: asyncio.AbstractEventLoop
    queue: asyncio.Queue[Sequence[Part] | None] = field(default_factory=lambda: asyncio.Queue(BACKLOG))
    behind_bytes: int = 0

    def take(self, parts: Sequence[Part] | None) -> None:
        """Take what is new; None ends the stream, and so does a backlog that is too large."""
        self.behind_bytes += _size(parts)
        if self.queue.full() or self.behind_bytes > BACKLOG_BYTES:
            while not self.queue.empty():
                self.queue.get_nowait()
            parts, self.behind_bytes = None, 0
        self.queue.put_nowait(parts)

    async def next(self) -> Sequence[Part] | None:
        """Return what came next."""
        parts = await self.queue.get()
        self.behind_bytes -= _size(parts)
        return parts


def _size(parts: Sequence[Part] | None) -> int:
    return sum(len(part.text) for part in parts or ())


@dataclass(slots=True)
class _Topic:
    read: Read
    seen: int
    probe: Probe | None
    probed: object = None
    listeners: set[Listener] = field(default_factory=set)


class Hub:
    """Reads what changed once and gives it to all who follow it."""

    def __init__(self, repo: Repository) -> None:
        self._topics: dict[str, _Topic] = {}
        self._lock = threading.Lock()
        self._every_s = repo.settings.stream_seconds
        self.lookers = Lookers(lambda mission: self._look({lookers_topic(mission)}))
        """Who looks at which mission; other servers tell of theirs while anything is followed here."""
        self._watch = Watch(
            repo.database.url,
            self._look,
            lambda: bool(self._topics),
            self._moved,
            others={CHANNEL: self.lookers.hear},
        )

    def seen(self, topic: str) -> int | None:
        """Return the number of the newest event of a topic, None if nobody follows it."""
        with self._lock:
            followed = self._topics.get(topic)
            return None if followed is None else followed.seen

    def join(self, topic: str, seen: int, read: Read, probe: Probe | None = None) -> Listener:
        """Return a new listener to a topic whose newest event has (or had just now) the number `seen`.

        `probe` is asked again and again, once for all who follow, so it has to be quick.
        """
        with self._lock:
            followed = self._topics.setdefault(topic, _Topic(read, seen, probe))
            listener = Listener(followed.seen, asyncio.get_running_loop())
            followed.listeners.add(listener)
            is_new = len(followed.listeners) == 1
        if is_new:
            self._watch.poke()
            listener.loop.call_later(self._every_s, self._pulse, topic, followed)
        return listener

    def join_beside(self, topic: str, seen: int, read: Read, listener: Listener) -> None:
        """Let a listener follow a second topic, with parts `aside` alone; the first gives signs of life."""
        with self._lock:
            self._topics.setdefault(topic, _Topic(read, seen, None)).listeners.add(listener)

    def _pulse(self, name: str, followed: _Topic) -> None:
        """Give all who follow a topic a sign of life, again and again while anybody does.

        One clock for all: a timer of each listener cost more than all else in silence.
        """
        with self._lock:
            listeners = list(followed.listeners) if self._topics.get(name) is followed else []
        if listeners:
            _hand_out(listeners, ())
            listeners[0].loop.call_later(self._every_s, self._pulse, name, followed)

    def leave(self, topic: str, listener: Listener) -> None:
        """Let a listener go; what nobody follows is read no more."""
        with self._lock:
            followed = self._topics.get(topic)
            if followed is not None:
                followed.listeners.discard(listener)
                if not followed.listeners:
                    del self._topics[topic]

    def stop(self) -> None:
        """End the thread that hears of changes."""
        with self._lock:
            self._topics.clear()
        self._watch.stop()

    def _moved(self) -> Set[str] | None:
        """Return the topics whose probe gives something new; None where there is none to ask."""
        with self._lock:
            probed = [(name, topic) for name, topic in self._topics.items() if topic.probe is not None]
        moved = set()
        for name, topic in probed:
            found = None if topic.probe is None else topic.probe()
            if found != topic.probed:
                topic.probed = found
                moved.add(name)
        return moved if probed else None

    def _look(self, changed: Set[str] | None) -> None:
        with self._lock:
            wanted = [(n, t) for n, t in self._topics.items() if changed is None or n in changed]
        while wanted:  # a change of many rows is more than one read gives; none waits for another's
            wanted = [(name, topic) for name, topic in wanted if self._bring(name, topic)]

    def _bring(self, name: str, topic: _Topic) -> bool:
        """Hand out what has come to a topic since; return whether there may be more."""
        try:
            parts: Sequence[Part] | None = topic.read(topic.seen)
        except GroundError:  # it was deleted: who follows it is let go
            parts = None
        except Exception:
            logger.exception("what is followed cannot be read", extra={"topic": name})
            return False
        if parts is not None and not parts:
            return False
        with self._lock:
            topic.seen = topic.seen if parts is None else parts[-1].number
            listeners = list(topic.listeners)
        if listeners:
            listeners[0].loop.call_soon_threadsafe(_hand_out, listeners, parts)
        return parts is not None and not parts[-1].last and bool(listeners)


def lookers_topic(mission_id: str) -> str:
    """Return the topic of who looks at a mission."""
    return f"lookers {mission_id}"


def _hand_out(listeners: Sequence[Listener], parts: Sequence[Part] | None) -> None:
    for listener in listeners:
        listener.take(parts)
