"""Post one message: the name is resolved once, its addresses are checked, and that very address is used.

So a name that leads elsewhere at its second look-up (DNS rebinding) leads nowhere. The name still stands in
TLS and in the header Host. No proxy of the environment is asked, no redirect is followed, and of the answer
no more than the line with the status is read.
"""

from __future__ import annotations

import re
import socket
import ssl
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from ground.resources.webhooks.rules import Place, why_refused

Resolve = Callable[[str, int], list[str]]
"""Return the addresses of a host, for a port."""
Connect = Callable[[tuple[str, int], float], socket.socket]
"""Connect to an address and port within seconds."""
TIME_LIMIT_S = 15.0
"""Standard Webhooks recommends 15 to 30 s."""


MOST_READ = 65536
"""Bytes of interim answers (100 to 199) before the status; a fair server sends some dozens."""
_STATUS = re.compile(rb"HTTP/1\.[01] ([1-5][0-9][0-9])[ \r\n]")


@dataclass(frozen=True, slots=True)
class Answer:
    """The status of an answer, null if there was none, and what is said of it."""

    status: int | None
    detail: str

    @property
    def taken(self) -> bool:
        """Whether the message was taken: any status of 200 to 299."""
        return self.status is not None and 200 <= self.status < 300


def addresses_of(host: str, port: int) -> list[str]:
    """Return the addresses of a host as the system resolves it."""
    found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    return list(dict.fromkeys(str(entry[4][0]) for entry in found))


@dataclass(frozen=True, slots=True)
class Sender:
    """What a message is sent with."""

    resolve: Resolve = addresses_of
    connect: Connect = socket.create_connection
    context: ssl.SSLContext = field(default_factory=ssl.create_default_context)
    time_limit_s: float = TIME_LIMIT_S
    """For connection, handshake, request and the status of the answer together; looking up the name has the
    system's own limit.
    """

    def post(self, place: Place, headers: Mapping[str, str], body: bytes) -> Answer:
        """Send a message and return what came of it; nothing of the network is raised."""
        try:
            addresses = self.resolve(place.host, place.port)
        except (OSError, UnicodeError) as err:
            return Answer(None, f"the name {place.host} is not known: {_words(err)}"[:200])
        for address in addresses:
            why = why_refused(address)
            if why:
                return Answer(None, f"{place.host} leads to {address}, which is refused: {why}"[:200])
        if not addresses:
            return Answer(None, f"the name {place.host} has no address"[:200])
        until = time.monotonic() + self.time_limit_s
        failed = ""
        for address in addresses:  # of either version of IP; many machines reach one of them only
            left = until - time.monotonic()
            if left <= 0.0:
                break
            try:
                plain = self.connect((address, place.port), left)
            except OSError as err:
                failed = failed or _words(err)
                continue
            with plain:
                return self._over(plain, until, place, headers, body)
        return Answer(None, f"no connection: {failed}"[:200])

    def _over(
        self, plain: socket.socket, until: float, place: Place, headers: Mapping[str, str], body: bytes
    ) -> Answer:
        sent = {**headers, "Host": place.authority, "Content-Length": str(len(body))}
        lines = [f"POST {place.path} HTTP/1.1", *(f"{name}: {value}" for name, value in sent.items())]
        try:
            plain.settimeout(max(until - time.monotonic(), 0.001))
            with self.context.wrap_socket(plain, server_hostname=place.host) as secure:
                secure.sendall("\r\n".join([*lines, "", ""]).encode("ascii") + body)
                status = _status(secure, until)
        except TimeoutError:
            return Answer(None, f"no answer within {self.time_limit_s:g} s")
        except (OSError, ValueError) as err:
            return Answer(None, f"no answer: {_words(err)}"[:200])
        if 300 <= status < 400:
            return Answer(status, f"answered {status}; redirects are not followed")
        return Answer(status, f"answered {status}")


def _status(secure: ssl.SSLSocket, until: float) -> int:
    """Return the status of the answer, read no further than its first line; those of 100 to 199 go before it.

    Raises
    ------
    TimeoutError
        If it is not there in time.
    ValueError
        If it is not an answer of HTTP, or the other side goes on without one.
    """
    head, read = b"", 0
    while read < MOST_READ:
        left = until - time.monotonic()
        if left <= 0.0:
            raise TimeoutError
        secure.settimeout(left)
        part = secure.recv(4096)
        if not part:
            raise ValueError("the connection was closed without one")
        head, read = head + part, read + len(part)
        while b"\n" in head:
            found = _STATUS.match(head)
            if found is None:
                raise ValueError("what came is not HTTP")
            if found[1] >= b"200":
                return int(found[1])
            _, ended, behind = head.partition(b"\r\n\r\n")
            if not ended:
                break
            head = behind
    raise ValueError(f"{MOST_READ} bytes came without one")


def _words(err: BaseException) -> str:
    return getattr(err, "strerror", None) or str(err) or type(err).__name__
