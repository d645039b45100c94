"""SpatioTemporal Asset Catalogs, version 1.1.0: catalogue, collections and items as documents.

https://github.com/radiantearth/stac-spec. Where a document lies is for who asks: files refer to each other by
relative paths, a service by addresses.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime

from mission.codec import Document

VERSION = "1.1.0"
JSON, GEOJSON = "application/json", "application/geo+json"
COG = "image/tiff; application=geotiff; profile=cloud-optimized"
_SCHEMA = "https://stac-extensions.github.io/{}/schema.json"
EXTENSIONS = {
    "proj": _SCHEMA.format("projection/v2.0.0"),
    "processing": _SCHEMA.format("processing/v1.2.0"),
    "view": _SCHEMA.format("view/v1.0.0"),
    "file": _SCHEMA.format("file/v2.1.0"),
    "ssys": _SCHEMA.format("ssys/v1.1.0"),
}
"""Extensions by the prefix of their members."""
Corner = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Asset:
    """A file of an item; `members` are those of extensions."""

    href: str
    media: str
    title: str
    roles: tuple[str, ...]
    members: Document = field(default_factory=dict)

    def document(self) -> Mapping[str, object]:
        """Return the asset as it stands in an item."""
        about = {"href": self.href, "type": self.media, "title": self.title, "roles": list(self.roles)}
        return {**about, **self.members}


@dataclass(frozen=True, slots=True)
class Item:
    """One terrain layer or product.

    Attributes
    ----------
    outline
        Longitudes and latitudes (degrees, on the site's own body): one corner is a point, four are an area,
        none where the mission has no place; then the geometry is null.
    time
        When it was observed, with a zone.
    """

    id: str
    title: str
    outline: tuple[Corner, ...]
    time: datetime
    members: Document
    assets: Mapping[str, Asset]


@dataclass(frozen=True, slots=True)
class Group:
    """Items of one kind: a collection, or a catalogue where they have no geometry."""

    id: str
    title: str
    description: str
    items: tuple[Item, ...]


@dataclass(frozen=True, slots=True)
class Links:
    """Where documents lie as seen from one of them: hrefs by relation; `items` and `children` by id."""

    root: str
    parent: str | None = None
    own: str | None = None
    parts: Mapping[str, str] = field(default_factory=dict)


def instant(time: datetime) -> str:
    """Return a time as RFC 3339 has it, in UTC."""
    return time.astimezone(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def catalogue(
    identifier: str, title: str, description: str, groups: Sequence[Group], links: Links
) -> Mapping[str, object]:
    """Return the document of a mission's catalogue."""
    parts = [_link("child", links.parts[group.id], JSON, group.title) for group in groups]
    return {
        "type": "Catalog",
        "stac_version": VERSION,
        "id": identifier,
        "title": title,
        "description": description,
        "links": [*_common(links, JSON), *parts],
    }


def group_document(group: Group, links: Links) -> Mapping[str, object]:
    """Return the document of a group: a collection if its items have a place, else a catalogue."""
    parts = [_link("item", links.parts[item.id], GEOJSON, item.title) for item in group.items]
    head = {
        "type": "Collection" if is_collection(group) else "Catalog",
        "stac_version": VERSION,
        "id": group.id,
        "title": group.title,
        "description": group.description,
        "links": [*_common(links, JSON), *parts],
    }
    if head["type"] == "Catalog":
        return head
    boxes = [box for item in group.items if (box := box_of(item.outline)) is not None]
    times = sorted(item.time for item in group.items)
    return {
        **head,
        "license": "other",
        "extent": {
            "spatial": {"bbox": [_around(boxes)]},
            "temporal": {"interval": [[instant(times[0]), instant(times[-1])]]},
        },
    }


def is_collection(group: Group) -> bool:
    """Return whether a group has an extent on a body: a collection must state one, a catalogue has none."""
    return any(item.outline for item in group.items)


def item_document(item: Item, links: Links, collection: str | None) -> Mapping[str, object]:
    """Return the document of an item; `collection` is the id of the collection it is in, if it is in one."""
    box = box_of(item.outline)
    here = _common(links, GEOJSON)
    if collection is not None and links.parent is not None:
        here.append(_link("collection", links.parent, JSON, None))
    return {
        "type": "Feature",
        "stac_version": VERSION,
        "stac_extensions": sorted(_extensions(item)),
        "id": item.id,
        **({"collection": collection} if collection is not None else {}),
        "geometry": _geometry(item.outline),
        **({} if box is None else {"bbox": box}),
        "properties": {"datetime": instant(item.time), "title": item.title, **item.members},
        "links": here,
        "assets": {name: asset.document() for name, asset in item.assets.items()},
    }


def box_of(outline: Sequence[Corner]) -> list[float] | None:
    """Return west, south, east, north of corners; west is the larger where they lie across 180 degrees."""
    if not outline:
        return None
    west, east = _span([(lon, lon) for lon, _ in outline])
    north = [lat for _, lat in outline]
    return [west, min(north), east, max(north)]


def _around(boxes: Sequence[Sequence[float]]) -> list[float]:
    west, east = _span([(box[0], box[2]) for box in boxes])
    return [west, min(box[1] for box in boxes), east, max(box[3] for box in boxes)]


def _span(spans: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Return the west and east end, -180 to 180 degrees, of the shortest arc that holds all arcs."""
    whole = (-180.0, 180.0)
    if any(east - west >= 360.0 for west, east in spans):
        return whole
    arcs = sorted((_within(west), (east - west) % 360.0) for west, east in spans)
    end, gap, found = arcs[0][0], 0.0, whole
    for west, width in [*arcs, (arcs[0][0] + 360.0, 0.0)]:
        if west - end > gap:
            gap, found = west - end, (_within(west), _within(end))
        end = max(end, west + width)
    return found if gap > 0 else whole


def _within(longitude: float) -> float:
    """Return a longitude as -180 (not taken) to 180 degrees."""
    return longitude if -180.0 <= longitude <= 180.0 else 180.0 - (180.0 - longitude) % 360.0


def _geometry(outline: Sequence[Corner]) -> Document | None:
    if not outline:
        return None
    if len(outline) == 1:
        return {"type": "Point", "coordinates": list(outline[0])}
    return {"type": "Polygon", "coordinates": [[list(corner) for corner in (*outline, outline[0])]]}


def _extensions(item: Item) -> set[str]:
    names = [*item.members, *(name for asset in item.assets.values() for name in asset.members)]
    return {uri for prefix, uri in EXTENSIONS.items() if any(name.startswith(f"{prefix}:") for name in names)}


def _common(links: Links, media: str) -> list[Document]:
    found = [_link("root", links.root, JSON, None)]
    if links.parent is not None:
        found.append(_link("parent", links.parent, JSON, None))
    if links.own is not None:
        found.append(_link("self", links.own, media, None))
    return found


def _link(relation: str, href: str, media: str, title: str | None) -> Document:
    about = {"rel": relation, "href": href, "type": media}
    return about if title is None else {**about, "title": title}
