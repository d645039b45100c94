"""Targets and keep-outs as files: GeoJSON and CSV, read and written. Pure: no repository.

Coordinates are site metres, east and north (and up, which is written and not read: heights come from the
terrain), or those of a reference that the file names: GeoJSON by `"frame": "lonlat"` or a member `crs`, CSV
by a column `crs`, with `x`, `y` and `polygon` in place of `east_m`, `north_m` and `polygon_m`. A file that
names none counts in site metres unless the person says otherwise. What else a person may give of a target or
keep-out goes along by its name. CSV has one line for each thing; `polygon_m` holds corners as
`east north; east north; ...`.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from pydantic import ValidationError

from ground.errors import InvalidInputError
from ground.geo.in_reference import from_site, placed, to_site
from ground.geo.place import Place
from ground.geo.references import LONLAT, SITE
from ground.records.forms import Body
from ground.resources.geometry_files.gis_reading import gis_rows, is_gis
from ground.resources.geometry_files.named_in import named_in
from ground.resources.keep_outs.bodies import KeepOutCreate
from ground.resources.targets.bodies import TargetCreate
from ground.spreadsheet import inert, shown

MAX_ROWS = 5000
MAX_REFERENCES = 16
"""Of one file: looking up one and its transformation takes up to 10 ms of processor time."""
OWN = frozenset({"kind", "id", "author", "up_m", "geometry"})
"""Members of a file that say nothing that a person gives."""
IN_REFERENCE = ("x", "y", "polygon")
"""Columns that hold the place in a row that counts in another reference than the site's."""


@dataclass(frozen=True, slots=True)
class Exchanged:
    """A kind that goes into files: what a person gives to make one, and which of it is the geometry."""

    make: type[TargetCreate] | type[KeepOutCreate]
    place: tuple[str, ...]

    @property
    def others(self) -> tuple[str, ...]:
        """Return the members that are not geometry, in the order in which they are declared."""
        return tuple(name for name in self.make.model_fields if name not in {*self.place, "at"})


EXCHANGED: Mapping[str, Exchanged] = {
    "target": Exchanged(TargetCreate, ("east_m", "north_m")),
    "keep_out": Exchanged(KeepOutCreate, ("polygon_m",)),
}
"""A member that is declared there goes out and comes in without a word more."""

Values = Mapping[str, Sequence[Any]]
"""Values to write, by the name of their kind."""


@dataclass(frozen=True, slots=True)
class Shape:
    """One target or keep-out of a file; `row` is its line or feature, from 1."""

    row: int
    kind: str
    given: TargetCreate | KeepOutCreate


def refuse(wrong: Sequence[tuple[int, str]], total: int) -> InvalidInputError:
    """Return the error that names every row that cannot be used."""
    named = [(row, f"row {row}: {why}") for row, why in sorted(wrong)]
    lines = [line for _, line in named]
    more = f"; and {len(lines) - 5} more" if len(lines) > 5 else ""
    return InvalidInputError(
        f"nothing was taken in: {len(lines)} of {total} rows cannot be used: {'; '.join(lines[:5])}{more}",
        wrong=[{"detail": line, "pointer": f"/rows/{row}"} for row, line in named],
    )


def read_shapes(
    content: bytes,
    exchanged: Mapping[str, Exchanged] = EXCHANGED,
    *,
    crs: str | None = None,
    site: Place | None = None,
) -> list[Shape]:
    """Return what a GeoJSON, CSV, GeoPackage, KML or GPX file holds, all of it, in site metres.

    Members that are not ours are kept as lines of the notes. `crs` is the reference of what names none
    itself, `site` where the site lies.

    Raises
    ------
    InvalidInputError
        If the file is neither, or rows cannot be used; it names all of them.
    """
    rows, table = _rows_of(content)
    if len(rows) > MAX_ROWS:
        raise InvalidInputError(f"the file has {len(rows)} rows; {MAX_ROWS} are allowed")
    unusable = _unusable({named or crs or SITE for _, named, _ in rows}, site)
    shapes, wrong = [], []
    for row, named, members in rows:
        name = named or crs or SITE
        if name in unusable:
            if not (table and named):
                raise unusable[name]
            wrong.append((row, unusable[name].message))
            continue
        try:
            shapes.append(_shape(row, members, exchanged, name, site))
        except (ValueError, InvalidInputError) as err:
            wrong.append((row, str(err)))
    if wrong:
        raise refuse(wrong, len(rows))
    return shapes


def _rows_of(content: bytes) -> tuple[list[Row], bool]:
    """Return the rows of a file, and whether it is a table, each row of which may name a reference."""
    if is_gis(content):
        return [(row, named, dict(members)) for row, named, members in gis_rows(content)], False
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as err:
        raise InvalidInputError(f"the file is not UTF-8: {err.reason} at byte {err.start}") from err
    table = not text.lstrip().startswith("{")
    return list(_lines(text) if table else _features(text)), table


def _unusable(names: Collection[str], site: Place | None) -> Mapping[str, InvalidInputError]:
    """Return the references of a file that cannot be used, each with the reason."""
    others = [name for name in names if name != SITE]
    if len(others) > MAX_REFERENCES:
        raise InvalidInputError(f"the file names {len(others)} references; {MAX_REFERENCES} are allowed")
    found = {}
    for name in others:
        frame = placed(site, name)
        try:
            frame.require_reachable(name)
        except InvalidInputError as err:
            found[name] = err
    return found


Row = tuple[int, str | None, dict[str, Any]]
"""Number, reference that is named for it, members."""


def _features(text: str) -> Iterator[Row]:
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as err:
        raise InvalidInputError(f"the file is not JSON: {err}") from err
    features = document.get("features") if document.get("type") == "FeatureCollection" else None
    if not isinstance(features, list):
        raise InvalidInputError("the file is not a GeoJSON FeatureCollection")
    named = named_in(document)
    for row, feature in enumerate(features, 1):
        feature = feature if isinstance(feature, dict) else {}
        geometry, properties = feature.get("geometry"), feature.get("properties")
        yield row, named, {**(properties if isinstance(properties, dict) else {}), "geometry": geometry}


def _lines(text: str) -> Iterator[Row]:
    reader = csv.DictReader(io.StringIO(text, newline=""), strict=True)
    try:
        if not {"kind", "name"} <= set(reader.fieldnames or ()):
            raise InvalidInputError("the CSV needs a first line with the columns kind and name, and more")
        for members in reader:
            found = {name: _read(value) for name, value in members.items()}
            there = {name: value for name, value in found.items() if value not in (None, "")}
            yield reader.line_num, there.get("crs"), there
    except csv.Error as err:
        raise InvalidInputError(f"the CSV is damaged at line {reader.line_num}: {err}") from err


def _read(cell: Any) -> Any:
    """Return what a cell says; those behind the last column come as a list."""
    return shown(cell) if isinstance(cell, str) else cell


def _shape(
    row: int,
    members: Mapping[Any, Any],
    exchanged: Mapping[str, Exchanged],
    name: str,
    site: Place | None,
) -> Shape:
    """Return the shape of one row; a ValueError says what is wrong with it."""
    if None in members:
        raise ValueError("it has more cells than the first line has columns")
    from_feature = "geometry" in members
    kind, given_corners = _geometry(members["geometry"]) if from_feature else _cells(members, name)
    named = members.get("kind", kind)
    if named != kind:
        raise ValueError(f"kind is {str(named)[:40]!r}, but the geometry is that of a {kind}")
    corners = to_site(given_corners, name, site)
    form = exchanged[kind]
    given = {name: members[name] for name in form.others if members.get(name) is not None}
    if not from_feature:
        given = {name: _content(form.make, name, cell) for name, cell in given.items()}
    places = {name for other in exchanged.values() for name in other.place}
    ours = {*OWN, *places, *form.others}
    if not from_feature:
        ours |= {"crs"} if name == SITE else {"crs", *IN_REFERENCE}
    strange = {k: v for k, v in members.items() if k not in ours and v is not None}
    notes = [str(given["notes"])] if given.get("notes") else []
    given["notes"] = "\n".join([*notes, *(f"{key}: {content}" for key, content in strange.items())])
    place = corners[0] if len(form.place) == 2 else ([list(corner) for corner in corners],)
    try:
        return Shape(row, kind, form.make(**given, **dict(zip(form.place, place, strict=True))))
    except ValidationError as err:
        first = err.errors()[0]
        content = str(first["input"])[:40]
        raise ValueError(f"{'.'.join(map(str, first['loc']))}: {first['msg']}, not {content!r}") from None


def _content(make: type[Body], name: str, cell: str) -> Any:
    """Return what a cell of a table holds: a text as it stands, anything else as JSON."""
    if _is_text(make, name):
        return cell
    try:
        return json.loads(cell)
    except (ValueError, RecursionError):
        return cell


@lru_cache(maxsize=256)
def _is_text(make: type[Body], name: str) -> bool:
    schema = make.model_json_schema()["properties"][name]
    return "string" in {option.get("type") for option in (schema, *schema.get("anyOf", ()))}


def _number(value: Any, what: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise ValueError(f"{what} is not a number: {str(value)[:40]!r}")
    try:
        return float(value)
    except (ValueError, OverflowError):
        raise ValueError(f"{what} is not a number: {str(value)[:40]!r}") from None


def _corner(value: Any) -> tuple[float, float]:
    if not isinstance(value, list) or not 2 <= len(value) <= 3:
        raise ValueError("a coordinate is [east, north] or [east, north, up]")
    return _number(value[0], "east"), _number(value[1], "north")


def _geometry(geometry: Any) -> tuple[str, tuple[tuple[float, float], ...]]:
    kind = geometry.get("type") if isinstance(geometry, dict) else None
    coordinates = geometry.get("coordinates") if isinstance(geometry, dict) else None
    if kind == "Point":
        return "target", (_corner(coordinates),)
    if kind != "Polygon":
        raise ValueError(f"a target is a Point and a keep-out a Polygon, not {str(kind)[:40]}")
    if not isinstance(coordinates, list) or len(coordinates) != 1 or not isinstance(coordinates[0], list):
        raise ValueError("a keep-out is one ring without holes")
    return "keep_out", _opened([_corner(c) for c in coordinates[0]])


def _cells(members: Mapping[Any, Any], name: str) -> tuple[str, tuple[tuple[float, float], ...]]:
    across, up, ring = ("east_m", "north_m", "polygon_m") if name == SITE else ("x", "y", "polygon")
    if members.get("kind") == "target":
        place = _number(members.get(across, ""), across), _number(members.get(up, ""), up)
        return "target", (place,)
    if members.get("kind") != "keep_out":
        raise ValueError(f"kind is target or keep_out, not {str(members.get('kind', ''))[:40]!r}")
    corners = []
    for part in str(members.get(ring, "")).split(";"):
        cells = part.split()
        if len(cells) != 2:
            raise ValueError(f"a corner of {ring} is 'east north', not {part.strip()[:40]!r}")
        corners.append((_number(cells[0], "east"), _number(cells[1], "north")))
    return "keep_out", _opened(corners)


def _opened(ring: list[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
    corners = ring[:-1] if len(ring) > 1 and ring[0] == ring[-1] else ring
    if len(corners) < 3:
        raise ValueError(f"a keep-out needs 3 corners, this one has {len(corners)}")
    return tuple(corners)


def to_geojson(
    values: Values,
    exchanged: Mapping[str, Exchanged] = EXCHANGED,
    *,
    crs: str = SITE,
    site: Place | None = None,
) -> bytes:
    """Return a FeatureCollection in the site frame or another reference.

    Longitudes and latitudes of the Earth are as RFC 7946 has them; any other reference is named by a member
    `crs`. Points have a height in the site frame, and elsewhere if it is known to be over the ellipsoid.
    """
    features: list[dict[str, Any]] = []
    for kind, form in exchanged.items():
        for value in values.get(kind, ()):
            about = {"kind": kind, **{name: getattr(value, name) for name in form.others}}
            features.append(
                {
                    "type": "Feature",
                    "id": value.id,
                    "properties": {**about, "author": value.author},
                    "geometry": _drawn(value, crs, site),
                }
            )
    document = {"type": "FeatureCollection", **_naming(crs, site), "features": features}
    return json.dumps(document, indent=1, ensure_ascii=False).encode()


def _naming(name: str, site: Place | None) -> dict[str, Any]:
    """Return the members of a GeoJSON document that say what its coordinates count in."""
    if name == SITE:
        return {"frame": SITE}
    crs = placed(site, name).named(name)
    assert crs is not None
    known = crs.to_authority()
    if name == LONLAT and known == ("EPSG", "4326"):
        return {"frame": LONLAT}
    text = f"urn:ogc:def:crs:{known[0]}::{known[1]}" if known else crs.to_wkt()
    return {"crs": {"type": "name", "properties": {"name": text}}}


def _drawn(value: Any, name: str, site: Place | None) -> dict[str, Any]:
    if hasattr(value, "position"):
        place = value.position
        up = [place.up_m]
        if name != SITE:
            zero = placed(site, name).place
            known = zero.heights == "ellipsoid" and zero.height_m is not None
            up = [place.up_m + (zero.height_m or 0.0)] if known else []
        ((x, y),) = from_site([(place.east_m, place.north_m)], name, site)
        return {"type": "Point", "coordinates": [x, y, *up]}
    ring = from_site(value.polygon_m, name, site)
    return {"type": "Polygon", "coordinates": [[*ring, ring[0]]]}


def to_csv(
    values: Values,
    exchanged: Mapping[str, Exchanged] = EXCHANGED,
    *,
    crs: str = SITE,
    site: Place | None = None,
) -> bytes:
    """Return a table with one line for each target and keep-out; numbers as short as they stay exact.

    In another reference than the site's, columns `crs`, `x`, `y` and `polygon` stand for the site's.
    """
    out = io.StringIO(newline="")
    places = dict.fromkeys(name for form in exchanged.values() for name in form.place)
    others = dict.fromkeys(name for form in exchanged.values() for name in form.others)
    members = dict.fromkeys(name for form in exchanged.values() for name in (*form.place, *form.others))
    heads = members if crs == SITE else ("crs", "x", "y", "polygon", *(n for n in others if n not in places))
    writer = csv.DictWriter(out, ("kind", *heads, "up_m", "id"), restval="")
    writer.writeheader()
    for kind, form in exchanged.items():
        for value in values.get(kind, ()):
            cells = {name: _cell(form.make, name, getattr(value, name)) for name in form.others}
            writer.writerow({"kind": kind, **cells, **_place_cells(value, crs, site), "id": value.id})
    return out.getvalue().encode()


def _cell(make: type[Body], name: str, content: Any) -> str:
    if content is None:
        return ""
    return inert(str(content) if _is_text(make, name) else json.dumps(content))


def _place_cells(value: Any, name: str, site: Place | None) -> dict[str, str]:
    if name != SITE:
        if hasattr(value, "position"):
            place = value.position
            ((x, y),) = from_site([(place.east_m, place.north_m)], name, site)
            return {"crs": name, "x": repr(x), "y": repr(y), "up_m": repr(place.up_m)}
        ring = from_site(value.polygon_m, name, site)
        return {"crs": name, "polygon": "; ".join(f"{x!r} {y!r}" for x, y in ring)}
    if hasattr(value, "position"):
        return {name: repr(getattr(value.position, name)) for name in ("east_m", "north_m", "up_m")}
    return {"polygon_m": "; ".join(f"{east!r} {north!r}" for east, north in value.polygon_m)}
