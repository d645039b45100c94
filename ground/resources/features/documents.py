"""The documents of OGC API Features about a mission: landing page, conformance, collections, queryables."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

from ground.gdr.geometry import Bounds
from ground.geo.place import Place
from ground.resources.features.collections import COLLECTIONS
from ground.resources.features.references import out, references_of, storage_of
from ground.resources.features.value import Collection, Feature, Selection
from mission.codec import Document
from neighbours.geodata.cql2 import Form

FEATURES_1 = "http://www.opengis.net/spec/ogcapi-features-1/1.0/conf"
FEATURES_2 = "http://www.opengis.net/spec/ogcapi-features-2/1.0/conf"
FEATURES_3 = "http://www.opengis.net/spec/ogcapi-features-3/1.0/conf"
CQL2 = "http://www.opengis.net/spec/cql2/1.0/conf"
CONFORMS_TO = (
    f"{FEATURES_1}/core",
    f"{FEATURES_1}/geojson",
    f"{FEATURES_2}/crs",
    f"{FEATURES_3}/queryables",
    f"{FEATURES_3}/filter",
    f"{FEATURES_3}/features-filter",
    *(
        f"{CQL2}/{name}"
        for name in (
            "cql2-text",
            "basic-cql2",
            "advanced-comparison-operators",
            "case-insensitive-comparison",
            "accent-insensitive-comparison",
            "basic-spatial-functions",
            "basic-spatial-functions-plus",
            "spatial-functions",
            "temporal-functions",
            "property-property",
        )
    ),
)
JSON, GEOJSON, SCHEMA = "application/json", "application/geo+json", "application/schema+json"
OPENAPI = "application/vnd.oai.openapi+json;version=3.1"
TYPES: Mapping[Form, Document] = {
    "text": {"type": "string"},
    "number": {"type": "number"},
    "flag": {"type": "boolean"},
    "time": {"type": "string", "format": "date-time"},
}


def link(href: str, rel: str, media: str, title: str = "") -> Mapping[str, object]:
    """Return a link of a document."""
    return {"href": href, "rel": rel, "type": media, **({"title": title} if title else {})}


def landing_page(root: str, api: str, name: str, body: str) -> Mapping[str, object]:
    """Return the landing page of a mission whose documents are below `root`."""
    return {
        "title": name,
        "description": f"Targets, keep-outs, drives and images of the mission {name}, on {body}.",
        "links": [
            link(root, "self", JSON),
            link(api, "service-desc", OPENAPI, "the interface"),
            link(f"{api.rpartition('/')[0]}/docs", "service-doc", "text/html", "the interface, to read"),
            link(f"{root}/conformance", "conformance", JSON),
            link(f"{root}/collections", "data", JSON),
        ],
    }


def conformance() -> Mapping[str, object]:
    """Return the classes of requirements that are kept."""
    return {"conformsTo": list(CONFORMS_TO)}


def collections_page(root: str, place: Place, bounds: Bounds) -> Mapping[str, object]:
    """Return the list of collections."""
    found = [collection_page(root, collection, place, bounds) for collection, _ in COLLECTIONS.values()]
    uris = [reference.uri for reference in references_of(place)]
    return {"links": [link(f"{root}/collections", "self", JSON)], "collections": found, "crs": uris}


def collection_page(root: str, collection: Collection, place: Place, bounds: Bounds) -> Mapping[str, object]:
    """Return what is told of a collection; its extent is that of the mission's terrain."""
    here = f"{root}/collections/{collection.id}"
    known = references_of(place)
    storage = storage_of(place)
    return {
        "id": collection.id,
        "title": collection.title,
        "description": collection.description,
        "itemType": "feature",
        "extent": {"spatial": {"bbox": [_extent(place, bounds)], "crs": known[0].uri}},
        "crs": [reference.uri for reference in known],
        **({} if storage is None else {"storageCrs": storage.uri}),
        "links": [
            link(here, "self", JSON),
            link(f"{here}/items", "items", GEOJSON, collection.title),
            link(
                f"{here}/queryables",
                "http://www.opengis.net/def/rel/ogc/1.0/queryables",
                SCHEMA,
                "what a filter may name",
            ),
        ],
    }


def _extent(place: Place, bounds: Bounds) -> list[float]:
    """Return the rectangle round a terrain in the default reference."""
    import shapely

    around = shapely.box(bounds.east_min_m, bounds.north_min_m, bounds.east_max_m, bounds.north_max_m)
    (shape,) = out(place, [around.segmentize(10.0)], references_of(place)[0])
    assert shape is not None
    return [float(number) for number in shape.bounds]


def queryables(url: str, collection: Collection) -> Mapping[str, object]:
    """Return the schema of what a filter may name."""
    members: dict[str, Any] = {name: {"title": name, **TYPES[form]} for name, form in _plain(collection)}
    members["geometry"] = {"title": "geometry", "format": f"geometry-{collection.geometry}"}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": url,
        "type": "object",
        "title": collection.title,
        "properties": members,
        "additionalProperties": False,
    }


def _plain(collection: Collection) -> Sequence[tuple[str, Form]]:
    return [(name, form) for name, form in collection.queryables.items() if form != "geometry"]


def feature_document(feature: Feature) -> Mapping[str, object]:
    """Return a feature as GeoJSON."""
    import shapely

    shape = None if feature.geometry is None else json.loads(shapely.to_geojson(feature.geometry))
    told = {name: _shown(value) for name, value in feature.properties.items()}
    return {
        "type": "Feature",
        "id": feature.id,
        "geometry": shape,
        "properties": {**told, "created_utc": _shown(feature.created), **feature.more},
    }


def _shown(value: object) -> object:
    if isinstance(value, datetime):
        return value.isoformat().replace("+00:00", "Z")
    return int(value) if isinstance(value, float) and value.is_integer() else value


def items_page(selection: Selection, here: str, itself: str, behind: str | None) -> Mapping[str, object]:
    """Return a page of features with its links: itself, the page behind it, and its collection."""
    links = [link(itself, "self", GEOJSON), link(here, "collection", JSON)]
    if behind is not None:
        links.append(link(behind, "next", GEOJSON))
    return {
        "type": "FeatureCollection",
        "features": [feature_document(feature) for feature in selection.features],
        "numberMatched": selection.matched,
        "numberReturned": len(selection.features),
        "links": links,
    }


def item_page(selection: Selection, here: str, itself: str) -> Mapping[str, object]:
    """Return one feature with its links."""
    links = [link(itself, "self", GEOJSON), link(here, "collection", JSON)]
    return {**feature_document(selection.features[0]), "links": links}
