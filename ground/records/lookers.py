"""Who looks at which mission now, and what they have selected there.

In memory and nowhere else, for as long as a page goes on saying so: who looks does not belong to a
mission, and a row for each word of a page would be thousands a day. Servers on PostgreSQL tell each other by
`NOTIFY`.
"""

from __future__ import annotations

import secrets
import threading
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass

import orjson

BEAT_S = 15.0
"""How often a page says that somebody looks at it."""
GONE_S = 40.0
"""A page that missed two words is gone; one that is closed says so."""
EACH_MOST, MOST = 20, 200
"""Pages of a person and of all on one mission; the oldest words are forgotten."""
CHANNEL = "outcrop_lookers"
"""Where servers tell each other of it."""


@dataclass(frozen=True, slots=True)
class Selected:
    """What somebody has selected: a target, request, keep-out, product, plan or run, by its id."""

    kind: str
    id: str


@dataclass(frozen=True, slots=True)
class Looker:
    """Somebody who looks at a mission, on a page of theirs."""

    page_id: str
    person: str
    selected: Selected | None


@dataclass(frozen=True, slots=True)
class Word:
    """What a page says: that somebody looks at a mission there, or that they are gone."""

    mission_id: str
    looker: Looker
    gone: bool = False

    @classmethod
    def read(cls, text: str) -> Word:
        """Return what a server told."""
        told = orjson.loads(text)
        looker = told["looker"]
        selected = None if looker["selected"] is None else Selected(**looker["selected"])
        return cls(told["mission_id"], Looker(looker["page_id"], looker["person"], selected), told["gone"])


class Lookers:
    """Everybody who looks at a mission; each change that others can see has a number.

    `changed` is called with the mission of a change by a word, in the thread that took it in.
    """

    def __init__(
        self, changed: Callable[[str], None] = lambda _: None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._changed, self._clock = changed, clock
        self._lock = threading.Lock()
        self._known: dict[str, dict[tuple[str, str], tuple[float, Looker]]] = {}
        """By mission, then by person and page: when it was said last, and what."""
        self._numbers: dict[str, int] = {}
        self._last = 0
        self._server = secrets.token_hex(8)

    def text(self, word: Word) -> str:
        """Return a word as this server tells it the others."""
        return orjson.dumps({**asdict(word), "server": self._server}).decode()

    def hear(self, text: str) -> None:
        """Take in what a server told, unless it was this one: its own word comes back late, behind newer."""
        if self._server not in text:
            self.take(Word.read(text))

    def take(self, word: Word) -> bool:
        """Take a word in; return whether others see a change by it."""
        now, looker = self._clock(), word.looker
        with self._lock:
            here = self._known.setdefault(word.mission_id, {})
            number = self._numbers.get(word.mission_id, 0)
            before = self._living(word.mission_id, now)
            key = (looker.person, looker.page_id)
            here.pop(key, None)
            if not word.gone:
                here[key] = (now, looker)
                own = [k for k in here if k[0] == looker.person]
                for old in [*own[:-EACH_MOST], *list(here)[:-MOST]]:
                    here.pop(old, None)
            if before != self._living(word.mission_id, now):
                self._change(word.mission_id)
            changed = self._numbers.get(word.mission_id, 0) != number
            if not here:
                self._known.pop(word.mission_id)
        if changed:
            self._changed(word.mission_id)
        return changed

    def of(self, mission_id: str) -> list[Looker]:
        """Return who looks at a mission, by name."""
        with self._lock:
            return self._living(mission_id, self._clock())

    def number(self, mission_id: str) -> int:
        """Return the number of the last change on a mission."""
        with self._lock:
            return self._numbers.get(mission_id, 0)

    def _living(self, mission_id: str, now: float) -> list[Looker]:
        """Return who is there still; those who are not are forgotten, which is a change."""
        here = self._known.get(mission_id, {})
        dead = [key for key, (at, _) in here.items() if now - at > GONE_S]
        for key in dead:
            here.pop(key)
        if dead:
            self._change(mission_id)
        return sorted((one for _, one in here.values()), key=lambda one: (one.person, one.page_id))

    def _change(self, mission_id: str) -> None:
        self._last += 1
        self._numbers[mission_id] = self._last
