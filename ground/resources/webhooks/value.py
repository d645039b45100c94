"""Webhooks, and what was sent by them."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum

from ground.records.stored import OfMission


@dataclass(frozen=True, slots=True)
class Webhook(OfMission):
    """A server elsewhere that is told of a mission's events, for its author, who has to see the mission."""

    name: str
    url: str
    kinds: list[str]
    """Kinds of resource whose events are sent; empty for all."""
    active: bool


@dataclass(frozen=True, slots=True)
class NewSecret:
    """A webhook and its secret, which is shown this once."""

    id: str
    secret: str


class DeliveryState(StrEnum):
    """What became of an event that was to be sent."""

    DELIVERED = "delivered"
    RETRYING = "retrying"
    GIVEN_UP = "given_up"
    QUEUED = "queued"
    """Sent again by hand as soon as the worker comes to it."""


@dataclass(frozen=True, slots=True)
class Delivery:
    """What became of an event of a mission at a webhook."""

    event: int
    """Its number in the mission's history."""
    message_id: str
    """Sent as `webhook-id`: the same each time that the event is sent."""
    type: str
    state: DeliveryState
    attempts: int
    status: int | None
    """Of the last answer; null if there was none."""
    detail: str
    at_utc: datetime
    next_utc: datetime | None
    """When it is tried again."""


@dataclass(frozen=True, slots=True)
class Deliveries:
    """The last deliveries of a webhook, the newest event first, and why none goes on if that is so."""

    trouble: str
    items: list[Delivery]
