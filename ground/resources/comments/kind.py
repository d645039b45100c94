"""How comments are stored and shown."""

from __future__ import annotations

from ground.records.actor import Action
from ground.records.kind import Kind
from ground.resources.comments.bodies import CommentChange, CommentCreate
from ground.resources.comments.row import CommentRow
from ground.resources.comments.value import Comment

COMMENT = Kind(
    "comment",
    "cmt",
    "comments",
    CommentRow,
    Comment,
    Action.COMMENT,
    make=CommentCreate,
    change=CommentChange,
)
