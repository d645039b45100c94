"""Rows of GeoPackage, KML and GPX files: points are targets, outlines keep-outs.

XML is read by defusedxml: what a DTD and entities could do is refused.
"""

from __future__ import annotations

import json
import sqlite3
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ground.errors import InvalidInputError, TooLargeError, UnavailableError
from ground.geo.references import LONLAT, SITE, WGS84

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

MAX_ROWS = 5000
MAX_CELL = 16 << 20
"""Bytes of one value: those of a whole file that is taken."""
MOST_NESTED = 100
"""Elements within each other; folders of maps lie some ten deep."""
SQLITE = b"SQLite format 3\x00"
NOT_TAKEN = frozenset({"outcrop_id", "fid", "ogc_fid"})
"""Columns that our own files and GDAL write, and that say nothing that a person gives."""
NEEDS = "{} needs {}: pip install 'outcrop[{}]'"


def is_gis(content: bytes) -> bool:
    """Return whether a file is a GeoPackage or XML."""
    return content.startswith(SQLITE) or content.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<")


def gis_rows(content: bytes) -> Iterator[tuple[int, str | None, Mapping[str, object]]]:
    """Yield number, reference and members of each row of a GeoPackage, KML or GPX file.

    Raises
    ------
    InvalidInputError
        If it is none of them, damaged, or XML with a DTD or entities of its own.
    UnavailableError
        If what reads it is not installed.
    """
    found = _package(content) if content.startswith(SQLITE) else _xml(content)
    for number, (reference, geometry, members) in enumerate(found, 1):
        if number > MAX_ROWS:
            raise TooLargeError(f"the file has more than {MAX_ROWS} rows")
        there = {n: v for n, v in members.items() if n not in NOT_TAKEN and v not in (None, "")}
        yield number, reference, {**there, "geometry": geometry}


Found = tuple[str, Mapping[str, Any] | None, Mapping[str, Any]]


def _xml(content: bytes) -> Iterator[Found]:
    try:
        from defusedxml import DefusedXmlException
        from defusedxml.ElementTree import ParseError, fromstring
    except ImportError:
        raise UnavailableError(NEEDS.format("KML and GPX", "defusedxml", "geo")) from None
    try:
        root = fromstring(content, forbid_dtd=True)
    except DefusedXmlException as err:
        raise InvalidInputError(
            "the file has a DTD or entities of its own, which no KML or GPX needs; they are not read"
        ) from err
    except (ParseError, ValueError) as err:
        raise InvalidInputError(f"the file is damaged XML: {err}") from err
    name = _local(root)
    if name not in {"kml", "gpx"}:
        raise InvalidInputError(f"the file is XML of {name[:40]!r}; kml and gpx are read")
    _require_flat(root)
    return _placemarks(root) if name == "kml" else _waypoints(root)


def _require_flat(root: Element) -> None:
    """Refuse what is nested deeply, and placemarks within placemarks: each is read with all that it holds."""
    waiting = [(root, 0, False)]
    while waiting:
        element, depth, within = waiting.pop()
        if depth >= MOST_NESTED:
            raise InvalidInputError(f"the file nests elements more than {MOST_NESTED} deep")
        marks = _local(element) == "Placemark"
        if marks and within:
            name = _text(element, "name")[:40]
            raise InvalidInputError(f"the file has a Placemark {name!r} within a Placemark, as KML never has")
        waiting += [(part, depth + 1, within or marks) for part in element]


def _local(element: Element) -> str:
    return str(element.tag).rpartition("}")[2]


def _below(element: Element, name: str) -> Iterator[Element]:
    return (part for part in element.iter() if _local(part) == name)


def _text(element: Element, name: str) -> str:
    return next(((part.text or "").strip() for part in element if _local(part) == name), "")


def _waypoints(root: Element) -> Iterator[Found]:
    for element in root:
        members = {"name": _text(element, "name"), "notes": _text(element, "desc")}
        match _local(element):
            case "wpt":
                yield WGS84, {"type": "Point", "coordinates": _degrees(element)}, members
            case "rte":
                ring = [_degrees(point) for point in _below(element, "rtept")]
                yield WGS84, {"type": "Polygon", "coordinates": [ring]}, members
            case "trk":
                yield WGS84, {"type": "a track"}, members


def _degrees(element: Element) -> list[str]:
    return [element.get("lon", ""), element.get("lat", "")]


def _placemarks(root: Element) -> Iterator[Found]:
    for mark in _below(root, "Placemark"):
        members = {"name": _text(mark, "name"), "notes": _text(mark, "description")}
        members |= {d.get("name", ""): (d.text or "").strip() for d in _below(mark, "SimpleData")}
        members |= {d.get("name", ""): _text(d, "value") for d in _below(mark, "Data")}
        yield LONLAT, _drawn(mark), members


def _drawn(mark: Element) -> Mapping[str, Any] | None:
    shape = next((part for part in mark if _local(part) in {"Point", "Polygon"}), None)
    if shape is None:
        return None
    rings = [
        [point.split(",") for point in (part.text or "").split()] for part in _below(shape, "coordinates")
    ]
    if _local(shape) == "Polygon":
        return {"type": "Polygon", "coordinates": rings}
    return {"type": "Point", "coordinates": rings[0][0] if rings and rings[0] else None}


def _package(content: bytes) -> Iterator[Found]:
    try:
        import pyogrio.raw
        from pyogrio.errors import DataLayerError, DataSourceError
    except ImportError:
        raise UnavailableError(NEEDS.format("GeoPackage", "pyogrio", "geo")) from None
    with tempfile.TemporaryDirectory(prefix="outcrop-gis-") as folder:
        file = Path(folder) / "given.gpkg"
        file.write_bytes(content)
        try:
            _require_tables(file)
            for layer in pyogrio.list_layers(file)[:, 0]:
                count = pyogrio.read_info(file, layer=layer, force_feature_count=True)["features"]
                if count > MAX_ROWS:
                    raise TooLargeError(f"layer {layer} has {count} rows; {MAX_ROWS} are allowed")
                meta, _, shapes, columns = pyogrio.raw.read(file, layer=layer)
                yield from _layer(meta, shapes, columns)
        except (DataSourceError, DataLayerError) as err:
            raise InvalidInputError(f"the GeoPackage is damaged: {err}") from err


def _require_tables(file: Path) -> None:
    """Refuse a GeoPackage whose layers are not plain tables: a view may be a query that never ends."""
    try:
        with closing(sqlite3.connect(f"file:{file}?mode=ro&immutable=1", uri=True)) as base:
            base.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MAX_CELL)
            made = dict(base.execute("SELECT name, sql FROM sqlite_master WHERE type = 'table'"))
            views = {
                str(name) for (name,) in base.execute("SELECT name FROM sqlite_master WHERE type = 'view'")
            }
    except (sqlite3.Error, ValueError) as err:
        raise InvalidInputError(f"the GeoPackage is damaged: {err}") from err
    if views:
        raise InvalidInputError(
            f"the GeoPackage has views, which are not read: {', '.join(sorted(views)[:5])}"
        )
    if "gpkg_contents" not in made:
        raise InvalidInputError("the GeoPackage is damaged: it has no table gpkg_contents")


def _layer(meta: Mapping[str, Any], shapes: Sequence[Any] | None, columns: Sequence[Any]) -> Iterator[Found]:
    import shapely

    crs = meta["crs"]
    reference = SITE if crs is None or "Undefined" in crs else str(crs)
    names = [str(name) for name in meta["fields"]]
    for row, shape in enumerate(() if shapes is None else shapes):
        members = {name: _plain(column[row]) for name, column in zip(names, columns, strict=True)}
        geometry = None if shape is None else json.loads(shapely.to_geojson(shapely.from_wkb(shape)))
        yield reference, geometry, members


def _plain(value: Any) -> Any:
    found = value.item() if hasattr(value, "item") else value
    return found if found is None or isinstance(found, str | bool | int | float) else str(found)
