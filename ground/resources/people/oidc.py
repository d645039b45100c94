"""Log-in by an OpenID Connect provider: code flow with PKCE; the ID token is checked by authlib and joserfc.

A person of a provider is its issuer and subject together. Nobody is found by a name or an address of mail:
who could choose theirs at the provider would be whoever they like here.
"""

from __future__ import annotations

import hashlib
import secrets
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from urllib.parse import quote_plus, urlencode, urlsplit

from sqlalchemy import select

from ground.errors import AuthenticationError, InvalidInputError, NotFoundError, UnavailableError
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.records.actor import PROVIDER, SYSTEM_ACTOR, require_free_name
from ground.records.edit import insert
from ground.resources.people.kind import PERSON
from ground.resources.people.row import PersonRow
from ground.resources.people.told_by_provider import ToldByProvider, ask
from ground.resources.people.value import Person
from ground.settings import Settings

if TYPE_CHECKING:
    from joserfc.jwt import Token

ALGORITHMS = ["RS256", "PS256", "ES256", "EdDSA"]
"""Signatures of an ID token that are believed: no `none`, and no secret that both sides share."""
LEEWAY_S = 60
"""By how much the clocks of both sides may differ."""
PATH = "/api/v1/oidc/callback"
SCOPE = "openid profile"
TOLD = ToldByProvider()


@dataclass(frozen=True, slots=True)
class Attempt:
    """What a browser keeps between going to the provider and coming back."""

    state: str
    nonce: str
    verifier: str

    @property
    def text(self) -> str:
        """The attempt as a cookie holds it."""
        return f"{self.state}.{self.nonce}.{self.verifier}"


@dataclass(frozen=True, slots=True)
class Identity:
    """Who somebody is at a provider."""

    issuer: str
    subject: str
    name: str

    @property
    def sha256(self) -> str:
        """What is kept of issuer and subject."""
        return hashlib.sha256(f"{self.issuer}\n{self.subject}".encode()).hexdigest()


def attempt_of(text: str, state: str) -> Attempt:
    """Return the attempt that a browser kept, if it is the one of the answer.

    Raises
    ------
    AuthenticationError
        If this browser did not begin it.
    """
    parts = text.split(".")
    if len(parts) != 3 or not secrets.compare_digest(parts[0].encode(), state.encode()):
        raise AuthenticationError("this browser did not begin that log-in, or it is too old; begin again")
    return Attempt(*parts)


def begin(settings: Settings) -> tuple[str, Attempt]:
    """Return the page of the provider to go to, and what to keep until the way back."""
    from authlib.oauth2.rfc7636 import create_s256_code_challenge

    attempt = Attempt(secrets.token_urlsafe(24), secrets.token_urlsafe(24), secrets.token_urlsafe(48))
    asked = {
        "response_type": "code",
        "client_id": settings.oidc_client_id,
        "redirect_uri": _way_back(settings),
        "scope": SCOPE,
        "state": attempt.state,
        "nonce": attempt.nonce,
        "code_challenge": create_s256_code_challenge(attempt.verifier),
        "code_challenge_method": "S256",
    }
    page = _metadata(settings)["authorization_endpoint"]
    return f"{page}{'&' if '?' in page else '?'}{urlencode(asked)}", attempt


def finish(settings: Settings, code: str, attempt: Attempt) -> Identity:
    """Return who the provider says came back with a code.

    Raises
    ------
    AuthenticationError
        If the provider does not take the code, or its token is not for us, for this attempt, or in force.
    UnavailableError
        If the provider cannot be reached or answers nonsense.
    """
    from authlib.oidc.core import CodeIDToken
    from joserfc.errors import JoseError

    metadata = _metadata(settings)
    given = {
        "grant_type": "authorization_code",
        "code": code,
        "redirect_uri": _way_back(settings),
        "client_id": settings.oidc_client_id,
        "code_verifier": attempt.verifier,
    }
    secret = settings.oidc_client_secret.get_secret_value()
    client = (quote_plus(settings.oidc_client_id), quote_plus(secret)) if secret else None
    answer = ask("POST", metadata["token_endpoint"], data=given, auth=client)
    expected = {
        "iss": {"essential": True, "value": settings.oidc_issuer},
        "aud": {"essential": True, "value": settings.oidc_client_id},
        "nonce": {"essential": True, "value": attempt.nonce},
    }
    told = {"client_id": settings.oidc_client_id, "nonce": attempt.nonce}
    told["access_token"] = str(answer.get("access_token") or "")
    try:
        token = _read_token(str(answer.get("id_token")), metadata["jwks_uri"])
        claims: Any = CodeIDToken(token.claims, token.header, expected, told)
        claims.validate(leeway=LEEWAY_S)
        subject = claims["sub"]
    except (JoseError, ValueError, TypeError, KeyError) as err:
        raise AuthenticationError(f"the provider's ID token is not good: {err}") from err
    if not isinstance(subject, str) or not subject:
        raise AuthenticationError("the provider's ID token names nobody")
    names = (claims.get(name) for name in ("preferred_username", "name"))
    name = next((n for n in names if isinstance(n, str) and n.strip()), subject)
    clean = "".join(c for c in name.strip() if c.isprintable())[:80]
    return Identity(settings.oidc_issuer, subject, clean or "somebody")


def _read_token(text: str, jwks_uri: str) -> Token:
    """Return an ID token whose signature is one of the provider's keys; they may have changed since."""
    from joserfc import jwt
    from joserfc.errors import JoseError
    from joserfc.jwk import KeySet

    def read(keys: Any) -> Token:
        return jwt.decode(text, KeySet.import_key_set(keys), algorithms=ALGORITHMS)

    try:
        return read(TOLD.read(jwks_uri))
    except (JoseError, ValueError, KeyError):
        return read(TOLD.read(jwks_uri, anew=True))


def enter(repo: Repository, identity: Identity) -> Person:
    """Return the person of a provider; who comes for the first time has the role `OUTCROP_OIDC_ROLE`.

    Raises
    ------
    AuthenticationError
        If they are shut out, their name is not for people, or somebody else has it here.
    """
    with repo.database.write() as session:
        known = session.scalars(select(PersonRow).where(PersonRow.external_sha256 == identity.sha256)).first()
        if known is not None:
            if not known.active:
                raise AuthenticationError(f"{known.name} is shut out; ask an administrator")
            return PERSON.show_one(session, known)
        try:
            require_free_name(identity.name)
        except InvalidInputError as err:
            raise AuthenticationError(f"{err.message}; take another name at the provider") from err
        if session.scalars(select(PersonRow.id).where(PersonRow.name == identity.name)).first():
            raise AuthenticationError(
                f"somebody else is called {identity.name!r} here; take another name at the provider"
            )
        row = PersonRow(
            id=new_id("psn"),
            author=PROVIDER,
            name=identity.name,
            role=repo.settings.oidc_role,
            mission_roles={},
            active=True,
            external_sha256=identity.sha256,
        )
        insert(session, SYSTEM_ACTOR, PERSON, row)
        return PERSON.show_one(session, row)


def _way_back(settings: Settings) -> str:
    return settings.public_url.rstrip("/") + PATH


def _metadata(settings: Settings) -> dict[str, str]:
    """Return the addresses of the provider, as it tells them itself (OpenID Connect Discovery 1.0)."""
    if not settings.oidc_issuer:
        raise NotFoundError("no provider is set (OUTCROP_OIDC_ISSUER)")
    found = TOLD.read(settings.oidc_issuer.rstrip("/") + "/.well-known/openid-configuration")
    if found.get("issuer") != settings.oidc_issuer:
        raise UnavailableError(f"the provider calls itself {str(found.get('issuer'))[:200]!r}")
    addresses = {
        name: str(found.get(name, "")) for name in ("authorization_endpoint", "token_endpoint", "jwks_uri")
    }
    for name, address in addresses.items():
        if not safe_address(address):
            raise UnavailableError(f"the provider's {name} is {address[:200]!r}, which is not https")
    return addresses


def safe_address(address: str) -> bool:
    """Say whether an address is https, or of this machine."""
    parts = urlsplit(address)
    local = parts.scheme == "http" and parts.hostname in {"localhost", "127.0.0.1", "::1"}
    return (parts.scheme == "https" or local) and bool(parts.hostname)
