"""What the API takes for people, their sessions and keys."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from pydantic import BaseModel, Field, StringConstraints

from ground.records.actor import Role
from ground.records.forms import Body, Flag, Id, Name, unset
from ground.resources.people.value import Person


class SessionCreate(Body):
    """Log in; with `OUTCROP_AUTH=profiles` the password stays empty."""

    name: Name
    password: Annotated[str, StringConstraints(max_length=1000)] = ""


class SessionValue(BaseModel):
    """Who one is; `csrf_token` goes into the header X-CSRF-Token of every change made with the cookie."""

    person: Person | None
    csrf_token: str
    auth: str


class PersonCreate(Body):
    name: Name
    role: Role = Role.VIEWER
    password: Annotated[str, StringConstraints(min_length=8, max_length=1000)] | None = None


class PersonChange(Body):
    role: Role = Field(default_factory=unset)
    mission_roles: dict[Id, Role] = Field(default_factory=unset)
    active: Flag = Field(default_factory=unset)


class ApiKeyCreate(Body):
    name: Name
    days: Annotated[int, Field(strict=True, ge=1, le=3650)] = 90


class SigningKeyCreate(Body):
    """A public key, 32 bytes in base64; `proof` is its signature over `outcrop signing-key/1 owner`, a line
    feed and one's name.
    """

    public: Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9+/]{43}=$")]
    proof: Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9+/]{86}==$")]
    name: Annotated[str, StringConstraints(max_length=80)] = ""


class ApiKeyValue(BaseModel):
    """A new key; the secret is shown once."""

    id: str
    name: str
    secret: str
    expires_utc: datetime
