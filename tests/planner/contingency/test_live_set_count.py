"""The number of live sets is that of the sets themselves."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.contingency import live_set_count
from planner.contingency.live_set_count import count_sets
from planner.contingency.policy import Live, LiveSets, TooLargeError
from planner.evaluate.model import Model
from planner.problem import Problem
from tests.planner.examples import problems


@st.composite
def _ordered(draw: st.DrawFn) -> Problem:
    """Draw a problem some of whose observations come after others."""
    problem = draw(problems(targets=4))
    pairs = list(combinations([o.id for o in problem.observations], 2))
    chosen = draw(st.lists(st.sampled_from(pairs), max_size=4, unique=True)) if pairs else []
    return replace(problem, precedence=tuple(chosen))


def _beginning(problem: Problem) -> tuple[LiveSets, Live]:
    model = Model.of(problem)
    sets = LiveSets(model, (1 << model.m) - 1)
    return sets, sets.initial(sum(1 << p for p in range(1, model.n + 1) if model.trackable[p]))


@settings(deadline=None)  # compiled when it is first called
@given(problem=_ordered(), once=st.booleans())
def test_the_compiled_count_is_the_number_of_the_sets(problem: Problem, once: bool) -> None:
    sets, start = _beginning(problem)
    found = sets.once_from([start])[0] if once else sets.all_from([start])
    assert count_sets(sets, start, once=once) == len(found)


@settings(deadline=None)
@given(problem=_ordered())
def test_too_many_sets_are_refused(problem: Problem) -> None:
    sets, start = _beginning(problem)
    if sets.remembered or len(sets.all_from([start])) < 2:
        return
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(live_set_count, "MAX_STATES", 1)
        with pytest.raises(TooLargeError):
            count_sets(sets, start, once=False)
