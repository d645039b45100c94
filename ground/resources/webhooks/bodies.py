"""What the API takes for webhooks."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from ground.records.forms import ONE_LINE, Body, Flag, Name

EventKind = Literal[
    "mission",
    "sol",
    "target",
    "observation_request",
    "keep_out",
    "frame",
    "site_map",
    "traverse",
    "path_network",
    "plan",
    "run",
    "campaign",
    "product",
    "approval",
    "comment",
    "draft",
    "webhook",
]


class WebhookCreate(Body):
    name: Name
    url: Annotated[
        str,
        Field(
            min_length=9,
            max_length=500,
            pattern=ONE_LINE,
            description="https, at a host of OUTCROP_WEBHOOK_HOSTS; everybody in the mission can read it",
            examples=["https://hooks.example.org/outcrop"],
        ),
    ]
    kinds: Annotated[list[EventKind], Field(max_length=30, description="empty for all")] = Field(
        default_factory=list
    )
    active: Flag = True


class WebhookChange(WebhookCreate, partial=True, never_null={"kinds", "active"}):
    pass


class Redelivery(Body):
    event: Annotated[int, Field(strict=True, ge=1, le=2**53, description="its number in the history")]
