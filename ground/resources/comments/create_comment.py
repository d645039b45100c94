"""Remark on a resource."""

from __future__ import annotations

from typing import Any

from ground.errors import InvalidInputError
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.edit import insert, new_row
from ground.records.get_resource import require_mission, row_in_mission
from ground.records.kind import Kind
from ground.resources.comments.bodies import CommentCreate
from ground.resources.comments.kind import COMMENT
from ground.resources.comments.value import Comment


def create_comment(
    repo: Repository, actor: Actor, mission_id: str, subject: Kind[Any], given: CommentCreate
) -> Comment:
    """Return a new comment on a resource of the mission.

    Raises
    ------
    InvalidInputError
        If a part is named of something other than a plan, or there is no such resource.
    """
    actor.require(Action.COMMENT, mission_id)
    if given.part is not None and given.subject_kind != "plan":
        raise InvalidInputError("only a plan has parts to comment: its steps", pointer="/part")
    with repo.database.write() as session:
        require_mission(session, mission_id)
        row_in_mission(session, subject, given.subject_id, mission_id, "/subject_id")
        row = new_row(COMMENT, actor, mission_id, given)
        insert(session, actor, COMMENT, row)
        return COMMENT.show_one(session, row)
