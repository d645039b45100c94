"""What a provider of log-ins tells of itself: asked over the network, and kept for a while.

Anybody may begin a log-in. Without keeping what was told, each would ask the provider again, and a slow one
would have every thread of the server wait for it.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import httpx

from ground.errors import AuthenticationError, UnavailableError
from mission.codec import Document

TIMEOUT_S = 10.0
KEEP_S = 300.0
"""How long metadata and keys are taken as told; keys that fail are asked for again before."""
FAIL_S = 5.0
"""How long a provider that did not answer is left alone, and the least time between two looks at its keys."""


@dataclass(frozen=True, slots=True)
class _Told:
    at_s: float
    document: Document
    trouble: str = ""


class ToldByProvider:
    """Documents of a provider by address. One thread asks at a time; the others get what it was told."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._told: dict[str, _Told] = {}

    def read(self, address: str, *, anew: bool = False) -> Mapping[str, object]:
        """Return a document, kept for `KEEP_S`; with `anew` for `FAIL_S` alone.

        Raises
        ------
        UnavailableError
            If the provider does not answer, or did not a moment ago.
        """
        with self._lock:
            told = self._told.get(address)
            keep_s = FAIL_S if anew or (told is not None and told.trouble) else KEEP_S
            if told is None or self._clock() - told.at_s >= keep_s:
                try:
                    told = _Told(self._clock(), ask("GET", address))
                except UnavailableError as err:
                    told = _Told(self._clock(), {}, err.message)
                self._told[address] = told
        if told.trouble:
            raise UnavailableError(told.trouble)
        return told.document

    def forget(self) -> None:
        """Take nothing as told."""
        with self._lock:
            self._told.clear()


def ask(method: str, address: str, **options: Any) -> Mapping[str, object]:
    """Return the JSON object of an answer of the provider.

    Raises
    ------
    AuthenticationError
        If it refuses what is handed in.
    UnavailableError
        If it does not answer, or not as it should.
    """
    try:
        answer = httpx.request(method, address, timeout=TIMEOUT_S, follow_redirects=False, **options)
        document = answer.json()
    except (httpx.HTTPError, ValueError) as err:
        raise UnavailableError(f"the provider does not answer at {address}: {err}") from err
    if method == "POST" and 400 <= answer.status_code < 500:
        raise AuthenticationError(f"the provider refuses: {str(document)[:200]}")
    if answer.status_code != 200 or not isinstance(document, dict):
        raise UnavailableError(f"the provider answers {answer.status_code} at {address}")
    return document
