"""How uploads are stored and shown."""

from __future__ import annotations

from collections.abc import Sequence

from ground.records.actor import Action
from ground.records.kind import Kind
from ground.records.show import value_of
from ground.resources.uploads.row import UploadRow
from ground.resources.uploads.value import Upload


def show_uploads(_session: object, rows: Sequence[UploadRow]) -> list[Upload]:
    return [value_of(Upload, r) for r in rows]


UPLOAD = Kind("upload", "upload", "upl", "uploads", UploadRow, show_uploads, Action.EDIT_SCIENCE)
