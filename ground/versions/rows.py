"""Three-way merge of rows: two edits of one set of rows joined, and what cannot be joined named.

A row has a kind, an id that is the same on all three sides, and fields. What one side alone has changed is
taken. Two different changes of one field are a conflict with a name; so is a row that one side removed and
the other changed, and a row that refers to one which the other side removed. Nothing is dropped in silence.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import orjson

from ground.errors import InvalidInputError
from ground.versions.merge import Take
from mission.values import value

Key = tuple[str, str]
"""Kind and id of a row."""
Fields = Mapping[str, object]
Rows = Mapping[Key, Fields]
ConflictKey = tuple[str, str, str]
"""Kind of the conflict, id of the row, field."""


class RowConflictKind(StrEnum):
    """What cannot be joined."""

    BOTH_CHANGED = "both-changed"
    REMOVED_AND_CHANGED = "removed-and-changed"
    REFERS_TO_REMOVED = "refers-to-removed"
    SAME_NAME = "same-name"
    CIRCLE = "circle"
    NOT_MERGED = "not-merged"
    """A change of something that no merge carries over: taking `ours` leaves it where it is."""
    INVALID = "invalid"


_CHOOSABLE = frozenset(RowConflictKind) - {RowConflictKind.CIRCLE, RowConflictKind.INVALID}


@value
class RowConflict:
    """One place where two edits cannot be joined: the row, the field, and what each side says."""

    kind: RowConflictKind
    row: Key
    name: str = ""
    field: str = ""
    base: str = ""
    ours: str = ""
    theirs: str = ""

    @property
    def key(self) -> ConflictKey:
        """Return what tells it from the others of a merge."""
        return (str(self.kind), self.row[1], self.field)

    @property
    def choosable(self) -> bool:
        """Return whether a side can be taken."""
        return self.kind in _CHOOSABLE


@value
class RowChange:
    """What one side, or both alike, did since the base."""

    side: str
    action: str
    row: Key
    name: str = ""
    field: str = ""
    base: str = ""
    now: str = ""


@dataclass(frozen=True, slots=True)
class Schema:
    """What the merge has to know of rows."""

    references: Callable[[Key, str, Any], Iterator[Key]]
    """The rows that a value of a field names."""
    without: Callable[[Key, str, Any, Key], Any]
    """The value of a field without the name of one row; `GONE` where the row cannot be without it."""
    unique: Mapping[str, str]
    """The field of a kind that has to be another in each row: a name or a number."""
    before: tuple[str, str]
    """The kind and the field of it that put rows into an order, which has to be without circles."""
    merged: frozenset[str]
    """Kinds whose rows are joined; changes of the others are named."""
    name: Callable[[Key, Fields], str]
    """What people call a row."""


GONE = object()


@dataclass(frozen=True, slots=True)
class MergedRows:
    """What a merge gave: `rows` is None where conflicts are open."""

    rows: Rows | None
    conflicts: tuple[RowConflict, ...]


def text_of(found: Any) -> str:
    """Return a value of a field for people."""
    if found is None:
        return ""
    return found if isinstance(found, str) else orjson.dumps(found).decode()


def row_changes(base: Rows, ours: Rows, theirs: Rows, schema: Schema) -> list[RowChange]:
    """Return what each side did since the base, in the order of kinds and ids."""
    found: list[RowChange] = []
    for key in sorted({*base, *ours, *theirs}):
        sides = {"ours": ours.get(key), "theirs": theirs.get(key)}
        was = base.get(key)
        name = schema.name(key, sides["ours"] or sides["theirs"] or was or {})
        if sides["ours"] == sides["theirs"]:
            sides = {"both": sides["ours"]}
        for side, now in sides.items():
            if now is None and was is not None:
                found.append(RowChange(side, "removed", key, name))
            elif was is None and now is not None:
                found.append(RowChange(side, "added", key, name))
            elif was is not None and now is not None:
                found += [
                    RowChange(side, "changed", key, name, f, text_of(was.get(f)), text_of(now.get(f)))
                    for f in sorted({*was, *now})
                    if was.get(f) != now.get(f)
                ]
    return found


def merge_rows(
    base: Rows,
    ours: Rows,
    theirs: Rows,
    schema: Schema,
    take: Take | None = None,
    choices: Mapping[ConflictKey, Take] | None = None,
) -> MergedRows:
    """Join two edits of a set of rows.

    Parameters
    ----------
    take
        Whose state stands in every conflict in which a side can be taken. Such conflicts are still listed.
    choices
        The same for single conflicts; it goes before `take`. One decides what others there are, so those of
        conflicts that are there under other choices are accepted too.

    Raises
    ------
    InvalidInputError
        If a choice is of no conflict, or takes what no merge carries over.
    """
    chosen = choices or {}
    work = _Merge(base, ours, theirs, schema, take, chosen)
    rows = work.run()
    known = {c.key for c in work.conflicts if c.choosable}
    if not chosen.keys() <= known:
        plain = _Merge(base, ours, theirs, schema, take, {})
        plain.run()
        known |= {c.key for c in plain.conflicts if c.choosable}
    for kind, name, where in chosen:
        if (kind, name, where) not in known and not work.may_arise((kind, name, where)):
            place = name + (f" :{where}" if where else "")
            raise InvalidInputError(f"there is no conflict {kind} at {place} in which a side can be taken")
    return MergedRows(rows if work.closed else None, tuple(work.conflicts))


@dataclass(slots=True)
class _Merge:
    """One merge: the rows of three sides, and the conflicts found so far."""

    base: Rows
    ours: Rows
    theirs: Rows
    schema: Schema
    take: Take | None
    choices: Mapping[ConflictKey, Take]
    conflicts: list[RowConflict] = field(default_factory=list)
    closed: bool = True

    def run(self) -> Rows:
        """Return the joined rows; where a conflict is open, as if ours were taken."""
        joined: dict[Key, Fields] = {}
        for key in sorted({*self.base, *self.ours, *self.theirs}):
            row = self._joined(key)
            if row is not None:
                joined[key] = row
        self._settle_references(joined)
        self._settle_names(joined)
        self._find_circles(joined)
        return joined

    def _decide(
        self,
        kind: RowConflictKind,
        key: Key,
        where: str = "",
        base: str = "",
        ours: str = "",
        theirs: str = "",
    ) -> Take:
        """Name a conflict and return whose state stands in it."""
        known = self.ours.get(key) or self.theirs.get(key) or self.base.get(key) or {}
        conflict = RowConflict(kind, key, self.schema.name(key, known), where, base, ours, theirs)
        self.conflicts.append(conflict)
        taken = self.choices.get(conflict.key, self.take) if conflict.choosable else None
        if kind is RowConflictKind.NOT_MERGED and taken is Take.THEIRS:
            if conflict.key in self.choices:
                raise InvalidInputError(
                    f"{key[0].replace('_', ' ')} {key[1]}: no merge carries this over; take ours, and do it "
                    "there by hand"
                )
            taken = None
        self.closed &= taken is not None
        return taken or Take.OURS

    def may_arise(self, conflict: ConflictKey) -> bool:
        """Return whether a conflict that rests on choices may be there under others than those given."""
        kind, row, where = conflict
        fields = [(k, side[k]) for side in (self.base, self.ours, self.theirs) for k in side if k[1] == row]
        if kind == RowConflictKind.SAME_NAME:
            return any(self.schema.unique.get(key[0]) == where for key, _ in fields)
        return kind == RowConflictKind.REFERS_TO_REMOVED and any(
            other not in self.ours or other not in self.theirs
            for key, found in fields
            for other in self.schema.references(key, where, found.get(where))
        )

    # ---- single rows

    def _joined(self, key: Key) -> Fields | None:
        was, our, their = self.base.get(key), self.ours.get(key), self.theirs.get(key)
        if key[0] not in self.schema.merged:
            return self._left(key, was, our, their)
        if our is None or their is None:
            return self._one_sided(key, was, our, their)
        old = was or {}
        row = {}
        for name in sorted({*old, *our, *their}):
            three = [side.get(name) for side in (old, our, their)]
            row[name] = three[1]
            if three[1] == three[2] or three[2] == three[0]:
                continue
            if three[1] == three[0]:
                row[name] = three[2]
            else:
                taken = self._decide(RowConflictKind.BOTH_CHANGED, key, name, *map(text_of, three))
                row[name] = three[1 if taken is Take.OURS else 2]
        return row

    def _one_sided(
        self, key: Key, was: Fields | None, our: Fields | None, their: Fields | None
    ) -> Fields | None:
        left = our if our is not None else their
        if was is None or left is None or left == was:
            return left if was is None else None
        words = [", ".join(f for f in sorted({*was, *left}) if was.get(f) != left.get(f)) + " changed"]
        words.insert(0 if our is None else 1, "removed")
        taken = self._decide(RowConflictKind.REMOVED_AND_CHANGED, key, "", "", *words)
        return our if taken is Take.OURS else their

    def _left(self, key: Key, was: Fields | None, our: Fields | None, their: Fields | None) -> Fields | None:
        """Return a row of a kind that is not joined as ours has it; name what theirs did to it."""
        if their not in (was, our):
            texts = ["" if side is None else text_of(dict(side)) for side in (was, our, their)]
            self._decide(RowConflictKind.NOT_MERGED, key, "", *texts)
        return our

    # ---- rows that refer to others

    def _settle_references(self, joined: dict[Key, Fields]) -> None:
        """Take out what refers to nothing, or bring back what is referred to, as the choices say."""
        settled: set[tuple[Key, str, Key]] = set()
        while True:
            dangling = [
                (key, name, other)
                for key, row in joined.items()
                for name, found in row.items()
                for other in self.schema.references(key, name, found)
                if other not in joined
            ]
            if not dangling:
                return
            for key, name, other in dangling:
                if key not in joined or other in joined:
                    continue
                if (key, name, other) in settled:
                    self._decide(RowConflictKind.INVALID, key, name, "", *2 * [f"{other[1]} is not there"])
                    joined[key] = {**joined[key], name: None}
                    continue
                settled.add((key, name, other))
                self._settle_reference(joined, key, name, other)

    def _settle_reference(self, joined: dict[Key, Fields], key: Key, name: str, other: Key) -> None:
        removed_by = Take.OURS if other not in self.ours else Take.THEIRS
        gone = f"{other[0].replace('_', ' ')} {self._name(other)} removed"
        kept = f"refers to {self._name(other)}"
        texts = (gone, kept) if removed_by is Take.OURS else (kept, gone)
        taken = self._decide(RowConflictKind.REFERS_TO_REMOVED, key, name, "", *texts)
        if taken is not removed_by:
            side = self.theirs if removed_by is Take.OURS else self.ours
            brought = side.get(other)
            if brought is not None and other[0] in self.schema.merged:
                joined[other] = brought
                return
        rest = self.schema.without(key, name, joined[key][name], other)
        if rest is GONE:
            del joined[key]
        else:
            joined[key] = {**joined[key], name: rest}

    def _name(self, key: Key) -> str:
        for side in (self.ours, self.theirs, self.base):
            if key in side:
                return self.schema.name(key, side[key]) or key[1]
        return key[1]

    # ---- names and orders

    def _settle_names(self, joined: dict[Key, Fields]) -> None:
        for kind, name in self.schema.unique.items():
            holders: dict[Any, list[Key]] = {}
            for key, row in joined.items():
                if key[0] == kind:
                    holders.setdefault(row.get(name), []).append(key)
            taken = set(holders)
            for found, keys in holders.items():
                # whoever has the name in ours comes first: each side alone gives it once
                keys.sort(key=lambda k: (self.ours.get(k, {}).get(name) != found, k))
                first = keys[0]
                for key in keys[1:]:
                    texts = (self._holder(first, found), self._holder(key, found))
                    side = self._decide(RowConflictKind.SAME_NAME, key, name, "", *texts)
                    loser = key if side is Take.OURS else first
                    first = first if side is Take.OURS else key
                    free = _free(found, taken)
                    taken.add(free)
                    joined[loser] = {**joined[loser], name: free}

    def _holder(self, key: Key, found: Any) -> str:
        return f"{text_of(found)} is {key[1]}"

    def _find_circles(self, joined: Mapping[Key, Fields]) -> None:
        kind, name = self.schema.before
        after = {
            key: [other for other in self.schema.references(key, name, row.get(name)) if other in joined]
            for key, row in joined.items()
            if key[0] == kind
        }
        for circle in _circles(after):
            words = " after ".join(self._name(key) for key in (*circle, circle[0]))
            self._decide(RowConflictKind.CIRCLE, circle[0], name, "", words, words)


def _free(found: Any, taken: set[Any]) -> Any:
    """Return a name or number like one that is taken, and free."""
    if isinstance(found, int):
        return max(n for n in taken if isinstance(n, int)) + 1
    number = 2
    while (name := f"{str(found)[:70]} ({number})") in taken:
        number += 1
    return name


def _circles(after: Mapping[Key, Sequence[Key]]) -> list[list[Key]]:
    """Return a circle of each group of rows that wait for each other."""
    found: list[list[Key]] = []
    done: set[Key] = set()
    for start in sorted(after):
        path: list[Key] = []
        on_path: set[Key] = set()
        stack: list[tuple[Key, Iterator[Key]]] = []
        if start not in done:
            stack.append((start, iter(after[start])))
            path.append(start)
            on_path.add(start)
        while stack:
            key, rest = stack[-1]
            other = next((o for o in rest if o in after and o not in done), None)
            if other is None:
                stack.pop()
                path.pop()
                on_path.discard(key)
                done.add(key)
            elif other in on_path:
                found.append(path[path.index(other) :])
            else:
                stack.append((other, iter(after[other])))
                path.append(other)
                on_path.add(other)
    return found
