"""Read what archives say was done elsewhere."""

from __future__ import annotations

from sqlalchemy import select

from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.get_resource import require_mission
from ground.records.show import value_of
from ground.resources.missions.row import ElsewhereRow
from ground.resources.missions.value import Elsewhere


def read_elsewhere(repo: Repository, actor: Actor, mission_id: str) -> list[Elsewhere]:
    """Return one document for each archive that a mission came from, oldest first."""
    actor.require(Action.READ, mission_id)
    with repo.database.read() as session:
        require_mission(session, mission_id)
        query = select(ElsewhereRow).where(ElsewhereRow.mission_id == mission_id).order_by(ElsewhereRow.id)
        return [value_of(Elsewhere, row) for row in session.scalars(query)]
