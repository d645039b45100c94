"""What differs between two plans, by meaning: blanks, spelling and the order of conditions are nothing."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from enum import StrEnum
from typing import Any

from executive.crl.declaration import Syntax
from executive.crl.nodes import FORMS, Plan
from executive.crl.printer import flat
from executive.crl.syntax import codec
from executive.crl.values import ConsumableResource, Relative
from ground.errors import InvalidInputError
from ground.versions.meaning import map_meaning
from ground.versions.parts import HEADER, Part, Parts, meaning_of, part_meaning, parts_of, spread_of
from mission.codec import Codec
from mission.values import value


class Deed(StrEnum):
    """What was done to a part."""

    ADDED = "added"
    REMOVED = "removed"
    CHANGED = "changed"
    MOVED = "moved"
    REORDERED = "reordered"
    RENAMED = "renamed"


class Group(StrEnum):
    """What a difference is about; `words` never change what a rover does."""

    STEPS = "steps"
    BRANCHES = "branches"
    CONDITIONS = "conditions"
    WINDOWS = "windows"
    RESOURCES = "resources"
    HEADER = "header"
    WORDS = "words"


_GROUPS: Mapping[str, Group] = {
    **dict.fromkeys(("name", "probability", "expectations"), Group.WORDS),
    **dict.fromkeys(("start_temporal_conditions", "end_temporal_conditions"), Group.WINDOWS),
    **dict.fromkeys(("uses", "requires", "resources", "budgets"), Group.RESOURCES),
    **dict.fromkeys(("utility", "if_none", "on_option_failure"), Group.BRANCHES),
}


PLAN_TREE_PATH = "step"
"""Key of a node's metadata: its path in the plan tree, which changes when another step is put before it."""


@value
class Change:
    """One difference.

    Parameters
    ----------
    deed
        added, removed, changed, moved, reordered or renamed.
    group
        What it is about: steps, branches, conditions, windows, resources, header or words.
    kind, id
        Head and id of the form; the header has the id "".
    field
        The field that changed, without colon; empty if it is the whole.
    before, after
        As text of CRL; empty where there is none.
    """

    deed: Deed
    group: Group
    kind: str
    id: str
    field: str = ""
    before: str = ""
    after: str = ""

    def line(self) -> str:
        """Return the difference as a line for people."""
        who = f"{self.kind} {self.id}".rstrip()
        what = f" :{self.field}" if self.field else ""
        match self.deed:
            case Deed.CHANGED:
                return f"{who}{what}: {self.before or '(none)'} -> {self.after or '(none)'}"
            case Deed.ADDED | Deed.REMOVED:
                place = self.after or self.before
                return f"{who} {self.deed}" + (f" ({place})" if place else "")
            case _:
                return f"{who} {self.deed}: {self.before} -> {self.after}"


@value
class PlanDifference:
    """All differences of two plans, in the order of the second; `same` if both mean the same.

    `same` holds where the only differences are `words`: names, predictions, and metadata that is not sent to
    the rover with a task and does not state a resource.
    """

    same: bool
    changes: tuple[Change, ...]


DIFFERENCES = Codec(PlanDifference, "plan-difference/1", "plan difference", error=InvalidInputError)


def _place(part: Part) -> str:
    """Return where a part stands, in words."""
    return f"in {part.slot[0] or 'the plan'}" if part.slot is not None else ""


def difference(before: Plan, after: Plan) -> PlanDifference:
    """Return what the second plan says that the first does not, and the reverse.

    Raises
    ------
    InvalidInputError
        If an id stands twice in one of them.
    """
    try:
        first, second = parts_of(before), parts_of(after)
    except ValueError as err:
        raise InvalidInputError(f"the plans cannot be compared: {err}") from err
    renamed = _renamed(first, second)
    changes = [*_parts_changed(first, second, renamed), *_reordered(first, second, renamed)]
    same = all(c.group is Group.WORDS for c in changes)
    return PlanDifference(same, tuple(changes))


def _renamed(first: Parts, second: Parts) -> dict[str, str]:
    """Return parts that have another id and are otherwise the only ones of their kind: old id to new."""
    gone = [p for name, p in first.items() if name not in second]
    new = [p for name, p in second.items() if name not in first]
    olds, news = _signs(gone, first), _signs(new, second)
    counts = Counter(olds.values()), Counter(news.values())
    by_sign = {sign: name for name, sign in news.items()}
    return {
        old: by_sign[sign] for old, sign in olds.items() if counts[0][sign] == 1 and counts[1].get(sign) == 1
    }


def _signs(parts: Sequence[Part], side: Parts) -> dict[str, Any]:
    spread = spread_of(side)
    signs = {}
    for part in parts:
        inside = tuple((name, len(ids)) for name, ids in part.below.items())
        signs[part.id] = (part_meaning(part, spread), inside)
    return signs


def _parts_changed(first: Parts, second: Parts, renamed: Mapping[str, str]) -> Iterator[Change]:
    back = {new: old for old, new in renamed.items()}
    for name, part in first.items():
        if name not in second and name not in renamed:
            yield Change(Deed.REMOVED, _whole(part), part.kind, name, before=_place(part))
    for name, part in second.items():
        if name in back:
            old = first[back[name]]
            yield Change(Deed.RENAMED, _whole(part), part.kind, name, before=old.id, after=name)
            yield from _moved(old, part, renamed)
        elif name not in first:
            yield Change(Deed.ADDED, _whole(part), part.kind, name, after=_place(part))
        else:
            yield from _moved(first[name], part, renamed)
            yield from _fields(first, second, name)


def _moved(old: Part, new: Part, renamed: Mapping[str, str]) -> Iterator[Change]:
    if old.slot is None or new.slot is None:
        return
    kept = (renamed.get(old.slot[0], old.slot[0]), old.slot[1])
    if kept != new.slot:
        before, after = (slot[0] or "the plan" for slot in (old.slot, new.slot))
        yield Change(Deed.MOVED, _whole(new), new.kind, new.id, before=before, after=after)


def _fields(first: Parts, second: Parts, name: str) -> Iterator[Change]:
    old, new = first[name], second[name]
    if old.kind != new.kind:
        yield Change(Deed.CHANGED, _whole(new), new.kind, name, "kind", old.kind, new.kind)
    spreads = spread_of(first), spread_of(second)
    for attribute in dict.fromkeys((*old.fields, *new.fields)):
        if meaning_of(old, attribute, spreads[0]) == meaning_of(new, attribute, spreads[1]):
            continue
        texts = field_text(old, attribute), field_text(new, attribute)
        word = attribute.removesuffix("_ms").replace("_", "-")
        group = _metadata_group(old, new) if attribute == "metadata" else _group(new, attribute)
        yield Change(Deed.CHANGED, group, new.kind, name, word, *texts)


def _reordered(first: Parts, second: Parts, renamed: Mapping[str, str]) -> Iterator[Change]:
    back = {new: old for old, new in renamed.items()}
    for name, new in second.items():
        old = first.get(back.get(name, name))
        if old is None or not (old.ordered or new.ordered):
            continue
        for slot, after in new.below.items():
            before = [renamed.get(i, i) for i in old.below.get(slot, [])]
            stayed = [i for i in before if i in set(after)]
            if stayed != [i for i in after if i in set(before)]:
                texts = " ".join(old.below[slot]), " ".join(after)
                yield Change(Deed.REORDERED, Group.STEPS, new.kind, name, slot.replace("_", "-"), *texts)


def _whole(part: Part) -> Group:
    if part.kind in ("option", "branch", "floating-contingency", "alternate"):
        return Group.BRANCHES
    return Group.HEADER if part.id == HEADER else Group.STEPS


def _group(part: Part, attribute: str) -> Group:
    if attribute in _GROUPS:
        return _GROUPS[attribute]
    if attribute.endswith("_conditions"):
        return Group.CONDITIONS
    return _whole(part)


def _metadata_group(old: Part, new: Part) -> Group:
    """Return what changed metadata is about.

    That of a task goes to the rover with the command: it picks the observation by it, labels products with
    it, and the ground finds the request of a product by it. That of the header may state the level of a
    consumable resource.
    """
    held = old.fields.get("metadata", {}), new.fields["metadata"]
    changed = {key for key, _ in map_meaning(held[0]) ^ map_meaning(held[1])}
    if new.id == HEADER:
        keys = {
            r.key
            for part in (old, new)
            for r in part.fields["resources"]
            if isinstance(r, ConsumableResource)
        }
        return Group.RESOURCES if changed & keys else Group.WORDS
    return Group.STEPS if "task" in (old.kind, new.kind) and changed - {PLAN_TREE_PATH} else Group.WORDS


def field_text(part: Part, attribute: str) -> str:
    """Return a field of a part as CRL; empty if it is absent, or at its default."""
    if attribute == "end_temporal_conditions" and part.fields.get("duration") is not None:
        windows = (*part.fields[attribute], Relative(part.fields["duration"]))
        return flat(codec(Syntax.TEMPORALS).tree(windows))
    declared = next((d for d in FORMS[part.kind].fields.values() if d.attribute == attribute), None)
    held = part.fields.get(attribute)
    if declared is None or held is None or (not declared.required and held == declared.default):
        return ""
    return flat(codec(declared.syntax).tree(held))


def without_words(found: PlanDifference) -> PlanDifference:
    """Return a difference without what changes words alone."""
    return replace(found, changes=tuple(c for c in found.changes if c.group is not Group.WORDS))
