"""Remark on a resource."""

from __future__ import annotations

from ground.errors import InvalidInputError
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.edit import insert
from ground.records.get_resource import mission_of, require_mission
from ground.records.kind import Kind
from ground.resources.comments.kind import COMMENT, show_comments
from ground.resources.comments.row import CommentRow
from ground.resources.comments.value import Comment


def create_comment(
    repo: Repository, actor: Actor, mission_id: str, subject: Kind, *, subject_id: str, text: str
) -> Comment:
    """Return a new comment on a resource of the mission."""
    actor.require(Action.COMMENT, mission_id)
    with repo.database.write() as session:
        require_mission(session, mission_id)
        row = session.get(subject.row, subject_id)
        if row is None or mission_of(row) != mission_id:
            raise InvalidInputError(
                f"there is no {subject.name} {subject_id} in mission {mission_id}", pointer="/subject_id"
            )
        row = CommentRow(
            id=new_id("cmt"),
            author=actor.name,
            mission_id=mission_id,
            subject_kind=subject.name,
            subject_id=subject_id,
            text=text,
        )
        insert(session, actor, COMMENT, row)
        return show_comments(session, [row])[0]
