"""What the API takes for people, their sessions and keys."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, Field, StringConstraints

from ground.records.actor import Role
from ground.records.forms import Body, Flag, Id, Name, unset
from ground.resources.people.value import Person

Password = Annotated[str, StringConstraints(min_length=8, max_length=1000)]


class SessionCreate(Body):
    """Log in; with `OUTCROP_AUTH=profiles` the password stays empty."""

    name: Name
    password: Annotated[str, StringConstraints(max_length=1000)] = ""


class SessionValue(BaseModel):
    """Who one is; `csrf_token` goes into the header X-CSRF-Token of every change made with the cookie."""

    person: Person | None
    csrf_token: str
    auth: str
    provider: bool = False
    """Whether one may log in by an OpenID Connect provider: `GET /oidc/login`."""
    wants_administrator: bool = False
    """Nobody administers this service yet: `POST /first-administrator`."""


class FirstAdministrator(Body):
    """The one-time token of the server's log, and who is to administer."""

    token: Annotated[str, StringConstraints(min_length=1, max_length=100)]
    name: Name
    password: Password


class PersonCreate(Body):
    name: Name
    role: Role = Role.VIEWER
    password: Password | None = None


class PersonChange(Body):
    role: Role = Field(default_factory=unset)
    mission_roles: dict[Id, Role] = Field(default_factory=unset)
    active: Flag = Field(default_factory=unset)


class ApiKeyCreate(Body):
    name: Name
    days: Annotated[int, Field(strict=True, ge=1, le=3650)] = 90
    role: Role | None = None
    """At most what this role may; else all that its owner may."""
    mission_ids: Annotated[list[Id], Field(min_length=1, max_length=100)] | None = None
    """In these missions alone."""


class PasswordChange(Body):
    """Change one's own password."""

    old: Annotated[str, StringConstraints(max_length=1000)]
    new: Password


class PasswordReset(Body):
    """Give somebody a password."""

    password: Password


class SigningKeyCreate(Body):
    """A public key, 32 bytes in base64; `proof` is its signature over `outcrop signing-key/1 owner`, a line
    feed and one's name.
    """

    public: Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9+/]{43}=$")]
    proof: Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9+/]{86}==$")]
    name: Annotated[str, StringConstraints(max_length=80)] = ""
