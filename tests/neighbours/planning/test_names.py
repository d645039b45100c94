"""Names of ours as identifiers of PDDL and ANML."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from neighbours.planning.errors import PlanningFormatError
from neighbours.planning.names import identifier, name_of, word

NAMES = st.text(min_size=1, max_size=12) | st.text("aAzZ_0-9.", min_size=1, max_size=6)


@given(NAMES)
def test_name_comes_back_from_its_word(name: str) -> None:
    assert name_of(word(name)) == name


@given(st.tuples(NAMES, NAMES), st.tuples(NAMES, NAMES))
def test_two_pairs_of_names_never_share_an_identifier(one: tuple[str, str], other: tuple[str, str]) -> None:
    first, second = identifier("drive", *one), identifier("drive", *other)
    assert (first == second) == (one == other)
    assert re.fullmatch("[a-z][a-z0-9_]*", first)


@pytest.mark.parametrize("text", ["", "T1", "a__b", "a_", "_05", "_"])
def test_what_no_name_became_is_refused(text: str) -> None:
    with pytest.raises(PlanningFormatError, match="not a word of an exported name"):
        name_of(text)
