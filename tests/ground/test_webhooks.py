"""Webhooks: signed, in order, at least once, and never to an address that the operator did not mean."""

from __future__ import annotations

import contextlib
import json
import logging
import re
import socket
import ssl
import threading
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, get_args

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID
from sqlalchemy import select

from ground.app.api import build_api
from ground.app.courier import KEPT, LEASE_S, READ_AT, WAITS_S, Courier
from ground.errors import DamagedDataError, InvalidInputError
from ground.gdr.history import EventRow
from ground.gdr.repository import Repository, open_repository
from ground.records.actor import SYSTEM_ACTOR, Actor, Role
from ground.resources.backups.backup import backup
from ground.resources.backups.restore import drill, restore
from ground.resources.mission_archives.mission_archive import export_mission
from ground.resources.missions.value import Mission
from ground.resources.people.credentials import create_api_key
from ground.resources.people.row import PersonRow
from ground.resources.webhooks.bodies import EventKind
from ground.resources.webhooks.row import WebhookDeliveryRow, WebhookStateRow
from ground.resources.webhooks.rules import Place, place_of, why_refused
from ground.resources.webhooks.send import Answer, Sender
from ground.resources.webhooks.signature import new_secret, signed_headers
from ground.settings import SettingsError, load_settings
from tests.ground.conftest import Api, open_api, settings_for

HOST, URL, PUBLIC = "hooks.example", "https://hooks.example/in?key=1", "93.184.216.34"
GUIDE = Path(__file__).resolve().parents[2] / "docs/how-to/webhooks.md"
FIRST = datetime(2100, 1, 1, tzinfo=UTC)


def verify() -> Callable[..., bool]:
    """Return the receiver's check that the guide prints."""
    found = re.search(r"```python\n(.*?)```", GUIDE.read_text(encoding="utf-8"), re.DOTALL)
    assert found is not None
    names: dict[str, Any] = {}
    exec(found[1], names)
    check: Callable[..., bool] = names["verify"]
    return check


# ---- where it may lead


@pytest.mark.parametrize(
    ("address", "why"),
    [
        ("0.0.0.0", "unspecified"),
        ("127.0.0.1", "loopback"),
        ("127.8.9.1", "loopback"),
        ("10.0.0.1", "private"),
        ("172.16.3.4", "private"),
        ("192.168.1.1", "private"),
        ("169.254.169.254", "link-local"),
        ("100.64.0.1", "not public"),
        ("224.0.0.1", "multicast"),
        ("239.1.1.1", "multicast"),
        ("240.0.0.1", "private"),
        ("255.255.255.255", "private"),
        ("192.0.2.1", "private"),
        ("::", "unspecified"),
        ("::1", "loopback"),
        ("fe80::1", "link-local"),
        ("fe80::1%eth0", "link-local"),
        ("fc00::1", "private"),
        ("fec0::1", "private"),
        ("ff02::1", "multicast"),
        ("2001:db8::1", "private"),
        ("::ffff:127.0.0.1", "loopback"),
        ("::ffff:10.0.0.1", "private"),
        ("::ffff:169.254.169.254", "link-local"),
        ("::127.0.0.1", "loopback"),
        ("64:ff9b::7f00:1", "loopback"),
        ("64:ff9b::a00:1", "private"),
        ("2002:7f00:1::", "loopback"),
        ("2002:c0a8:101::", "private"),
        ("2001:0:4136:e378:8000:63bf:f5ff:fffe", "private"),
        ("nonsense", "not an address"),
    ],
)
def test_an_address_inside_is_refused_in_whatever_form(address: str, why: str) -> None:
    assert why_refused(address) == why
    asked: list[Any] = []

    def connect(*given: Any) -> socket.socket:
        asked.append(given)
        raise OSError("never")

    for found in ([address], [PUBLIC, address]):
        answer = Sender(lambda _h, _p, found=found: found, connect).post(Place(HOST, 443, "/"), {}, b"")  # type: ignore[misc]
        assert (answer.status, asked) == (None, [])
        assert address in answer.detail


@pytest.mark.parametrize("address", [PUBLIC, "2606:2800:220:1::1", "::ffff:93.184.216.34"])
def test_a_public_address_is_not_refused(address: str) -> None:
    assert why_refused(address) == ""


@pytest.mark.parametrize(
    "url",
    [
        "http://hooks.example/",
        "http://localhost/",
        "ftp://hooks.example/",
        "https://other.example/",
        "https://hooks.example:8443/",
        "https://user:word@hooks.example/",
        "https://hooks.example@other.example/",
        "https://other.example#@hooks.example/",
        "https://other.example\\@hooks.example/",
        "https://hooks.example.other/",
        "https://127.0.0.1/",
        "https://[::1]/",
        "https://hooks.example:99999/",
        "https://hooks.example/a b",
        "https:///x",
        "https://hooks.ex\u00e4mple/",
    ],
)
def test_an_address_that_the_operator_did_not_allow_is_refused(url: str) -> None:
    with pytest.raises(InvalidInputError) as caught:
        place_of(url, {HOST})
    assert caught.value.pointer == "/url"


def test_an_allowed_address_is_read_by_its_parts() -> None:
    assert place_of(URL, {HOST}) == Place(HOST, 443, "/in?key=1")
    assert place_of("https://HOOKS.example:443", {HOST}) == Place(HOST, 443, "/")
    assert place_of("https://hooks.example:8443/", {f"{HOST}:8443"}).authority == "hooks.example:8443"


def test_the_setting_names_hosts(tmp_path: Path) -> None:
    given = load_settings(data_dir=tmp_path, webhook_hosts=" Hooks.Example:443, b.example:8443")
    assert given.hook_hosts == {HOST, "b.example:8443"}
    with pytest.raises(SettingsError, match="OUTCROP_WEBHOOK_HOSTS"):
        load_settings(data_dir=tmp_path, webhook_hosts="https://hooks.example/")


# ---- signatures


def test_the_signature_is_that_of_the_specifications_example() -> None:
    secret = "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw"
    name, body = "msg_p5jXN8AQM9LWM0D4loKWxJek", b'{"test": 2432232314}'
    told = signed_headers([secret], name, 1614265330, body)
    assert told["webhook-signature"] == "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE="


def test_the_check_of_the_guide_takes_what_we_sign_and_nothing_else() -> None:
    check, secret, old = verify(), new_secret(), new_secret()
    told = signed_headers([secret, old], "whk-1-7", 1000, b"body")
    assert check(secret, told, b"body", 1000.0)
    assert check(old, told, b"body", 1299.0)
    assert not check(secret, told, b"Body", 1000.0)
    assert not check(new_secret(), told, b"body", 1000.0)
    assert not check(secret, {**told, "webhook-id": "whk-1-8"}, b"body", 1000.0)
    assert not check(secret, {**told, "webhook-timestamp": "1001"}, b"body", 1000.0)
    assert not check(secret, told, b"body", 1301.0)


# ---- over TLS


@dataclass
class Receiver:
    """An https server of `hooks.example` on loopback, which does with each connection what it is told."""

    server: socket.socket
    inside: ssl.SSLContext
    outside: ssl.SSLContext
    answers: list[Callable[[ssl.SSLSocket], None]] = field(default_factory=list)
    got: list[tuple[str, dict[str, str], bytes]] = field(default_factory=list)
    names: list[str | None] = field(default_factory=list)
    dialled: list[tuple[str, int]] = field(default_factory=list)
    resolved: list[str] = field(default_factory=list)

    def serve(self) -> None:
        while True:
            try:
                plain, _ = self.server.accept()
            except OSError:
                return
            try:
                with self.inside.wrap_socket(plain, server_side=True) as over:
                    reader = over.makefile("rb")
                    first = reader.readline().decode().strip()
                    headers = {}
                    while (line := reader.readline().decode().strip()) != "":
                        name, _, value = line.partition(": ")
                        headers[name.lower()] = value
                    self.got.append((first, headers, reader.read(int(headers["content-length"]))))
                    self.answers.pop(0)(over)
            except OSError:
                continue

    def sender(self, time_limit_s: float = 15.0) -> Sender:
        def resolve(host: str, _port: int) -> list[str]:
            self.resolved.append(host)
            return [PUBLIC] if len(self.resolved) == 1 else ["127.0.0.1"]

        def connect(address: tuple[str, int], _limit: float) -> socket.socket:
            self.dialled.append(address)
            return socket.create_connection(self.server.getsockname())

        return Sender(resolve, connect, self.outside, time_limit_s)


@pytest.fixture
def receiver(tmp_path: Path) -> Iterator[Receiver]:
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, HOST)])
    now = datetime.now(UTC)
    certificate = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - timedelta(days=1))
        .not_valid_after(now + timedelta(days=1))
        .add_extension(x509.SubjectAlternativeName([x509.DNSName(HOST)]), critical=False)
        .sign(key, hashes.SHA256())
    )
    pem = tmp_path / "hooks.pem"
    form = serialization.PrivateFormat.PKCS8
    private = key.private_bytes(serialization.Encoding.PEM, form, serialization.NoEncryption())
    pem.write_bytes(private + certificate.public_bytes(serialization.Encoding.PEM))
    inside = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    inside.load_cert_chain(pem)
    outside = ssl.create_default_context(cadata=certificate.public_bytes(serialization.Encoding.PEM).decode())
    made = Receiver(socket.create_server(("127.0.0.1", 0)), inside, outside)
    inside.sni_callback = lambda _socket, asked, _context: made.names.append(asked)  # type: ignore[assignment]
    thread = threading.Thread(target=made.serve, daemon=True)
    thread.start()
    yield made
    made.server.shutdown(socket.SHUT_RDWR)
    made.server.close()
    thread.join(timeout=10.0)
    assert not thread.is_alive()


def says(text: str) -> Callable[[ssl.SSLSocket], None]:
    return lambda over: over.sendall(text.encode())


def test_the_checked_address_is_connected_to_with_the_hosts_name(receiver: Receiver) -> None:
    receiver.answers.append(says("HTTP/1.1 204 No Content\r\n\r\n"))
    answer = receiver.sender().post(Place(HOST, 443, "/in?key=1"), {"webhook-id": "m"}, b"{}")
    assert answer.taken, answer
    assert receiver.resolved == [HOST]  # a second look-up would lead to loopback
    assert (receiver.dialled, receiver.names) == ([(PUBLIC, 443)], [HOST])
    first, headers, body = receiver.got[0]
    assert (first, headers["host"], headers["webhook-id"], body) == (
        "POST /in?key=1 HTTP/1.1",
        HOST,
        "m",
        b"{}",
    )


def test_a_certificate_of_another_host_or_of_nobody_known_is_refused(receiver: Receiver) -> None:
    other = receiver.sender().post(Place("other.example", 443, "/"), {}, b"{}")
    nobody = replace(receiver.sender(), context=ssl.create_default_context())
    receiver.resolved.clear()
    strange = nobody.post(Place(HOST, 443, "/"), {}, b"{}")
    assert (other.status, strange.status, receiver.got) == (None, None, [])
    for detail in (other.detail, strange.detail):
        assert "certificate" in detail.lower()


@pytest.mark.parametrize("status", [301, 302, 303, 307, 308])
def test_a_redirect_is_not_followed(receiver: Receiver, status: int) -> None:
    receiver.answers.append(says(f"HTTP/1.1 {status} X\r\nLocation: https://hooks.example/b\r\n\r\n"))
    answer = receiver.sender().post(Place(HOST, 443, "/"), {}, b"{}")
    assert (answer.status, answer.taken, len(receiver.got)) == (status, False, 1)
    assert "redirects are not followed" in answer.detail


def _silent(over: ssl.SSLSocket) -> None:
    over.recv(1)


def _dripping(over: ssl.SSLSocket) -> None:
    over.settimeout(0.02)
    while True:
        over.sendall(b"H" if over.pending() == 0 else b"")
        with contextlib.suppress(TimeoutError):
            if over.recv(1) == b"":
                return


def _endless_body(over: ssl.SSLSocket) -> None:
    over.sendall(b"HTTP/1.1 200 OK\r\n\r\n")
    while True:
        over.sendall(b"x" * 65536)


def _endless_head(over: ssl.SSLSocket) -> None:
    over.sendall(b"HTTP/1.1 200 OK\r\n")
    while True:
        over.sendall(b"X-More: 1\r\n" * 1000)


def _endless_continue(over: ssl.SSLSocket) -> None:
    while True:
        over.sendall(b"HTTP/1.1 100 Continue\r\n\r\n")


@pytest.mark.parametrize(
    ("behaviour", "limit_s", "status", "word"),
    [
        (_silent, 0.3, None, "no answer within 0.3 s"),
        (_endless_continue, 15.0, None, "65536 bytes came"),
        (_endless_head, 15.0, 200, "answered 200"),
        (_endless_body, 15.0, 200, "answered 200"),
        (_dripping, 0.3, None, "no answer within 0.3 s"),
        (says("nonsense\r\n\r\n"), 15.0, None, "no answer"),
        (says(""), 15.0, None, "no answer"),
    ],
)
def test_a_slow_or_endless_answer_holds_nobody(
    receiver: Receiver, behaviour: Any, limit_s: float, status: int | None, word: str
) -> None:
    receiver.answers.append(behaviour)
    answer = receiver.sender(limit_s).post(Place(HOST, 443, "/"), {}, b"{}")
    assert answer.status == status
    assert word in answer.detail


def test_a_name_that_is_not_known_and_a_closed_port_are_said() -> None:
    def unknown(_host: str, _port: int) -> list[str]:
        raise socket.gaierror(-2, "Name or service not known")

    def closed(*_given: Any) -> socket.socket:
        raise ConnectionRefusedError(111, "Connection refused")

    place = Place(HOST, 443, "/")
    assert "Name or service not known" in Sender(unknown).post(place, {}, b"").detail
    assert "Connection refused" in Sender(lambda _h, _p: [PUBLIC], closed).post(place, {}, b"").detail


def test_an_address_that_does_not_answer_is_followed_by_the_next(receiver: Receiver) -> None:
    """A name has an address of either version, and many machines reach one of them."""
    receiver.answers.append(says("HTTP/1.1 200 OK\r\n\r\n"))
    whole, asked = receiver.sender(), []

    def connect(address: tuple[str, int], limit_s: float) -> socket.socket:
        asked.append(address[0])
        if ":" in address[0]:
            raise OSError(101, "Network is unreachable")
        return whole.connect(address, limit_s)

    both = ["2606:2800:21f:cb07:6820:80da:af6b:8b2c", PUBLIC]
    sender = replace(whole, resolve=lambda _h, _p: both, connect=connect)
    assert sender.post(Place(HOST, 443, "/"), {}, b"{}") == Answer(200, "answered 200")
    assert asked == both


# ---- deliveries


class Post:
    """Takes messages in place of the network; answers as it is told, 200 else."""

    time_limit_s = 1.0

    def __init__(self) -> None:
        self.got: list[tuple[dict[str, str], Any]] = []
        self.bodies: list[bytes] = []
        self.statuses: list[int | None] = []

    def post(self, place: Place, headers: Any, body: bytes) -> Answer:
        assert place.host == HOST
        self.got.append((dict(headers), json.loads(body)))
        self.bodies.append(body)
        status = self.statuses.pop(0) if self.statuses else 200
        return Answer(status, "no connection" if status is None else f"answered {status}")

    @property
    def events(self) -> list[int]:
        return [body["data"]["event"] for _, body in self.got]


class Site:
    """A mission with its service, a receiver and a clock."""

    def __init__(self, api: Api, mission: Mission) -> None:
        self.api, self.mission, self.post = api, f"/missions/{mission.id}", Post()
        self.now = FIRST
        self.courier = self.another()

    def another(self) -> Courier:
        return Courier(self.api.repo, self.post, lambda: self.now)  # type: ignore[arg-type]

    def hook(self, **more: Any) -> dict[str, Any]:
        made: dict[str, Any] = self.api.post(
            f"{self.mission}/webhooks", {"name": "lab", "url": URL, **more}, who="Planner"
        )
        return made

    def target(self, name: str) -> Any:
        return self.api.post(f"{self.mission}/targets", {"name": name, "east_m": 1.0, "north_m": 1.0})

    def deliveries(self, hook: dict[str, Any]) -> Any:
        return self.api.get(f"/webhooks/{hook['id']}/deliveries")

    def run(self) -> int:
        count = 0
        while tried := self.courier.step():
            count += tried
        return count


@pytest.fixture
def site(repo: Repository, mission: Mission) -> Iterator[Site]:
    public = "https://ops.example"
    settings = repo.settings.model_copy(update={"webhook_hosts": HOST, "public_url": public})
    for api in open_api(replace(repo, settings=settings)):
        yield Site(api, mission)


def test_events_are_told_signed_with_ids_and_without_contents(site: Site) -> None:
    hook = site.hook()
    target = site.target("Secret rock")
    assert site.run() == 1
    headers, body = site.post.got[0]
    data = body["data"]
    assert (body["type"], data["id"], data["action"]) == ("target.create", target["id"], "create")
    assert data["url"] == f"https://ops.example/api/v1/targets/{target['id']}"
    assert headers["webhook-id"] == f"{hook['id']}-{data['event']}"
    assert b"Secret rock" not in site.post.bodies[0]
    assert verify()(hook["secret"], headers, site.post.bodies[0], FIRST.timestamp())
    (told,) = site.deliveries(hook)["items"]
    assert (told["state"], told["status"], told["attempts"]) == ("delivered", 200, 1)
    assert site.run() == 0


def test_a_webhook_is_told_of_its_kinds_alone(site: Site) -> None:
    site.hook(kinds=["comment"])
    site.target("A")
    site.api.post(
        f"{site.mission}/comments", {"subject_kind": "mission", "subject_id": site.mission[10:], "text": "x"}
    )
    site.target("B")
    assert site.run() == 1
    assert [body["type"] for _, body in site.post.got] == ["comment.create"]


def test_a_receiver_that_fails_and_recovers_gets_each_event_in_order(site: Site) -> None:
    hook = site.hook()
    for name in "ABC":
        site.target(name)
    site.post.statuses = [500, None, 302, 200]
    assert site.run() == 1  # and not the next, which waits
    for wait in WAITS_S[:2]:
        site.now += timedelta(seconds=wait - 1)
        assert site.run() == 0
        site.now += timedelta(seconds=1)
        assert site.run() == 1
    assert "failed 3 times" in site.deliveries(hook)["trouble"]
    site.now += timedelta(seconds=WAITS_S[2])
    assert site.run() == 3
    first = site.post.events[0]
    assert site.post.events == [first] * 4 + [first + 1, first + 2]
    assert len({headers["webhook-id"] for headers, _ in site.post.got}) == 3
    assert site.deliveries(hook)["trouble"] == ""


def test_an_event_is_given_up_after_the_last_try_and_said(
    site: Site, caplog: pytest.LogCaptureFixture
) -> None:
    hook = site.hook()
    site.target("A")
    site.target("B")
    tries = len(WAITS_S) + 1
    site.post.statuses = [503] * tries
    with caplog.at_level(logging.WARNING):
        for _ in range(tries):
            site.now += timedelta(seconds=max(WAITS_S))
            site.courier.step()
    assert "given up" in caplog.text
    (told,) = site.deliveries(hook)["items"]
    assert (told["state"], told["attempts"], told["status"]) == ("given_up", tries, 503)
    assert f"given up after {tries} tries" in site.deliveries(hook)["trouble"]
    assert site.run() == 1
    assert site.post.events == [told["event"]] * tries + [told["event"] + 1]


def test_what_was_sent_and_not_written_down_is_sent_again_with_the_same_id(site: Site) -> None:
    hook = site.hook()
    for name in "AB":
        site.target(name)
    errand = site.courier.take(hook["id"])
    assert errand is not None
    site.courier.send(errand)  # and then the process dies
    other = site.another()
    assert other.step() == 0  # the dead one still holds it
    site.now += timedelta(seconds=LEASE_S + 1)
    assert (other.step(), other.step(), other.step()) == (1, 1, 0)
    first = site.post.events[0]
    assert site.post.events == [first, first, first + 1]
    assert site.post.got[0][0]["webhook-id"] == site.post.got[1][0]["webhook-id"]
    site.courier.settle(errand, Answer(500, "late"))  # who lost the lease writes nothing
    assert [d["state"] for d in site.deliveries(hook)["items"]] == ["delivered", "delivered"]


def test_two_couriers_do_not_send_by_one_webhook_at_once(site: Site) -> None:
    hook = site.hook()
    site.target("A")
    assert site.courier.take(hook["id"]) is not None
    assert site.another().take(hook["id"]) is None


def test_a_slow_receiver_and_a_damaged_row_hold_up_no_other_webhook(site: Site) -> None:
    slow, fast = site.hook(name="slow"), site.hook(name="fast")
    damaged = site.hook(name="damaged")
    held, sent = threading.Event(), threading.Event()
    take, post = site.courier.take, site.post.post

    def taken(webhook_id: str) -> Any:
        if webhook_id == damaged["id"]:
            raise DamagedDataError("the row psn-1 of people holds the role 'king'")
        return take(webhook_id)

    def posted(place: Place, headers: Any, body: bytes) -> Answer:
        if headers["webhook-id"].startswith(slow["id"]):
            held.wait(30.0)
        else:
            sent.set()
        return post(place, headers, body)

    site.courier.take, site.post.post = taken, posted  # type: ignore[method-assign]
    site.courier.start()
    try:
        for name in "AB":
            sent.clear()
            site.target(name)
            assert sent.wait(20.0), "the fast one waits for the slow one"
        assert [d["event"] for d in site.deliveries(slow)["items"]] == []
    finally:
        held.set()
        site.courier.stop()
    assert site.deliveries(fast)["items"][0]["state"] == "delivered"


def test_an_event_is_sent_again_by_hand(site: Site) -> None:
    hook = site.hook()
    for name in "AB":
        site.target(name)
    site.run()
    event, path = site.post.events[0], f"/webhooks/{hook['id']}/redeliver"
    assert site.api.post(path, {"event": event}, 200)["state"] == "queued"
    assert site.run() == 1
    assert site.post.events == [event, event + 1, event]
    assert {d["state"] for d in site.deliveries(hook)["items"]} == {"delivered"}
    site.api.post(path, {"event": 10_000}, 404)
    site.target("C")
    assert "is at event" in site.api.post(path, {"event": event + 2}, 409)["detail"]


def test_a_rotated_secret_signs_beside_the_old_one_for_a_day(site: Site) -> None:
    hook = site.hook()
    site.now = datetime.now(UTC)
    new = site.api.post(f"/webhooks/{hook['id']}/secret", None, 200)["secret"]
    site.target("A")
    site.run()
    site.now += timedelta(hours=25)
    site.target("B")
    site.run()
    check, (first, second) = verify(), site.post.got[-2:]
    at = [int(headers["webhook-timestamp"]) for headers, _ in (first, second)]
    bodies = site.post.bodies[-2:]
    assert check(new, first[0], bodies[0], at[0])
    assert check(hook["secret"], first[0], bodies[0], at[0])
    assert check(new, second[0], bodies[1], at[1])
    assert not check(hook["secret"], second[0], bodies[1], at[1])


@pytest.mark.parametrize("what", [{"active": False}, {"role": "none"}, {"mission_roles": "none"}])
def test_a_webhook_tells_what_its_author_may_see_and_no_more(site: Site, what: dict[str, Any]) -> None:
    hook = site.hook()
    with site.api.repo.database.write() as session:
        planner = session.scalars(select(PersonRow).where(PersonRow.name == "Planner")).one()
        for name, value in what.items():
            roles = {site.mission.rpartition("/")[2]: value}
            setattr(planner, name, roles if name == "mission_roles" else value)
    site.api.post(f"{site.mission}/targets", {"east_m": 1.0, "north_m": 1.0}, who="Scientist")
    assert (site.run(), site.post.got) == (0, [])
    told = site.api.get(f"/webhooks/{hook['id']}/deliveries", who="Scientist")
    assert "its author Planner" in told["trouble"]


def test_the_host_is_held_against_the_setting_when_made_changed_and_sent(site: Site) -> None:
    given = {"name": "x", "url": "https://other.example/"}
    problem = site.api.post(f"{site.mission}/webhooks", given, 422)
    assert "OUTCROP_WEBHOOK_HOSTS" in problem["detail"]
    hook = site.hook()
    path, head = f"/webhooks/{hook['id']}", {"If-Match": "*"}
    assert site.api("PATCH", path, {"url": given["url"]}, headers=head).status_code == 422
    site.target("A")
    none = site.api.repo.settings.model_copy(update={"webhook_hosts": ""})
    shut = Courier(replace(site.api.repo, settings=none), site.post, lambda: site.now)  # type: ignore[arg-type]
    assert shut.step() == 1
    assert site.post.got == []
    assert "may not lead to hooks.example" in site.deliveries(hook)["items"][0]["detail"]


def test_one_that_is_off_sends_nothing_and_goes_on_where_it_was(site: Site) -> None:
    hook = site.hook()
    path, head = f"/webhooks/{hook['id']}", {"If-Match": "*"}
    assert site.api("PATCH", path, {"active": False}, headers=head).status_code == 200
    site.target("A")
    assert site.run() == 0
    assert site.api("PATCH", path, {"active": True}, headers=head).status_code == 200
    site.run()
    kinds = [body["type"] for _, body in site.post.got]
    assert kinds == ["webhook.change", "target.create", "webhook.change"]
    assert site.api("DELETE", path, headers=head).status_code == 204
    with site.api.repo.database.read() as session:
        assert session.scalars(select(WebhookStateRow)).all() == []
        assert session.scalars(select(WebhookDeliveryRow)).all() == []


def test_old_deliveries_are_forgotten(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ground.app.courier.KEPT", 3)
    assert KEPT > 3
    hook = site.hook()
    for name in "ABCDE":
        site.target(name)
    site.run()
    assert [d["event"] for d in site.deliveries(hook)["items"]] == site.post.events[:1:-1]


# ---- secrets


def test_the_secret_is_told_once_and_stands_nowhere_else(site: Site, tmp_path: Path) -> None:
    hook, repo = site.hook(), site.api.repo
    site.target("A")
    site.run()
    mission = site.mission.rpartition("/")[2]
    told = [
        site.api("GET", path).text
        for path in (
            f"/webhooks/{hook['id']}",
            f"{site.mission}/webhooks",
            f"/webhooks/{hook['id']}/deliveries",
            f"{site.mission}/history?limit=200",
        )
    ]
    export_mission(repo, SYSTEM_ACTOR, mission, tmp_path / "m.zip")
    with repo.database.read() as session:
        told += [str((e.before, e.after, e.rows)) for e in session.scalars(select(EventRow))]
    assert hook["secret"] not in "".join(told)
    with zipfile.ZipFile(tmp_path / "m.zip") as archive:
        rows = json.loads(archive.read("rows.json"))
        assert all(hook["secret"].encode() not in archive.read(name) for name in archive.namelist())
    assert "webhooks" not in rows


def test_a_narrowed_key_makes_no_webhook_which_would_outlive_it(site: Site) -> None:
    owner = Actor("Planner", Role.PLANNER)
    key = create_api_key(site.api.repo, owner, "k", 1, Role.PLANNER)
    head = {"Authorization": f"Bearer {key.secret}"}
    hook = site.hook()
    given = {"name": "x", "url": URL}
    assert site.api("POST", f"{site.mission}/webhooks", given, headers=head).status_code == 403
    assert site.api("POST", f"/webhooks/{hook['id']}/secret", headers=head).status_code == 403


@pytest.mark.parametrize("passphrase", [None, "four words of one's own"])
def test_a_backup_holds_the_secret_only_sealed(site: Site, tmp_path: Path, passphrase: str | None) -> None:
    hook, repo = site.hook(), site.api.repo
    file = tmp_path / "all.tar"
    backup(repo, file, passphrase=passphrase)
    assert hook["secret"].encode() not in file.read_bytes()
    other = open_repository(settings_for(tmp_path / "other", webhook_hosts=HOST))
    restore(other, file, passphrase=passphrase)
    assert drill(repo, file, passphrase=passphrase) == []
    with other.database.read() as session:
        found = session.get(WebhookStateRow, hook["id"])
    assert (found is not None and found.secret) == (hook["secret"] if passphrase else False)
    for api in open_api(other):
        again = api.post(f"/webhooks/{hook['id']}/secret", None, 200, who="Planner")
        assert again["secret"] != hook["secret"]
        assert api.get(f"/webhooks/{hook['id']}/deliveries")["trouble"] == ""
    other.database.dispose()


def test_every_address_that_a_message_names_is_one_of_the_interface() -> None:
    paths = build_api().openapi()["paths"]
    assert set(READ_AT) == set(get_args(EventKind)) - {"approval"}
    for kind, collection in READ_AT.items():
        assert "get" in paths[f"/api/v1/{collection}/{{{kind}_id}}"], kind
