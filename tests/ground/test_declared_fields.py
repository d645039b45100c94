"""What a kind declares goes everywhere: into its row, into files of exchange and into archives."""

from __future__ import annotations

import dataclasses
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from pydantic import create_model
from sqlalchemy import JSON, Boolean, Float, Integer, select

from ground.gdr.base import Utc
from ground.gdr.repository import Repository, open_repository
from ground.records.actor import SYSTEM_ACTOR
from ground.resources.geometry_files.site_geometry import (
    EXCHANGED,
    Exchanged,
    read_shapes,
    to_csv,
    to_geojson,
)
from ground.resources.kinds import KINDS
from ground.resources.mission_archives.import_mission import import_mission, quarantined
from ground.resources.mission_archives.mission_archive import RIGHTS, TABLES, export_mission
from ground.resources.tables import METADATA
from ground.resources.targets.bodies import TargetCreate
from ground.resources.targets.value import Target
from tests.ground.conftest import Api, settings_for, yard
from tests.ground.planning import PlannedDay
from tests.ground.test_missions_api import upload

FOUND = {
    "observation_request": {"observation_pose": "observation_point"},
    "target": {"at": "east_m"},
    "keep_out": {"at": "polygon_m"},
}
"""Members that set a column of another name."""

RING = [[6.0, 6.0], [8.0, 6.0], [8.0, 8.5]]


@pytest.mark.parametrize("kind", KINDS.values(), ids=list(KINDS))
def test_what_a_person_may_set_is_kept_in_a_column(kind: Any) -> None:
    columns = set(kind.row.__table__.c.keys())
    for name in kind.fields:
        assert FOUND.get(kind.name, {}).get(name, name) in columns


def sample(kind: str) -> dict[str, Any]:
    """Return members with which every field of an exchanged kind differs from its default."""
    own: dict[str, dict[str, Any]] = {
        "target": {
            "name": "R1",
            "notes": "a, b\nc",
            "source_image": "x.png",
            "feature_type": "float",
            "east_m": 0.1,
            "north_m": -2.5,
            "frame_id": "frm-1",
        },
        "keep_out": {"name": "Pit", "notes": "deep", "polygon_m": RING, "frame_id": "frm-1"},
    }
    return own[kind]


@pytest.mark.parametrize("form", [to_geojson, to_csv])
@pytest.mark.parametrize("kind", EXCHANGED)
def test_every_field_of_an_exchanged_kind_goes_out_and_comes_in(kind: str, form: Any) -> None:
    given = EXCHANGED[kind].make(**sample(kind))
    assert set(sample(kind)) == set(type(given).model_fields) - {"at"}, "the sample has every field"
    (shape,) = read_shapes(form({kind: [value_like(kind, sample(kind))]}))
    assert (shape.kind, shape.given) == (kind, given)


@pytest.mark.parametrize("form", [to_geojson, to_csv])
@pytest.mark.parametrize(
    ("content", "default"), [(3, 0), ("high", ""), (True, False), (2.5, None), (["a", "b"], None)]
)
def test_a_field_added_to_targets_goes_out_and_comes_in(form: Any, content: Any, default: Any) -> None:
    wider = create_model("Wider", __base__=TargetCreate, priority=(type(content) | type(default), default))
    exchanged = {**EXCHANGED, "target": Exchanged(wider, EXCHANGED["target"].place)}
    value = value_like("target", {**sample("target"), "priority": content})
    (shape,) = read_shapes(form({"target": [value]}, exchanged), exchanged)
    assert shape.given == wider(**sample("target"), priority=content)


def value_like(kind: str, members: dict[str, Any]) -> Any:
    """Return a value of a kind with these members, also such as the kind does not have yet."""
    now = datetime(2026, 1, 1, tzinfo=UTC)
    known: dict[str, Any] = {"id": f"{kind}-1", "mission_id": "msn-1", "author": "Planner", "revision": 1}
    known |= {"created_utc": now, "modified_utc": now, "slope_rad": 0.0, "sigma_m": 0.0}
    known |= {"normal": [0.0, 0.0, 1.0], "covariance_m2": [[0.0] * 3] * 3} | members
    fields = {f.name for f in dataclasses.fields(Target)} | set(known) | {"position"}
    if kind == "target":
        known["position"] = dataclasses.make_dataclass("Place", ["east_m", "north_m", "up_m"])(
            known.pop("east_m"), known.pop("north_m"), 1.0
        )
    return dataclasses.make_dataclass("Wide", sorted(fields & set(known)))(**{k: known[k] for k in known})


def test_what_is_tied_to_a_frame_of_the_mission_stays_tied(sqlite_api: Api, terrain_folder: Path) -> None:
    api, mission = sqlite_api, yard(sqlite_api.repo, terrain_folder).id
    frame = api.post(f"/missions/{mission}/frames", {"name": "SITE_FRAME", "counter": [0]})["id"]
    api.post(f"/missions/{mission}/targets", {"east_m": 1.0, "north_m": 2.0, "frame_id": frame})
    api.post(f"/missions/{mission}/keep-outs", {"polygon_m": RING, "frame_id": frame})
    file = api("GET", f"/missions/{mission}/geometry?form=csv").content.replace(b",T1,", b",T2,")
    made = api.post(f"/missions/{mission}/geometry", {"upload_id": upload(api, "g.csv", file)})
    assert [t["frame_id"] for t in made["targets"] + made["keep_outs"]] == [frame, frame]
    other = yard(api.repo, terrain_folder, "Other").id
    made = api.post(f"/missions/{other}/geometry", {"upload_id": upload(api, "g.csv", file)})
    assert [t["frame_id"] for t in made["targets"] + made["keep_outs"]] == [None, None]
    assert all(t["notes"] == f"frame_id: {frame}" for t in made["targets"] + made["keep_outs"])


def other_than(column: Any) -> Any:
    """Return content that a column has from nobody else."""
    match column.type:
        case Utc():
            return datetime(2031, 2, 3, 4, 5, 6, tzinfo=UTC)
        case JSON():
            return None
        case Boolean():
            return True
        case Integer():
            return 7
        case Float():
            return 0.375
    return "x7"


def test_every_column_of_every_table_of_a_mission_survives_its_archive(
    sqlite_planned_day: PlannedDay, tmp_path: Path
) -> None:
    api, mission = sqlite_planned_day.api, sqlite_planned_day.mission
    api.post(f"/missions/{mission.id}/keep-outs", {"polygon_m": RING})
    repo = api.repo
    fixed = {"id", "mission_id", "sha256", "document", "crl_text"}
    with repo.database.write() as session:
        for name in TABLES:
            table = METADATA.tables[name]
            for column in table.c:
                if (
                    column.name in fixed
                    or column.foreign_keys
                    or column.name.endswith(("_sha256", "_id", "_ids"))
                ):
                    continue
                content = other_than(column)
                if content is not None and not any(column.name in u.columns for u in table.constraints):
                    session.execute(table.update().values({column: content}))
    export_mission(repo, SYSTEM_ACTOR, mission.id, tmp_path / "m.zip")
    fresh = open_repository(settings_for(tmp_path / "fresh"))
    from ground.gdr.migrate import migrate

    migrate(fresh.database)
    import_mission(fresh, SYSTEM_ACTOR, tmp_path / "m.zip")
    brought = {
        name: [quarantined(name, row._mapping, SYSTEM_ACTOR.name) for row in kept]
        for name, kept in rows(repo).items()
    }
    there = {name: [dict(row._mapping) for row in kept] for name, kept in rows(fresh).items()}
    for plan in (*there["plans"], *brought["plans"]):
        del plan["findings"]  # of elsewhere: they are computed anew
    assert there == brought
    assert sum(map(len, rows(fresh).values())) > 8
    fresh.database.dispose()


def rows(repo: Repository) -> dict[str, list[Any]]:
    with repo.database.read() as session:
        return {name: session.execute(select(METADATA.tables[name])).all() for name in TABLES}


def test_every_table_with_a_mission_is_in_its_archive(tmp_path: Path) -> None:
    of_missions = {t.name for t in METADATA.sorted_tables if "mission_id" in t.c}
    stays = {"jobs", "counters", "webhooks"}  # webhooks hold secrets of this server
    assert of_missions - stays == {*TABLES, *RIGHTS}
