"""A typed client of the REST interface: what the command line and scripts use."""

from __future__ import annotations

import time
from collections.abc import Hashable, Iterator, Mapping
from types import TracebackType
from typing import Any, NoReturn, Self, TypeVar, cast

import httpx

from ground.client.operations import (
    Document,
    MissionOperations,
    PeopleOperations,
    PlanOperations,
    RunOperations,
    SiteOperations,
    TerrainOperations,
    adapter,
    events_of,
)
from ground.jobs.value import Job, JobState
from ground.resources.approvals.value import Approval
from ground.resources.comments.value import Comment
from ground.resources.frames.value import Frame
from ground.resources.keep_outs.value import KeepOut
from ground.resources.lineage.value import Lineage
from ground.resources.missions.value import Mission
from ground.resources.observation_requests.value import ObservationRequest
from ground.resources.path_networks.value import PathNetwork
from ground.resources.people.value import Person
from ground.resources.plans.value import Plan
from ground.resources.problems.value import Problem
from ground.resources.products.value import Product
from ground.resources.runs.value import Run
from ground.resources.site_maps.value import SiteMap
from ground.resources.sols.value import Sol
from ground.resources.solutions.value import FrameFile, Solution
from ground.resources.targets.value import Target
from ground.resources.traverses.value import Traverse

T = TypeVar("T")
DEFAULT_ADDRESS = "http://127.0.0.1:8000"

COLLECTIONS: Mapping[type, str] = {
    Mission: "missions",
    Sol: "sols",
    Target: "targets",
    ObservationRequest: "observation-requests",
    KeepOut: "keep-outs",
    PathNetwork: "path-networks",
    Problem: "problems",
    Plan: "plans",
    Run: "runs",
    Product: "products",
    Comment: "comments",
    Job: "jobs",
    Person: "people",
    Approval: "approvals",
    Frame: "frames",
    Solution: "solutions",
    FrameFile: "frame-files",
    SiteMap: "site-maps",
    Traverse: "traverses",
}
"""Where each kind of value is found."""


class ApiError(Exception):
    """The server answered with a problem document; `kind` is the last part of its type."""

    def __init__(self, status: int, document: Mapping[str, Any]) -> None:
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


class Client(
    MissionOperations, TerrainOperations, PlanOperations, RunOperations, SiteOperations, PeopleOperations
):
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
            base_url=f"{self.address}/api/v1", headers=headers, timeout=120.0, transport=transport
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
            response = self._http.request(method, path.removeprefix("/api/v1"), **options)
        except httpx.TransportError as err:
            raise ServerUnreachableError(f"no server answers at {self.address} ({err})") from err
        if response.status_code >= 400:
            _raise(response)
        return response

    def keep_token(self, token: str) -> None:
        """Send a session's token with every change from now on."""
        self._http.headers["X-CSRF-Token"] = token

    def stream(self, path: str, last_event_id: str | None = None) -> Iterator[Document]:
        """Yield the events of a stream as they come: `id`, `event` and `data`.

        Parameters
        ----------
        last_event_id
            Of the event seen last: the stream goes on behind it.
        """
        headers = {} if last_event_id is None else {"Last-Event-ID": last_event_id}
        try:
            with self._http.stream("GET", path, headers=headers, timeout=None) as response:
                if response.status_code >= 400:
                    response.read()
                    _raise(response)
                yield from events_of(response.iter_lines())
        except httpx.TransportError as err:
            raise ServerUnreachableError(f"no server answers at {self.address} ({err})") from err

    # ---- resources

    def get(self, kind: type[T], identifier: str) -> T:
        """Return one resource."""
        return self.value(kind, "GET", f"/{COLLECTIONS[kind]}/{identifier}")

    def each(self, kind: type[T], mission_id: str | None = None, **where: str) -> Iterator[T]:
        """Yield the resources of a kind, page after page."""
        path = (
            f"/{COLLECTIONS[kind]}" if mission_id is None else f"/missions/{mission_id}/{COLLECTIONS[kind]}"
        )
        cursor: str | None = None
        while True:
            parameters = {**where, "limit": "200", **({} if cursor is None else {"cursor": cursor})}
            page = self.request("GET", path, params=parameters).json()
            for item in page["items"]:
                yield adapter(cast("Hashable", kind)).validate_python(item)
            cursor = page["next_cursor"]
            if cursor is None:
                return

    def create(self, kind: type[T], body: Mapping[str, Any], mission_id: str | None = None) -> T:
        """Return a new resource."""
        path = (
            f"/{COLLECTIONS[kind]}" if mission_id is None else f"/missions/{mission_id}/{COLLECTIONS[kind]}"
        )
        return self.value(kind, "POST", path, json=dict(body))

    def change(
        self, kind: type[T], identifier: str, body: Mapping[str, Any], revision: int | None = None
    ) -> T:
        """Return a resource after a change of the revision seen; None changes whatever stands there."""
        headers = {"If-Match": "*" if revision is None else f'"{revision}"'}
        path = f"/{COLLECTIONS[kind]}/{identifier}"
        return self.value(kind, "PATCH", path, json=dict(body), headers=headers)

    def delete(self, kind: type, identifier: str, revision: int | None = None) -> None:
        """Delete a resource."""
        headers = {"If-Match": "*" if revision is None else f'"{revision}"'}
        self.request("DELETE", f"/{COLLECTIONS[kind]}/{identifier}", headers=headers)

    # ---- long work

    def wait(self, job: Job, *, limit_s: float = 3600.0) -> Iterator[Job]:
        """Yield the job at each change until it is over."""
        until = time.monotonic() + limit_s
        seen = -1
        while True:
            if job.revision != seen:
                seen = job.revision
                yield job
            if job.state in {JobState.SUCCEEDED, JobState.FAILED, JobState.CANCELLED}:
                return
            if time.monotonic() > until:
                raise TimeoutError(f"job {job.id} is still {job.state.value} after {limit_s:g} s")
            time.sleep(0.2)
            job = self.get(Job, job.id)

    def lineage(self, kind: type, identifier: str) -> Lineage:
        """Return where a target, request or product comes from and what came of it."""
        return self.value(Lineage, "GET", f"/{COLLECTIONS[kind]}/{identifier}/lineage")
