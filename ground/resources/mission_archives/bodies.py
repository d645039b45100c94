"""What the API takes for missions as archives and as copies."""

from __future__ import annotations

from ground.records.forms import Body, Id, LongName, Text


class MissionCopy(Body):
    """A copy of a mission with its sols, targets, requests, keep-outs (and plans if wanted)."""

    name: LongName
    notes: Text = ""


class ArchiveImport(Body):
    upload_id: Id
    name: LongName | None = None
