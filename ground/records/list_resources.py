"""List resources of one kind, a page at a time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sqlalchemy import ColumnElement, func, select

from ground.errors import InvalidInputError
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.get_resource import require_mission
from ground.records.kind import Kind
from ground.records.paging import Order, Page
from ground.records.scalars import sortable


def list_resources(
    repo: Repository,
    actor: Actor,
    kind: Kind[Any],
    mission_id: str | None,
    *,
    limit: int,
    cursor: str | None,
    where: Mapping[str, object] | None = None,
    sort: str | None = None,
    count: bool = False,
    crs: str | None = None,
) -> Page:
    """Return one page, in the order in which the resources were made or by the member that `sort` names.

    `where` holds columns with the value they must have; those that are None do not count. `orphan` stands
    for products without a request. With `count` the page says how many there are in all. With `crs` they
    tell where they lie in that reference too.

    Raises
    ------
    InvalidInputError
        If they cannot be sorted so, the cursor is not of this list, or the reference is of no use here.
    """
    actor.require(Action.READ, mission_id)
    order, wanted = _order(kind, sort), _wanted(actor, kind, mission_id, where or {})
    query = order.put(kind.shown().where(*wanted)).limit(limit + 1)
    if cursor is not None:
        query = query.where(order.behind(cursor))
    with repo.database.read() if kind.related or count else repo.database.connection() as reader:
        rows: list[Any] = list(reader.execute(query))
        if not rows and mission_id is not None:
            require_mission(reader, mission_id)
        more = len(rows) > limit
        rows = rows[:limit]
        total = None
        if count:
            total = reader.scalar(
                select(func.count()).select_from(kind.row.__table__).where(*kind.there, *wanted)
            )
        shown = [kind.conceal(actor, value) for value in kind.show(reader, rows)]
        if crs is not None and kind.locate is not None:
            shown = kind.locate(reader, mission_id, shown, crs)
        return Page(shown, order.cursor(rows[-1]) if more else None, total)


def _order(kind: Kind[Any], sort: str | None) -> Order:
    """Return the order that a word such as `name` or `-created_utc` means."""
    identifier = kind.row.__table__.c.id
    word = sort or "id"
    name = word.removeprefix("-")
    columns = sortable(kind)
    if name not in columns:
        raise InvalidInputError(
            f"{kind.title}s cannot be sorted by {name[:40]!r}; they can by {', '.join(columns)}",
            pointer="sort",
        )
    return Order(name, columns[name], identifier, word.startswith("-"))


def _wanted(
    actor: Actor, kind: Kind[Any], mission_id: str | None, where: Mapping[str, object]
) -> list[ColumnElement[bool]]:
    """Return the conditions of a list."""
    column = kind.row.__table__.c
    found: list[ColumnElement[bool]] = [] if mission_id is None else [column.mission_id == mission_id]
    if mission_id is None and kind.row.mission_key in column and not actor.sees_all:
        mission = column[kind.row.mission_key]
        only, hidden = actor.visible_missions()
        found.append(mission.not_in(hidden) if only is None else mission.in_(only))
    found += [column[name] == value for name, value in kind.only(actor).items()]
    for name, value in where.items():
        if value is None:
            continue
        if name == "orphan":
            found.append(column.request_id.is_(None) if value else column.request_id.is_not(None))
        else:
            found.append(column[name] == value)
    return found
