"""What the API takes for approvals, waivers and flight rules."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from ground.records.forms import Body, Name, Text


class WaiverCreate(Body):
    rule: Name
    reason: Annotated[Text, Field(min_length=1)]
