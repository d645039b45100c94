"""What follows from a kind's declarations: its form of change, its values, its endpoints."""

from __future__ import annotations

from dataclasses import fields
from types import SimpleNamespace
from typing import Any

import pytest
from pydantic import ValidationError

from ground.api.resource_routes import resource_routes
from ground.gdr.geometry import Pose
from ground.records.show import value_of
from ground.resources.keep_outs.kind import KEEP_OUT
from ground.resources.kinds import KINDS
from ground.resources.observation_requests.bodies import ObservationRequestChange, ObservationRequestCreate
from ground.resources.observation_requests.value import ObservationPoint
from ground.resources.sols.bodies import SolChange
from ground.resources.sols.value import CommunicationPass, Sol
from ground.resources.targets.bodies import TargetChange


def test_a_form_of_change_has_the_members_of_the_form_of_making_but_those_named() -> None:
    made, changed = set(ObservationRequestCreate.model_fields), set(ObservationRequestChange.model_fields)
    assert made - changed == {"target_id", "target"}
    assert changed - made == {"state"}
    assert ObservationRequestChange().model_fields_set == set()
    assert all(not member.is_required() for member in ObservationRequestChange.model_fields.values())


@pytest.mark.parametrize(
    ("form", "given"),
    [
        (ObservationRequestChange, {"value": -1.0}),
        (ObservationRequestChange, {"target_id": "tgt-1"}),
        (ObservationRequestChange, {"tracked": None}),
        (ObservationRequestChange, {"notes": None}),
        (ObservationRequestChange, {"window_s": [1.0]}),
        (TargetChange, {"name": None}),
        (TargetChange, {"east_m": 1e6}),
        (SolChange, {"start_pose": None}),
        (SolChange, {"number": -1}),
    ],
)
def test_a_form_of_change_keeps_the_bounds_of_the_form_of_making(form: Any, given: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        form(**given)


def test_a_member_that_may_be_null_may_be_set_to_null() -> None:
    assert ObservationRequestChange(window_s=None).model_fields_set == {"window_s"}
    assert TargetChange(frame_id=None).model_fields_set == {"frame_id"}


def test_columns_become_what_the_members_of_the_value_are() -> None:
    row = SimpleNamespace(**dict.fromkeys((field.name for field in fields(Sol)), None))
    row.start_pose = {"east_m": 1, "north_m": 2.0, "heading_rad": 0.5}
    row.passes = [{"name": "noon", "start_s": 0.0, "end_s": 60.0, "data_mbit": 8.0}]
    sol = value_of(Sol, row)
    assert sol.start_pose == Pose(1.0, 2.0, 0.5)
    assert sol.passes == [CommunicationPass("noon", 0.0, 60.0, 8.0)]
    row.passes = None
    assert value_of(Sol, row).passes == []


def test_a_document_within_a_document_becomes_a_value_too() -> None:
    place = {"pose": {"east_m": 0.0, "north_m": 0.0, "heading_rad": 0.0}, "reachable": True, "manual": False}
    row = SimpleNamespace(**place, reason="")
    assert value_of(ObservationPoint, row).pose == Pose(0.0, 0.0, 0.0)


def test_a_kind_has_the_endpoints_of_which_it_is_said_what_they_are_for() -> None:
    router = resource_routes(KEEP_OUT, "keep-outs", reads="Read one.", deletes="Delete one.")
    assert [(route.name, sorted(route.methods)) for route in router.routes] == [  # type: ignore[attr-defined]
        ("get_keep_out", ["GET"]),
        ("delete_keep_out", ["DELETE"]),
    ]
    assert [route.description for route in router.routes] == ["Read one.", "Delete one."]  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", sorted(KINDS))
def test_every_member_of_a_value_is_a_column_or_is_said_by_its_kind(name: str) -> None:
    kind = KINDS[name]
    columns = set(kind.row.__table__.c.keys()) - kind.unseen
    rest = {field.name for field in fields(kind.value)} - columns - set(kind.computed)
    assert not rest or kind.related is not None, rest
