"""List resources of one kind, a page at a time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.get_resource import require_mission
from ground.records.kind import Kind
from ground.records.paging import Page, decode_cursor, encode_cursor


def list_resources(
    repo: Repository,
    actor: Actor,
    kind: Kind[Any],
    mission_id: str | None,
    *,
    limit: int,
    cursor: str | None,
    where: Mapping[str, object] | None = None,
) -> Page:
    """Return one page in the order in which the resources were made.

    `where` holds columns with the value they must have; those that are None do not count. `orphan` stands
    for products without a request.
    """
    actor.require(Action.READ, mission_id)
    column = kind.row.__table__.c
    query = kind.shown().order_by(column.id).limit(limit + 1)
    if mission_id is not None:
        query = query.where(column.mission_id == mission_id)
    if cursor is not None:
        query = query.where(column.id > decode_cursor(cursor))
    for name, value in (where or {}).items():
        if value is None:
            continue
        if name == "orphan":
            query = query.where(column.request_id.is_(None) if value else column.request_id.is_not(None))
        else:
            query = query.where(column[name] == value)
    with repo.database.read() if kind.related else repo.database.connection() as reader:
        rows: list[Any] = list(reader.execute(query))
        if not rows and mission_id is not None:
            require_mission(reader, mission_id)
        more = len(rows) > limit
        rows = rows[:limit]
        return Page(kind.show(reader, rows), encode_cursor(rows[-1].id) if more else None)
