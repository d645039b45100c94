"""What stands of a mission's history: which changes are done, which were taken back, and what rests on what.

People's changes are *originals*; each is done or taken back, as the last undo or redo of it says. A mission
is always what its done originals make of it, one after the other. So an original may be taken back exactly if
no done original behind it set the same member of the same resource, refers to what would go, or was worked
out from what would change.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NoReturn, TypeVar

import orjson
from sqlalchemy import Text, UniqueConstraint, cast, select
from sqlalchemy.orm import Session

from ground.errors import StateError
from ground.gdr.base import Row
from ground.gdr.history import EventRow
from ground.resources.kinds import KINDS

K = TypeVar("K", bound=Hashable)
FEW = 10
"""Names that the database looks for; a search takes some milliseconds in a history of 10,000 events."""
COUNTED = frozenset({"revision", "modified_utc"})
"""What every change sets; it belongs to none."""


@dataclass(frozen=True, slots=True)
class Line:
    """An event without its documents; `root` is the original that an undo or redo is about."""

    seq: int
    actor: str
    action: str
    kind: str
    subject_id: str
    group: str
    gone: bool
    root: int

    @property
    def counts(self) -> bool:
        """Return whether it is a person's change of something that can be undone."""
        return self.actor != "system" and self.kind in KINDS and KINDS[self.kind].undoable

    def __str__(self) -> str:
        title = KINDS[self.kind].title if self.kind in KINDS else self.kind
        return f"act {self.seq} ({self.action} {title} {self.subject_id} by {self.actor})"


class Acts:
    """The events of a chain from one of them on, without documents, and what stands of them."""

    def __init__(self, session: Session, chain_id: str, first: int) -> None:
        e = EventRow
        columns = (e.seq, e.actor, e.action, e.kind, e.subject_id, e.group, e.after.is_(None), e.undoes)
        query = select(*columns).where(e.chain_id == chain_id, e.seq >= first).order_by(e.seq)
        self.session, self.chain_id = session, chain_id
        self._others: dict[str, Others] = {}
        self.lines: dict[int, Line] = {}
        self._last: dict[int, Line] = {}
        """The newest event about each original: what it is, or an undo or redo of it."""
        for seq, actor, action, kind, subject_id, group, gone, undoes in session.execute(query):
            turned = self.lines.get(undoes) if undoes is not None else None
            root = seq if undoes is None else undoes if turned is None else turned.root
            line = Line(seq, actor, action, kind, subject_id, group, gone, root)
            self.lines[seq] = self._last[root] = line

    def last(self, root: int) -> Line:
        """Return the event that did, took back or did again an original last."""
        return self._last[root]

    def is_done(self, root: int) -> bool:
        """Return whether an original stands."""
        return self._last[root].action != "undo"

    def act_of(self, line: Line) -> list[Line]:
        """Return the originals of the act to which an original belongs, newest first."""
        return [
            o for o in reversed(self.lines.values()) if o.group == line.group and o.root == o.seq and o.counts
        ]

    def document(self, seq: int) -> EventRow:
        """Return an event with its documents."""
        return self.session.get_one(EventRow, (self.chain_id, seq))

    def others(self, group: str) -> Others:
        """Return the done originals of people that are of another act."""
        if group not in self._others:
            done = (
                line
                for line in self.lines.values()
                if line.root == line.seq and line.counts and line.group != group and self.is_done(line.seq)
            )
            self._others[group] = Others(self, list(done))
        return self._others[group]


class Others:
    """The done originals beside one act, found by what they are about: an act may be thousands."""

    def __init__(self, acts: Acts, lines: Sequence[Line]) -> None:
        self._acts, self._lines = acts, lines
        self._seqs = [line.seq for line in lines]
        self._asked = 0
        self._by_values: dict[tuple[str, frozenset[str]], Mapping[bytes, Sequence[Line]]] = {}

    def behind(self, seq: int) -> Sequence[Line]:
        """Return those behind an event."""
        return self._lines[bisect_right(self._seqs, seq) :]

    def about(self, subject_id: str) -> Sequence[Line]:
        """Return those that set members of one resource."""
        return self._by_subject.get(subject_id, ())

    def naming(self, subject_id: str) -> Sequence[Line]:
        """Return those that set a member to something that names a resource.

        The database looks for a few names; for many, each document is looked through once.
        """
        self._asked += 1
        if self._asked > FEW:
            return self._by_name.get(subject_id, ())
        e = EventRow
        query = select(e.seq).where(e.chain_id == self._acts.chain_id, e.seq > self._seqs[0] - 1)
        found = set(self._acts.session.scalars(query.where(cast(e.after, Text).contains(subject_id))))
        return [n for n in self._lines if n.seq in found and subject_id in _named(self._acts.document(n.seq))]

    def standing_at(self, target_id: str) -> Sequence[Line]:
        """Return those that set the stand of a request of a target."""
        return self._by_target.get(target_id, ())

    def giving(self, kind: str, names: frozenset[str], values: Mapping[str, object]) -> Sequence[Line]:
        """Return those that set any of these members of a kind, and left all with these values."""
        if (kind, names) not in self._by_values:
            self._by_values[kind, names] = _gathered(
                (_values(event.after or {}, names), line)
                for line, event in self._documents(kind)
                if names & cells(event)
            )
        return self._by_values[kind, names].get(_values(values, names), ())

    @cached_property
    def _by_subject(self) -> Mapping[str, Sequence[Line]]:
        return _gathered((line.subject_id, line) for line in self._lines)

    @cached_property
    def _by_name(self) -> Mapping[str, Sequence[Line]]:
        return _gathered((name, line) for line, event in self._documents() for name in _named(event))

    @cached_property
    def _by_target(self) -> Mapping[str, Sequence[Line]]:
        return _gathered(
            (str((event.after or event.before or {}).get("target_id")), line)
            for line, event in self._documents("observation_request")
            if "observation_point" in cells(event)
        )

    def _documents(self, kind: str | None = None) -> Iterator[tuple[Line, EventRow]]:
        """Yield those of one kind, or all, with their events, which are read many at once."""
        lines = [line for line in self._lines if kind in {None, line.kind}]
        e = EventRow
        for first in range(0, len(lines), 500):
            some = lines[first : first + 500]
            numbers = e.seq.in_([line.seq for line in some])
            query = select(e).where(e.chain_id == self._acts.chain_id, numbers).order_by(e.seq)
            yield from zip(some, self._acts.session.scalars(query), strict=True)


def _named(event: EventRow) -> set[str]:
    """Return every text within the members that an event set."""
    after = event.after or {}
    return mentions([after.get(name) for name in cells(event)])


def _gathered(found: Iterable[tuple[K, Line]]) -> Mapping[K, Sequence[Line]]:
    """Return lines by what they were found under."""
    by: dict[K, list[Line]] = {}
    for key, line in found:
        by.setdefault(key, []).append(line)
    return by


def _values(document: Mapping[str, object], names: Iterable[str]) -> bytes:
    return orjson.dumps([document.get(name) for name in sorted(names)])


def cells(event: EventRow) -> frozenset[str]:
    """Return the members that an event set; all of them where it made or removed the resource."""
    before, after = event.before or {}, event.after or {}
    names = before.keys() | after.keys()
    return frozenset(n for n in names if before.get(n) != after.get(n) or not before or not after) - COUNTED


def mentions(value: object) -> set[str]:
    """Return every text within a JSON value."""
    if isinstance(value, str):
        return {value}
    if isinstance(value, Mapping):
        return set().union(*map(mentions, value.values())) if value else set()
    if isinstance(value, Sequence):
        return set().union(*map(mentions, value)) if value else set()
    return set()


def require_free(acts: Acts, original: Line, word: str) -> None:
    """Raise if a done act behind an original rests on it.

    Raises
    ------
    StateError
        It names the newest of them; its number is the member `event`.
    """
    event = acts.document(original.seq)
    others = acts.others(original.group)
    behind = others.behind(original.seq)
    if not behind:
        return
    own = cells(event)
    resting = [line for line in others.about(original.subject_id) if own & cells(acts.document(line.seq))]
    if event.before is None:
        resting += others.naming(original.subject_id)
    if original.kind == "target" and own & {"east_m", "north_m"}:
        resting += others.standing_at(original.subject_id)
    if original.kind == "frame" and "solution_id" in own:
        resting += [line for line in behind if _follows_a_frame(acts, line)]
    resting = [line for line in resting if line.seq > original.seq]
    if resting:
        refuse(word, original, max(resting, key=lambda line: line.seq))


_PLACE = frozenset({"east_m", "north_m", "polygon_m", "outline_m", "in_frame", "frame_id"})


def _follows_a_frame(acts: Acts, line: Line) -> bool:
    """Return whether an act set the place of what is tied to a frame, which the solutions in use say."""
    if line.kind not in {"target", "keep_out", "site_map"}:
        return False
    event = acts.document(line.seq)
    tied = any((side or {}).get("frame_id") is not None for side in (event.before, event.after))
    return tied and bool(cells(event) & _PLACE)


def require_there(acts: Acts, original: Line, values: Mapping[str, object], word: str) -> None:
    """Raise if values that are to come back refer to something of the mission that is gone.

    Raises
    ------
    StateError
        It names the act by which that went.
    """
    named = mentions(dict(values)) - {original.subject_id}
    named = {name for name in named if 4 < len(name) <= 40 and name[3] == "-"}
    if not named:
        return
    e = EventRow
    query = select(e.subject_id, e.seq).where(e.chain_id == acts.chain_id, e.subject_id.in_(named))
    newest = {row.subject_id: row.seq for row in acts.session.execute(query.order_by(e.seq))}
    for seq in newest.values():
        last = acts.document(seq)
        if last.after is None and KINDS.get(last.kind) is not None and KINDS[last.kind].undoable:
            line = acts.lines.get(seq)
            by = acts.lines.get(line.root, line) if line is not None else None
            if by is None or by.group != original.group:
                refuse(word, original, by or _line_of(last))


def _line_of(event: EventRow) -> Line:
    root = event.undoes or event.seq
    return Line(event.seq, event.actor, event.action, event.kind, event.subject_id, event.group, True, root)


def require_unique(acts: Acts, original: Line, row: Any, restored: Collection[str], word: str) -> None:
    """Raise if a done act behind an original gave a name or number that is to come back to something else.

    Raises
    ------
    StateError
        It names that act.
    """
    for constraint in type(row).__table__.constraints:
        names = {column.name for column in getattr(constraint, "columns", ())} - {"mission_id"}
        if not isinstance(constraint, UniqueConstraint) or not names & set(restored):
            continue
        others = acts.others(original.group)
        if not others.behind(original.seq):
            continue
        values = {name: getattr(row, name) for name in names}
        for line in reversed(others.giving(original.kind, frozenset(names), values)):
            if line.seq > original.seq and line.subject_id != original.subject_id:
                refuse(word, original, line)


def require_unused(acts: Acts, original: Line, row: Row, word: str) -> None:
    """Raise if rows would go with one that is to go, unseen by the history: those that a job made, say.

    Raises
    ------
    StateError
        It names the event by which one of them came.
    """
    table = row.__table__
    for kind in KINDS.values():
        for column in kind.row.__table__.columns:
            if not any(key.column.table is table for key in column.foreign_keys):
                continue
            found = acts.session.scalar(select(kind.row.id).where(column == row.id).limit(1))
            if found is None:
                continue
            e = EventRow
            query = select(e).where(e.chain_id == acts.chain_id, e.subject_id == found).order_by(e.seq.desc())
            came = acts.session.scalars(query.limit(1)).first()
            number = None if came is None else came.seq
            told = f"{kind.title} {found}" if came is None else str(_line_of(came))
            stays = "" if kind.undoable else ", and stays"
            raise StateError(f"cannot {word} {original}: {told} rests on it{stays}", event=number)


def newest_touching(acts: Acts, original: Line, names: frozenset[str]) -> Line | None:
    """Return the newest done act behind an original that set one of these members of the same kind."""
    for line in reversed(acts.others(original.group).behind(original.seq)):
        if line.kind == original.kind and names & cells(acts.document(line.seq)):
            return line
    return None


def refuse(word: str, original: Line, by: Line) -> NoReturn:
    """Raise the refusal of an undo or redo that another act stands in the way of."""
    raise StateError(f"cannot {word} {original}: {by} rests on it; take that back first", event=by.seq)
