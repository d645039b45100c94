"""Three-valued conditions: the tables of the language, and the engine's form against the plain one."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from executive.crl import parse
from executive.crl.checks.satisfiability import (
    database_key,
    evaluate,
    evaluate_all,
    gap,
    implies,
    satisfiable,
)
from executive.crl.values import Condition, Conditions, Value
from executive.engine.compile_plan import compile_guard
from tests import strategies

DATABASE: dict[str, Value] = {"n": 5, "w": "tracked", "b": True, "trackerstate Rock1": "lost", "k 3": 0}


def conditions(text: str) -> Conditions:
    return parse(f"(task :id a :action x :start-conditions ({text}))").node.start_conditions


@pytest.mark.parametrize(
    ("text", "truth"),
    [
        ("", True),
        ("(database (:n = 5))", True),
        ("(database (:n /= 5.0))", False),
        ("(database (:n < 5))", False),
        ("(database (:n <= 5))", True),
        ("(database (:n = :five))", None),
        ("(database (:n = t))", None),
        ("(database (:w = tracked))", True),
        ('(database (:w /= "lost"))', True),
        ("(database (:w > 5))", None),
        ("(database (:b = true))", True),
        ("(database (:b = nil))", False),
        ("(database (:b = 1))", None),
        ("(database (:gone = 1))", None),
        ("(not (database (:gone = 1)))", None),
        ("(known (:gone))", False),
        ("(not (known (:gone)))", True),
        ('(database (:trackerstate "Rock1" = :lost))', True),
        ("(database (:k 3.0 = 0))", True),
        ("(and)", True),
        ("(or)", False),
        ("(and (database (:gone = 1)) (database (:n = 6)))", False),
        ("(and (database (:gone = 1)) (database (:n = 5)))", None),
        ("(or (database (:gone = 1)) (database (:n = 5)))", True),
        ("(or (database (:gone = 1)) (database (:n = 6)))", None),
        ("(database (:n = 5)) (database (:gone = 1))", None),
    ],
)
def test_truth_of_conditions(text: str, truth: bool | None) -> None:
    found = conditions(text)
    assert evaluate_all(found, DATABASE.get) is truth
    guard = compile_guard(found)
    assert (True if guard is None else guard.ask(DATABASE)) is truth


@settings(max_examples=200, deadline=None)
@given(
    strategies.conditions(),
    st.dictionaries(
        st.sampled_from(["soc", "tilt", "novelty", "battery-energy", "trackerstate", "trackerstate Rock1"]),
        st.one_of(st.integers(-3, 3), st.booleans(), st.sampled_from(["tracked", "lost"])),
    ),
)
def test_the_engine_asks_as_the_language_means(condition: Condition, database: dict[str, Value]) -> None:
    given_time = {**database, "time": 7}
    guard = compile_guard((condition,))
    assert guard is not None
    assert guard.ask(given_time) is evaluate(condition, given_time.get)


def test_keys_are_spelled_with_blanks_and_shortest_numbers() -> None:
    assert database_key("trackerstate", ("Rock1",)) == "trackerstate Rock1"
    assert database_key("pose", ("x", 2.50, 3.0)) == "pose x 2.5 3"


def test_questions_about_conditions_are_decided_by_cases() -> None:
    low, high = conditions("(database (:n < 5))"), conditions("(database (:n > 5))")
    assert satisfiable((*low, *high)) is False
    assert satisfiable(low) is True
    assert implies(conditions("(database (:n < 4))"), low) is True
    assert implies(low, conditions("(database (:n < 4))")) is False
    assert gap([low, high, conditions("(not (known (:n)))"), conditions("(database (:n = 5))")]) is False
    assert gap([low, high, conditions("(not (known (:n)))")]) == {"n": 5}


def test_too_many_cases_are_not_decided() -> None:
    many = conditions(" ".join(f"(database (:k{i} = 1))" for i in range(12)))
    assert satisfiable(many) is None
