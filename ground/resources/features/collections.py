"""The collections that every mission has, and how their features are read."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import orjson
from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.errors import NotFoundError
from ground.gdr.base import Row
from ground.gdr.repository import Repository
from ground.reports.figures import ribbons
from ground.resources.features.footprints import footprint
from ground.resources.features.value import Collection, Feature
from ground.resources.keep_outs.row import KeepOutRow
from ground.resources.missions.row import MissionRow
from ground.resources.observation_requests.row import ObservationRequestRow
from ground.resources.plans.row import PlanRow
from ground.resources.problems.row import ProblemRow
from ground.resources.products.row import ProductRow
from ground.resources.runs.row import RunRow
from ground.resources.targets.row import TargetRow
from ground.resources.traverses.row import TraverseRow
from neighbours.geodata.cql2 import Scalar

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

NEWEST_PLANS = 20
"""Plans whose ribbons are told: each is a document of up to some megabytes that is read for an answer."""
NEWEST_RUNS = 50
"""Runs whose paths are told: of each a file of telemetry is read."""
Read = Callable[[Repository, Session, str, "str | None"], Iterable[Feature]]
"""Reads the features of a mission; with the id of one of them nothing of the others is read."""

TARGETS = Collection(
    "targets",
    "Targets",
    "Points on rocks, with the observation requests on each.",
    "point",
    {
        "name": "text",
        "notes": "text",
        "feature_type": "text",
        "source_image": "text",
        "author": "text",
        "up_m": "number",
        "slope_rad": "number",
        "request_count": "number",
        "request_value": "number",
        "instruments": "text",
        "must_do": "flag",
    },
)
KEEP_OUTS = Collection(
    "keep-outs",
    "Keep-outs",
    "Ground that the rover must not enter.",
    "polygon",
    {"name": "text", "notes": "text", "author": "text", "sigma_m": "number"},
)
TRAVERSES = Collection(
    "traverses",
    "Traverses",
    "Stops of recorded drives that were adjusted together, in the order driven.",
    "linestring",
    {"name": "text", "notes": "text", "author": "text", "stops": "number"},
)
FOOTPRINTS = Collection(
    "footprints",
    "Footprints",
    "The ground in each image: what its camera model sees of the terrain, else a square where the product "
    "tells its size, else the point that it shows, else the point from which it was taken.",
    "any",
    {
        "kind": "text",
        "instrument": "text",
        "file_name": "text",
        "media": "text",
        "run_id": "text",
        "plan_id": "text",
        "request_id": "text",
        "target_id": "text",
        "t_s": "number",
        "size_bytes": "number",
    },
)
RIBBONS = Collection(
    "ribbons",
    "Ribbons",
    f"Drives of the {NEWEST_PLANS} newest computed plans: routes of the main line and of branches, with the "
    "chance that each is driven.",
    "linestring",
    {
        "plan_id": "text",
        "plan_number": "number",
        "plan_state": "text",
        "step": "number",
        "branch": "flag",
        "probability": "number",
    },
)
RUNS = Collection(
    "runs",
    "Runs",
    f"Where the rover drove in the {NEWEST_RUNS} newest runs, by its own telemetry.",
    "linestring",
    {
        "plan_id": "text",
        "kind": "text",
        "rover": "text",
        "state": "text",
        "outcome": "text",
        "utility": "number",
        "duration_s": "number",
        "energy_used_j": "number",
    },
)


def _rows(session: Session, row: Any, mission_id: str, only: str | None) -> Sequence[Any]:
    query = select(row).where(row.mission_id == mission_id).order_by(row.id)
    return session.scalars(query if only is None else query.where(row.id == only)).all()


def _feature(
    row: Row, collection: Collection, geometry: BaseGeometry | None, more: Mapping[str, Any], **found: Any
) -> Feature:
    members = {name: found[name] if name in found else getattr(row, name) for name in collection.properties}
    head: Any = row
    return Feature(head.id, geometry, head.created_utc, members, more)


def _targets(_repo: Repository, session: Session, mission_id: str, only: str | None) -> Iterator[Feature]:
    import shapely

    asked: dict[str, list[ObservationRequestRow]] = defaultdict(list)
    requests_here = (
        select(ObservationRequestRow)
        .where(ObservationRequestRow.mission_id == mission_id)
        .order_by(ObservationRequestRow.id)
    )
    if only is not None:
        requests_here = requests_here.where(ObservationRequestRow.target_id == only)
    for request in session.scalars(requests_here):
        asked[request.target_id].append(request)
    for row in _rows(session, TargetRow, mission_id, only):
        requests = asked[row.id]
        told = [
            {"id": r.id, "instrument": r.instrument, "value": r.value, "must_do": r.must_do} for r in requests
        ]
        yield _feature(
            row,
            TARGETS,
            shapely.Point(row.east_m, row.north_m),
            {"requests": told},
            request_count=float(len(requests)),
            request_value=float(sum(r.value for r in requests)),
            instruments=",".join(sorted({r.instrument for r in requests})),
            must_do=any(r.must_do for r in requests),
        )


def _keep_outs(_repo: Repository, session: Session, mission_id: str, only: str | None) -> Iterator[Feature]:
    import shapely

    for row in _rows(session, KeepOutRow, mission_id, only):
        yield _feature(row, KEEP_OUTS, shapely.Polygon(row.polygon_m), {})


def line_of(points: Iterable[Sequence[float]]) -> BaseGeometry | None:
    """Return the line through points [east, north, ...] m without repeats; None where there are not two."""
    import shapely

    corners: list[tuple[float, float]] = []
    for east, north, *_ in points:
        if (east, north) != (corners[-1] if corners else None):
            corners.append((float(east), float(north)))
    return shapely.LineString(corners) if len(corners) > 1 else None


def _traverses(_repo: Repository, session: Session, mission_id: str, only: str | None) -> Iterator[Feature]:
    for row in _rows(session, TraverseRow, mission_id, only):
        stops = [] if row.document is None else row.document["stops"]
        line = line_of(stop["adjusted_m"] for stop in stops)
        yield _feature(row, TRAVERSES, line, {}, stops=float(len(row.stops)))


def _footprints(repo: Repository, session: Session, mission_id: str, only: str | None) -> Iterator[Feature]:
    images = [row for row in _rows(session, ProductRow, mission_id, only) if row.media.startswith("image/")]
    terrain = repo.terrain_dir(session.get_one(MissionRow, mission_id).terrain_id)
    for row in images:
        shape = footprint(row.label, terrain)
        yield _feature(row, FOOTPRINTS, shape, {"file_url": f"/api/v1/products/{row.id}/file"})


def _ribbons(_repo: Repository, session: Session, mission_id: str, only: str | None) -> Iterator[Feature]:
    newest = (
        select(PlanRow)
        .where(PlanRow.mission_id == mission_id, PlanRow.crl_sha256.is_not(None))
        .order_by(PlanRow.number.desc())
        .limit(NEWEST_PLANS)
    )
    told = session.scalars(newest.with_only_columns(PlanRow.id)).all() if only is not None else ()
    wanted = None if only is None else only.rpartition(".")[0]
    if wanted is not None:
        newest = select(PlanRow).where(PlanRow.id == wanted, PlanRow.id.in_(told))
    for plan in session.scalars(newest):
        if plan.problem_id is None or not plan.tree:
            continue
        problem = session.get_one(ProblemRow, plan.problem_id).document
        for number, ribbon in enumerate(ribbons(problem, plan.tree), 1):
            members: dict[str, Scalar] = {
                "plan_id": plan.id,
                "plan_number": float(plan.number),
                "plan_state": plan.state,
                "step": float(number),
                "branch": ribbon.branch,
                "probability": ribbon.probability,
            }
            name = f"{plan.id}.{number:04d}"
            if only not in (None, name):
                continue
            yield Feature(name, line_of(ribbon.points_m), plan.created_utc, members)


def _runs(repo: Repository, session: Session, mission_id: str, only: str | None) -> Iterator[Feature]:
    newest = (
        select(RunRow).where(RunRow.mission_id == mission_id).order_by(RunRow.id.desc()).limit(NEWEST_RUNS)
    )
    if only is not None:
        told = session.scalars(newest.with_only_columns(RunRow.id)).all()
        newest = select(RunRow).where(RunRow.id == only, RunRow.id.in_(told))
    for row in session.scalars(newest):
        points: Iterable[Sequence[float]] = ()
        if row.telemetry_sha256 is not None:
            table = orjson.loads(repo.files.read(row.telemetry_sha256))
            pairs = zip(table.get("east_m", ()), table.get("north_m", ()), strict=True)
            points = [(east, north) for east, north in pairs if east is not None and north is not None]
        yield _feature(row, RUNS, line_of(points), {})


COLLECTIONS: Mapping[str, tuple[Collection, Read]] = {
    collection.id: (collection, read)
    for collection, read in (
        (TARGETS, _targets),
        (KEEP_OUTS, _keep_outs),
        (TRAVERSES, _traverses),
        (FOOTPRINTS, _footprints),
        (RIBBONS, _ribbons),
        (RUNS, _runs),
    )
}


def collection_of(name: str) -> tuple[Collection, Read]:
    """Return a collection by its id, and what reads it.

    Raises
    ------
    NotFoundError
        If there is none.
    """
    if name not in COLLECTIONS:
        raise NotFoundError(f"there is no collection {name}; there are {', '.join(COLLECTIONS)}")
    return COLLECTIONS[name]
