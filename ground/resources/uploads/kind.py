"""How uploads are stored and shown."""

from __future__ import annotations

from ground.records.actor import Action
from ground.records.kind import Kind
from ground.resources.uploads.row import UploadRow
from ground.resources.uploads.value import Upload

UPLOAD = Kind(
    "upload",
    "upl",
    "uploads",
    UploadRow,
    Upload,
    Action.EDIT_SCIENCE,
)
