"""Rules of the nouns, held without a database."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ground.errors import GroundError, InvalidInputError, NameTakenError, OutsideTerrainError
from ground.gdr.geometry import Bounds
from ground.resources.keep_outs.rules import MARGIN_M, require_outline
from ground.resources.missions.bodies import DriveRuleBody
from ground.resources.missions.rules import require_drive_rules
from ground.resources.observation_requests.rules import require_order, require_window
from ground.resources.targets.rules import free_name

YARD = Bounds(-16.0, -16.0, 16.0, 16.0)
NAMES = st.sets(st.sampled_from([f"T{n}" for n in range(1, 9)]))


@given(NAMES)
def test_a_target_without_a_name_gets_one_that_is_free(taken: set[str]) -> None:
    assert free_name(taken, None) not in taken


@given(NAMES, st.sampled_from(["T1", "T5", "Rock"]))
def test_a_name_wanted_is_given_or_refused(taken: set[str], wanted: str) -> None:
    if wanted in taken:
        with pytest.raises(NameTakenError, match=wanted):
            free_name(taken, wanted)
    else:
        assert free_name(taken, wanted) == wanted


@pytest.mark.parametrize(
    ("corners", "error", "words"),
    [
        ([(0, 0), (1, 1), (0, 0)], InvalidInputError, "needs 3 corners, this one has 2"),
        ([(0, 0), (2, 2), (2, 0), (0, 2)], InvalidInputError, "crosses itself"),
        ([(0, 0), (1, 1), (2, 2)], InvalidInputError, "no area"),
        ([(0, 0), (16 + MARGIN_M + 0.1, 0), (0, 1)], OutsideTerrainError, "off the terrain"),
    ],
)
def test_an_outline_is_refused_with_the_reason(
    corners: list[tuple[float, float]], error: type[GroundError], words: str
) -> None:
    with pytest.raises(error, match=words):
        require_outline(corners, YARD)


def test_an_outline_may_reach_over_the_edge_and_be_closed() -> None:
    require_outline([(0, 0), (16 + MARGIN_M, 0), (0, 1), (0, 0)], YARD)


def test_a_window_ends_after_it_begins() -> None:
    require_window(None)
    require_window([0.0, 1.0])
    with pytest.raises(InvalidInputError, match="ends at 1 s and begins at 1 s"):
        require_window([1.0, 1.0])


@given(st.lists(st.lists(st.integers(0, 4), max_size=3), min_size=5, max_size=5), st.data())
def test_requests_are_put_in_an_order_that_can_be_kept_or_refused(
    rows: list[list[int]], data: st.DataObject
) -> None:
    before = {f"r{n}": [f"r{k}" for k in row if k < n] for n, row in enumerate(rows)}
    changed = data.draw(st.sampled_from(sorted(before)))
    after = [f"r{k}" for k in data.draw(st.lists(st.integers(0, 4), max_size=3))]
    wanted = {**before, changed: after}
    kept = any(
        all(order.index(b) < order.index(r) for r, bs in wanted.items() for b in bs)
        for order in itertools.permutations(before)
    )
    if kept:
        require_order(before, changed, after)
    else:
        with pytest.raises(InvalidInputError):
            require_order(before, changed, after)


def test_a_new_request_comes_after_those_that_are_there() -> None:
    require_order({"a": []}, None, ["a"])
    with pytest.raises(InvalidInputError, match="no other observation request b"):
        require_order({"a": []}, None, ["a", "b"])


@pytest.mark.parametrize(
    ("rules", "words"),
    [
        ([("a", "gone")], "no target gone"),
        ([("a", "a")], "from one place to another"),
        ([(None, "a"), ("b", "a"), ("a", "b")], "already"),
    ],
)
def test_drive_rules_are_about_two_places_each_once(rules: list[tuple[str | None, str]], words: str) -> None:
    bodies = [DriveRuleBody(from_target_id=a, to_target_id=b) for a, b in rules]
    with pytest.raises(InvalidInputError, match=words):
        require_drive_rules(bodies, {"a", "b"})
    require_drive_rules(bodies[:-1], {"a", "b"})
