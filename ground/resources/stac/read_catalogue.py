"""What a mission has to show: its terrain layers and products as items of a STAC catalogue."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import timedelta
from importlib.metadata import version
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.errors import NotFoundError
from ground.gdr.base import Columns
from ground.gdr.repository import Repository
from ground.gdr.terrain_folders import load_cached
from ground.geo.place import Place
from ground.geo.references import LONLAT
from ground.geo.site_frame import FAR_M, SiteFrame, site_frame
from ground.geo.spice_site import body_of
from ground.records.actor import Action, Actor
from ground.records.get_resource import require_mission
from ground.resources.missions.row import MissionRow
from ground.resources.missions.terrain import terrain_row
from ground.resources.products.row import ProductRow
from ground.resources.runs.row import RunRow
from ground.resources.sols.row import SolRow
from ground.resources.sols.sol_sky import sol_sky
from ground.resources.stac.planned_sols import aware, planned_sols
from ground.resources.targets.row import TargetRow
from ground.resources.terrains.row import TerrainRow
from ground.resources.terrains.terrain import layer_names, layer_of, ortho_file
from neighbours.geodata.cog import SITE, GridPlace, write_cog
from neighbours.geodata.stac import COG, Asset, Corner, Group, Item

if TYPE_CHECKING:
    from mission.soltime import SunClock
    from rover_iface.terrain import Terrain

TERRAIN, PRODUCTS = "terrain", "products"
BY_SOL = "start_utc of the sol, and the seconds since the plan's start"
BY_ROW = "when it came into the repository: its sol has no start_utc"


@dataclass(frozen=True, slots=True)
class Catalogue:
    """A mission's groups of items, and where the files of products lie by item.

    `placed` are the groups in which an item has a place on a body, also where not all items were read.
    """

    id: str
    title: str
    description: str
    groups: tuple[Group, ...]
    files: dict[str, Path]
    placed: frozenset[str]

    def group(self, name: str) -> Group:
        """Return a group by its name.

        Raises
        ------
        NotFoundError
            If there is none.
        """
        for group in self.groups:
            if group.id == name:
                return group
        raise NotFoundError(f"the catalogue has no {name!r}; it has {', '.join(g.id for g in self.groups)}")

    def item(self, group: str, name: str) -> Item:
        """Return an item by group and name.

        Raises
        ------
        NotFoundError
            If there is none.
        """
        for item in self.group(group).items:
            if item.id == name:
                return item
        raise NotFoundError(f"{group} has no item {name!r}")


Href = Callable[[str, str], str]
"""Gives the address of an asset, by its item and the name of its file."""


def read_catalogue(
    repo: Repository,
    actor: Actor,
    mission_id: str,
    terrain_href: Href,
    product_href: Href,
    only: tuple[str, str] | None = None,
) -> Catalogue:
    """Return the catalogue of a mission; with `only`, a group and an item, nothing of other items is read.

    Raises
    ------
    InvalidInputError
        If the mission has a place that is of no use.
    UnavailableError
        If it has a place and pyproj is not installed.
    """
    actor.require(Action.READ, mission_id)
    with repo.database.read() as session:
        require_mission(session, mission_id)
        mission = session.get_one(MissionRow, mission_id)
        frame = None if mission.place is None else site_frame(Place(**mission.place))
        ground = load_cached(repo.terrain_dir(mission.terrain_id))
        row = terrain_row(session, mission_id)
        group, item = only or (None, None)
        layers = [
            _layer_item(mission, row, ground, name, frame, terrain_href)
            for name in layer_names(ground)
            if group in (None, TERRAIN)
        ]
        rows: list[ProductRow] = []
        if group in (None, PRODUCTS):
            query = select(ProductRow).where(ProductRow.mission_id == mission_id).order_by(ProductRow.id)
            rows += session.scalars(query if item is None else query.where(ProductRow.id == item))
        products = _product_items(repo, session, mission, rows, frame, product_href)
        files = {product.id: repo.files.path(product.sha256) for product in rows}
        placed = {TERRAIN} if any(one.outline for one in layers) else set()
        if any(one.outline for one in products) or (only and frame and _any_place(session, mission_id)):
            placed.add(PRODUCTS)
    where = "in metres of the site, with no place on a body" if frame is None else f"in {frame.crs.name}"
    return Catalogue(
        mission.id,
        mission.name,
        f"Terrain and data products of the mission {mission.name}, {where}.",
        (
            Group(TERRAIN, "Terrain", f"Heights and ortho images of {row.name}.", tuple(layers)),
            Group(PRODUCTS, "Products", "Data products of runs.", tuple(products)),
        ),
        files,
        frozenset(placed),
    )


def grid_place(frame: SiteFrame | None) -> GridPlace:
    """Return where the site's metres lie in the projection whose metres they are."""
    if frame is None:
        return SITE
    from pyproj.enums import WktVersion

    x, y = (frame.place.x, frame.place.y) if frame.crs.is_projected else (0.0, 0.0)
    wkt = frame.grid.to_wkt(WktVersion.WKT2_2019)
    return GridPlace(wkt, x, y, frame.place.rotation_rad)


def write_layer(repo: Repository, actor: Actor, mission_id: str, layer: str, kind: str, target: Path) -> None:
    """Write the heights (`dem`) or the ortho image (`ortho`) of a terrain layer as a COG.

    Heights count from the site's zero, and from what the place names where it says how high that lies.

    Raises
    ------
    NotFoundError
        If there is no such layer, or no ortho image of it.
    """
    import numpy as np

    actor.require(Action.READ, mission_id)
    with repo.database.read() as session:
        require_mission(session, mission_id)
        mission = session.get_one(MissionRow, mission_id)
        place = None if mission.place is None else Place(**mission.place)
        ground = load_cached(repo.terrain_dir(mission.terrain_id))
    grid = grid_place(None if place is None else site_frame(place))
    found = layer_of(ground, layer)
    if kind == "dem":
        west, _, _, north = found.bounds
        zero = 0.0 if place is None or place.height_m is None else place.height_m
        heights = (found.heights[::-1].astype(np.float64) + zero).astype(np.float32)
        tags = {"HEIGHTS": _heights(place), "SITE_ZERO_M": repr(zero)}
        write_cog(target, heights[None], grid, west, north, found.spacing, tags=tags)
        return
    for ortho in ground.orthos:
        if ortho.path is not None and ortho.path == ortho_file(ground, layer):
            west, _, _, north = ortho.bounds
            write_cog(target, np.moveaxis(ortho.rgb, 2, 0).copy(), grid, west, north, ortho.spacing)
            return
    raise NotFoundError(f"the terrain has no ortho image for its layer {layer!r}")


def _heights(place: Place | None) -> str:
    return "site" if place is None or place.height_m is None else place.heights


def _corners(frame: SiteFrame | None, bounds: tuple[float, float, float, float]) -> tuple[Corner, ...]:
    west, south, east, north = bounds
    return _lonlat(frame, [(west, south), (east, south), (east, north), (west, north)])


def _lonlat(frame: SiteFrame | None, points: list[Corner]) -> tuple[Corner, ...]:
    if frame is None:
        return ()
    return tuple((float(lon), float(lat)) for lon, lat in frame.out(points, LONLAT))


def _body(frame: SiteFrame | None) -> dict[str, Any]:
    return {} if frame is None else {"ssys:targets": [body_of(frame.place).title()]}


def _layer_item(
    mission: MissionRow, row: TerrainRow, ground: Terrain, name: str, frame: SiteFrame | None, href: Href
) -> Item:
    layer, grid = layer_of(ground, name), grid_place(frame)
    rows, columns = layer.heights.shape
    identifier = f"{row.id}-{name}"
    shape = {"proj:shape": [rows, columns], **_transform(grid, layer.bounds, layer.spacing)}
    bands = [{"name": "height", "data_type": "float32", "unit": "m", "nodata": "nan"}]
    assets = {"dem": Asset(href(identifier, "dem.tif"), COG, "Heights", ("data",), {**shape, "bands": bands})}
    for ortho in ground.orthos:
        if ortho.path is not None and ortho.path == ortho_file(ground, name):
            size = {"proj:shape": list(ortho.rgb.shape[:2]), **_transform(grid, ortho.bounds, ortho.spacing)}
            bands = [{"name": colour, "data_type": "uint8"} for colour in ("red", "green", "blue")]
            about = {**size, "bands": bands}
            assets["ortho"] = Asset(href(identifier, "ortho.tif"), COG, "Ortho image", ("visual",), about)
    members = {
        **_reference(frame),
        **_body(frame),
        "mission": mission.name,
        "gsd": layer.spacing,
        "outcrop:heights": _heights(None if frame is None else frame.place),
        "outcrop:site_bounds_m": list(layer.bounds),
        "outcrop:sha256": row.sha256,
        "outcrop:datetime_is": "when it came into the repository",
        "processing:software": {"Outcrop": version("outcrop")},
    }
    return Item(
        identifier,
        f"{row.name}, {name}",
        _corners(frame, layer.bounds),
        aware(row.created_utc),
        members,
        assets,
    )


def _transform(grid: GridPlace, bounds: tuple[float, float, float, float], spacing: float) -> dict[str, Any]:
    return {"proj:transform": list(grid.transform(bounds[0], bounds[3], spacing))}


def _reference(frame: SiteFrame | None) -> dict[str, Any]:
    """Return the projection's members: code where it has one, and always WKT and PROJJSON."""
    if frame is None:
        return {}
    known = frame.grid.to_authority()
    return {
        "proj:code": f"{known[0]}:{known[1]}" if known else None,
        "proj:wkt2": grid_place(frame).wkt,
        "proj:projjson": frame.grid.to_json_dict(),
    }


def _any_place(session: Session, mission_id: str) -> bool:
    """Return whether a product of a mission shows a place, as `_point` has it."""
    here = ProductRow.mission_id == mission_id
    on = select(ProductRow.id).join(TargetRow, TargetRow.id == ProductRow.target_id).where(here).limit(1)
    if session.scalar(on) is not None:
        return True
    return any(_said(label) for label in session.scalars(select(ProductRow.label).where(here)))


def _product_items(
    repo: Repository,
    session: Session,
    mission: MissionRow,
    rows: Sequence[ProductRow],
    frame: SiteFrame | None,
    href: Href,
) -> list[Item]:
    """Return the items of products: all of a mission, or one."""
    targets, runs = select(TargetRow), select(RunRow)
    plan_id = None
    if len(rows) == 1:
        targets = targets.where(TargetRow.id == rows[0].target_id)
        runs, plan_id = runs.where(RunRow.id == rows[0].run_id), rows[0].plan_id
    target_of = {row.id: row for row in session.scalars(targets.where(TargetRow.mission_id == mission.id))}
    run_of = {row.id: row for row in session.scalars(runs.where(RunRow.mission_id == mission.id))}
    sols = planned_sols(session, mission.id, plan_id) if rows else {}
    clocks = {sol.id: sol_sky(repo, session, sol).clock() for sol in set(sols.values())}
    martian = frame is None or body_of(frame.place) == "MARS" or bool(repo.settings.kernels)
    items = []
    for row in rows:
        sol = sols.get(row.plan_id or "")
        target = target_of.get(row.target_id or "")
        clock = clocks[sol.id] if sol is not None and martian else None
        items.append(_product_item(mission, row, run_of.get(row.run_id), target, sol, clock, frame, href))
    return items


def _product_item(
    mission: MissionRow,
    row: ProductRow,
    run: RunRow | None,
    target: TargetRow | None,
    sol: SolRow | None,
    clock: SunClock | None,
    frame: SiteFrame | None,
    href: Href,
) -> Item:
    time, how = aware(row.created_utc), BY_ROW
    if sol is not None and sol.start_utc is not None:
        time, how = aware(sol.start_utc) + timedelta(seconds=row.t_s), BY_SOL
    name = PurePosixPath(row.file_name).name
    digest = {"file:size": row.size_bytes, "file:checksum": f"1220{row.sha256}"}
    members: dict[str, Any] = {
        "mission": mission.name,
        "platform": mission.rover_profile,
        **({"instruments": [row.instrument]} if row.instrument else {}),
        **_body(frame),
        "created": aware(row.created_utc).isoformat().replace("+00:00", "Z"),
        "outcrop:datetime_is": how,
        "outcrop:kind": row.kind,
        "outcrop:run": row.run_id,
        "outcrop:run_kind": None if run is None else run.kind,
        "outcrop:plan": row.plan_id,
        "outcrop:task": row.task_id,
        "outcrop:request": row.request_id,
        "outcrop:target": row.target_id,
        "outcrop:target_name": None if target is None else target.name,
        "outcrop:sol": None if sol is None else sol.number,
        "outcrop:t_s": row.t_s,
        "processing:lineage": f"task {row.task_id} of run {row.run_id}",
        "processing:software": {"Outcrop": version("outcrop")},
        **({} if clock is None else _sun(clock, row.t_s)),
    }
    assets = {"data": Asset(href(row.id, name), row.media, name, ("data",), digest)}
    return Item(row.id, name, _lonlat(frame, _point(row, target)), time, members, assets)


def _point(row: ProductRow, target: TargetRow | None) -> list[Corner]:
    """Return the place that a product shows, east and north, by its label or its target; none if unknown."""
    return _said(row.label) or ([] if target is None else [(target.east_m, target.north_m)])


def _said(label: Columns | None) -> list[Corner]:
    """Return the place that a label names, east and north, if it does."""
    said = (label or {}).get("point_m")
    if isinstance(said, list) and len(said) == 3 and all(_is_near(v) for v in said[:2]):
        return [(float(said[0]), float(said[1]))]
    return []


def _is_near(value: object) -> bool:
    """Return whether a member of a label, which anybody may have written, is metres within a site."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= FAR_M


def _sun(clock: SunClock, t_s: float) -> dict[str, float]:
    east, north, up = clock.direction(t_s)
    return {
        "view:sun_azimuth": math.degrees(math.atan2(east, north)) % 360.0,
        "view:sun_elevation": math.degrees(math.asin(max(-1.0, min(1.0, up)))),
    }
