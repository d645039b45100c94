"""Change members of a resource."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ground.errors import InvalidInputError
from ground.gdr.repository import Repository
from ground.records.actor import Actor
from ground.records.edit import open_for_change, update
from ground.records.get_resource import find_row, mission_of
from ground.records.kind import Kind


def change_resource(
    repo: Repository,
    actor: Actor,
    kind: Kind,
    resource_id: str,
    changes: Mapping[str, Any],
    revision: int | None,
    *,
    reason: str = "",
) -> Any:
    """Return the resource after the change.

    `revision` is the one the person saw; None changes whatever stands there (the command line's `--force`).

    Raises
    ------
    StaleRevisionError
        If somebody else changed it in between.
    """
    wrong = set(changes) - kind.fields
    while True:
        with repo.database.read() as session:
            row = find_row(session, kind, resource_id)
            actor.require(kind.edit, mission_of(row))
            prepared = kind.prepare(repo, session, row, {} if wrong else changes)
        with repo.database.write() as session:
            row = open_for_change(session, actor, kind, resource_id, revision)
            if wrong:
                raise InvalidInputError(f"{kind.title} has nothing to set called {sorted(wrong)[0]!r}")
            if row.revision != prepared.revision:
                continue  # somebody was faster: what was prepared is of another state
            changed = kind.apply(repo, session, row, changes, prepared)
            if changed is None:
                continue
            update(session, actor, kind, row, changed.columns, reason=reason)
            for other_kind, other, columns in changed.followers:
                update(session, actor, other_kind, other, columns)
            return kind.show(session, [row])[0]
