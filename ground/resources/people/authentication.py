"""Who makes a request: an API key, a session cookie, or (profiles only) the name of a local profile."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Collection, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial

from starlette.datastructures import Headers
from starlette.requests import Request, cookie_parser
from starlette.responses import RedirectResponse, Response

from ground.api.context import Ask, P, R, answer, call, created, look, no_content
from ground.api.shared_reads import SharedReads
from ground.errors import AuthenticationError, ForbiddenError
from ground.gdr.repository import Repository
from ground.records.actor import Actor
from ground.resources.people import accounts, credentials, oidc
from ground.resources.people.first_administrator import make_first_administrator, wants_administrator
from ground.resources.people.kind import conceal_missions
from ground.resources.people.log_in_limits import LogInLimits, address_of, check, pay, refund
from ground.resources.people.passwords import change_password, may_enter
from ground.settings import Authentication

COOKIE = "outcrop_session"
ATTEMPT = "outcrop_oidc"
PROVIDER = "\nprovider"
"""The name under which failed log-ins by a provider are counted; nobody has a line feed in theirs."""
NEWCOMER = "\nfirst administrator"
"""The name under which guesses of the first token are counted; nobody has a line feed in theirs."""
CSRF_HEADER = "x-csrf-token"
PROFILE_HEADER = "x-outcrop-person"
SAFE = {"GET", "HEAD", "OPTIONS"}
_KEPT_S = 1.0


class _Known:
    """Who stands behind words of one kind, remembered for a second; those not known are read together."""

    MOST = 10_000
    """Of some hundred bytes each; then all are forgotten."""

    def __init__(self, read: Callable[[Collection[str]], Mapping[str, Actor]]) -> None:
        self._reads = SharedReads(look, read)
        self._known: dict[str, tuple[float, Actor]] = {}

    async def actor(self, word: str) -> Actor | None:
        now, known = time.monotonic(), self._known
        found = known.get(word)
        if found is not None and now - found[0] < _KEPT_S:
            return found[1]
        actor = await self._reads.get(word)
        if actor is not None:
            if len(known) >= self.MOST:
                known.clear()
            known[word] = (now, actor)  # nobody looks there if it was forgotten meanwhile
        return actor

    def forget(self) -> None:
        self._known = {}


class Identities:
    """Remembers for a second who a secret belongs to, so that a page of requests asks the database once."""

    def __init__(self, repo: Repository) -> None:
        self._repo = repo
        self._secrets = _Known(partial(credentials.identify, repo))
        self._profiles = _Known(partial(accounts.profiles, repo))

    async def actor_of(self, method: str, headers: Headers) -> Actor:
        """Return who makes the request.

        Raises
        ------
        AuthenticationError
            If it is nobody, or the secret is unknown or outdated.
        ForbiddenError
            If a change comes with a session cookie but without its CSRF token.
        """
        authorization = headers.get("authorization")
        if authorization is not None:
            scheme, _, secret = authorization.partition(" ")
            if scheme.lower() != "bearer" or not secret:
                raise AuthenticationError("the Authorization header has to be `Bearer` and an API key")
            return await self._known_secret(secret.strip())
        cookie = cookie_parser(headers.get("cookie", "")).get(COOKIE)
        with_profiles = self._repo.settings.auth.value == "profiles"
        if cookie:
            try:
                actor = await self._known_secret(cookie)
            except AuthenticationError:
                if not with_profiles:
                    raise
            else:
                sent = headers.get(CSRF_HEADER, "")
                if not with_profiles and method not in SAFE and sent != credentials.csrf_token(cookie):
                    raise ForbiddenError(
                        "a change with a session cookie needs the session's token in X-CSRF-Token"
                    )
                return actor
        if not with_profiles:  # said without a thread: whoever knocks has to cost nothing
            raise AuthenticationError("log in, or send an API key")
        name = headers.get(PROFILE_HEADER)
        profile = await self._profiles.actor(name or "")
        if profile is None:
            raise AuthenticationError(f"there is no profile {name!r}")
        return profile

    def forget(self) -> None:
        """Ask the database again from now on."""
        self._secrets.forget()
        self._profiles.forget()

    async def _known_secret(self, secret: str) -> Actor:
        actor = await self._secrets.actor(secret)
        if actor is None:
            raise AuthenticationError("the session or API key is unknown, outdated or taken back")
        return actor


def session_value(repo: Repository, request: Request) -> Mapping[str, object]:
    """Return who one is and the CSRF token of the session."""
    actor: Actor | None = getattr(request.state, "actor", None)
    cookie = request.cookies.get(COOKIE)
    return {
        "person": None if actor is None else accounts.person_value(repo, actor),
        "csrf_token": credentials.csrf_token(cookie) if cookie else "",
        "auth": repo.settings.auth.value,
        "provider": bool(repo.settings.oidc_issuer),
        "wants_administrator": actor is None and wants_administrator(repo),
    }


def secret_of(request: Request) -> str:
    """Return the secret with which a request comes: that of its key, else of its session; empty without."""
    bearer = request.headers.get("authorization", "").partition(" ")[2].strip()
    return bearer or request.cookies.get(COOKIE, "")


def _address(request: Request) -> str:
    return address_of(None if request.client is None else request.client.host)


async def change_own_password(request: Request, ask: Ask, old: str, new: str) -> Response:
    """Change who asks' password; a wrong old one is a guess like one at a log-in, and paid for like it."""
    ask.who.require_person()  # before anything is paid: else a narrowed key shuts its owner out
    limits: LogInLimits = request.app.state.limits
    name, address = ask.who.name, _address(request)
    limits.knock(name, address)
    await call(pay, ask.repo, name, address)
    kept = credentials.digest(secret_of(request))
    await check(partial(change_password, ask.repo, ask.who, old, new, kept))
    limits.forgive(name, address)
    await call(refund, ask.repo, name, address)
    return no_content()


async def be_first(request: Request, repo: Repository, token: str, name: str, password: str) -> Response:
    """Make the first administrator by the token of the log; a wrong one is paid for like a guess."""
    limits: LogInLimits = request.app.state.limits
    address = _address(request)
    limits.knock(NEWCOMER, address)
    await call(pay, repo, NEWCOMER, address)
    person = await check(partial(make_first_administrator, repo, token, name, password))
    return created(person, f"/api/v1/people/{person.id}")


async def log_in(request: Request, repo: Repository, name: str, password: str) -> Response:
    """Answer a login with the cookie of a new session; a guess that has its place is paid for, then checked.

    Raises
    ------
    AuthenticationError
        If name and password do not fit, or the person is shut out.
    TooManyAttemptsError
        After 5 guesses for the name from this address within 5 minutes, or 50 for all names.
    """
    if repo.settings.auth is Authentication.PROFILES:
        person = await call(may_enter, repo, name, password)
    else:
        limits: LogInLimits = request.app.state.limits
        address = _address(request)
        limits.knock(name, address)
        await call(pay, repo, name, address)
        person = await check(partial(may_enter, repo, name, password))
        if person is not None:
            limits.forgive(name, address)
            await call(refund, repo, name, address)
    if person is None:
        with_passwords = repo.settings.auth is Authentication.ACCOUNTS
        raise AuthenticationError(
            "name and password do not fit" if with_passwords else f"there is no profile {name!r}"
        )
    program = request.headers.get("user-agent", "")
    secret = await call(credentials.open_session, repo, person, program)
    token = credentials.csrf_token(secret)
    actor = Actor(person.name, person.role, person.mission_roles)
    seen = conceal_missions(actor, person)
    content = {"person": seen, "csrf_token": token, "auth": repo.settings.auth.value}
    response = answer(content, 201)
    _give(repo, response, secret)
    return response


_PROVIDER = ThreadPoolExecutor(4, "provider")
"""A provider that is slow keeps those waiting who log in by it, and nobody else."""


async def _of_provider(function: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
    """Run what may have to ask the provider."""
    return await asyncio.get_running_loop().run_in_executor(_PROVIDER, partial(function, *args, **kwargs))


async def go_to_provider(repo: Repository) -> Response:
    """Send the browser to the provider; what it has to bring back stands in a cookie of ten minutes."""
    page, attempt = await _of_provider(oidc.begin, repo.settings)
    response = RedirectResponse(page, 303)
    # Lax: the way back comes from another site, and has to bring it along.
    response.set_cookie(
        ATTEMPT,
        attempt.text,
        max_age=600,
        httponly=True,
        samesite="lax",
        secure=_secure(repo),
        path=oidc.PATH,
    )
    return response


async def come_from_provider(request: Request, repo: Repository, code: str, state: str) -> Response:
    """Open a session for who the provider says it is; a failed one is paid for like a guess."""
    attempt = oidc.attempt_of(request.cookies.get(ATTEMPT, ""), state)
    limits: LogInLimits = request.app.state.limits
    address = _address(request)
    limits.knock(PROVIDER, address)
    await call(pay, repo, PROVIDER, address)
    identity = await _of_provider(oidc.finish, repo.settings, code, attempt)
    person = await call(oidc.enter, repo, identity)
    limits.forgive(PROVIDER, address)
    await call(refund, repo, PROVIDER, address)
    secret = await call(credentials.open_session, repo, person, request.headers.get("user-agent", ""))
    response = RedirectResponse("/", 303)
    response.delete_cookie(ATTEMPT, path=oidc.PATH)
    _give(repo, response, secret)
    return response


def _secure(repo: Repository) -> bool:
    return repo.settings.cookie_secure or repo.settings.public_url.startswith("https:")


def _give(repo: Repository, response: Response, secret: str) -> None:
    """Set the cookie of a session."""
    response.set_cookie(
        COOKIE,
        secret,
        max_age=int(repo.settings.session_hours * 3600),
        httponly=True,
        samesite="strict",
        secure=_secure(repo),
        path="/",
    )


async def log_out(repo: Repository, request: Request) -> Response:
    """End the session of the cookie."""
    secret = request.cookies.get(COOKIE)
    if secret:
        await call(credentials.log_out, repo, secret)
    request.app.state.identities.forget()
    response = Response(status_code=204)
    response.delete_cookie(COOKIE, path="/")
    return response
