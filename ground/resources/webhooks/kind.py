"""How webhooks are stored and shown."""

from __future__ import annotations

from typing import Any

from ground.gdr.repository import Repository
from ground.records.actor import Action
from ground.records.kind import Changed, Kind, Prepared, given_columns
from ground.resources.webhooks.bodies import WebhookChange, WebhookCreate
from ground.resources.webhooks.row import WebhookRow
from ground.resources.webhooks.rules import place_of
from ground.resources.webhooks.value import Webhook


def _apply(
    repo: Repository, _session: object, _row: object, given: WebhookChange, _prepared: Prepared
) -> Changed:
    if "url" in given.model_fields_set:
        place_of(given.url, repo.settings.hook_hosts)
    return Changed(given_columns(given))


WEBHOOK: Kind[Any] = Kind(
    "webhook",
    "whk",
    "webhooks",
    WebhookRow,
    Webhook,
    Action.EDIT_MISSION,
    make=WebhookCreate,
    change=WebhookChange,
    apply=_apply,
)
