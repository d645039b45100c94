"""Maps made at a site: filed with where they lie, and carried along when the site is re-localised."""

from __future__ import annotations

from pathlib import Path

from ground.errors import InvalidInputError
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.edit import insert, new_row
from ground.records.get_resource import find_row, require_mission
from ground.resources.frames.site_chain import load_chain, outline_of, require_frame
from ground.resources.frames.value import Level
from ground.resources.site_maps.bodies import SiteMapCreate
from ground.resources.site_maps.kind import SITE_MAP
from ground.resources.site_maps.value import SiteMap
from ground.resources.uploads.row import UploadRow
from ground.resources.uploads.store_upload import uploaded_file

MEDIA = "image/tiff"


def create_site_map(repo: Repository, actor: Actor, mission_id: str, given: SiteMapCreate) -> SiteMap:
    """Return a new map of a site from an uploaded GeoTIFF in metres east and north of the site's origin.

    Raises
    ------
    InvalidInputError
        If the frame is not a site of the mission, or the file no georeferenced GeoTIFF.
    StateError
        If nothing ties the site to the anchor.
    """
    actor.require(Action.EDIT_MISSION, mission_id)
    west, south, east, north = _bounds(uploaded_file(repo, actor, given.upload_id))
    with repo.database.write() as session:
        require_mission(session, mission_id)
        frame = require_frame(session, mission_id, given.frame_id)
        if frame.level != Level.SITE:
            raise InvalidInputError(f"a map belongs to a site; {frame.key} is none", pointer="/frame_id")
        upload = session.get_one(UploadRow, given.upload_id)
        corners = [[south, west, 0.0], [south, east, 0.0], [north, east, 0.0], [north, west, 0.0]]
        in_frame = {"outline_m": corners}
        outline, sigma = outline_of(load_chain(session, mission_id).placed(frame.id), in_frame)
        row = new_row(
            SITE_MAP,
            actor,
            mission_id,
            given,
            name=given.name or Path(upload.file_name).stem[:80],
            in_frame=in_frame,
            outline_m=outline,
            sigma_m=sigma,
            file_name=upload.file_name,
            media=MEDIA,
            size_bytes=upload.size_bytes,
            sha256=upload.sha256,
        )
        insert(session, actor, SITE_MAP, row)
        return SITE_MAP.show_one(session, row)


def _bounds(path: Path) -> tuple[float, float, float, float]:
    """Return west, south, east, north of a GeoTIFF.

    Raises
    ------
    InvalidInputError
        If it is none, or says not where it lies.
    """
    import warnings

    import rasterio
    from rasterio.errors import NotGeoreferencedWarning, RasterioError

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", NotGeoreferencedWarning)
            with rasterio.open(path, driver="GTiff") as opened:
                transform, bounds = opened.transform, opened.bounds
    except RasterioError as err:
        raise InvalidInputError("the upload is not a GeoTIFF", pointer="/upload_id") from err
    if transform.is_identity or transform.b or transform.d:
        raise InvalidInputError(
            "the GeoTIFF does not say where it lies (a north-up geotransform is needed)", pointer="/upload_id"
        )
    west, south, east, north = (float(x) for x in bounds)
    if max(map(abs, (west, south, east, north))) > 100_000.0:
        raise InvalidInputError(
            f"the map reaches to ({east:.0f}, {north:.0f}) m; metres from the site's origin are needed, "
            "at most 100000",
            pointer="/upload_id",
        )
    return west, south, east, north


def read_site_map(repo: Repository, actor: Actor, map_id: str) -> tuple[Path, str, str]:
    """Return the file of a map, its name and SHA-256."""
    with repo.database.read() as session:
        row = find_row(session, SITE_MAP, map_id)
        actor.require(Action.READ, row.mission_id)
    return repo.files.path(row.sha256), row.file_name, row.sha256
