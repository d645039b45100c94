"""A process that holds a private key and signs over a Unix socket: who asks never reads the key.

One line of JSON asks, one answers: `{"ask": "public"}`, or `{"ask": "sign", "form", "role", "content"}` with
the content in base64. What is signed names its form and role (`ground.uplink.verify.message`), and a signer
signs those forms alone that it was started for: who reaches the socket of one that signs heads of the audit
cannot have a plan signed.
"""

from __future__ import annotations

import base64
import binascii
import contextlib
import json
import logging
import os
import socket
import stat
import struct
import threading
from collections.abc import Iterator
from pathlib import Path

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from ground.errors import UnavailableError
from ground.uplink.keys import public_text, sign

logger = logging.getLogger(__name__)
LONGEST = 8 * 2**20
"""Bytes of a question; a manifest has some kilobytes, the heads of 10,000 missions one megabyte."""
WAIT_S = 10.0
"""Who asks sends its line within this; another can ask after it."""
LOOK_S = 0.5
"""After which the one who answers looks up: a signal that comes just before it listens wakes nobody."""
ASKING = threading.BoundedSemaphore(8)


class Signer:
    """Answers on a socket that its owner alone may open."""

    def __init__(self, key: Ed25519PrivateKey, path: Path, forms: frozenset[str]) -> None:
        self._key, self._path, self._forms = key, path, forms
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        _make_way(path)
        earlier = os.umask(0o177)  # the socket is never there with a wider mode
        try:
            self._socket.bind(str(path))
        except OSError as err:
            raise UnavailableError(f"the socket {path} cannot be made: {err.strerror}") from err
        finally:
            os.umask(earlier)
        self._socket.listen(16)
        self._socket.settimeout(LOOK_S)

    def serve(self) -> None:
        """Answer until `stop`."""
        while True:
            try:
                asker, _ = self._socket.accept()
            except TimeoutError:
                continue
            except OSError:
                return
            threading.Thread(target=self._answer, args=(asker,), daemon=True).start()

    def stop(self) -> None:
        """End `serve`, and take the socket away."""
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()
        self._path.unlink(missing_ok=True)

    def _answer(self, asker: socket.socket) -> None:
        with asker, ASKING:
            asker.settimeout(WAIT_S)
            try:
                _check_peer(asker)
                said = self._say(_line(asker))
            except (OSError, ValueError, RecursionError) as err:
                said = {"error": str(err)}
            with contextlib.suppress(OSError):
                asker.sendall(json.dumps(said).encode() + b"\n")

    def _say(self, line: bytes) -> dict[str, str]:
        """Return the answer to a question.

        Raises
        ------
        ValueError
            If it is none, or asks for a form that is not signed here.
        """
        asked = json.loads(line)
        if not isinstance(asked, dict):
            raise ValueError("a question is one JSON object on a line")
        if asked.get("ask") == "public":
            return {"public": public_text(self._key)}
        form, role, content = (asked.get(name) for name in ("form", "role", "content"))
        if asked.get("ask") != "sign" or not all(isinstance(x, str) for x in (form, role, content)):
            raise ValueError("ask `public`, or `sign` with form, role and content")
        if form not in self._forms:
            raise ValueError(f"this signer signs {', '.join(sorted(self._forms))}, not {str(form)[:40]!r}")
        try:
            plain = base64.b64decode(str(content), validate=True)
        except binascii.Error:
            raise ValueError("the content is not base64") from None
        logger.info("signed", extra={"form": form, "role": role, "size_bytes": len(plain)})
        return {"signature": sign(self._key, str(form), str(role), plain)}


class RemoteKey:
    """The key of a signer, as who asks it sees it."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def public_text(self) -> str:
        """Return its public half, base64."""
        return self._ask({"ask": "public"}, "public")

    def sign(self, form: str, role: str, content: bytes) -> str:
        """Return its signature, base64, over content in a role.

        Raises
        ------
        UnavailableError
            If no signer answers there, or it does not sign that.
        """
        told = {"ask": "sign", "form": form, "role": role, "content": base64.b64encode(content).decode()}
        return self._ask(told, "signature")

    def _ask(self, question: dict[str, str], wanted: str) -> str:
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as channel:
                channel.settimeout(WAIT_S)
                channel.connect(str(self._path))
                channel.sendall(json.dumps(question).encode() + b"\n")
                answer = json.loads(_line(channel))
                if wanted in answer:
                    return str(answer[wanted])
        except (OSError, ValueError) as err:
            raise UnavailableError(f"no signer answers at {self._path}: {err}") from err
        raise UnavailableError(f"the signer at {self._path} refuses: {answer.get('error')}")


def is_signer(path: Path) -> bool:
    """Say whether a path is the socket of a signer and not the file of a key.

    Raises
    ------
    UnavailableError
        If others may open it.
    """
    try:
        found = path.stat()
    except OSError:
        return False
    if not stat.S_ISSOCK(found.st_mode):
        return False
    if stat.S_IMODE(found.st_mode) & 0o077:
        raise UnavailableError(f"others may use the signer {path} (mode {stat.S_IMODE(found.st_mode):03o})")
    return True


def _make_way(path: Path) -> None:
    """Take away the socket of a signer that died; that of one that lives stays."""
    path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    if not path.exists():
        return
    if not stat.S_ISSOCK(path.stat().st_mode):
        raise UnavailableError(f"{path} is there and no socket")
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as channel:
        try:
            channel.connect(str(path))
        except OSError:
            path.unlink(missing_ok=True)
            return
    raise UnavailableError(f"a signer answers at {path} already")


def _check_peer(asker: socket.socket) -> None:
    """Raise unless who asks is of the same user, where the system tells."""
    if not hasattr(socket, "SO_PEERCRED"):
        return
    told = asker.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, struct.calcsize("3i"))
    user = struct.unpack("3i", told)[1]
    if user not in {os.geteuid(), 0}:
        raise ValueError(f"user {user} is not the one of this signer")


def _line(channel: socket.socket) -> bytes:
    """Return what comes until the end of the line.

    Raises
    ------
    ValueError
        If there is no end, or it is too long.
    """
    found = bytearray()
    for part in _parts(channel):
        found += part
        if len(found) > LONGEST:
            raise ValueError(f"a question has at most {LONGEST} bytes")
        if part.endswith(b"\n"):
            return bytes(found)
    raise ValueError("the line has no end")


def _parts(channel: socket.socket) -> Iterator[bytes]:
    while part := channel.recv(65536):
        yield part
