"""CQL2 text: what is read, what is refused, and what it says of a feature."""

from __future__ import annotations

import contextlib
import re
from datetime import UTC, datetime

import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from neighbours.geodata.cql2 import Cql2Error, Subject, checked, holds, read_cql2
from neighbours.geodata.cql2.evaluate import RELATIONS, like
from neighbours.geodata.cql2.expression import Form

KNOWN: dict[str, Form] = {
    "name": "text",
    "value": "number",
    "other": "number",
    "flag": "flag",
    "made": "time",
    "end": "time",
    "geometry": "geometry",
}
ROCK = Subject(
    {
        "name": "Rock",
        "value": 5.0,
        "other": None,
        "flag": True,
        "made": datetime(2026, 11, 22, 10, tzinfo=UTC),
        "end": datetime(2026, 11, 23, tzinfo=UTC),
    },
    shapely.Point(1.0, 2.0),
)


def says(text: str) -> bool:
    return holds(checked(read_cql2(text), KNOWN), ROCK)


@pytest.mark.parametrize(
    "text",
    [
        "value = 5 AND (name = 'Rock' or value < -1e3)",
        "not value > 5",
        "5 = value",
        "flag = TRUE and true",
        "value not in (1, 2) AND name NOT LIKE 'r%'",
        "value between 5 and 5.0",
        "other is null and value IS NOT NULL",
        "made = DATE('2026-11-22') and made > DATE('2026-11-21')",
        "made <= TIMESTAMP('2026-11-22T11:00:00+01:00')",
        "T_DURING(made, INTERVAL('2026-11-22T00:00:00Z', '..'))",
        "T_STARTEDBY(INTERVAL(made, end), made)",
        "T_MEETS(INTERVAL(made, end), INTERVAL('2026-11-23T00:00:00Z', '..'))",
        "CASEI(name) IN (CASEI('ROCK'), 'x')",
        "S_INTERSECTS(geometry, BBOX(0, 0, 0, 2, 3, 9))",
        "S_CROSSES(LINESTRING(0 0, 2 2), LINESTRING Z (0 2 1, 2 0 1))",
        "S_CONTAINS(MULTIPOLYGON(((0 0, 9 0, 9 9, 0 0)), ((20 20, 21 20, 21 21, 20 20))), POINT(5 1))",
        "S_TOUCHES(geometry, POLYGON((1 2, 3 2, 3 4, 1 2)))",
        "S_EQUALS(geometry, MULTIPOINT((1 2)))",
        "S_WITHIN(geometry, GEOMETRYCOLLECTION(POINT(1 2), POINT(3 4)))",
        "\"name\" = 'Rock'",
    ],
)
def test_it_is_true(text: str) -> None:
    assert says(text)
    assert not says(f"NOT ({text})")


@pytest.mark.parametrize("text", ["other = 1", "other <> 1", "other in (1)", "other between 1 and 2"])
def test_of_what_is_not_there_neither_is_true(text: str) -> None:
    assert not says(text)
    assert not says(f"not ({text})")
    assert says(f"({text}) or value = 5")
    assert not says(f"({text}) and value = 5")


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "expected"),
        ("value", "a comparison"),
        ("value = ", "expected"),
        ("value = 5 value", "end of the filter"),
        ("(value = 5", "')' expected"),
        ("colour = 1", "there is no property 'colour'"),
        ("name = 5", "a text and a number cannot be compared"),
        ("value like 'a%'", "like takes a text"),
        ("name like value", "a text expected behind 'like'"),
        ("geometry = 'x'", "cannot be compared"),
        ("name = 'open", "not closed"),
        ("made > TIMESTAMP('2026-11-22T10:00:00')", "no zone"),
        ("made > TIMESTAMP('2026-02-30T10:00:00Z')", "not a date of the calendar"),
        ("made > DATE('22.11.2026')", "is not a date"),
        ("T_AFTER(made, INTERVAL('2026-11-22', '2026-11-21'))", "ends before"),
        ("S_INTERSECTS(geometry, POLYGON((0 0, 1 1, 1 0, 0 1, 0 0)))", "Self-intersection"),
        ("S_INTERSECTS(geometry, POLYGON((0 0, 1 1, 1 0)))", "a ring has 4 corners"),
        ("S_INTERSECTS(geometry, POINT(NaN 1))", "a number expected"),
        ("S_INTERSECTS(geometry, POINT(1e999 1))", "not a number"),
        ("S_INTERSECTS(geometry, BBOX(1, 2, 3))", "4 numbers"),
        ("S_INTERSECTS(name, POINT(1 1))", "s_intersects takes a geometry"),
        ("S_NEAR(geometry, POINT(1 1))", "no function 'S_NEAR'"),
        ("value + 1 = 2", "is not a word"),
        ("(" * 60 + "value = 1" + ")" * 60, "within each other"),
        ("value = 1 or " * 3000 + "value = 1", "characters; 20000 are allowed"),
        ("value = 1; drop table", "is not a word"),
    ],
)
def test_what_is_none_is_refused_with_the_reason(text: str, why: str) -> None:
    with pytest.raises(Cql2Error, match=re.escape(why)):
        says(text)


@given(st.text(alphabet="ab%_\\", max_size=8), st.text(alphabet="ab%", max_size=8))
def test_like_agrees_with_a_regular_expression(pattern: str, text: str) -> None:
    parts, escaped = [], False
    for character in pattern:
        if character == "\\" and not escaped:
            escaped = True
            continue
        wild = {"%": ".*", "_": "."} if not escaped else {}
        parts.append(wild.get(character, re.escape(character)))
        escaped = False
    wanted = re.fullmatch("".join(parts) + (r"\\" if escaped else ""), text) is not None
    assert like(text, pattern) == wanted


def test_a_pattern_of_many_wildcards_ends_soon() -> None:
    assert not like("a" * 3000, "%a" * 200 + "%b")


@given(st.lists(st.integers(0, 4), min_size=4, max_size=4))
def test_each_pair_of_times_has_one_of_allens_relations(ends: list[int]) -> None:
    """Of two intervals with a length exactly one of the thirteen holds; three are joins of others."""
    one, other = sorted(ends[:2]), sorted(ends[2:])
    if one[0] == one[1] or other[0] == other[1]:
        return
    spans = [tuple(datetime(2026, 1, 1 + day, tzinfo=UTC) for day in span) for span in (one, other)]
    found = {name for name, relation in RELATIONS.items() if relation(*spans)}  # type: ignore[arg-type]
    assert len(found - {"t_disjoint", "t_intersects"}) == 1
    assert ("t_disjoint" in found) != ("t_intersects" in found)


@given(st.text(alphabet="name=<>'()5 andornotliks_itersc,.BOX\"%-", max_size=40))
def test_any_text_is_read_or_refused(text: str) -> None:
    with contextlib.suppress(Cql2Error):
        assert says(text) in {True, False}
