"""List resources of one kind, a page at a time."""

from __future__ import annotations

from collections.abc import Mapping

from sqlalchemy import select

from ground.errors import NotFoundError
from ground.gdr import models as m
from ground.gdr.repository import Repository
from ground.services.actor import Action, Actor
from ground.services.kinds import KINDS, Page, decode_cursor, encode_cursor


def list_resources(
    repo: Repository,
    actor: Actor,
    kind_name: str,
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
    kind = KINDS[kind_name]
    actor.require(Action.READ, mission_id)
    with repo.database.read() as session:
        query = select(kind.row).order_by(kind.row.id).limit(limit + 1)
        if mission_id is not None:
            if session.get(m.MissionRow, mission_id) is None:
                raise NotFoundError(f"there is no mission {mission_id}")
            query = query.where(kind.row.__table__.c.mission_id == mission_id)
        if cursor is not None:
            query = query.where(kind.row.id > decode_cursor(cursor))
        for column, value in (where or {}).items():
            if value is None:
                continue
            if column == "orphan":
                is_orphan = m.ProductRow.request_id.is_(None)
                query = query.where(is_orphan if value else ~is_orphan)
            else:
                query = query.where(getattr(kind.row, column) == value)
        rows = list(session.scalars(query))
        more = len(rows) > limit
        rows = rows[:limit]
        return Page(kind.show(session, rows), encode_cursor(rows[-1].id) if more else None)
