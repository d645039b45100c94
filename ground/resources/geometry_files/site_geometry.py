"""Targets and keep-outs as files: site GeoJSON and CSV, read and written. Pure: no repository.

Coordinates are site metres, east and north (and up, which is written and not read: heights come from the
terrain). What else a person may give of a target or keep-out goes along by its name. A GeoJSON file says so
with `"frame": "site"`; a `crs` member is refused, since longitudes would be taken for metres. CSV has one
line for each thing; `polygon_m` holds corners as `east north; east north; ...`.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from pydantic import ValidationError

from ground.errors import InvalidInputError
from ground.records.forms import Body
from ground.resources.keep_outs.bodies import KeepOutCreate
from ground.resources.targets.bodies import TargetCreate
from ground.spreadsheet import inert, shown

MAX_ROWS = 5000
LIMIT_M = 100_000.0
OWN = frozenset({"kind", "id", "author", "up_m", "geometry"})
"""Members of a file that say nothing that a person gives."""


@dataclass(frozen=True, slots=True)
class Exchanged:
    """A kind that goes into files: what a person gives to make one, and which of it is the geometry."""

    make: type[TargetCreate] | type[KeepOutCreate]
    place: tuple[str, ...]

    @property
    def others(self) -> tuple[str, ...]:
        """Return the members that are no geometry, in the order in which they are declared."""
        return tuple(name for name in self.make.model_fields if name not in self.place)


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


def read_shapes(content: bytes, exchanged: Mapping[str, Exchanged] = EXCHANGED) -> list[Shape]:
    """Return what a GeoJSON or CSV file holds, all of it.

    Members that are not ours are kept as lines of the notes.

    Raises
    ------
    InvalidInputError
        If the file is neither, or rows cannot be used; it names all of them.
    """
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as err:
        raise InvalidInputError(f"the file is not UTF-8: {err.reason} at byte {err.start}") from err
    rows = list(_features(text) if text.lstrip().startswith("{") else _lines(text))
    if len(rows) > MAX_ROWS:
        raise InvalidInputError(f"the file has {len(rows)} rows; {MAX_ROWS} are allowed")
    shapes, wrong = [], []
    for row, members in rows:
        try:
            shapes.append(_shape(row, members, exchanged))
        except ValueError as err:
            wrong.append((row, str(err)))
    if wrong:
        raise refuse(wrong, len(rows))
    return shapes


def _features(text: str) -> Iterator[tuple[int, dict[str, Any]]]:
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as err:
        raise InvalidInputError(f"the file is no JSON: {err}") from err
    features = document.get("features") if document.get("type") == "FeatureCollection" else None
    if not isinstance(features, list):
        raise InvalidInputError("the file is no GeoJSON FeatureCollection")
    if "crs" in document or document.get("frame", "site") != "site":
        raise InvalidInputError("coordinates must be metres of the site frame; the file names another one")
    for row, feature in enumerate(features, 1):
        feature = feature if isinstance(feature, dict) else {}
        geometry, properties = feature.get("geometry"), feature.get("properties")
        yield row, {**(properties if isinstance(properties, dict) else {}), "geometry": geometry}


def _lines(text: str) -> Iterator[tuple[int, dict[str, Any]]]:
    reader = csv.DictReader(io.StringIO(text, newline=""), strict=True)
    try:
        if not {"kind", "name"} <= set(reader.fieldnames or ()):
            raise InvalidInputError("the CSV needs a first line with the columns kind and name, and more")
        for members in reader:
            found = {name: _read(value) for name, value in members.items()}
            yield reader.line_num, {name: value for name, value in found.items() if value not in (None, "")}
    except csv.Error as err:
        raise InvalidInputError(f"the CSV is damaged at line {reader.line_num}: {err}") from err


def _read(cell: Any) -> Any:
    """Return what a cell says; those behind the last column come as a list."""
    return shown(cell) if isinstance(cell, str) else cell


def _shape(row: int, members: Mapping[Any, Any], exchanged: Mapping[str, Exchanged]) -> Shape:
    """Return the shape of one row; a ValueError says what is wrong with it."""
    if None in members:
        raise ValueError("it has more cells than the first line has columns")
    from_feature = "geometry" in members
    kind, corners = _geometry(members["geometry"]) if from_feature else _cells(members)
    named = members.get("kind", kind)
    if named != kind:
        raise ValueError(f"kind is {str(named)[:40]!r}, but the geometry is that of a {kind}")
    for east, north in corners:
        if not (math.isfinite(east) and math.isfinite(north) and max(abs(east), abs(north)) <= LIMIT_M):
            raise ValueError(f"({east:g}, {north:g}) is not within {LIMIT_M:g} m of the site")
    form = exchanged[kind]
    given = {name: members[name] for name in form.others if members.get(name) is not None}
    if not from_feature:
        given = {name: _content(form.make, name, cell) for name, cell in given.items()}
    places = {name for other in exchanged.values() for name in other.place}
    strange = {k: v for k, v in members.items() if k not in {*OWN, *places, *form.others} and v is not None}
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
        raise ValueError(f"{what} is no number: {str(value)[:40]!r}")
    try:
        return float(value)
    except (ValueError, OverflowError):
        raise ValueError(f"{what} is no number: {str(value)[:40]!r}") from None


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


def _cells(members: Mapping[Any, Any]) -> tuple[str, tuple[tuple[float, float], ...]]:
    if members.get("kind") == "target":
        place = _number(members.get("east_m", ""), "east_m"), _number(members.get("north_m", ""), "north_m")
        return "target", (place,)
    if members.get("kind") != "keep_out":
        raise ValueError(f"kind is target or keep_out, not {str(members.get('kind', ''))[:40]!r}")
    corners = []
    for part in str(members.get("polygon_m", "")).split(";"):
        cells = part.split()
        if len(cells) != 2:
            raise ValueError(f"a corner of polygon_m is 'east north', not {part.strip()[:40]!r}")
        corners.append((_number(cells[0], "east"), _number(cells[1], "north")))
    return "keep_out", _opened(corners)


def _opened(ring: list[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
    corners = ring[:-1] if len(ring) > 1 and ring[0] == ring[-1] else ring
    if len(corners) < 3:
        raise ValueError(f"a keep-out needs 3 corners, this one has {len(corners)}")
    return tuple(corners)


def to_geojson(values: Values, exchanged: Mapping[str, Exchanged] = EXCHANGED) -> bytes:
    """Return a FeatureCollection in the site frame."""
    features: list[dict[str, Any]] = []
    for kind, form in exchanged.items():
        for value in values.get(kind, ()):
            about = {"kind": kind, **{name: getattr(value, name) for name in form.others}}
            features.append(
                {
                    "type": "Feature",
                    "id": value.id,
                    "properties": {**about, "author": value.author},
                    "geometry": _drawn(value),
                }
            )
    document = {"type": "FeatureCollection", "frame": "site", "features": features}
    return json.dumps(document, indent=1, ensure_ascii=False).encode()


def _drawn(value: Any) -> dict[str, Any]:
    if hasattr(value, "position"):
        place = value.position
        return {"type": "Point", "coordinates": [place.east_m, place.north_m, place.up_m]}
    ring = [list(corner) for corner in value.polygon_m]
    return {"type": "Polygon", "coordinates": [[*ring, ring[0]]]}


def to_csv(values: Values, exchanged: Mapping[str, Exchanged] = EXCHANGED) -> bytes:
    """Return a table with one line for each target and keep-out; numbers as short as they stay exact."""
    out = io.StringIO(newline="")
    members = dict.fromkeys(name for form in exchanged.values() for name in (*form.place, *form.others))
    writer = csv.DictWriter(out, ("kind", *members, "up_m", "id"), restval="")
    writer.writeheader()
    for kind, form in exchanged.items():
        for value in values.get(kind, ()):
            cells = {name: _cell(form.make, name, getattr(value, name)) for name in form.others}
            writer.writerow({"kind": kind, **cells, **_place_cells(value), "id": value.id})
    return out.getvalue().encode()


def _cell(make: type[Body], name: str, content: Any) -> str:
    if content is None:
        return ""
    return inert(str(content) if _is_text(make, name) else json.dumps(content))


def _place_cells(value: Any) -> dict[str, str]:
    if hasattr(value, "position"):
        return {name: repr(getattr(value.position, name)) for name in ("east_m", "north_m", "up_m")}
    return {"polygon_m": "; ".join(f"{east!r} {north!r}" for east, north in value.polygon_m)}
