"""Log-in by an OpenID Connect provider that runs inside the test, and what it must not be fooled by."""

from __future__ import annotations

import base64
import hashlib
import json
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, urlsplit

import pytest
from joserfc import jwt
from joserfc.jwk import RSAKey

from ground.errors import InvalidInputError, UnavailableError
from ground.gdr.repository import Repository, open_repository
from ground.records.actor import SYSTEM_ACTOR, Role
from ground.resources.people import oidc, told_by_provider
from ground.resources.people.accounts import create_person
from ground.resources.people.row import PersonRow
from ground.settings import SettingsError, load_settings
from tests.ground.conftest import Api, open_api, settings_for
from tests.ground.test_missions_api import problem

CLIENT, SECRET = "outcrop", "a secret: of 2"
KEY, FOREIGN = RSAKey.generate_key(2048, {"kid": "1"}), RSAKey.generate_key(2048, {"kid": "1"})


class Provider(ThreadingHTTPServer):
    """Hands out codes and tokens as RFC 6749, RFC 7636 and OpenID Connect say; a test may change any."""

    daemon_threads = True

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.issuer = f"http://127.0.0.1:{self.server_port}"
        self.subject: dict[str, Any] = {"sub": "248289", "preferred_username": "Ada"}
        self.claims: dict[str, Any] = {}
        self.key, self.header = KEY, {"alg": "RS256", "kid": "1"}
        self.codes: dict[str, dict[str, str]] = {}
        self.discovered: dict[str, str] = {}

    def approve(self, page: str) -> dict[str, str]:
        """Do what a person at the provider's page does; return what their browser brings back."""
        asked = {name: values[0] for name, values in parse_qs(urlsplit(page).query).items()}
        assert asked["code_challenge_method"] == "S256"
        assert (asked["client_id"], asked["response_type"]) == (CLIENT, "code")
        code = f"code-{len(self.codes)}"
        self.codes[code] = asked
        return {"code": code, "state": asked["state"]}

    def token(self, form: dict[str, str], authorization: str) -> tuple[int, dict[str, Any]]:
        given = base64.b64encode(f"{CLIENT}:a+secret%3A+of+2".encode()).decode()
        asked = self.codes.pop(form.get("code", ""), None)
        digest = hashlib.sha256(form.get("code_verifier", "").encode()).digest()
        challenge = base64.urlsafe_b64encode(digest).rstrip(b"=").decode()
        if authorization != f"Basic {given}" or asked is None or asked["code_challenge"] != challenge:
            return 400, {"error": "invalid_grant"}
        if form["redirect_uri"] != asked["redirect_uri"]:
            return 400, {"error": "invalid_grant"}
        now = int(time.time())
        claims = {"iss": self.issuer, "aud": CLIENT, "iat": now, "exp": now + 300, "nonce": asked["nonce"]}
        claims |= self.subject | self.claims
        text = jwt.encode(self.header, {k: v for k, v in claims.items() if v is not None}, self.key)
        return 200, {"access_token": "x", "token_type": "Bearer", "id_token": text}


class _Handler(BaseHTTPRequestHandler):
    server: Provider

    def log_message(self, *_: object) -> None: ...

    def do_GET(self) -> None:
        issuer = self.server.issuer
        if self.path == "/keys":
            self._say(200, {"keys": [KEY.as_dict(private=False)]})
        else:
            names = {"authorization_endpoint": "/authorize", "token_endpoint": "/token", "jwks_uri": "/keys"}
            told = {"issuer": issuer, **{name: issuer + path for name, path in names.items()}}
            self._say(200, told | self.server.discovered)

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["content-length"])).decode()
        form = {name: values[0] for name, values in parse_qs(body).items()}
        self._say(*self.server.token(form, self.headers.get("authorization", "")))

    def _say(self, status: int, document: object) -> None:
        content = json.dumps(document).encode()
        self.send_response(status)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)


@pytest.fixture
def provider() -> Iterator[Provider]:
    oidc.TOLD.forget()
    server = Provider()
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05})
    thread.start()
    yield server
    server.shutdown()
    thread.join()
    server.server_close()


@pytest.fixture
def service(repo: Repository, provider: Provider) -> Iterator[Api]:
    address = repo.database.url.render_as_string(hide_password=False)
    settings = settings_for(
        repo.data_dir,
        address,
        auth="accounts",
        oidc_issuer=provider.issuer,
        oidc_client_id=CLIENT,
        oidc_client_secret=SECRET,
        public_url="https://ops.example",
    )
    ours = open_repository(settings)
    yield from open_api(ours)
    ours.database.dispose()


def begin(api: Api) -> tuple[str, str]:
    """Return the provider's page, and the cookie that this browser keeps."""
    answer = api("GET", "/oidc/login")
    assert answer.status_code == 303, answer.text
    cookie = answer.headers["set-cookie"]
    assert "HttpOnly" in cookie
    assert "Secure" in cookie
    api.client.cookies.clear()
    return answer.headers["location"], cookie.split(";")[0]


def come_back(api: Api, brought: dict[str, str], cookie: str) -> Any:
    answer = api("GET", "/oidc/callback", params=brought, headers={"Cookie": cookie})
    api.client.cookies.clear()
    return answer


def log_in(api: Api, provider: Provider) -> Any:
    page, cookie = begin(api)
    return come_back(api, provider.approve(page), cookie)


def session_of(answer: Any) -> dict[str, str]:
    assert answer.status_code == 303, answer.text
    assert answer.headers["location"] == "/"
    cookies = [v for k, v in answer.headers.multi_items() if k == "set-cookie" and "outcrop_session" in v]
    assert "SameSite=strict" in cookies[0]
    return {"Cookie": cookies[0].split(";")[0]}


def test_a_person_comes_in_by_the_provider_and_is_the_same_the_next_time(
    service: Api, provider: Provider
) -> None:
    headers = session_of(log_in(service, provider))
    person = service.get("/session", headers=headers)["person"]
    assert (person["name"], person["role"]) == ("Ada", "none")
    assert service.get("/missions", headers=headers)["items"] == []
    provider.subject["preferred_username"] = "Ada the Elder"  # a name is theirs to change, not who they are
    again = service.get("/session", headers=session_of(log_in(service, provider)))["person"]
    assert again["id"] == person["id"]


def test_nobody_has_a_name_under_which_the_program_acts(service: Api, provider: Provider) -> None:
    for name in ("system", " System", "first administrator", "provider", "Bo (elsewhere)"):
        provider.subject = {"sub": "1", "preferred_username": name}
        problem(log_in(service, provider), 401, "not-authenticated")
        with pytest.raises(InvalidInputError, match="nobody may be called"):
            create_person(service.repo, SYSTEM_ACTOR, name, Role.VIEWER, "correct horse battery")


def test_nobody_becomes_somebody_else_by_their_name(service: Api, provider: Provider) -> None:
    create_person(service.repo, SYSTEM_ACTOR, "Ada", Role.ADMIN, "correct horse battery")
    problem(log_in(service, provider), 401, "not-authenticated")
    provider.subject = {"sub": "1", "preferred_username": "Bo"}
    session_of(log_in(service, provider))
    provider.subject = {"sub": "2", "preferred_username": "Bo"}
    problem(log_in(service, provider), 401, "not-authenticated")


def test_who_is_shut_out_stays_out(service: Api, provider: Provider) -> None:
    headers = session_of(log_in(service, provider))
    person = service.get("/session", headers=headers)["person"]["id"]
    with service.repo.database.write() as session:
        session.get_one(PersonRow, person).active = False
    problem(log_in(service, provider), 401, "not-authenticated")


@pytest.mark.parametrize(
    "lie",
    [
        {"iss": "https://evil.example"},
        {"aud": "another client"},
        {"aud": [CLIENT, "another client"]},
        {"azp": "another client"},
        {"nonce": "of another log-in"},
        {"nonce": None},
        {"exp": int(time.time()) - 3600},
        {"exp": None},
        {"iat": int(time.time()) + 3600},
        {"sub": None},
        {"sub": ""},
    ],
)
def test_a_token_that_is_not_for_this_log_in_opens_nothing(
    service: Api, provider: Provider, lie: dict[str, Any]
) -> None:
    provider.claims = lie
    problem(log_in(service, provider), 401, "not-authenticated")


def test_a_token_signed_by_another_key_or_by_none_opens_nothing(service: Api, provider: Provider) -> None:
    provider.key = FOREIGN
    problem(log_in(service, provider), 401, "not-authenticated")
    page, cookie = begin(service)
    brought = provider.approve(page)
    parts = [{"alg": "none"}, {"iss": provider.issuer, "aud": CLIENT, "sub": "1", "exp": 2**40, "iat": 1}]
    bare = ".".join(base64.urlsafe_b64encode(json.dumps(p).encode()).rstrip(b"=").decode() for p in parts)
    provider.token = lambda *_: (200, {"id_token": bare + "."})  # type: ignore[method-assign]
    problem(come_back(service, brought, cookie), 401, "not-authenticated")


def test_a_code_is_good_for_the_browser_that_asked_for_it_once(service: Api, provider: Provider) -> None:
    page, cookie = begin(service)
    brought = provider.approve(page)
    _, another = begin(service)
    for kept in (another, "outcrop_oidc=x", "a=b"):
        problem(come_back(service, brought, kept), 401, "not-authenticated")
    stolen = {**brought, "state": another.split("=", 1)[1].split(".")[0]}
    problem(come_back(service, stolen, another), 401, "not-authenticated")  # its verifier does not fit
    page, cookie = begin(service)
    brought = provider.approve(page)
    session_of(come_back(service, brought, cookie))
    problem(come_back(service, brought, cookie), 401, "not-authenticated")


@pytest.mark.parametrize(
    "told",
    [{"issuer": "https://evil.example"}, {"token_endpoint": "http://evil.example/token"}, {"jwks_uri": ""}],
)
def test_a_provider_that_contradicts_itself_is_not_used(
    service: Api, provider: Provider, told: dict[str, str]
) -> None:
    provider.discovered = told
    assert service("GET", "/oidc/login").status_code == 503


def test_settings_of_a_provider_are_checked_at_the_start() -> None:
    good = {
        "auth": "accounts",
        "oidc_issuer": "https://id.example",
        "oidc_client_id": CLIENT,
        "public_url": "https://ops.example",
    }
    assert "xyzzy" not in repr(load_settings(**good, oidc_client_secret="xyzzy"))
    for name, value in (
        ("auth", "profiles"),
        ("oidc_client_id", ""),
        ("oidc_issuer", "http://id.example"),
        ("public_url", ""),
        ("oidc_role", "admin"),
    ):
        with pytest.raises(SettingsError, match="OUTCROP_"):
            load_settings(**{**good, name: value})


def test_without_a_provider_there_is_no_way_in(sqlite_api: Api) -> None:
    problem(sqlite_api("GET", "/oidc/login"), 404, "not-found")


def test_a_slow_provider_is_asked_once_and_a_silent_one_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each unauthenticated log-in once asked anew, and two hundred of them kept every thread waiting."""
    asked: list[str] = []
    now = [0.0]

    def ask(_method: str, address: str) -> dict[str, str]:
        asked.append(address)
        time.sleep(0.05)
        if "down" in address:
            raise UnavailableError("the provider does not answer")
        return {"asked": str(len(asked))}

    monkeypatch.setattr(told_by_provider, "ask", ask)
    told = told_by_provider.ToldByProvider(clock=lambda: now[0])
    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(lambda _: told.read("up"), range(50))) == [{"asked": "1"}] * 50
    for _ in range(3):
        with pytest.raises(UnavailableError):
            told.read("down")
    assert asked == ["up", "down"]
    assert told.read("up", anew=True) == {"asked": "1"}, "not again within a moment"
    now[0] = told_by_provider.FAIL_S
    assert told.read("up", anew=True) == {"asked": "3"}
    with pytest.raises(UnavailableError):
        told.read("down")
    now[0] += told_by_provider.KEEP_S
    assert told.read("up") == {"asked": "5"}
