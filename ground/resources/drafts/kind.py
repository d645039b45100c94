"""How drafts are stored and shown."""

from __future__ import annotations

from ground.records.actor import Action
from ground.records.kind import Kind
from ground.resources.drafts.bodies import DraftCreate
from ground.resources.drafts.row import DraftRow
from ground.resources.drafts.value import Draft

DRAFT = Kind("draft", "dft", "drafts", DraftRow, Draft, Action.DRAFT, make=DraftCreate)
