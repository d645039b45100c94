"""Targets, keep-outs and lines as files that a GIS opens: GeoPackage, KML and GPX.

Needs pyogrio but for GPX. Lines are traverses and the ribbons of plans.
"""

from __future__ import annotations

import json
import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ground.errors import InvalidInputError, UnavailableError
from ground.geo.in_reference import from_site, placed
from ground.geo.place import Place
from ground.geo.references import LONLAT, SITE, WGS84
from ground.geo.site_frame import SiteFrame
from ground.resources.features.collections import collection_of
from ground.resources.features.value import Feature
from ground.resources.geometry_files.site_geometry import EXCHANGED, Values

if TYPE_CHECKING:
    from types import ModuleType

    from shapely.geometry.base import BaseGeometry

LAYERS = {"target": ("targets", "Point"), "keep_out": ("keep_outs", "Polygon")}
Lines = Mapping[str, Sequence[Feature]]
"""Features by the name of their collection; those without a line are left out."""
DRIVERS = {"gpkg": "GPKG", "kml": "LIBKML"}
MISSING = "GeoPackage and KML need pyogrio: pip install 'outcrop[geo]'"
UNDEFINED = 'LOCAL_CS["Undefined Cartesian SRS",UNIT["metre",1],AXIS["Easting",EAST],AXIS["Northing",NORTH]]'
"""Site metres: GDAL files it as the srs_id -1 that the GeoPackage standard has for them."""
GPX = "http://www.topografix.com/GPX/1/1"


@dataclass(frozen=True, slots=True)
class Layer:
    """A layer of a file: one kind of geometry in site metres, and a column a property."""

    name: str
    geometry_type: str
    shapes: Sequence[BaseGeometry]
    columns: Mapping[str, Any]


def write_gis(
    values: Values, target: Path, form: str, name: str, site: Place | None, lines: Lines | None = None
) -> None:
    """Write a GeoPackage or KML with a layer of targets, one of keep-outs, and one for each kind of line.

    `name` is the reference of a GeoPackage; KML is in longitude and latitude, of the mission's own body.

    Raises
    ------
    InvalidInputError
        If the mission has no place, or there is no transformation.
    UnavailableError
        If pyogrio is not installed.
    """
    import numpy as np
    import shapely

    pyogrio = _pyogrio()
    if form == "kml":
        name = LONLAT
    crs = UNDEFINED if name == SITE else _wkt(placed(site, name), name)
    for layer in _layers(values, lines or {}):
        shapes = shapely.transform(
            np.array(layer.shapes, dtype=object),
            lambda corners: np.array(from_site(corners.tolist(), name, site), dtype=np.float64),
        )
        pyogrio.raw.write(
            str(target),
            geometry=shapely.to_wkb(shapes),
            field_data=list(layer.columns.values()),
            fields=list(layer.columns),
            geometry_type=layer.geometry_type,
            crs=WGS84 if form == "kml" else crs,
            driver=DRIVERS[form],
            layer=layer.name,
            append=target.exists(),
        )


def _layers(values: Values, lines: Lines) -> Iterator[Layer]:
    for kind, (layer, geometry_type) in LAYERS.items():
        found = values.get(kind, ())
        yield Layer(layer, geometry_type, [_shape(value) for value in found], _columns(kind, found))
    for layer, features in lines.items():
        drawn = [(feature, shape) for feature in features if (shape := feature.geometry) is not None]
        columns = _properties(layer, [feature for feature, _ in drawn])
        yield Layer(layer, "LineString", [shape for _, shape in drawn], columns)


def to_gpx(values: Values, site: Place | None, lines: Lines | None = None) -> bytes:
    """Return targets as waypoints, keep-outs as closed routes and lines as tracks: GPX 1.1, WGS 84.

    Raises
    ------
    InvalidInputError
        If the mission has no place, or one on another body than Earth: GPX allows no other.
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
        _described(ET.SubElement(root, f"{{{GPX}}}wpt", _at(lon, lat)), value.name, value.notes)
    for value in values.get("keep_out", ()):
        route = ET.SubElement(root, f"{{{GPX}}}rte")
        _described(route, value.name, value.notes)
        ring = from_site(value.polygon_m, LONLAT, site)
        for lon, lat in [*ring, ring[0]]:
            ET.SubElement(route, f"{{{GPX}}}rtept", _at(lon, lat))
    for collection, features in (lines or {}).items():
        for feature in features:
            if feature.geometry is not None:
                track = ET.SubElement(root, f"{{{GPX}}}trk")
                _described(track, _name_of(collection, feature), str(feature.properties.get("notes") or ""))
                segment = ET.SubElement(track, f"{{{GPX}}}trkseg")
                for lon, lat in from_site(list(feature.geometry.coords), LONLAT, site):
                    ET.SubElement(segment, f"{{{GPX}}}trkpt", _at(lon, lat))
    content: bytes = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    return content


def _described(element: ET.Element, name: str, notes: str) -> None:
    for tag, text in (("name", name), ("desc", notes)):
        if text:
            ET.SubElement(element, f"{{{GPX}}}{tag}").text = text


def _name_of(collection: str, feature: Feature) -> str:
    """Return what a person calls a line: a traverse has a name, a drive is one of its plan's."""
    told = feature.properties
    if collection != "ribbons":
        return str(told.get("name") or feature.id)
    branch = ", branch" if told["branch"] else ""
    return f"Plan {told['plan_number']:.0f}, drive {told['step']:.0f}{branch} ({told['probability']:.0%})"


def _at(lon: float, lat: float) -> dict[str, str]:
    """Return the attributes of a point; nine decimals of a degree are 0.1 mm."""
    return {"lat": f"{lat:.10f}", "lon": f"{(lon + 180.0) % 360.0 - 180.0:.10f}"}


def _wkt(frame: SiteFrame, name: str) -> str:
    crs = frame.named(name)
    assert crs is not None
    wkt: str = crs.to_wkt()
    return wkt


def _shape(value: Any) -> BaseGeometry:
    import shapely

    if hasattr(value, "position"):
        return shapely.Point(value.position.east_m, value.position.north_m)
    return shapely.Polygon(value.polygon_m)


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


def _properties(collection: str, features: Sequence[Feature]) -> dict[str, Any]:
    """Return id, name and a column for each property of lines: numbers and flags as such."""
    import numpy as np

    columns: dict[str, Any] = {
        "outcrop_id": np.array([feature.id for feature in features], dtype=object),
        "name": np.array([_name_of(collection, feature) for feature in features], dtype=object),
    }
    for member, form in collection_of(collection)[0].properties.items():
        cells = [feature.properties[member] for feature in features]
        match form:
            case "number":
                numbers = [math.nan if cell is None else cell for cell in cells]
                columns[member] = np.array(numbers, dtype=np.float64)
            case "flag":
                columns[member] = np.array([bool(cell) for cell in cells], dtype=np.bool_)
            case _ if member != "name":
                texts = ["" if cell is None else str(cell) for cell in cells]
                columns[member] = np.array(texts, dtype=object)
    return columns


def _pyogrio() -> ModuleType:
    try:
        import pyogrio.raw
    except ImportError:
        raise UnavailableError(MISSING) from None
    module: ModuleType = pyogrio
    return module
