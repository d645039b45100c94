"""A client of one server: requests, answers, streams and long work."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Mapping
from itertools import islice
from pathlib import Path
from types import TracebackType
from typing import Any, NoReturn, Self
from urllib.parse import quote

import httpx

from ground.client.interface import PREFIX, Operation, Record
from ground.client.operations import Operations

DEFAULT_ADDRESS = "http://127.0.0.1:8000"
PAGE = 200
"""Rows asked for at once; a page of 200 targets has about 100 kB."""
OVER = {"succeeded", "failed", "cancelled"}


class ApiError(Exception):
    """The server answered with a problem document; `kind` is the last part of its type."""

    def __init__(self, status: int, document: Mapping[str, object]) -> None:
        super().__init__(str(document.get("detail") or document.get("title") or f"status {status}"))
        self.status, self.document = status, dict(document)
        self.kind = str(document.get("type", "")).rsplit(":", 1)[-1]


class ServerUnreachableError(Exception):
    """No server answers at the address."""


def _raise(response: httpx.Response) -> NoReturn:
    try:
        document = response.json()
    except ValueError:
        document = {"detail": response.text[:200]}
    raise ApiError(response.status_code, document if isinstance(document, dict) else {})


class Client(Operations):
    """Talks to one server, as one person: every operation of the interface is a method.

    Parameters
    ----------
    address
        Of the server, without path.
    person
        Name of a local profile, where the server uses profiles.
    api_key
        Secret of an API key, where it uses accounts.
    """

    def __init__(
        self,
        address: str = DEFAULT_ADDRESS,
        *,
        person: str | None = None,
        api_key: str | None = None,
        transport: httpx.BaseTransport | None = None,
    ) -> None:
        headers = {}
        if person is not None:
            headers["X-Outcrop-Person"] = person
        if api_key is not None:
            headers["Authorization"] = f"Bearer {api_key}"
        self.address = address.rstrip("/")
        self._http = httpx.Client(
            base_url=f"{self.address}{PREFIX}", headers=headers, timeout=120.0, transport=transport
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        self._http.close()

    def request(self, method: str, path: str, **options: Any) -> httpx.Response:
        """Return the answer to a request.

        Raises
        ------
        ApiError
            If it is a problem document.
        ServerUnreachableError
            If there is no answer.
        """
        try:
            response = self._http.request(method, path.removeprefix(PREFIX), **options)
        except httpx.TransportError as err:
            raise ServerUnreachableError(f"no server answers at {self.address} ({err})") from err
        if response.status_code >= 400:
            _raise(response)
        return response

    def send(self, operation: Operation, *where: str | int, **members: Any) -> httpx.Response:
        """Return the answer to an operation as it comes, with its headers.

        Raises
        ------
        TypeError
            If the operation takes something else.
        """
        path, options = _filled(operation, where, members)
        response = self.request(operation.method, path, **options)
        if operation.name == "create_session":  # its token goes with every change from now on
            self._http.headers["X-CSRF-Token"] = response.json()["csrf_token"]
        return response

    def call(self, operation: Operation, *where: str | int, **members: Any) -> Any:
        """Return the answer to an operation as the value that it describes."""
        if operation.media == "text/event-stream":
            path, options = _filled(operation, where, members)
            return self._stream(path, options["headers"])
        if operation.paged:
            limit = members.pop("limit", None)
            members["limit"] = PAGE if limit is None else min(PAGE, limit)
            return islice(self._pages(operation, where, members), limit)
        response = self.send(operation, *where, **members)
        if operation.media == "application/json":
            return json.loads(response.content, object_hook=Record)
        if operation.media == "text/plain":
            return response.text
        return response.content if operation.media else None

    def _pages(
        self, operation: Operation, where: tuple[str | int, ...], members: Mapping[str, Any]
    ) -> Iterator[Record]:
        asked = dict(members)
        follow = next(p.name for p in operation.parameters["query"] if p.name in {"cursor", "after"})
        while True:
            page = json.loads(self.send(operation, *where, **asked).content, object_hook=Record)
            yield from page["items"]
            if page["next_cursor"] is None:
                return
            asked[follow] = page["next_cursor"]

    def _stream(self, path: str, headers: Mapping[str, str]) -> Iterator[Record]:
        try:
            with self._http.stream("GET", path, headers=headers, timeout=None) as response:
                if response.status_code >= 400:
                    response.read()
                    _raise(response)
                yield from events_of(response.iter_lines())
        except httpx.TransportError as err:
            raise ServerUnreachableError(f"no server answers at {self.address} ({err})") from err

    def upload(self, path: Path) -> Record:
        """Upload a file."""
        with path.open("rb") as file:
            found: Record = self.create_upload(file_name=path.name, content=file)
        return found

    def wait(self, job: Record, *, limit_s: float = 3600.0) -> Iterator[Record]:
        """Yield a job at each change until it is over."""
        until = time.monotonic() + limit_s
        seen = -1
        while True:
            if job.revision != seen:
                seen = job.revision
                yield job
            if job.state in OVER:
                return
            if time.monotonic() > until:
                raise TimeoutError(f"job {job.id} is still {job.state} after {limit_s:g} s")
            time.sleep(0.2)
            job = self.get_job(job.id)


def _filled(
    operation: Operation, where: tuple[str | int, ...], members: Mapping[str, Any]
) -> tuple[str, dict[str, Any]]:
    """Return the path of a request and how it is sent."""
    places = operation.parameters["path"]
    if len(where) != len(places):
        raise TypeError(f"{operation.name} takes {', '.join(p.name for p in places)}; {len(where)} are given")
    path = operation.path.format(
        **{p.name: quote(str(part), safe="") for p, part in zip(places, where, strict=True)}
    )
    rest = dict(members)
    query = {p.name: rest.pop(p.name) for p in operation.parameters["query"] if p.name in rest}
    headers = {p.name: rest.pop(p.word, None) for p in operation.parameters["header"]}
    if "if-match" in headers:
        headers["if-match"] = "*" if headers["if-match"] is None else f'"{headers["if-match"]}"'
    options: dict[str, Any] = {
        "params": {name: value for name, value in query.items() if value is not None},
        "headers": {name: str(value) for name, value in headers.items() if value is not None},
    }
    if operation.sends_file:
        options["content"] = rest.pop("content")
    strange = rest.keys() - {member.name for member in operation.body or ()}
    if strange:
        raise TypeError(f"{operation.name} takes no {', '.join(sorted(strange))}")
    if operation.body is not None:
        options["json"] = rest
    return path, options


def events_of(lines: Iterator[str]) -> Iterator[Record]:
    """Yield the events of a text/event-stream: `id`, `event` and `data`, which is read as JSON."""
    event: dict[str, str] = {}
    data: list[str] = []
    for line in lines:
        if line == "":
            if data:
                told = json.loads("\n".join(data), object_hook=Record)
                yield Record({"event": "message", **event, "data": told})
            event, data = {}, []
        elif not line.startswith(":"):
            name, _, text = line.partition(":")
            text = text.removeprefix(" ")
            if name == "data":
                data.append(text)
            elif name in {"id", "event"}:
                event[name] = text
