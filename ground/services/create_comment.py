"""Remark on a resource."""

from __future__ import annotations

from ground.errors import InvalidInputError, NotFoundError
from ground.gdr import values as v
from ground.gdr.ids import new_id
from ground.gdr.models import CommentRow, MissionRow
from ground.gdr.repository import Repository
from ground.services.actor import Action, Actor
from ground.services.edit import insert
from ground.services.get_resource import mission_of
from ground.services.kinds import KINDS
from ground.services.views import show_comments


def create_comment(
    repo: Repository, actor: Actor, mission_id: str, *, subject_kind: str, subject_id: str, text: str
) -> v.Comment:
    """Return a new comment on a resource of the mission."""
    actor.require(Action.COMMENT, mission_id)
    with repo.database.write() as session:
        if session.get(MissionRow, mission_id) is None:
            raise NotFoundError(f"there is no mission {mission_id}")
        kind = KINDS.get(subject_kind)
        subject = None if kind is None else session.get(kind.row, subject_id)
        if subject is None or mission_of(subject) != mission_id:
            raise InvalidInputError(
                f"there is no {subject_kind} {subject_id} in mission {mission_id}", pointer="/subject_id"
            )
        row = CommentRow(
            id=new_id("cmt"),
            author=actor.name,
            mission_id=mission_id,
            subject_kind=subject_kind,
            subject_id=subject_id,
            text=text,
        )
        insert(session, actor, KINDS["comment"], row)
        return show_comments(session, [row])[0]
