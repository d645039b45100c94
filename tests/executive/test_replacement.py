"""Replacement of a running plan: what must hold whatever is sent when, and equality with the model."""

from __future__ import annotations

from functools import lru_cache

import pytest

from executive.crl import canonical_text, check
from executive.crl.reader import parse
from executive.crl.validate import Report
from executive.ports import Operation, Operator
from executive.runtime import loading
from tests.executive import model
from tests.executive.replaced_runs import HORIZON_MS, check_case, check_seed, difference
from tests.executive.replacements import OPTION_EDITS
from tests.executive.worlds import Case


@pytest.fixture(autouse=True)
def each_text_is_read_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Session, replay and model get one report of a text, a value: reading took half of a run."""

    @lru_cache(maxsize=16)
    def report(text: str) -> Report:
        return check(text)

    for module in (loading, model):
        monkeypatch.setattr(module, "check", lambda text, **_: report(text))
    monkeypatch.setattr(loading, "parse", lru_cache(maxsize=16)(parse))


def test_random_replacements_keep_the_rules_and_agree_with_the_model() -> None:
    assert sum(check_seed(seed) > 0 for seed in range(400)) >= 200


def test_nodes_under_other_options_keep_the_rules_and_agree_with_the_model() -> None:
    assert sum(check_seed(seed, OPTION_EDITS) > 0 for seed in range(600, 1_000)) >= 200


def test_a_node_that_two_replacements_find_stopping_is_waited_for_once() -> None:
    assert check_seed(20_233)


def test_a_branch_that_lost_its_choice_is_not_over_before_what_is_stopped_below_it() -> None:
    assert check_seed(15_460)


def test_a_task_that_was_kept_bounds_the_fresh_composite_above_it() -> None:
    assert check_seed(30_546_399)  # found by 100,000 replacements: the engine held the fresh root back


def test_a_branch_that_stops_knows_its_choice_when_others_of_its_nodes_went_elsewhere() -> None:
    assert check_seed(157_374_708, OPTION_EDITS)  # found by 102,000 replacements: a traceback of the engine


def test_a_start_window_that_closes_at_the_horizon_is_part_of_the_comparison() -> None:
    text = f"""(plan :id p :node (task :id a :action act :wait-for-conditions ((database (:k = 1)))
        :start-temporal-conditions ((0 {HORIZON_MS // 1000}))))"""
    plan = check(text).plan
    assert plan is not None
    again = Operator(1_000, Operation.REPLACE, canonical_text(plan))
    check_case(Case(text, {"k": 0}, {}, (again,)), plan)
    assert check_seed(112_517_250, OPTION_EDITS)  # found by the study: the same with an alternate


def test_traces_that_differ_are_told_apart_by_the_first_instant() -> None:
    found = {0: [("start", "a")], 5: [("end", "a")]}
    expected = {0: [("start", "a")], 3: [("retry", "a")], 5: [("end", "b")]}
    assert difference(found, expected) == "at 3 ms the engine has [], the model [('retry', 'a')]"


@pytest.mark.slow
def test_many_random_replacements_keep_the_rules_and_agree_with_the_model() -> None:
    """`python -m studies.replacements` flies ten thousands."""
    assert sum(check_seed(seed) > 0 for seed in range(10_000, 12_000)) >= 1_000
    assert sum(check_seed(seed, OPTION_EDITS) > 0 for seed in range(10_000, 10_400)) >= 200
