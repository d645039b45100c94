"""People, sessions and API keys."""

from __future__ import annotations

from functools import partial
from typing import Annotated

from fastapi import Query, Request
from starlette.responses import Response

from ground.api.context import Asked, Id, Repo, answer, call, created, no_content
from ground.api.problems import responses
from ground.api.resource_routes import resource_routes
from ground.resources.people.accounts import create_person as create_person_use_case
from ground.resources.people.authentication import (
    be_first,
    change_own_password,
    come_from_provider,
    go_to_provider,
    log_in,
    log_out,
    secret_of,
    session_value,
)
from ground.resources.people.bodies import (
    ApiKeyCreate,
    FirstAdministrator,
    PasswordChange,
    PasswordReset,
    PersonCreate,
    SessionCreate,
    SessionValue,
    SigningKeyCreate,
)
from ground.resources.people.credentials import create_api_key as create_api_key_use_case
from ground.resources.people.credentials import delete_api_key as delete_api_key_use_case
from ground.resources.people.credentials import digest
from ground.resources.people.credentials import end_session as end_session_use_case
from ground.resources.people.credentials import list_api_keys as list_api_keys_use_case
from ground.resources.people.credentials import list_sessions as list_sessions_use_case
from ground.resources.people.kind import PERSON
from ground.resources.people.log_in_limits import check
from ground.resources.people.passwords import reset_password as reset_password_use_case
from ground.resources.people.signing_keys import list_signing_keys as list_signing_keys_use_case
from ground.resources.people.signing_keys import register_signing_key, revoke_signing_key
from ground.resources.people.value import ApiKey, NewApiKey, OpenSession, Person, SigningKey

FromProvider = Annotated[str, Query(min_length=1, max_length=4000)]
Everyone = Annotated[bool, Query(description="everybody's, for administrators")]

router = resource_routes(
    PERSON,
    "people",
    lists="List people; with profiles these are who one may work as.",
    reads="Read a person.",
    changes="Change role, roles in single missions, or shut a person out (administrators).",
)


@router.post("/people", response_model=Person, status_code=201, responses=responses(400, 409, 422))
async def create_person(ask: Asked, body: PersonCreate) -> Response:
    """Add a person (administrators)."""
    person = await ask.do(create_person_use_case, body.name, body.role, body.password)
    return created(person, f"/api/v1/people/{person.id}")


@router.get("/session", response_model=SessionValue)
async def get_session(repo: Repo, request: Request) -> Response:
    """Say who one is; `person` is null for nobody."""
    return answer(await call(session_value, repo, request))


@router.post("/session", response_model=SessionValue, status_code=201, responses=responses(400, 422, 429))
async def create_session(repo: Repo, request: Request, body: SessionCreate) -> Response:
    """Log in, or change to another profile; sets the session cookie."""
    return await log_in(request, repo, body.name, body.password)


@router.delete("/session", status_code=204)
async def delete_session(repo: Repo, request: Request) -> Response:
    """Log out."""
    return await log_out(repo, request)


@router.post(
    "/first-administrator",
    response_model=Person,
    status_code=201,
    responses=responses(400, 401, 409, 422, 429),
)
async def create_first_administrator(repo: Repo, request: Request, body: FirstAdministrator) -> Response:
    """Make the first administrator of a new service, with the one-time token of the server's log."""
    return await be_first(request, repo, body.token, body.name, body.password)


# For browsers alone, which follow them: no part of the interface that programs speak.
@router.get("/oidc/login", include_in_schema=False)
async def begin_oidc(repo: Repo) -> Response:
    """Go to the OpenID Connect provider to log in."""
    return await go_to_provider(repo)


@router.get("/oidc/callback", include_in_schema=False)
async def finish_oidc(repo: Repo, request: Request, code: FromProvider, state: FromProvider) -> Response:
    """Come back from the provider: sets the session cookie and goes to the page."""
    return await come_from_provider(request, repo, code, state)


@router.put("/session/password", status_code=204, responses=responses(400, 409, 422, 429))
async def change_password(ask: Asked, request: Request, body: PasswordChange) -> Response:
    """Change one's own password with the old one; one's other sessions end."""
    return await change_own_password(request, ask, body.old, body.new)


@router.put("/people/{person_id}/password", status_code=204, responses=responses(400, 404, 409, 422))
async def reset_password(ask: Asked, person_id: Id, body: PasswordReset) -> Response:
    """Give somebody else a password (administrators); their sessions end."""
    await check(partial(reset_password_use_case, ask.repo, ask.who, person_id, body.password))
    return no_content()


@router.get("/sessions", response_model=list[OpenSession], responses=responses(422))
async def list_sessions(ask: Asked, request: Request, everyone: Everyone = False) -> Response:
    """List one's open sessions, or everybody's; `current` marks the one that asks."""
    mine = digest(secret_of(request))
    return answer(await ask.do(list_sessions_use_case, mine, everyone=everyone))


@router.delete("/sessions/{session_id}", status_code=204, responses=responses(404, 422))
async def end_session(ask: Asked, session_id: Id) -> Response:
    """End a session of one's own, or anybody's (administrators)."""
    await ask.do(end_session_use_case, session_id)
    return no_content()


@router.get("/api-keys", response_model=list[ApiKey], responses=responses(422))
async def list_api_keys(ask: Asked, everyone: Everyone = False) -> Response:
    """List one's API keys, or everybody's; never their secrets."""
    return answer(await ask.do(list_api_keys_use_case, everyone=everyone))


@router.post("/api-keys", response_model=NewApiKey, status_code=201, responses=responses(400, 422))
async def create_api_key(ask: Asked, body: ApiKeyCreate) -> Response:
    """Make an API key for oneself; the secret is shown this once."""
    key = await ask.do(create_api_key_use_case, body.name, body.days, body.role, body.mission_ids)
    return answer(key, 201)


@router.delete("/api-keys/{key_id}", status_code=204, responses=responses(404, 422))
async def delete_api_key(ask: Asked, key_id: Id) -> Response:
    """Take back an API key."""
    await ask.do(delete_api_key_use_case, key_id)
    return no_content()


@router.get("/signing-keys", response_model=list[SigningKey], responses=responses(422))
async def list_signing_keys(ask: Asked) -> Response:
    """List the public keys with which people sign plans; revoked ones too."""
    return answer(await ask.do(list_signing_keys_use_case))


@router.post("/signing-keys", response_model=SigningKey, status_code=201, responses=responses(400, 409, 422))
async def create_signing_key(ask: Asked, body: SigningKeyCreate) -> Response:
    """Register the public half of a key of one's own; the private half never leaves its owner."""
    return answer(await ask.do(register_signing_key, body.public, body.proof, body.name), 201)


@router.delete("/signing-keys/{key_id}", status_code=204, responses=responses(404, 422))
async def delete_signing_key(ask: Asked, key_id: Id) -> Response:
    """Revoke a signing key here; it stays in the list. Trust files on board are changed apart from it."""
    await ask.do(revoke_signing_key, key_id)
    return no_content()
