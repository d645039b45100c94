"""What the API takes for approvals, waivers and flight rules."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, StringConstraints

from ground.records.forms import Body, Name, Text


class ApprovalCreate(Body):
    """The second person's word; `crl_sha256` says which text was read."""

    crl_sha256: Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{64}$")]
    note: Text = ""


class WaiverCreate(Body):
    rule: Name
    reason: Annotated[Text, Field(min_length=1)]
