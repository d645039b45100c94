"""Delete a resource."""

from __future__ import annotations

from typing import Any

from ground.gdr.repository import Repository
from ground.records.actor import Actor
from ground.records.edit import open_for_change, remove
from ground.records.kind import Kind


def delete_resource(
    repo: Repository,
    actor: Actor,
    kind: Kind[Any],
    resource_id: str,
    revision: int | None,
    *,
    reason: str = "",
) -> None:
    """Delete a resource and what goes with it, all in one undoable act.

    Raises
    ------
    StateError
        If something rests on it: a sol with plans, a plan that was approved or has runs.
    """
    if kind.delete is not None:
        actor.require(kind.delete, resource_id)
    with repo.database.write() as session:
        row = open_for_change(session, actor, kind, resource_id, revision)
        for forget in kind.forget:
            forget(session, actor, row, reason)
        remove(session, actor, kind, row, reason=reason)
