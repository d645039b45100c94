"""Plans in which two targets are in each other's place."""

from __future__ import annotations

from dataclasses import replace

from planner.evaluate.model import Model
from planner.plan_edits import drivable, exchanged
from planner.plan_tree import (
    Branch,
    DoneCondition,
    Navigate,
    Observe,
    Option,
    Plan,
    TrackedCondition,
    TrackStart,
)
from planner.problem import ObservationId, TargetId
from tests.planner.examples import example, observation

T1, T2, T3 = (TargetId(f"T{k}") for k in (1, 2, 3))
ROWS = [
    [observation("I1"), observation("P1", "place")],
    [observation("P2", "place"), observation("I2")],
    [observation("I3")],
]


def _visit(target: TargetId, image: str, place: str) -> Plan:
    return (Navigate(target), Observe(ObservationId(image), target), Observe(ObservationId(place), target))


def _plan() -> Plan:
    lost = (TrackedCondition(T1, value=False), DoneCondition(ObservationId("I1"), value=True))
    option = Option(lost, (Navigate(T3), Observe(ObservationId("I3"), T3)))
    return (TrackStart(T1), *_visit(T1, "I1", "P1")[:2], Branch((option,)), _visit(T1, "I1", "P1")[2])


def test_targets_are_exchanged_in_lists_and_conditions_and_back_again() -> None:
    model = Model.of(example(observations=ROWS))
    found = exchanged(model, _plan(), T1, T2)
    assert found is not None
    assert found[0] == TrackStart(T2)
    assert found[1:3] == _visit(T2, "I2", "P2")[:2]
    assert found[4] == _visit(T2, "I2", "P2")[2]
    branch = found[3]
    assert isinstance(branch, Branch)
    assert branch.options[0].when == (
        TrackedCondition(T2, value=False), DoneCondition(ObservationId("I2"), value=True)
    )  # fmt: skip
    assert branch.options[0].plan == (Navigate(T3), Observe(ObservationId("I3"), T3))
    assert exchanged(model, found, T2, T1) == _plan()


def test_targets_that_offer_other_observations_are_not_exchanged() -> None:
    assert exchanged(Model.of(example(observations=ROWS)), _plan(), T1, T3) is None


def test_what_no_leg_leads_to_is_not_exchanged() -> None:
    problem = example(observations=ROWS)
    legs = tuple(leg for leg in problem.legs if (leg.origin, leg.to) != ("T2", "T3"))
    model = Model.of(replace(problem, legs=legs))
    assert drivable(model, _plan())
    assert exchanged(model, _plan(), T1, T2) is None
