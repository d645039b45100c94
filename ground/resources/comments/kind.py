"""How comments are stored and shown."""

from __future__ import annotations

from collections.abc import Sequence

from ground.records.actor import Action
from ground.records.kind import Kind
from ground.records.show import value_of
from ground.resources.comments.bodies import CommentChange, CommentCreate
from ground.resources.comments.row import CommentRow
from ground.resources.comments.value import Comment


def show_comments(_session: object, rows: Sequence[CommentRow]) -> list[Comment]:
    return [value_of(Comment, r) for r in rows]


COMMENT = Kind(
    "comment",
    "comment",
    "cmt",
    "comments",
    CommentRow,
    show_comments,
    Action.COMMENT,
    make=CommentCreate,
    change=CommentChange,
)
