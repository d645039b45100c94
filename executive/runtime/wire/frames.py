"""Frames of `wire/1`: four bytes of length, then one JSON object."""

from __future__ import annotations

import json
import socket
import ssl
from collections import deque
from collections.abc import Mapping

from executive.errors import WireError

LIMIT = 1 << 20
"""Bytes of the longest frame: one that announces more is a lie or a foreign protocol, and ends the line."""
HEAD = 4

_encode = json.JSONEncoder(separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode


def frame(document: Mapping[str, object]) -> bytes:
    """Return the frame of a message.

    Raises
    ------
    WireError
        If it holds what JSON cannot, or is longer than the limit.
    """
    try:
        body = _encode(document).encode()
    except (TypeError, ValueError) as error:
        raise WireError(f"message {document.get('m')!a} is not JSON: {error}") from error
    if len(body) > LIMIT:
        raise WireError(f"message {document.get('m')!a} has {len(body)} bytes; a frame holds {LIMIT}")
    return len(body).to_bytes(HEAD, "big") + body


class FrameReader:
    """Cuts what comes in into messages; keeps at most one frame that is not whole yet."""

    def __init__(self) -> None:
        self._rest = bytearray()

    def feed(self, data: bytes) -> list[dict[str, object]]:
        """Return the messages that are whole now.

        Raises
        ------
        WireError
            If a length is 0 or over the limit, or a frame is not a JSON object: the place of the next frame
            is then not known, and the line has to be begun anew.
        """
        rest = self._rest
        rest += data
        found: list[dict[str, object]] = []
        at = 0
        while len(rest) - at >= HEAD:
            length = int.from_bytes(rest[at : at + HEAD], "big")
            if not 0 < length <= LIMIT:
                raise WireError(f"a frame says that it has {length} bytes; 1 to {LIMIT} are allowed")
            if len(rest) - at < HEAD + length:
                break
            found.append(_object(bytes(rest[at + HEAD : at + HEAD + length])))
            at += HEAD + length
        del rest[:at]
        return found


def _object(body: bytes) -> dict[str, object]:
    try:
        document = json.loads(body)
    except (ValueError, RecursionError) as error:
        raise WireError(f"a frame of {len(body)} bytes is not JSON: {str(error)[:80]}") from error
    if not isinstance(document, dict):
        raise WireError(f"a frame holds {str(document)[:40]!a}, not an object")
    return document


class Connection:
    """One end of a line that never blocks; reads and writes belong to one thread, `put` to any."""

    def __init__(self, line: socket.socket) -> None:
        line.setblocking(False)
        self.line = line
        self._reader = FrameReader()
        self._waiting: deque[bytes] = deque()
        self._current = memoryview(b"")

    def put(self, document: Mapping[str, object], *, urgent: bool = False) -> None:
        """Line up a message; an urgent one goes before all that have not begun to leave."""
        data = frame(document)
        if urgent:
            self._waiting.appendleft(data)
        else:
            self._waiting.append(data)

    def put_raw(self, data: bytes) -> None:
        """Line up bytes that may be no frame; for checks."""
        self._waiting.append(data)

    @property
    def wants_to_write(self) -> bool:
        return bool(self._current or self._waiting)

    @property
    def backlog(self) -> int:
        """Return how many messages wait."""
        return len(self._waiting)

    def read(self) -> list[dict[str, object]]:
        """Return the messages that have come.

        Raises
        ------
        WireError
            If the line is closed, broken or does not speak in frames.
        """
        found: list[dict[str, object]] = []
        while True:
            try:
                data = self.line.recv(1 << 16)
            except (BlockingIOError, ssl.SSLWantReadError, ssl.SSLWantWriteError):
                return found
            except OSError as error:
                raise WireError(f"the line broke: {error.strerror or error}") from error
            if not data:
                if found:
                    return found
                raise WireError("the line was closed")
            found += self._reader.feed(data)

    def write(self) -> None:
        """Send what the line takes.

        Raises
        ------
        WireError
            If the line is broken.
        """
        while self.wants_to_write:
            if not self._current:
                try:
                    self._current = memoryview(self._waiting.popleft())
                except IndexError:
                    return
            try:
                sent = self.line.send(self._current)
            except (BlockingIOError, ssl.SSLWantReadError, ssl.SSLWantWriteError):
                return
            except OSError as error:
                raise WireError(f"the line broke: {error.strerror or error}") from error
            self._current = self._current[sent:]

    def close(self) -> None:
        self.line.close()
