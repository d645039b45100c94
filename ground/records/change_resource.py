"""Change members of a resource."""

from __future__ import annotations

from typing import Any

from ground.gdr.repository import Repository
from ground.records.actor import Actor
from ground.records.edit import open_for_change, update
from ground.records.forms import Body
from ground.records.get_resource import find_row, mission_of
from ground.records.kind import Kind, Prepared


def prepare_change(
    repo: Repository, actor: Actor, kind: Kind[Any], resource_id: str, given: Body
) -> tuple[Body, Prepared]:
    """Return the form of a change as it is kept, and what it needs that takes long."""
    with repo.database.read() as session:
        row = find_row(session, kind, resource_id)
        actor.require(kind.edit, mission_of(row))
        given = kind.settle(session, mission_of(row) or "", given)
        return given, kind.prepare(repo, session, row, given)


def change_resource(
    repo: Repository,
    actor: Actor,
    kind: Kind[Any],
    resource_id: str,
    given: Body,
    revision: int | None,
    *,
    reason: str = "",
    prepared: tuple[Body, Prepared] | None = None,
) -> Any:
    """Return the resource after the members that the form names are set.

    `revision` is the one the person saw; None changes whatever stands there (the command line's `--force`).
    `prepared` is what was worked out before, by `prepare_change`.

    Raises
    ------
    StaleRevisionError
        If somebody else changed it in between.
    """
    while True:
        given, ready = prepared or prepare_change(repo, actor, kind, resource_id, given)
        prepared = None
        with repo.database.write() as session:
            row = open_for_change(session, actor, kind, resource_id, revision)
            if row.revision != ready.revision:
                continue  # somebody was faster: what was prepared is of another state
            changed = kind.apply(repo, session, row, given, ready)
            if changed is None:
                continue
            update(session, actor, kind, row, changed.columns, reason=reason)
            for other_kind, other, columns in changed.followers:
                update(session, actor, other_kind, other, columns)
            return kind.show_one(session, row)
