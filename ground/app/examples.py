"""Examples of what is sent and answered, made from the schemas of the OpenAPI document."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

from ground.api.openapi_form import Media, Schema
from ground.api.streams import sse
from ground.resources.kinds import KINDS

DEEP = 6
"""Schemas within schemas that an example shows; trees go on for ever."""
OTHER = "tgt"
"""The prefix of an id of which nothing else is known."""
SERIAL = "1qep8e5zsqmg5"
DIGEST = "9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08"
PREFIXES = {
    **{kind.name: kind.prefix for kind in KINDS.values()},
    **{kind.value.__name__: kind.prefix for kind in KINDS.values()},
    "request": KINDS["observation_request"].prefix,
    "subject": KINDS["mission"].prefix,
    "parent": KINDS["plan"].prefix,
    "upload": "upl",
    "key": "key",
    "session": "ses",
    "terrain": "trn",
}
"""What the ids of a thing begin with, by its name or that of its schema."""

WORDS: dict[str, Any] = {
    "name": "Rock1",
    "author": "Planner",
    "actor": "Planner",
    "person": "Planner",
    "approver": "Director",
    "approved_by": "Director",
    "waived_by": "Director",
    "notes": "a float beside the drive",
    "note": "checked against the terrain",
    "text": "Could the drive end farther north?",
    "reason": "agreed at the uplink meeting",
    "rationale": "is the layering the same here?",
    "label": "bundle adjustment",
    "role": "planner",
    "active": True,
    "subject_kind": "mission",
    "relation": "serves",
    "status": "ok",
    "outcome": "success",
    "version": "0.1.0",
    "credits": "NASA/JPL-Caltech",
    "layer": "site",
    "camera": "navcam_left",
    "doc": "what it is for",
    "rule": "verified",
    **dict.fromkeys(
        ("after", "exclude", "force", "gained", "lost", "displaced", "only_in_a", "only_in_b"),
        f"{KINDS['observation_request'].prefix}-{SERIAL}",
    ),
    "feature_type": "float rock",
    "source_image": "panorama-7.png",
    "instrument": "microscopic_imager",
    "rover_profile": "k9",
    "rover": "abstract",
    "task": "drive-1",
    "token": "the-token-of-the-log",
    "password": "a long sentence of one's own",
    "old": "a long sentence of one's own",
    "new": "another long sentence of one's own",
    "file_name": "targets.csv",
    "media": "image/png",
    "detail": f"there is no target tgt-{SERIAL}",
    "url": f"/api/v1/targets/tgt-{SERIAL}",
    "secret": "whsec_C2FVsBQIhrscChlQIMV+b5sSYspob7oD",
    "crl": "(plan :id sol5 :node (task :id pan :action imagepanorama))",
    "east_m": 4.2,
    "north_m": -1.5,
    "up_m": 0.1,
    "polygon_m": [[1.0, 1.0], [4.0, 1.0], [4.0, 3.0]],
    "crs": "EPSG:32612",
    "at": {"crs": "EPSG:32612", "x": 518338.2, "y": 4251498.5},
    "polygon": [[518335.0, 4251501.0], [518338.0, 4251501.0], [518338.0, 4251503.0]],
    "outline_m": [[1.0, 1.0], [4.0, 1.0], [4.0, 3.0]],
    "window_s": [3600.0, 7200.0],
    "quaternion": [1.0, 0.0, 0.0, 0.0],
    "covariance_m2": [[1e-4, 0.0, 0.0], [0.0, 1e-4, 0.0], [0.0, 0.0, 4e-4]],
    "covariance": [[0.01 if row == column else 0.0 for column in range(6)] for row in range(6)],
    "offset_m": [4.2, -1.5, 0.1],
    "normal": [0.0, 0.0, 1.0],
    "end_s": 5400.0,
    "heading_rad": 1.57,
    "azimuth_rad": 1.57,
}
"""What a member of that name holds where its schema allows it; others follow from their schema alone."""
AMOUNTS = {"_s": 3600.0, "_j": 250_000.0, "_rad": 0.35, "_m": 1.5, "_h": 9.5, "_mbit": 40.0}
"""What a number of that unit is."""
CODED = (f"tgt-{SERIAL}", "0a1b2c3d4e5f6071", f"{'A' * 43}=", f"{'A' * 86}==")
"""Texts of the patterns that there are: an id, the id of a key, a public key, a signature."""
FILES: dict[str, object] = {
    "get_plan_crl": "(plan :id sol5 :node (task :id pan :action imagepanorama))\n",
    "metrics": "outcrop_event_streams 2.0\n",
    "get_campaign_table": "seed,utility\n7,31.5\n",
    "text/html": "<!doctype html><html lang='en'><title>Report</title></html>",
    "text/csv": "kind,name,east_m,north_m\ntarget,Rock1,4.2,-1.5\n",
    "text/event-stream": 'id: 7\nevent: change\ndata: {"kind": "target"}\n\n',
    "text/vnd.graphviz": 'digraph plan { drive -> "Rock1" }',
    "image/svg+xml": "<svg xmlns='http://www.w3.org/2000/svg'/>",
    "application/xml": "<solution_file/>",
    "application/geo+json": {"type": "FeatureCollection", "frame": "site", "features": []},
    "application/schema+json": {"type": "object", "properties": {"name": {"type": "string"}}},
    "application/gpx+xml": '<gpx version="1.1"><wpt lat="18.4" lon="77.4"><name>Rock</name></wpt></gpx>',
    "application/vnd.google-earth.kml+xml": (
        '<kml xmlns="http://www.opengis.net/kml/2.2"><Placemark><name>Rock</name>'
        "<Point><coordinates>77.4508,18.4447</coordinates></Point></Placemark></kml>"
    ),
}
"""What a file of text may be, by the operation that sends it, else by its media type."""
STREAMS = {
    "stream_job": ("job", "Job"),
    "stream_mission": ("change", "Event"),
    "stream_run": ("trace", "TraceEvent"),
}
"""An event of each stream and the schema of its data."""


class Examples:
    """Examples that fit the schemas of a document; those of named schemas are kept once."""

    def __init__(self, schemas: Mapping[str, Schema]) -> None:
        self._schemas = schemas
        self.stated: dict[str, object] = {}
        """By the name of their schema."""

    def show(self, operation: str, media: str, content: Media) -> None:
        """Give a body its example, unless it has one or is a file of bytes."""
        if {"example", "examples"} & content.keys():
            return
        schema = content.get("schema", {})
        if media != "application/json":
            text = self._file(operation, media)
            if text is not None:
                content["example"] = text
        elif "$ref" in schema:
            name = schema["$ref"].rpartition("/")[2]
            if name not in self.stated:
                self.stated[name] = {"value": self.of(schema)}
            content["examples"] = {"default": {"$ref": f"#/components/examples/{name}"}}
        else:
            content["example"] = self.of(schema)

    def has(self, content: Media, member: str) -> bool:
        """Return whether a body is an object with such a member."""
        name = content.get("schema", {}).get("$ref", "").rpartition("/")[2]
        return member in self._schemas.get(name, {}).get("properties", {})

    def _file(self, operation: str, media: str) -> Any:
        if operation in STREAMS:
            event, name = STREAMS[operation]
            return sse(event, self.of(self._schemas[name]), 7).decode()
        return FILES.get(operation, FILES.get(media))

    def of(self, schema: Schema, name: str = "", depth: int = 0) -> Any:
        """Return a value that fits a schema; `name` is that of the member it stands in."""
        if "$ref" in schema:
            return self.of(self._schemas[schema["$ref"].rpartition("/")[2]], name, depth)
        if schema.get("examples"):
            return schema["examples"][0]
        if "enum" in schema:
            return WORDS[name] if WORDS.get(name) in schema["enum"] else schema["enum"][0]
        if "const" in schema:
            return schema["const"]
        options = schema.get("anyOf") or schema.get("oneOf")
        if options:
            if depth >= DEEP and {"type": "null"} in options:
                return None
            return self.of(options[0], name, depth)
        kind = schema.get("type", "object")
        if kind == "object":
            return self._object(schema, depth)
        if kind == "array":
            return self._array(schema, name, depth)
        if kind == "string":
            return text_of(schema, name)
        if kind in {"number", "integer"}:
            return number_of(schema, name)
        return WORDS.get(name, False) if kind == "boolean" else None

    def _object(self, schema: Schema, depth: int) -> dict[str, object]:
        """Return an object: near the top with all its members, farther below with those it must have."""
        needed = schema.get("required", ())
        found = {
            name: self.of(told, name, depth + 1)
            for name, told in schema.get("properties", {}).items()
            if name in needed or depth < 2
        }
        if found.get("id") == f"{OTHER}-{SERIAL}" and schema.get("title") in PREFIXES:
            found["id"] = f"{PREFIXES[schema['title']]}-{SERIAL}"
        return found

    def _array(self, schema: Schema, name: str, depth: int) -> list[Any]:
        """Return an array with one item, or as many as it must have."""
        items = schema.get("prefixItems")
        item = schema.get("items", {}) if items is None else items[0]
        least = schema.get("minItems", 0)
        word = WORDS.get(name)
        if isinstance(word, list) and len(word) >= least and is_table(word) == (item.get("type") == "array"):
            return word
        if items is not None:
            return [self.of(part, name, depth + 1) for part in items]
        count = min(max(least, 0 if depth >= DEEP else 1), schema.get("maxItems", 1 + least))
        inner = name[:-1] if name.endswith("_ids") else name
        return [self.of(item, inner, depth + 1) for _ in range(count)]


def is_table(word: list[Any]) -> bool:
    """Return whether a list has rows."""
    return isinstance(word[0], list)


def number_of(schema: Mapping[str, object], name: str) -> float:
    """Return a number within the bounds of its schema."""
    word = WORDS.get(name)
    units = (amount for unit, amount in AMOUNTS.items() if name.endswith(unit))
    known: float = word if isinstance(word, float) else next(units, 1.0)
    low: Any = schema.get("minimum", schema.get("exclusiveMinimum", known))
    high: Any = schema.get("maximum", schema.get("exclusiveMaximum", known))
    value = min(max(known, low), high)
    if value in {schema.get("exclusiveMaximum"), schema.get("exclusiveMinimum")}:
        value = (low + high) / 2 if "exclusiveMaximum" in schema else value + 1.0
    return int(value) if schema["type"] == "integer" else float(value)


def text_of(schema: Schema, name: str) -> str:
    """Return a text that fits its schema."""
    if schema.get("format") == "date-time" or name.endswith("_utc"):
        return "2026-11-22T08:31:26Z"
    if name.endswith("sha256"):
        return DIGEST
    pattern = schema.get("pattern", "")
    words: Iterable[str] = (*_words(name), name.replace("_", " ") or "text", *CODED)
    text = next((word for word in words if re.search(pattern, word)), "")
    return text[: schema.get("maxLength", 200)].ljust(schema.get("minLength", 0), "x")


def _words(name: str) -> Iterable[str]:
    """Yield what a text of that name may be."""
    if name == "id" or name.endswith("_id"):
        thing = name.removesuffix("id").rstrip("_")
        yield f"{PREFIXES.get(thing, PREFIXES.get(thing.rpartition('_')[2], OTHER))}-{SERIAL}"
    known = WORDS.get(name)
    if isinstance(known, str):
        yield known
