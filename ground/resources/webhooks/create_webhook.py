"""Make a webhook, give it a new secret, list what it sent, send an event again."""

from __future__ import annotations

from datetime import timedelta

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from ground.errors import NotFoundError, StateError
from ground.gdr.base import utc_now
from ground.gdr.history import ChainRow, Change, EventRow, record
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.edit import insert, new_row
from ground.records.get_resource import find_row, require_mission
from ground.resources.webhooks.bodies import Redelivery, WebhookCreate
from ground.resources.webhooks.kind import WEBHOOK
from ground.resources.webhooks.message import message_id, type_of
from ground.resources.webhooks.row import WebhookDeliveryRow, WebhookRow, WebhookStateRow
from ground.resources.webhooks.rules import place_of
from ground.resources.webhooks.signature import new_secret
from ground.resources.webhooks.value import Deliveries, Delivery, DeliveryState, NewSecret

MOST = 20
"""Webhooks of a mission: each is looked after by itself."""
OLD_SECRET = timedelta(hours=24)
"""How long the secret before signs too after a rotation, so that a receiver can be changed in between."""
SHOWN = 100
"""Deliveries that are listed."""


def create_webhook(repo: Repository, actor: Actor, mission_id: str, given: WebhookCreate) -> NewSecret:
    """Return a new webhook's id and secret; it is told of what happens from now on.

    Raises
    ------
    ForbiddenError
        If a narrowed API key asks: a webhook would outlive it.
    InvalidInputError
        If it may not lead where it is to lead.
    StateError
        If the mission has too many.
    """
    actor.require(Action.EDIT_MISSION, mission_id)
    actor.require_person()
    place_of(given.url, repo.settings.hook_hosts)
    with repo.database.write() as session:
        require_mission(session, mission_id)
        row = new_row(WEBHOOK, actor, mission_id, given)
        insert(session, actor, WEBHOOK, row)
        if (session.scalar(select(func.count()).where(WebhookRow.mission_id == mission_id)) or 0) > MOST:
            raise StateError(f"mission {mission_id} has {MOST} webhooks; delete one first")
        secret = new_secret()
        session.add(WebhookStateRow(webhook_id=row.id, secret=secret, position=_head(session, mission_id)))
        return NewSecret(row.id, secret)


def rotate_secret(repo: Repository, actor: Actor, webhook_id: str) -> NewSecret:
    """Return a webhook's new secret; for a day messages carry a signature by the one before too."""
    actor.require_person()
    with repo.database.write() as session:
        row = find_row(session, WEBHOOK, webhook_id, lock=True)
        actor.require(Action.EDIT_MISSION, row.mission_id)
        secret, state = new_secret(), session.get(WebhookStateRow, webhook_id)
        if state is None:  # it came from a backup
            position = _head(session, row.mission_id)
            session.add(WebhookStateRow(webhook_id=webhook_id, secret=secret, position=position))
        else:
            state.old_secret, state.old_until_utc = state.secret, utc_now() + OLD_SECRET
            state.secret = secret
        record(session, row.mission_id, Change(actor.name, "rotate", "webhook", webhook_id, None, None))
        return NewSecret(webhook_id, secret)


def list_deliveries(repo: Repository, actor: Actor, webhook_id: str) -> Deliveries:
    """Return what became of the last events, the newest first."""
    with repo.database.read() as session:
        row = find_row(session, WEBHOOK, webhook_id)
        actor.require(Action.READ, row.mission_id)
        query = select(WebhookDeliveryRow).where(WebhookDeliveryRow.webhook_id == webhook_id)
        found = session.scalars(query.order_by(WebhookDeliveryRow.event.desc()).limit(SHOWN))
        state = session.get(WebhookStateRow, webhook_id)
        trouble = "it has no secret here; rotate it" if state is None else state.trouble
        return Deliveries(trouble, [delivery_of(sent) for sent in found])


def redeliver(repo: Repository, actor: Actor, webhook_id: str, given: Redelivery) -> Delivery:
    """Have an event sent once more, beside the order of the others.

    Raises
    ------
    NotFoundError
        If the mission has no such event.
    StateError
        If its turn has not come yet, or the webhook has no secret.
    """
    with repo.database.write() as session:
        row = find_row(session, WEBHOOK, webhook_id, lock=True)
        actor.require(Action.EDIT_MISSION, row.mission_id)
        event = session.get(EventRow, (row.mission_id, given.event))
        if event is None:
            raise NotFoundError(f"mission {row.mission_id} has no event {given.event}")
        state = session.get(WebhookStateRow, webhook_id, with_for_update=True)
        if state is None or event.seq > state.position:
            why = "it has no secret here; rotate it" if state is None else f"it is at event {state.position}"
            raise StateError(f"webhook {webhook_id} cannot send event {event.seq} again: {why}")
        sent = session.get(WebhookDeliveryRow, (webhook_id, event.seq))
        if sent is None:
            sent = WebhookDeliveryRow(webhook_id=webhook_id, event=event.seq, type=type_of(event), attempts=0)
            session.add(sent)
        sent.state, sent.status, sent.detail = DeliveryState.QUEUED.value, None, f"asked for by {actor.name}"
        sent.at_utc = sent.next_utc = utc_now()
        session.flush()
        return delivery_of(sent)


def delivery_of(row: WebhookDeliveryRow) -> Delivery:
    """Return what is told of a delivery."""
    return Delivery(
        row.event,
        message_id(row.webhook_id, row.event),
        row.type,
        DeliveryState(row.state),
        row.attempts,
        row.status,
        row.detail,
        row.at_utc,
        row.next_utc,
    )


def _head(session: Session, mission_id: str) -> int:
    return int(session.scalar(select(ChainRow.seq).where(ChainRow.id == mission_id)) or 0)
