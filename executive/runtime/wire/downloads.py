"""Data products that come down in pieces: asked for piece by piece, held to their hash, kept when whole."""

from __future__ import annotations

import base64
import binascii
import hashlib
import logging
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from executive.errors import WireError
from executive.ports import Product
from executive.runtime.wire.messages import text, whole

logger = logging.getLogger(__name__)

CHUNK = 192 * 1024
"""Bytes asked for at a time: in base64 a quarter of the longest frame."""
LARGEST = 1 << 32
"""Bytes of the largest product that is taken down."""
TRIES = 3
"""How often a file whose hash is wrong is taken down anew."""


@dataclass(slots=True)
class _File:
    path: str
    sha256: str | None
    """None for the label beside a product, which needs no hash: it names that of the product."""
    at: int = 0
    asked: float = 0.0
    tries: int = 1
    failed: bool = False
    """It could not be written at least once."""
    digest: hashlib._Hash = field(default_factory=hashlib.sha256)


def safe_path(path: str) -> PurePosixPath | None:
    """Return a product's path below the run's folder, None if it leads elsewhere."""
    relative = PurePosixPath(path)
    odd = relative.is_absolute() or ".." in relative.parts or "\\" in path or "\0" in path
    return None if odd or len(relative.parts) < 2 or relative.parts[0] != "products" else relative


class Downloads:
    """The files that are still to come into the folder of a run; belongs to one thread."""

    def __init__(self, out: Path, complain: Callable[[str, str], None]) -> None:
        self._out, self._complain = out, complain
        self._waiting: deque[_File] = deque()
        self._seen: set[str] = set()

    @property
    def open(self) -> int:
        """Return how many files are still to come."""
        return len(self._waiting)

    def want(self, product: Product) -> None:
        """Line up a product and the label beside it."""
        if product.path in self._seen:
            return
        self._seen.add(product.path)
        if safe_path(product.path) is None:
            self._complain("product", f"the product path {product.path!a} leads out of products/: not taken")
            return
        for one in (_File(product.path, product.sha256), _File(f"{product.path}.json", None)):
            if not (self._out / one.path).exists():
                self._waiting.append(one)

    def request(self, now: float, retry_s: float) -> dict[str, object] | None:
        """Return the message that asks for the next piece, if one is due at `now` (monotonic, s)."""
        if not self._waiting or now - self._waiting[0].asked < retry_s:
            return None
        first = self._waiting[0]
        first.asked = now
        return {"m": "fetch", "path": first.path, "offset": first.at, "size": CHUNK}

    def take(self, message: dict[str, object]) -> None:
        """Write down a piece.

        Raises
        ------
        WireError
            If the message is malformed.
        """
        if not self._waiting or text(message, "path") != self._waiting[0].path:
            return
        first = self._waiting[0]
        if message.get("total") is None:
            self._drop(first, "the rover has no such file" if first.sha256 else "")
            return
        total = whole(message, "total")
        if whole(message, "offset") != first.at:
            return
        try:
            data = base64.b64decode(text(message, "data"), validate=True)
        except (binascii.Error, ValueError) as error:
            raise WireError(f"chunk of {first.path!a}: {error}") from error
        if total > LARGEST or first.at + len(data) > total or (not data and first.at < total):
            self._drop(first, f"{len(data)} bytes at {first.at} of {total} make no file")
            return
        try:
            self._write(first, data)
            first.at += len(data)
            first.asked = 0.0
            if first.at == total:
                self._close(first)
        except OSError as error:  # it is asked for again: a full disk may have room later
            self._put_last(first, error)

    def _part(self, one: _File) -> Path:
        return self._out / f"{one.path}.part"

    def _write(self, one: _File, data: bytes) -> None:
        path = self._part(one)
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("r+b" if one.at else "wb") as file:
            file.seek(one.at)
            file.write(data)
        one.digest.update(data)

    def _close(self, one: _File) -> None:
        """Give a file its name if it is what the rover said it made."""
        found = one.digest.hexdigest()
        if one.sha256 in (None, found):
            if one.at == 0:
                self._write(one, b"")
            self._part(one).replace(self._out / one.path)
            self._waiting.popleft()
        elif one.tries < TRIES:
            one.at, one.asked, one.tries, one.digest = 0, 0.0, one.tries + 1, hashlib.sha256()
        else:
            self._drop(one, f"SHA-256 {found[:12]}, not {str(one.sha256)[:12]}, {TRIES} times")

    def _put_last(self, one: _File, error: OSError) -> None:
        """Let the other files come first, and begin this one anew after them."""
        if not one.failed:
            self._complain("product", f"{one.path} cannot be written, and is tried again: {error.strerror}")
        one.failed, one.at, one.digest = True, 0, hashlib.sha256()
        self._waiting.rotate(-1)

    def _drop(self, one: _File, why: str) -> None:
        self._waiting.popleft()
        with suppress(OSError):
            self._part(one).unlink(missing_ok=True)
        if why:
            self._complain("product", f"{one.path} did not come down: {why}")
