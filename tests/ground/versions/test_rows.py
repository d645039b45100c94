"""Three-way merge of rows: what one side alone did is taken, everything else is a conflict with a name."""

from __future__ import annotations

from collections.abc import Iterator
from random import Random
from typing import Any

import pytest

from ground.errors import InvalidInputError
from ground.versions.merge import Take
from ground.versions.rows import GONE, Key, MergedRows, Rows, Schema, merge_rows, row_changes
from tests.seeds import drawn_seed

PAIRS = 600


def references(_key: Key, name: str, found: Any) -> Iterator[Key]:
    if name == "of" and found is not None:
        yield "rock", found
    elif name == "after":
        yield from (("look", i) for i in found)


def without(_key: Key, name: str, found: Any, other: Key) -> Any:
    return GONE if name == "of" else [i for i in found if i != other[1]]


SCHEMA = Schema(
    references,
    without,
    {"rock": "name"},
    ("look", "after"),
    frozenset({"rock", "look"}),
    lambda _key, row: str(row.get("name", "")),
)


def rock(name: str, **more: Any) -> dict[str, Any]:
    return {"name": name, "notes": "", "at": [0.0, 1.0], **more}


def look(of: str, *after: str, **more: Any) -> dict[str, Any]:
    return {"of": of, "after": list(after), "value": 1.0, **more}


BASE: Rows = {
    ("rock", "r1"): rock("One"),
    ("rock", "r2"): rock("Two"),
    ("look", "a"): look("r1"),
    ("look", "b"): look("r2", "a"),
}


def edited(**rows: dict[str, Any] | None) -> Rows:
    """Return the base with rows set, or removed where None."""
    found = dict(BASE)
    for name, row in rows.items():
        key = ("rock" if name.startswith("r") else "look", name)
        found.pop(key, None)
        if row is not None:
            found[key] = row
    return found


def merged(ours: Rows, theirs: Rows, *choices: tuple[str, str, str, str], take: str = "") -> MergedRows:
    chosen = {choice[:3]: Take(choice[3]) for choice in choices}
    return merge_rows(BASE, ours, theirs, SCHEMA, Take(take) if take else None, chosen)


def keys(found: MergedRows) -> list[tuple[str, str, str]]:
    return [conflict.key for conflict in found.conflicts]


def test_different_fields_of_one_row_are_joined_and_equal_edits_are_one() -> None:
    ours = edited(r1=rock("One", notes="dusty", at=[2.0, 2.0]))
    theirs = edited(r1=rock("Uno", at=[2.0, 2.0]))
    found = merged(ours, theirs)
    assert found.conflicts == ()
    assert found.rows == edited(r1=rock("Uno", notes="dusty", at=[2.0, 2.0]))


@pytest.mark.parametrize(("take", "notes"), [("ours", "a"), ("theirs", "b")])
def test_two_values_of_one_field_are_a_conflict_that_a_choice_decides(take: str, notes: str) -> None:
    ours, theirs = edited(r1=rock("One", notes="a")), edited(r1=rock("One", notes="b", at=[3.0, 3.0]))
    found = merged(ours, theirs)
    assert found.rows is None
    (conflict,) = found.conflicts
    assert (conflict.base, conflict.ours, conflict.theirs) == ("", "a", "b")
    decided = merged(ours, theirs, (*conflict.key, take))
    assert decided.rows == edited(r1=rock("One", notes=notes, at=[3.0, 3.0]))
    assert merged(ours, theirs, take=take).rows == decided.rows
    assert keys(decided) == [conflict.key]


@pytest.mark.parametrize("take", ["ours", "theirs"])
def test_a_row_that_was_removed_and_changed_is_a_conflict_either_way(take: str) -> None:
    gone, changed = edited(b=None), edited(b=look("r2", "a", value=5.0))
    for ours, theirs in ((gone, changed), (changed, gone)):
        found = merged(ours, theirs)
        assert keys(found) == [("removed-and-changed", "b", "")]
        decided = merged(ours, theirs, ("removed-and-changed", "b", "", take))
        assert decided.rows == (ours if take == "ours" else theirs)


@pytest.mark.parametrize("take", ["ours", "theirs"])
def test_a_new_row_on_one_that_the_other_side_removed_comes_or_goes_with_it(take: str) -> None:
    gone, asked = edited(r2=None, b=None), edited(c=look("r2"))
    for ours, theirs in ((gone, asked), (asked, gone)):
        found = merged(ours, theirs)
        assert keys(found) == [("refers-to-removed", "c", "of")]
        decided = merged(ours, theirs, ("refers-to-removed", "c", "of", take)).rows
        kept = (ours if take == "ours" else theirs) is asked
        assert decided == ({k: v for k, v in asked.items() if k != ("look", "b")} if kept else gone)


def test_a_choice_that_brings_another_conflict_about_is_good_beside_its_choice() -> None:
    """`b` is changed on a rock that went with it: it stays only if the rock does."""
    ours, theirs = edited(r2=None, b=None), edited(b=look("r2", "a", value=5.0))
    assert keys(merged(ours, theirs)) == [("removed-and-changed", "b", "")]
    first = ("removed-and-changed", "b", "", "theirs")
    half = merged(ours, theirs, first)
    assert half.rows is None
    assert keys(half) == [("removed-and-changed", "b", ""), ("refers-to-removed", "b", "of")]
    second = ("refers-to-removed", "b", "of")
    assert merged(ours, theirs, first, (*second, "theirs")).rows == theirs
    assert merged(ours, theirs, first, (*second, "ours")).rows == ours


def test_one_name_given_twice_is_kept_by_one_and_free_for_the_other() -> None:
    ours, theirs = edited(r3=rock("New")), edited(r4=rock("New"))
    assert keys(merged(ours, theirs)) == [("same-name", "r4", "name")]
    for take, names in (("ours", ("New", "New (2)")), ("theirs", ("New (2)", "New"))):
        rows = merged(ours, theirs, take=take).rows
        assert rows is not None
        assert (rows["rock", "r3"]["name"], rows["rock", "r4"]["name"]) == names


def test_a_circle_of_two_orders_leaves_no_rows_whatever_is_taken() -> None:
    base_free = edited(b=look("r2"))
    found = merge_rows(
        base_free,
        {**base_free, ("look", "a"): look("r1", "b")},
        {**base_free, ("look", "b"): look("r2", "a")},
        SCHEMA,
        Take.OURS,
    )
    assert found.rows is None
    assert [kind for kind, *_ in keys(found)] == ["circle"]


def test_what_no_merge_carries_over_is_named_and_stays() -> None:
    theirs = {**BASE, ("site", "s"): {"key": "1"}}
    found = merged(BASE, theirs)
    assert keys(found) == [("not-merged", "s", "")]
    assert merged(BASE, theirs, take="ours").rows == BASE
    assert merged(BASE, theirs, take="theirs").rows is None
    with pytest.raises(InvalidInputError, match="no merge carries"):
        merged(BASE, theirs, ("not-merged", "s", "", "theirs"))


def test_a_choice_of_a_conflict_that_another_choice_does_away_with_is_good() -> None:
    """Somebody changes their mind about the first; what they said of the second is moot, and not wrong."""
    ours, theirs = edited(r2=None, b=None), edited(b=look("r2", "a", value=5.0))
    second = ("refers-to-removed", "b", "of", "theirs")
    assert merged(ours, theirs, ("removed-and-changed", "b", "", "ours"), second).rows == ours
    for other in (("refers-to-removed", "b", "after"), ("refers-to-removed", "a", "of")):
        with pytest.raises(InvalidInputError, match="there is no conflict refers-to-removed"):
            merged(ours, theirs, ("removed-and-changed", "b", "", "ours"), (*other, "ours"))
    named = ("same-name", "r1", "name", "ours")
    assert merged(ours, theirs, ("removed-and-changed", "b", "", "ours"), named).rows == ours
    with pytest.raises(InvalidInputError, match="there is no conflict same-name"):
        merged(ours, theirs, ("removed-and-changed", "b", "", "ours"), ("same-name", "b", "name", "ours"))


def test_a_choice_of_no_conflict_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="there is no conflict both-changed at r1 :notes"):
        merged(BASE, edited(r1=rock("One", notes="x")), ("both-changed", "r1", "notes", "ours"))


# ---- at random


def random_edits(rows: Rows, rng: Random, side: str) -> Rows:
    """Return a valid state of the rows a few edits further."""
    found = {key: dict(row) for key, row in rows.items()}
    for number in range(rng.randrange(6)):
        key = rng.choice(sorted(found))
        deed = rng.randrange(7)
        rocks = sorted(k for k in found if k[0] == "rock")
        if deed == 0 and len(rocks) > 1 and key[0] == "rock":
            del found[key]
            for other in [k for k, r in found.items() if r.get("of") == key[1]]:
                del found[other]
        elif deed == 1 and key[0] == "look" and len(found) > 3:
            del found[key]
        elif deed == 2:
            found["look", f"{side}{number}"] = look(rng.choice(rocks)[1])
        elif deed == 3:
            found["rock", f"{side}{number}"] = rock(f"{rng.choice('XYZ')}{number}")
        elif key[0] == "rock":
            found[key]["notes"] = rng.choice("uvw")
        else:
            looks = sorted(k[1] for k in found if k[0] == "look" and k < key)
            found[key]["value"] = rng.choice([2.0, 3.0])
            found[key]["after"] = rng.sample(looks, min(len(looks), rng.randrange(3)))
        left = {k[1] for k in found if k[0] == "look"}
        for row in found.values():
            if "after" in row:
                row["after"] = [i for i in row["after"] if i in left]
    names: set[str] = set()
    for key in [k for k, r in found.items() if k[0] == "rock"]:
        if found[key]["name"] in names:
            found[key]["name"] += key[1]
        names.add(found[key]["name"])
    return found


def test_of_random_pairs_every_edit_is_taken_or_named_and_nothing_else_is_said() -> None:
    seed = drawn_seed()
    rng = Random(seed)
    clean = named = 0
    for _ in range(PAIRS):
        base = random_edits(BASE, rng, "z")
        ours, theirs = random_edits(base, rng, "o"), random_edits(base, rng, "t")
        found = merge_rows(base, ours, theirs, SCHEMA)
        about = {conflict.row for conflict in found.conflicts}
        changes = row_changes(base, ours, theirs, SCHEMA)
        for key in {*base, *ours, *theirs}:
            sides = [side.get(key) for side in (base, ours, theirs)]
            told = {(c.side, c.action) for c in changes if c.row == key}
            assert bool(told) == (sides[1] != sides[0] or sides[2] != sides[0]), seed
        if found.rows is None:
            named += 1
            assert about, seed
        else:
            clean += 1
            assert not about, seed
            for key in {*base, *ours, *theirs}:
                check_row(key, base.get(key), ours.get(key), theirs.get(key), found.rows.get(key), seed)
        for side in (Take.OURS, Take.THEIRS):
            taken = merge_rows(base, ours, theirs, SCHEMA, side)
            if taken.rows is not None:
                for key, row in taken.rows.items():
                    refs = [r for name, v in row.items() for r in references(key, name, v)]
                    assert all(r in taken.rows for r in refs), seed
    assert clean > PAIRS / 6  # the test would also pass if everything were called a conflict
    assert named > PAIRS / 20


def check_row(key: Key, was: Any, our: Any, their: Any, now: Any, seed: int) -> None:
    """Hold one row of a merge without a conflict against the definition."""
    if our == was:
        assert now == their, (seed, key)
    elif their == was:
        assert now == our, (seed, key)
    elif now is None:
        assert our is None, (seed, key)
        assert their is None, (seed, key)
    else:
        for name in now:
            three = [side.get(name) if side else None for side in (was, our, their)]
            wanted = three[1] if three[2] in (three[0], three[1]) else three[2]
            assert three[1] in (three[0], three[2]) or three[2] == three[0], (seed, key, name)
            assert now[name] == wanted, (seed, key, name)
