"""Targets and keep-outs as files that a GIS opens: GeoPackage, KML and GPX. Needs pyogrio but for GPX."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ground.errors import InvalidInputError, UnavailableError
from ground.geo.in_reference import from_site, placed
from ground.geo.place import Place
from ground.geo.references import LONLAT, SITE, WGS84
from ground.geo.site_frame import SiteFrame
from ground.resources.geometry_files.site_geometry import EXCHANGED, Values

if TYPE_CHECKING:
    from types import ModuleType

LAYERS = {"target": ("targets", "Point"), "keep_out": ("keep_outs", "Polygon")}
DRIVERS = {"gpkg": "GPKG", "kml": "LIBKML"}
MISSING = "GeoPackage and KML need pyogrio: pip install 'outcrop[geo]'"
UNDEFINED = 'LOCAL_CS["Undefined Cartesian SRS",UNIT["metre",1],AXIS["Easting",EAST],AXIS["Northing",NORTH]]'
"""Site metres: GDAL files it as the srs_id -1 that the GeoPackage standard has for them."""
GPX = "http://www.topografix.com/GPX/1/1"


def write_gis(values: Values, target: Path, form: str, name: str, site: Place | None) -> None:
    """Write a GeoPackage or KML with a layer of targets and one of keep-outs.

    `name` is the reference of a GeoPackage; KML is in longitude and latitude, of the mission's own body.

    Raises
    ------
    InvalidInputError
        If the mission has no place, or there is no transformation.
    UnavailableError
        If pyogrio is not installed.
    """
    pyogrio = _pyogrio()
    if form == "kml":
        name = LONLAT
    crs = UNDEFINED if name == SITE else _wkt(placed(site, name), name)
    for kind, (layer, geometry_type) in LAYERS.items():
        found = values.get(kind, ())
        columns = _columns(kind, found)
        pyogrio.raw.write(
            str(target),
            geometry=_shapes(found, name, site),
            field_data=list(columns.values()),
            fields=list(columns),
            geometry_type=geometry_type,
            crs=WGS84 if form == "kml" else crs,
            driver=DRIVERS[form],
            layer=layer,
            append=target.exists(),
        )


def to_gpx(values: Values, site: Place | None) -> bytes:
    """Return targets as waypoints and keep-outs as closed routes: GPX 1.1, WGS 84.

    Raises
    ------
    InvalidInputError
        If the mission has no place, or one on another body than Earth: GPX knows no other.
    """
    here = placed(site, LONLAT)
    if here.degrees.to_epsg() != 4326:
        raise InvalidInputError(
            f"GPX is of the Earth alone; the site lies in {here.crs.name}", pointer="form"
        )
    ET.register_namespace("", GPX)
    root = ET.Element(f"{{{GPX}}}gpx", {"version": "1.1", "creator": "Outcrop"})
    for value in values.get("target", ()):
        place = value.position
        ((lon, lat),) = from_site([(place.east_m, place.north_m)], LONLAT, site)
        _described(ET.SubElement(root, f"{{{GPX}}}wpt", _at(lon, lat)), value)
    for value in values.get("keep_out", ()):
        route = ET.SubElement(root, f"{{{GPX}}}rte")
        _described(route, value)
        ring = from_site(value.polygon_m, LONLAT, site)
        for lon, lat in [*ring, ring[0]]:
            ET.SubElement(route, f"{{{GPX}}}rtept", _at(lon, lat))
    content: bytes = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    return content


def _described(element: ET.Element, value: Any) -> None:
    for tag, text in (("name", value.name), ("desc", value.notes)):
        if text:
            ET.SubElement(element, f"{{{GPX}}}{tag}").text = text


def _at(lon: float, lat: float) -> dict[str, str]:
    """Return the attributes of a point; nine decimals of a degree are 0.1 mm."""
    return {"lat": f"{lat:.10f}", "lon": f"{(lon + 180.0) % 360.0 - 180.0:.10f}"}


def _wkt(frame: SiteFrame, name: str) -> str:
    crs = frame.named(name)
    assert crs is not None
    wkt: str = crs.to_wkt()
    return wkt


def _shapes(found: Sequence[Any], name: str, site: Place | None) -> Any:
    import numpy as np
    import shapely

    shapes: list[Any] = []
    for value in found:
        if hasattr(value, "position"):
            place = value.position
            shapes.append(shapely.Point(*from_site([(place.east_m, place.north_m)], name, site)))
        else:
            shapes.append(shapely.Polygon(from_site(value.polygon_m, name, site)))
    return np.array([shapely.to_wkb(shape) for shape in shapes], dtype=object)


def _columns(kind: str, found: Sequence[Any]) -> dict[str, Any]:
    """Return a column of text for each member that a person gives, and id, author and height."""
    import numpy as np

    columns: dict[str, Any] = {}
    for member in ("id", "author", *EXCHANGED[kind].others):
        cells = [getattr(value, member) for value in found]
        texts = ["" if c is None else c if isinstance(c, str) else json.dumps(c) for c in cells]
        columns["outcrop_id" if member == "id" else member] = np.array(texts, dtype=object)
    if kind == "target":
        columns["up_m"] = np.array([value.position.up_m for value in found], dtype=np.float64)
    return columns


def _pyogrio() -> ModuleType:
    try:
        import pyogrio.raw
    except ImportError:
        raise UnavailableError(MISSING) from None
    module: ModuleType = pyogrio
    return module
