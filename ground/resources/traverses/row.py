"""Tables of traverses."""

from __future__ import annotations

from typing import Any, TypedDict

from sqlalchemy.orm import Mapped, mapped_column

from ground.gdr.base import JsonObject, Notes, Row, Text40, Text200, mission_column


class StoredPicture(TypedDict):
    """What a stop saw: the hash of the image in the file store."""

    sha256: str


class AdjustedStop(TypedDict):
    """A stop in a `localization/1` document."""

    picture: StoredPicture


class Localization(TypedDict):
    """What the ground itself reads of a `localization/1` document."""

    stops: list[AdjustedStop]


class TraverseRow(Row):
    """Stops of recorded runs that were adjusted together: a job's result."""

    __tablename__ = "traverses"

    mission_id: Mapped[str] = mission_column()
    name: Mapped[Text200]
    notes: Mapped[Notes]
    job_id: Mapped[Text40]
    stops: Mapped[list[Any]]
    """Frame and source of each, in the order driven."""
    document: Mapped[Localization | None] = mapped_column(JsonObject(none_as_null=True))
    """`localization/1`, with the pictures; null while it is computed."""
    solution_ids: Mapped[list[Any]]
