"""What the API takes for signatures."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import StringConstraints

from ground.records.forms import Body, Text


class SignatureCreate(Body):
    """A person's signature in one role; `sha256` is that of the manifest that was read and signed."""

    role: Literal["author", "verifier", "approver"]
    sha256: Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{64}$")]
    key: Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{16}$")]
    signature: Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9+/]{86}==$")]
    note: Text = ""
