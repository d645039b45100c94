"""Targets and keep-outs as files: site GeoJSON and CSV, read and written. Pure: no repository.

Coordinates are site metres, east and north (and up, which is written and not read: heights come from the
terrain). A GeoJSON file says so with `"frame": "site"`; a `crs` member is refused, since longitudes would be
taken for metres. CSV has one line for each thing; `polygon_m` holds corners as `east north; east north; ...`.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ground.errors import InvalidInputError
from ground.resources.keep_outs.value import KeepOut
from ground.resources.targets.value import Target

COLUMNS = ("kind", "name", "east_m", "north_m", "up_m", "polygon_m", "notes", "source_image", "id")
OWN = frozenset(COLUMNS) | {"author"}
MAX_ROWS = 5000
MAX_CORNERS = 500
MAX_NAME = 80
LIMIT_M = 100_000.0


@dataclass(frozen=True, slots=True)
class Shape:
    """One target (a single corner) or keep-out of a file; `row` is its line or feature, from 1."""

    row: int
    kind: str
    name: str | None
    notes: str
    source_image: str
    corners_m: tuple[tuple[float, float], ...]


def refuse(wrong: Sequence[tuple[int, str]], total: int) -> InvalidInputError:
    """Return the error that names every row that cannot be used."""
    told = [(row, f"row {row}: {why}") for row, why in sorted(wrong)]
    lines = [line for _, line in told]
    more = f"; and {len(lines) - 5} more" if len(lines) > 5 else ""
    return InvalidInputError(
        f"nothing was taken in: {len(lines)} of {total} rows cannot be used: {'; '.join(lines[:5])}{more}",
        wrong=[{"detail": line, "pointer": f"/rows/{row}"} for row, line in told],
    )


def read_shapes(content: bytes) -> list[Shape]:
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
            shapes.append(_shape(row, members))
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
            yield reader.line_num, {name: value for name, value in members.items() if value not in {None, ""}}
    except csv.Error as err:
        raise InvalidInputError(f"the CSV is damaged at line {reader.line_num}: {err}") from err


def _shape(row: int, members: Mapping[Any, Any]) -> Shape:
    """Return the shape of one row; a ValueError says what is wrong with it."""
    if None in members:
        raise ValueError("it has more cells than the first line has columns")
    kind, corners = _geometry(members["geometry"]) if "geometry" in members else _cells(members)
    named = members.get("kind", kind)
    if named != kind:
        raise ValueError(f"kind is {str(named)[:40]!r}, but the geometry is that of a {kind}")
    for east, north in corners:
        if not (math.isfinite(east) and math.isfinite(north) and max(abs(east), abs(north)) <= LIMIT_M):
            raise ValueError(f"({east:g}, {north:g}) is not within {LIMIT_M:g} m of the site")
    if len(corners) > MAX_CORNERS:
        raise ValueError(f"a keep-out has at most {MAX_CORNERS} corners, this one {len(corners)}")
    name = members.get("name")
    if name is not None and (not isinstance(name, str) or not name.strip() or len(name) > MAX_NAME):
        raise ValueError(f"a name is a text of 1 to {MAX_NAME} characters, not {str(name)[:40]!r}")
    if name is not None and any(ord(c) < 32 for c in name):
        raise ValueError("a name is one line without control characters")
    others = [f"{key}: {value}" for key, value in members.items() if key not in OWN and key != "geometry"]
    notes = "\n".join([*([str(members["notes"])] if members.get("notes") else []), *others])
    if len(notes) > 20_000 or any(ord(c) < 32 and c not in "\t\n\r" for c in notes):
        raise ValueError("the notes are longer than 20000 characters or hold control characters")
    image = str(members.get("source_image") or "")
    if len(image) > 200 or any(ord(c) < 32 for c in image):
        raise ValueError("source_image is one line of at most 200 characters")
    return Shape(row, kind, name, notes, image, corners)


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


def to_geojson(targets: Sequence[Target], keep_outs: Sequence[KeepOut]) -> bytes:
    """Return a FeatureCollection in the site frame."""
    features: list[dict[str, Any]] = []
    for t in targets:
        point = [t.position.east_m, t.position.north_m, t.position.up_m]
        about = {"kind": "target", "name": t.name, "notes": t.notes, "source_image": t.source_image}
        features.append(_feature(t.id, {"type": "Point", "coordinates": point}, about, t.author))
    for k in keep_outs:
        ring = [list(corner) for corner in k.polygon_m]
        about = {"kind": "keep_out", "name": k.name, "notes": k.notes}
        shape = {"type": "Polygon", "coordinates": [[*ring, ring[0]]]}
        features.append(_feature(k.id, shape, about, k.author))
    document = {"type": "FeatureCollection", "frame": "site", "features": features}
    return json.dumps(document, indent=1, ensure_ascii=False).encode()


def _feature(identifier: str, geometry: Any, about: Mapping[str, str], author: str) -> dict[str, Any]:
    properties = {**about, "author": author}
    return {"type": "Feature", "id": identifier, "properties": properties, "geometry": geometry}


def to_csv(targets: Sequence[Target], keep_outs: Sequence[KeepOut]) -> bytes:
    """Return a table with one line for each target and keep-out; numbers as short as they stay exact."""
    out = io.StringIO(newline="")
    writer = csv.DictWriter(out, COLUMNS, restval="")
    writer.writeheader()
    for t in targets:
        p = t.position
        place = {"east_m": repr(p.east_m), "north_m": repr(p.north_m), "up_m": repr(p.up_m)}
        about = {"kind": "target", "name": t.name, "notes": t.notes, "source_image": t.source_image}
        writer.writerow({**about, **place, "id": t.id})
    for k in keep_outs:
        corners = "; ".join(f"{east!r} {north!r}" for east, north in k.polygon_m)
        about = {"kind": "keep_out", "name": k.name, "notes": k.notes}
        writer.writerow({**about, "polygon_m": corners, "id": k.id})
    return out.getvalue().encode()
