"""Three-way merge: two edits of one plan joined, and every place where they cannot be joined named.

What one side alone has changed is taken. Two different changes of one thing are a conflict with a name; so is
a merged plan in which the validator finds an error that none of the three had (a window that two edits close,
a condition on a node that the other side removed). Nothing is dropped in silence.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from executive.crl.nodes import Plan
from executive.crl.printer import canonical_text
from executive.crl.validate import check
from executive.crl.values import Conditions, Spread
from ground.errors import InvalidInputError
from ground.versions.difference import field_text
from ground.versions.meaning import condition_meaning, map_meaning, scalar
from ground.versions.parts import (
    HEADER,
    Part,
    Parts,
    copy_of,
    in_spread,
    meaning_of,
    part_meaning,
    parts_of,
    plan_of,
    spread_of,
)
from mission.values import value

MAPS = ("parameters", "metadata")


class Take(StrEnum):
    """Whose value stands where both sides changed one field or one order."""

    OURS = "ours"
    THEIRS = "theirs"


ConflictKey = tuple[str, str, str]
"""Kind, id and field of a conflict."""


class ConflictKind(StrEnum):
    """What cannot be joined."""

    BOTH_CHANGED = "both-changed"
    BOTH_ADDED = "both-added"
    REMOVED_AND_CHANGED = "removed-and-changed"
    BOTH_MOVED = "both-moved"
    BOTH_REORDERED = "both-reordered"
    SAME_PLACE = "same-place"
    CIRCLE = "circle"
    INVALID = "invalid"


_CHOOSABLE = (ConflictKind.BOTH_CHANGED, ConflictKind.BOTH_REORDERED, ConflictKind.SAME_PLACE)
"""Kinds that leave a whole plan whichever side is taken."""


@value
class Conflict:
    """One place where two edits cannot be joined: its kind, the part, the field, and what each side says."""

    kind: ConflictKind
    id: str
    field: str = ""
    base: str = ""
    ours: str = ""
    theirs: str = ""

    def line(self) -> str:
        """Return the conflict as a line for people."""
        where = (self.id or "the header") + (f" :{self.field}" if self.field else "")
        said = (("was", self.base), ("ours", self.ours), ("theirs", self.theirs))
        return f"{self.kind}: {where}: " + "; ".join(f"{who}: {text or '(none)'}" for who, text in said)

    @property
    def key(self) -> ConflictKey:
        """Return what tells it from the others of a merge."""
        return (str(self.kind), self.id, self.field)

    @property
    def choosable(self) -> bool:
        """Return whether taking a side leaves a whole plan."""
        return self.kind in _CHOOSABLE


@dataclass(frozen=True, slots=True)
class Merged:
    """What a merge gave: `plan` is None where conflicts are open."""

    plan: Plan | None
    conflicts: tuple[Conflict, ...]


def merge(
    base: Plan,
    ours: Plan,
    theirs: Plan,
    take: Take | None = None,
    choices: Mapping[ConflictKey, Take] | None = None,
) -> Merged:
    """Join two edits of a plan.

    Parameters
    ----------
    take
        Whose value stands where both changed one field or order. Such conflicts are still listed. Without it,
        and for all other kinds, a conflict leaves no plan.
    choices
        The same for single conflicts; it goes before `take`.

    Raises
    ------
    InvalidInputError
        If an id stands twice in one of the plans, or a choice is of no conflict.
    """
    try:
        sides = _in_one_spread(parts_of(base), parts_of(ours), parts_of(theirs))
    except ValueError as err:
        raise InvalidInputError(f"the plans cannot be merged: {err}") from err
    chosen = choices or {}
    work = _Merge(*sides, take or Take.OURS, chosen)
    parts = work.run()
    for key in chosen:
        if key not in {c.key for c in work.conflicts if c.choosable}:
            kind, name, field = key
            where = (name or "the header") + (f" :{field}" if field else "")
            raise InvalidInputError(f"there is no conflict {kind} at {where} in which a side can be taken")
    closed = all(c.choosable and (take is not None or c.key in chosen) for c in work.conflicts)
    if parts is None or (work.conflicts and not closed):
        return Merged(None, tuple(work.conflicts))
    plan = plan_of(parts)
    broken = list(_newly_wrong(plan, (base, ours, theirs)))
    return Merged(None if broken else plan, (*work.conflicts, *broken))


def _in_one_spread(base: Parts, ours: Parts, theirs: Parts) -> tuple[Parts, Parts, Parts]:
    """Return the three with every spread stated as the merged plan does: as the side that changed it."""
    wanted = spread_of(theirs if spread_of(ours) is spread_of(base) else ours)
    return in_spread(base, wanted), in_spread(ours, wanted), in_spread(theirs, wanted)


def _newly_wrong(plan: Plan, before: Sequence[Plan]) -> Iterator[Conflict]:
    """Yield the validator's errors that none of the plans before had."""
    errors = check(canonical_text(plan)).errors
    if not errors:
        return
    known = {(e.code, e.node) for p in before for e in check(canonical_text(p)).errors}
    for error in errors:
        if (error.code, error.node) not in known:
            yield Conflict(ConflictKind.INVALID, error.node or "", theirs=f"{error.code} {error.message}")


class _Merge:
    """One merge: parts of the three plans, and the conflicts found so far."""

    def __init__(
        self, base: Parts, ours: Parts, theirs: Parts, take: Take, choices: Mapping[ConflictKey, Take]
    ) -> None:
        self.base, self.ours, self.theirs, self.take = base, ours, theirs, take
        self.choices = choices
        self.spread: Spread = spread_of(base)  # that of all three
        self.conflicts: list[Conflict] = []
        self.whole = True

    def run(self) -> Parts | None:
        """Return the joined parts, None if they do not hang together."""
        names = dict.fromkeys((*self.base, *self.ours, *self.theirs))
        kept = {name: part for name in names if (part := self._joined(name)) is not None}
        if self.whole:
            self._place(kept)
        return kept if self.whole else None

    def _conflict(self, kind: ConflictKind, name: str, field: str = "", *texts: str) -> None:
        self.conflicts.append(Conflict(kind, name, field, *texts))
        if kind not in _CHOOSABLE:
            self.whole = False

    def _taken(self, kind: ConflictKind, name: str, field: str) -> Take:
        return self.choices.get((str(kind), name, field), self.take)

    # ---- what a part says

    def _joined(self, name: str) -> Part | None:
        was, our, their = self.base.get(name), self.ours.get(name), self.theirs.get(name)
        if was is None:
            return self._added(our, their)
        if our is None or their is None:
            self._removed(was, our, their)
            return None
        if our.kind != their.kind or our.kind != was.kind:
            return self._of_another_kind(was, our, their)
        part = copy_of(our)
        part.slot = self._slot(was, our, their)
        part.ordered = was.ordered or our.ordered or their.ordered
        for attribute in was.fields:
            if attribute != "duration":
                self._field(part, was, our, their, attribute)
        return part

    def _added(self, our: Part | None, their: Part | None) -> Part | None:
        if our is None or their is None:
            added = our or their
            return None if added is None else copy_of(added)
        if our.slot != their.slot or self._meaning(our) != self._meaning(their):
            self._conflict(ConflictKind.BOTH_ADDED, our.id, "", "", _shown(our), _shown(their))
        return copy_of(our)

    def _removed(self, was: Part, our: Part | None, their: Part | None) -> None:
        """Name it if what one side removed was touched by the other."""
        left, side = (our, 1) if our is not None else (their, 2)
        if left is None:
            return
        touched = left.slot != was.slot or self._meaning(left) != self._meaning(was)
        if touched or self._ranked_anew(was, side):
            texts = ["removed", "removed"]
            texts[side - 1] = _shown(left)
            self._conflict(ConflictKind.REMOVED_AND_CHANGED, was.id, "", _shown(was), *texts)

    def _of_another_kind(self, was: Part, our: Part, their: Part) -> Part:
        if self._meaning(our) == self._meaning(their):
            part = copy_of(our)
        elif self._meaning(our) == self._meaning(was):
            part = copy_of(their)
        elif self._meaning(their) == self._meaning(was):
            part = copy_of(our)
        else:
            self._conflict(ConflictKind.BOTH_ADDED, was.id, "kind", was.kind, our.kind, their.kind)
            part = copy_of(our)
        part.slot = self._slot(was, our, their)
        return part

    def _slot(self, was: Part, our: Part, their: Part) -> tuple[str, str] | None:
        if our.slot == their.slot or their.slot == was.slot:
            if our.slot != their.slot and self._ranked_anew(was, 2):
                places = [p.slot[0] if p.slot else "" for p in (was, our, their)]
                self._conflict(ConflictKind.BOTH_MOVED, was.id, "", *places)
            return our.slot
        if our.slot != was.slot or self._ranked_anew(was, 1):
            places = [p.slot[0] if p.slot else "" for p in (was, our, their)]
            self._conflict(ConflictKind.BOTH_MOVED, was.id, "", *places)
        return their.slot

    def _ranked_anew(self, was: Part, side: int) -> bool:
        """Return whether a side put a part before or after others that stay beside it."""
        parts = (self.base, self.ours, self.theirs)[side]
        if was.slot is None or parts[was.id].slot != was.slot or was.slot[0] not in parts:
            return False
        around = self.base[was.slot[0]], parts[was.slot[0]]
        if not (around[0].ordered or around[1].ordered):
            return False
        old, new = (p.below[was.slot[1]] for p in around)
        before = [set(ids[: ids.index(was.id)]) for ids in (old, new)]
        both = set(old) & set(new)
        return before[0] & both != before[1] & both

    def _meaning(self, part: Part) -> Any:
        return part_meaning(part, self.spread)

    def _field(self, part: Part, was: Part, our: Part, their: Part, attribute: str) -> None:
        three = [meaning_of(p, attribute, self.spread) for p in (was, our, their)]
        if three[1] == three[2] or three[2] == three[0]:
            return
        source = their
        if three[1] != three[0]:
            joined = _joined_members(attribute, was, our, their)
            if joined is not None:
                part.fields[attribute] = joined
                return
            texts = [field_text(p, attribute) for p in (was, our, their)]
            word = attribute.replace("_", "-")
            self._conflict(ConflictKind.BOTH_CHANGED, was.id, word, *texts)
            ours = self._taken(ConflictKind.BOTH_CHANGED, was.id, word) is Take.OURS
            source = our if ours else their
        part.fields[attribute] = source.fields[attribute]
        if attribute == "end_temporal_conditions" and "duration" in source.fields:
            part.fields["duration"] = source.fields["duration"]

    # ---- where parts stand

    def _place(self, kept: Parts) -> None:
        members: dict[tuple[str, str], list[str]] = {}
        for name, part in kept.items():
            if part.slot is None:
                continue
            if part.slot[0] not in kept or part.slot[1] not in kept[part.slot[0]].below:
                self._conflict(
                    ConflictKind.REMOVED_AND_CHANGED, part.slot[0], "", "", f"{name} stands in it", "removed"
                )
                continue
            members.setdefault(part.slot, []).append(name)
        for name, part in kept.items():
            for slot in part.below:
                inside = members.get((name, slot), [])
                part.below[slot] = self._order(part, slot, inside)
                self._fits(part, slot)
        if self.whole and len(_reached(kept)) < len(kept):
            lost = sorted(set(kept) - _reached(kept))
            self._conflict(ConflictKind.CIRCLE, lost[0], "", "", *2 * [f"each lies in the other: {lost}"])

    def _fits(self, part: Part, slot: str) -> None:
        """Name it if a place for one is empty or has several, or a list that must hold something is empty."""
        count = len(part.below[slot])
        if slot == "node" and count != 1:
            self._conflict(ConflictKind.SAME_PLACE, part.id, slot, "", *2 * [" ".join(part.below[slot])])
            self.whole = False
        if slot in ("node_list", "options") and count == 0:
            self._conflict(
                ConflictKind.REMOVED_AND_CHANGED,
                part.id,
                slot,
                "",
                "nothing is left in it",
                "nothing is left",
            )

    def _order(self, part: Part, slot: str, inside: list[str]) -> list[str]:
        """Return what stands in a slot in joined order."""
        lists = [
            [i for i in side[part.id].below.get(slot, []) if i in set(inside)] if part.id in side else []
            for side in (self.base, self.ours, self.theirs)
        ]
        was, our, their = lists
        both = set(our) & set(their)
        common = [i for i in was if i in both]
        orders = [[i for i in ids if i in set(common)] for ids in (our, their)]
        if orders[0] == orders[1] or orders[1] == common:
            first, second = our, their
        elif orders[0] == common:
            first, second = their, our
        else:
            word = slot.replace("_", "-")
            ours = self._taken(ConflictKind.BOTH_REORDERED, part.id, word) is Take.OURS
            first, second = (our, their) if ours else (their, our)
            if part.ordered:
                texts = [" ".join(ids) for ids in lists]
                self._conflict(ConflictKind.BOTH_REORDERED, part.id, word, *texts)
        return self._interleaved(part, slot, first, second, common)

    def _interleaved(
        self, part: Part, slot: str, first: list[str], second: list[str], common: list[str]
    ) -> list[str]:
        """Put what the second list alone has into the first, each after what it follows there."""
        order = list(first)
        for at, name in enumerate(second):
            if name in order:
                continue
            before = next((i for i in reversed(second[:at]) if i in order), None)
            place = 0 if before is None else order.index(before) + 1
            rival = order[place] if place < len(order) else None
            if rival is not None and rival not in second and part.ordered and slot != "node":
                texts = (f"{rival} after {before or 'the start'}", f"{name} after {before or 'the start'}")
                self._conflict(ConflictKind.SAME_PLACE, part.id, slot.replace("_", "-"), "", *texts)
            order.insert(place, name)
        self._follows(part, slot, order, second, common)
        return order

    def _follows(self, part: Part, slot: str, order: list[str], second: list[str], common: list[str]) -> None:
        """Name it if the joined order breaks what the second side alone put before or after something."""
        if not part.ordered or slot == "node":
            return
        added = [i for i in second if i not in set(common)]
        place = {name: at for at, name in enumerate(order)}
        rank = {name: at for at, name in enumerate(second)}
        for name in added:
            for other in second:
                if (rank[name] < rank[other]) != (place[name] < place[other]) and name != other:
                    texts = " ".join(order), " ".join(second)
                    self._conflict(ConflictKind.SAME_PLACE, part.id, slot.replace("_", "-"), "", *texts)
                    return


def _shown(part: Part) -> str:
    fields = (f":{name.replace('_', '-')} {text}" for name in part.fields if (text := field_text(part, name)))
    return " ".join((part.kind, *fields))


def _reached(parts: Mapping[str, Part]) -> set[str]:
    found, stack = set(), [HEADER]
    while stack:
        name = stack.pop()
        found.add(name)
        stack += [i for ids in parts[name].below.values() for i in ids if i not in found]
    return found


def _joined_members(attribute: str, was: Part, our: Part, their: Part) -> Any | None:
    """Return a conjunction or named values changed by both sides; None if they changed one member."""
    three = tuple(p.fields[attribute] for p in (was, our, their))
    if attribute in MAPS:
        return _joined_map(*three)
    if attribute.endswith("_conditions") and "temporal" not in attribute:
        return _joined_set(*three)
    return None


def _joined_map(was: Mapping[str, Any], our: Mapping[str, Any], their: Mapping[str, Any]) -> Any | None:
    joined = dict(our)
    for name in dict.fromkeys((*was, *their)):
        before, ours, theirs = (scalar(m[name]) if name in m else None for m in (was, our, their))
        if theirs in (before, ours):
            continue
        if ours != before:
            return None
        if name in their:
            joined[name] = their[name]
        else:
            joined.pop(name, None)
    return joined if map_meaning(joined) != map_meaning(was) else None


def _joined_set(was: Conditions, our: Conditions, their: Conditions) -> Conditions | None:
    """Join two edits of a conjunction; None if both sides may have changed one member.

    A new member may stand for any that is gone. So nothing is joined where both sides took members away and
    put new ones in, nor where both took one away and a side put a new one in: it may be a change of that one.
    """
    before, ours, theirs = ({condition_meaning(c): c for c in side} for side in (was, our, their))
    gone = [{m for m in before if m not in side} for side in (ours, theirs)]
    new = [{m for m in side if m not in before} for side in (ours, theirs)]
    if (all(gone) and all(new)) or (gone[0] & gone[1] and any(new)):
        return None
    kept = [c for m, c in ours.items() if m not in gone[1]]
    return (*kept, *(c for m, c in theirs.items() if m in new[1] and m not in new[0]))
