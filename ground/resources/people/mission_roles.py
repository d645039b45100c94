"""Roles of people in single missions."""

from __future__ import annotations

from sqlalchemy import Text, cast, select
from sqlalchemy.orm import Session

from ground.records.actor import Actor, Role
from ground.records.edit import update
from ground.resources.people.kind import PERSON
from ground.resources.people.row import PersonRow


def inherit_roles(session: Session, actor: Actor, from_mission_id: str, to_mission_id: str) -> None:
    """Let a mission that is made of another be seen by whoever may see that one, and by nobody else.

    From whom the first is hidden, the second is too; whose general role sees nothing keeps their role of the
    first. All others have their general role in it.
    """
    named = cast(PersonRow.mission_roles, Text).contains(from_mission_id)
    query = select(PersonRow).where(named).order_by(PersonRow.id).with_for_update()
    query = query.execution_options(populate_existing=True)
    for person in session.scalars(query).all():  # all rows are locked before the history is
        given = person.mission_roles.get(from_mission_id)
        if given is not None and Role.NONE.value in {given, person.role}:
            roles = {**person.mission_roles, to_mission_id: given}
            update(session, actor, PERSON, person, {"mission_roles": roles})
