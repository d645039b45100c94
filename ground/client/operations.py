"""What the client asks beyond listing, reading, making, changing and deleting: one method an operation.

Values come back as dataclasses of `ground.gdr`, documents of a published form as mappings, files as bytes.
"""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Hashable, Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar, cast

import httpx
from pydantic import TypeAdapter

from ground.jobs.value import Job
from ground.records.list_history import Event
from ground.resources.approvals.value import Approval, FlightRuleResult
from ground.resources.geometry_files.value import ImportedGeometry
from ground.resources.missions.value import Mission
from ground.resources.observation_requests.value import StandCheck
from ground.resources.plans.study_value import PlanComparison, WhatIfAnswer, WhyNot
from ground.resources.runs.trace_value import RunSnapshot, Telemetry, Trace
from ground.resources.runs.value import Run, RunControl
from ground.resources.site_views.value import CameraView, Panorama, RoverShape
from ground.resources.solutions.value import Carried, FrameFile, Solution
from ground.resources.terrains.value import Terrain, TerrainPoint
from ground.resources.uploads.value import Upload

T = TypeVar("T")
Document = dict[str, Any]


@lru_cache(maxsize=128)
def adapter(kind: Hashable) -> TypeAdapter[Any]:
    """Return what reads a value of a kind from JSON."""
    return TypeAdapter(cast("Any", kind))


class Caller(ABC):
    """What the groups of operations below stand on."""

    @abstractmethod
    def request(self, method: str, path: str, **options: Any) -> httpx.Response:
        """Return the answer to a request."""

    @abstractmethod
    def keep_token(self, token: str) -> None:
        """Send a session's token with every change from now on."""

    @abstractmethod
    def stream(self, path: str, last_event_id: str | None = None) -> Iterator[Document]:
        """Yield the events of a stream as they come."""

    def value(self, kind: type[T], method: str, path: str, **options: Any) -> T:
        """Return the answer to a request as a value of a kind."""
        found: T = adapter(cast("Hashable", kind)).validate_json(
            self.request(method, path, **options).content
        )
        return found


class MissionOperations(Caller):
    """A mission as a whole: copies, archives, geometry, history, events."""

    def copy_mission(self, mission_id: str, name: str) -> Mission:
        """Return a copy of a mission, to try something without touching it."""
        return self.value(Mission, "POST", f"/missions/{mission_id}/copy", json={"name": name})

    def calibrate(self, mission_id: str, **order: Any) -> Job:
        """Ask for the calibration that the mission's runs bear out."""
        return self.value(Job, "POST", f"/missions/{mission_id}/calibrate", json=order)

    def export_mission(self, mission_id: str) -> bytes:
        """Return the archive of a mission, a zip."""
        return self.request("GET", f"/missions/{mission_id}/archive").content

    def import_mission(self, upload_id: str, name: str | None = None) -> Mission:
        """Return the mission of an archive that was uploaded."""
        body = {"upload_id": upload_id, **({} if name is None else {"name": name})}
        return self.value(Mission, "POST", "/missions/import", json=body)

    def export_geometry(self, mission_id: str, form: str = "geojson") -> bytes:
        """Return targets and keep-outs as `geojson` or `csv`."""
        return self.request("GET", f"/missions/{mission_id}/geometry", params={"form": form}).content

    def import_geometry(self, mission_id: str, upload_id: str) -> ImportedGeometry:
        """Return the targets and keep-outs of an uploaded GeoJSON or CSV file."""
        path = f"/missions/{mission_id}/geometry"
        return self.value(ImportedGeometry, "POST", path, json={"upload_id": upload_id})

    def history(self, mission_id: str) -> Iterator[Event]:
        """Yield what was done in a mission, oldest first."""
        after: str | None = None
        while True:
            where = {"limit": "200", **({} if after is None else {"after": after})}
            page = self.request("GET", f"/missions/{mission_id}/history", params=where).json()
            yield from adapter(list[Event]).validate_python(page["items"])
            after = page["next_cursor"]
            if after is None:
                return

    def undo(self, mission_id: str, *, anyone: bool = False) -> list[Event]:
        """Take back one's own last change, or with `anyone` the last one of all."""
        return self.value(list[Event], "POST", f"/missions/{mission_id}/undo", json={"anyone": anyone})

    def redo(self, mission_id: str, *, anyone: bool = False) -> list[Event]:
        """Do again what was taken back last."""
        return self.value(list[Event], "POST", f"/missions/{mission_id}/redo", json={"anyone": anyone})

    def mission_events(self, mission_id: str, last_event_id: str | None = None) -> Iterator[Document]:
        """Yield what changes in a mission, as it happens."""
        return self.stream(f"/missions/{mission_id}/events", last_event_id)


class TerrainOperations(Caller):
    """Terrain, rover and what its cameras see."""

    def terrain(self, mission_id: str) -> Terrain:
        """Return what a mission's terrain is."""
        return self.value(Terrain, "GET", f"/missions/{mission_id}/terrain")

    def terrain_point(self, mission_id: str, east_m: float, north_m: float) -> TerrainPoint:
        """Return the ground at a point of the full-resolution terrain."""
        where = {"east_m": east_m, "north_m": north_m}
        return self.value(TerrainPoint, "GET", f"/missions/{mission_id}/terrain/point", params=where)

    def ortho(self, mission_id: str, layer: str = "inner", max_px: int = 4096) -> bytes:
        """Return the ortho image of a layer."""
        where: dict[str, str | int] = {"layer": layer, "max_px": max_px}
        return self.request("GET", f"/missions/{mission_id}/terrain/ortho", params=where).content

    def heights(self, mission_id: str, layer: str = "inner", max_posts: int = 262_144) -> httpx.Response:
        """Return heights, float32 from the north-west; shape and bounds stand in the headers."""
        where: dict[str, str | int] = {"layer": layer, "max_posts": max_posts}
        return self.request("GET", f"/missions/{mission_id}/terrain/heights", params=where)

    def coverage(self, mission_id: str, layer: str = "inner", max_posts: int = 262_144) -> httpx.Response:
        """Return what the mast sees, a byte a post: 0 unknown, 1 hidden, else 2 + sigma in centimetres."""
        where: dict[str, str | int] = {"layer": layer, "max_posts": max_posts}
        return self.request("GET", f"/missions/{mission_id}/terrain/coverage", params=where)

    def rover(self, mission_id: str) -> RoverShape:
        """Return measures, cameras and limits of the rover."""
        return self.value(RoverShape, "GET", f"/missions/{mission_id}/rover")

    def camera_view(
        self, mission_id: str, camera: str, east_m: float, north_m: float, **pointing: float
    ) -> CameraView:
        """Return a camera's model in the site frame, the rover at a place; pointing as in the interface."""
        where = {"camera": camera, "east_m": east_m, "north_m": north_m, **pointing}
        return self.value(CameraView, "GET", f"/missions/{mission_id}/rover/view", params=where)

    def panorama(self, mission_id: str) -> Panorama:
        """Return how the panorama of the start is cut into tiles."""
        return self.value(Panorama, "GET", f"/missions/{mission_id}/panorama")

    def panorama_tile(self, mission_id: str, index: int) -> bytes:
        """Return a tile of the panorama, JPEG."""
        return self.request("GET", f"/missions/{mission_id}/panorama/tiles/{index}").content

    def panorama_point(self, mission_id: str, azimuth_rad: float, elevation_rad: float) -> TerrainPoint:
        """Return where a direction of the panorama meets the ground."""
        where = {"azimuth_rad": azimuth_rad, "elevation_rad": elevation_rad}
        return self.value(TerrainPoint, "GET", f"/missions/{mission_id}/panorama/point", params=where)

    def check_stand(
        self, request_id: str, east_m: float, north_m: float, heading_rad: float | None = None
    ) -> StandCheck:
        """Return whether a request can be carried out from a pose, and why not."""
        where = {"east_m": east_m, "north_m": north_m}
        if heading_rad is not None:
            where["heading_rad"] = heading_rad
        return self.value(StandCheck, "GET", f"/observation-requests/{request_id}/stand", params=where)


class PlanOperations(Caller):
    """Plans: ordered, read, weighed, reviewed and packed."""

    def plan(self, mission_id: str, **order: Any) -> Job:
        """Ask for a plan."""
        return self.value(Job, "POST", f"/missions/{mission_id}/plans", json=order)

    def path_network(self, mission_id: str) -> Job:
        """Ask for the path network."""
        return self.value(Job, "POST", f"/missions/{mission_id}/path-networks", json={})

    def plan_tree(self, plan_id: str) -> Document:
        """Return the plan as a tree (`plan-tree/2`)."""
        return cast("Document", self.request("GET", f"/plans/{plan_id}/tree").json())

    def plan_summary(self, plan_id: str) -> Document:
        """Return the figures of a plan."""
        return cast("Document", self.request("GET", f"/plans/{plan_id}/summary").json())

    def crl(self, plan_id: str, *, canonical: bool = False) -> str:
        """Return the CRL of a plan, readable or canonical."""
        where = {"canonical": "true" if canonical else "false"}
        return self.request("GET", f"/plans/{plan_id}/crl", params=where).text

    def findings(self, plan_id: str) -> list[Document]:
        """Return what the validator finds in the CRL of a plan."""
        return cast("list[Document]", self.request("GET", f"/plans/{plan_id}/findings").json())

    def why_not(self, plan_id: str, request_id: str) -> WhyNot:
        """Return why a request is not in a plan, and what demanding it would change."""
        return self.value(WhyNot, "GET", f"/plans/{plan_id}/why-not/{request_id}")

    def compare_plans(self, plan_id: str, other_id: str) -> PlanComparison:
        """Return two plans on the same futures."""
        return self.value(PlanComparison, "GET", f"/plans/{plan_id}/comparison/{other_id}")

    def what_if(self, plan_id: str, **changes: Any) -> WhatIfAnswer:
        """Return what changes of the day would mean for a plan."""
        return self.value(WhatIfAnswer, "POST", f"/plans/{plan_id}/what-if", json=changes)

    def flight_rules(self, plan_id: str) -> list[FlightRuleResult]:
        """Return how each flight rule stands for a plan."""
        return self.value(list[FlightRuleResult], "GET", f"/plans/{plan_id}/flight-rules")

    def waive(self, plan_id: str, rule: str, reason: str) -> list[FlightRuleResult]:
        """Accept a violation of a flight rule; return how all stand then."""
        body = {"rule": rule, "reason": reason}
        return self.value(list[FlightRuleResult], "POST", f"/plans/{plan_id}/waivers", json=body)

    def approve(self, plan_id: str, crl_sha256: str, note: str = "") -> Approval:
        """Approve the text that was read, as somebody who did not make the plan."""
        body = {"crl_sha256": crl_sha256, "note": note}
        return self.value(Approval, "POST", f"/plans/{plan_id}/approval", json=body)

    def package(self, plan_id: str) -> bytes:
        """Return the uplink package of an approved plan, a zip."""
        return self.request("POST", f"/plans/{plan_id}/package").content

    def plan_drawing(self, plan_id: str, form: str = "svg") -> bytes:
        """Return a plan drawn for other programs, in one of the forms of the interface."""
        return self.request("GET", f"/plans/{plan_id}/drawing", params={"form": form}).content

    def plan_report(self, plan_id: str) -> bytes:
        """Return the report for the uplink meeting, HTML."""
        return self.request("GET", f"/plans/{plan_id}/report").content


class RunOperations(Caller):
    """Runs and what they bring."""

    def run(self, mission_id: str, plan_id: str, **order: Any) -> Job:
        """Ask for a dry run of a plan."""
        return self.value(Job, "POST", f"/missions/{mission_id}/runs", json={"plan_id": plan_id, **order})

    def control_run(self, run_id: str, **wish: Any) -> RunControl:
        """Hold a live run, let it go, step it, give it another pace or abort it."""
        return self.value(RunControl, "POST", f"/runs/{run_id}/control", json=wish)

    def trace(self, run_id: str) -> Trace:
        """Return the trace of the executive."""
        return self.value(Trace, "GET", f"/runs/{run_id}/trace")

    def telemetry(self, run_id: str) -> Telemetry:
        """Return the telemetry of a run."""
        return self.value(Telemetry, "GET", f"/runs/{run_id}/telemetry")

    def snapshot(self, run_id: str, t_s: float) -> RunSnapshot:
        """Return the state of the executive at a moment of a run."""
        return self.value(RunSnapshot, "GET", f"/runs/{run_id}/snapshot", params={"t_s": t_s})

    def run_events(self, run_id: str, last_event_id: str | None = None) -> Iterator[Document]:
        """Yield the records of a run as it goes on."""
        return self.stream(f"/runs/{run_id}/events", last_event_id)

    def run_report(self, run_id: str) -> bytes:
        """Return the report of a run, HTML."""
        return self.request("GET", f"/runs/{run_id}/report").content

    def run_products(self, run_id: str) -> bytes:
        """Return all data products of a run, a zip."""
        return self.request("GET", f"/runs/{run_id}/products").content

    def run_product_file(self, run_id: str, product_id: str) -> bytes:
        """Return the file of a product that a live run announced."""
        return self.request("GET", f"/runs/{run_id}/products/{product_id}/file").content

    def product_file(self, product_id: str) -> bytes:
        """Return the file of a data product."""
        return self.request("GET", f"/products/{product_id}/file").content

    def ingest_run(self, upload_id: str) -> Run:
        """Return the run of an uploaded downlink."""
        return self.value(Run, "POST", "/runs/ingest", json={"upload_id": upload_id})

    def cancel_job(self, job_id: str) -> Job:
        """Ask a job to stop."""
        return self.value(Job, "POST", f"/jobs/{job_id}/cancel")

    def retry_job(self, job_id: str) -> Job:
        """Ask for a failed job once more."""
        return self.value(Job, "POST", f"/jobs/{job_id}/retry")

    def job_events(self, job_id: str, last_event_id: str | None = None) -> Iterator[Document]:
        """Yield the progress of a job."""
        return self.stream(f"/jobs/{job_id}/events", last_event_id)


class SiteOperations(Caller):
    """Frames, their solutions, maps of sites and traverses."""

    def choose_solution(
        self, frame_id: str, solution_id: str | None, *, preview: bool = False, reason: str = ""
    ) -> Carried:
        """Put a solution to use for a frame, or none; return what moves. A preview changes nothing."""
        body = {"solution_id": solution_id, "preview": preview, "reason": reason}
        return self.value(Carried, "PUT", f"/frames/{frame_id}/solution", json=body)

    def add_solution(self, frame_id: str, **solution: Any) -> Solution:
        """Return a new answer to where a frame lies."""
        return self.value(Solution, "POST", f"/frames/{frame_id}/solutions", json=solution)

    def import_frames(self, mission_id: str, upload_id: str) -> FrameFile:
        """Take in an uploaded frame file (.svf, .rvf)."""
        path = f"/missions/{mission_id}/frame-files"
        return self.value(FrameFile, "POST", path, json={"upload_id": upload_id})

    def export_frames(self, mission_id: str, site: int | None = None) -> bytes:
        """Return the frames as a file: those of a site, or all sites."""
        where = {} if site is None else {"site": str(site)}
        return self.request("GET", f"/missions/{mission_id}/frame-files/export", params=where).content

    def site_map_file(self, site_map_id: str) -> bytes:
        """Return the map of a site, GeoTIFF."""
        return self.request("GET", f"/site-maps/{site_map_id}/file").content

    def traverse(self, mission_id: str, **order: Any) -> Job:
        """Ask for a traverse out of recorded runs."""
        return self.value(Job, "POST", f"/missions/{mission_id}/traverses", json=order)

    def traverse_picture(self, traverse_id: str, index: int) -> bytes:
        """Return the panorama of a stop."""
        return self.request("GET", f"/traverses/{traverse_id}/pictures/{index}").content


class PeopleOperations(Caller):
    """Who is at work."""

    def session(self) -> Document:
        """Return who the client is to the server."""
        return cast("Document", self.request("GET", "/session").json())

    def log_in(self, name: str, password: str = "") -> Document:
        """Begin a session; its cookie and its token stay with the client."""
        body = {"name": name, "password": password}
        session = cast("Document", self.request("POST", "/session", json=body).json())
        self.keep_token(session["csrf_token"])
        return session

    def log_out(self) -> None:
        """End the session."""
        self.request("DELETE", "/session")

    def create_api_key(self, **order: Any) -> Document:
        """Return a new API key; its secret is told this once."""
        return cast("Document", self.request("POST", "/api-keys", json=order).json())

    def delete_api_key(self, key_id: str) -> None:
        """Make an API key worthless."""
        self.request("DELETE", f"/api-keys/{key_id}")

    def upload(self, path: Path) -> Upload:
        """Upload a file."""
        with path.open("rb") as file:
            return self.value(Upload, "POST", "/uploads", params={"file_name": path.name}, content=file)


def events_of(lines: Iterator[str]) -> Iterator[Document]:
    """Yield the events of a text/event-stream: `id`, `event` and `data`, which is read as JSON."""
    event: dict[str, str] = {}
    data: list[str] = []
    for line in lines:
        if line == "":
            if data:
                yield {"event": "message", **event, "data": json.loads("\n".join(data))}
            event, data = {}, []
        elif not line.startswith(":"):
            name, _, text = line.partition(":")
            text = text.removeprefix(" ")
            if name == "data":
                data.append(text)
            elif name in {"id", "event"}:
                event[name] = text
