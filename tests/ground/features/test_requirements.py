"""Each requirement of OGC API Features and CQL2 that is claimed, by a test with its name.

Part 1 (17-069r4): core, geojson. Part 2 (18-058r1): crs. Part 3 (19-079r2): queryables, filter,
features-filter. CQL2 (21-065r2): the classes of `CONFORMS_TO`.
"""

from __future__ import annotations

import json
from datetime import UTC, datetime, timedelta
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
import shapely
from jsonschema import Draft202012Validator  # type: ignore[import-untyped]
from sqlalchemy import event

from ground.gdr.base import Row
from ground.resources.features.documents import CONFORMS_TO
from ground.resources.features.references import CRS84
from tests.ground.features.conftest import EARTH, RING, World
from tests.shared import needed

needed("pyproj")
WGS84 = "http://www.opengis.net/def/crs/EPSG/0/4326"
UTM = "http://www.opengis.net/def/crs/EPSG/0/32612"
MARS_DEGREES = "http://www.opengis.net/def/crs/IAU/2015/49900"
ALL = ["targets", "keep-outs", "traverses", "footprints", "ribbons", "runs"]
REQUIRED = {
    "core": """root-op root-success api-definition-op api-definition-success conformance-op
        conformance-success http query-param-unknown query-param-invalid crs84 fc-md-op fc-md-success
        fc-md-links fc-md-items fc-md-items-links fc-md-extent sfc-md-op sfc-md-success fc-op
        fc-bbox-definition fc-bbox-response fc-limit-definition fc-limit-response-1 fc-time-definition
        fc-time-response fc-response fc-links fc-rel-type fc-timeStamp fc-numberMatched fc-numberReturned
        f-op f-success f-links""",
    "geojson": "definition content",
    "crs": """crs-uri fc-md-crs-list fc-md-crs-list-global fc-md-storageCrs fc-md-storageCrs-valid-value
        fc-crs-definition fc-crs-valid-value fc-crs-default-value fc-crs-action fc-bbox-crs-definition
        fc-bbox-crs-valid-values fc-bbox-crs-default-value fc-bbox-crs-action ogc-crs-header
        ogc-crs-header-value geojson""",
    "queryables": "queryables-link get-queryables-op get-queryables-response",
    "filter": """filter-param filter-lang-param filter-crs-param expression-construction
        mixing-expressions response""",
    "cql2-text": """basic-cql2 advanced-comparison-operators case-insensitive-comparison
        accent-insensitive-comparison basic-spatial-functions basic-spatial-functions-plus spatial-functions
        temporal-functions property-property escaping""",
}


def test_every_requirement_that_is_claimed_has_a_test() -> None:
    missing = [
        f"/req/{group}/{name}"
        for group, names in REQUIRED.items()
        for name in names.split()
        if f"test_req_{group}_{name}".replace("-", "_") not in globals()
    ]
    assert missing == []


def links(document: Any, rel: str) -> list[dict[str, Any]]:
    return [link for link in document["links"] if link["rel"] == rel]


def follow(world: World, href: str, **options: Any) -> Any:
    assert href.startswith("http://testserver/")
    parts = urlsplit(href)
    return world.api("GET", f"{parts.path}{'?' + parts.query if parts.query else ''}", **options)


def degrees(world: World, east: float, north: float) -> list[float]:
    found: list[float] = world.frame.out([(east, north)], "lonlat")[0].tolist()
    return found


# ---- Part 1, Core


def test_req_core_root_op(world: World) -> None:
    assert world.api("GET", world.root()).status_code == 200


def test_req_core_root_success(world: World) -> None:
    page = world.api.get(world.root())
    assert page["title"] == "Utah"
    for rel in ("service-desc", "conformance", "data", "self"):
        assert len(links(page, rel)) == 1, rel


def test_req_core_api_definition_op(world: World) -> None:
    (link,) = links(world.api.get(world.root()), "service-desc")
    assert follow(world, link["href"]).status_code == 200


def test_req_core_api_definition_success(world: World) -> None:
    (link,) = links(world.api.get(world.root()), "service-desc")
    document = follow(world, link["href"]).json()
    assert document["openapi"].startswith("3.1")
    assert "/api/v1/missions/{mission_id}/features/collections/{collection_id}/items" in document["paths"]


def test_req_core_conformance_op(world: World) -> None:
    (link,) = links(world.api.get(world.root()), "conformance")
    assert follow(world, link["href"]).status_code == 200


def test_req_core_conformance_success(world: World) -> None:
    found = world.api.get(f"{world.root()}/conformance")["conformsTo"]
    assert found == list(CONFORMS_TO)
    assert "http://www.opengis.net/spec/ogcapi-features-1/1.0/conf/core" in found


def test_req_core_http(world: World) -> None:
    missing = world.api("GET", f"{world.root()}/collections/none")
    assert missing.status_code == 404
    assert missing.headers["content-type"].startswith("application/problem+json")
    assert world.api("DELETE", world.root()).status_code == 405


def test_req_core_query_param_unknown(world: World) -> None:
    for path in ("", "/conformance", "/collections", "/collections/targets", "/collections/targets/items"):
        answer = world.api("GET", f"{world.root()}{path}?nonsense=1")
        assert answer.status_code == 400, path
        assert "nonsense" in answer.json()["detail"]


@pytest.mark.parametrize(
    ("asked", "named"),
    [
        ({"limit": "many"}, "limit"),
        ({"limit": 0}, "limit"),
        ({"bbox": "1,2,3"}, "4 numbers"),
        ({"bbox": "a,b,c,d"}, "bbox"),
        ({"bbox": "nan,1,2,3"}, "bbox"),
        ({"bbox": "0,5,1,4"}, "smaller goes first"),
        ({"datetime": "yesterday"}, "datetime"),
        ({"datetime": "2026-11-22T10:00:00"}, "no zone"),
        ({"datetime": "2026-11-22T10:00:00Z/2026-11-21T10:00:00Z"}, "ends before"),
        ({"datetime": "../.."}, "datetime"),
        ({"crs": "http://www.opengis.net/def/crs/EPSG/0/1"}, "there are"),
        ({"filter-lang": "cql2-json", "filter": "{}"}, "cql2-text"),
        ({"filter": "name = "}, "at character"),
    ],
)
def test_req_core_query_param_invalid(world: World, asked: dict[str, Any], named: str) -> None:
    answer = world.items("targets", **asked)
    assert answer.status_code == 400
    assert named in answer.json()["detail"]


def test_req_core_crs84(world: World) -> None:
    (feature,) = [f for f in world.items("targets").json()["features"] if f["id"] == world.targets["Near"]]
    assert np.allclose(feature["geometry"]["coordinates"], degrees(world, 4.0, 1.0), rtol=0, atol=1e-9)


def test_req_core_fc_md_op(world: World) -> None:
    (link,) = links(world.api.get(world.root()), "data")
    assert follow(world, link["href"]).status_code == 200


def test_req_core_fc_md_success(world: World) -> None:
    page = world.api.get(f"{world.root()}/collections")
    assert [collection["id"] for collection in page["collections"]] == ALL


def test_req_core_fc_md_links(world: World) -> None:
    (link,) = links(world.api.get(f"{world.root()}/collections"), "self")
    assert link["type"] == "application/json"
    assert link["href"].endswith("/collections")


def test_req_core_fc_md_items(world: World) -> None:
    for collection in world.api.get(f"{world.root()}/collections")["collections"]:
        assert world.items(collection["id"]).status_code == 200


def test_req_core_fc_md_items_links(world: World) -> None:
    for collection in world.api.get(f"{world.root()}/collections")["collections"]:
        (link,) = links(collection, "items")
        assert link["type"] == "application/geo+json"
        assert follow(world, link["href"]).status_code == 200


def test_req_core_fc_md_extent(world: World) -> None:
    for collection in world.api.get(f"{world.root()}/collections")["collections"]:
        ((west, south, east, north),) = collection["extent"]["spatial"]["bbox"]
        for feature in world.items(collection["id"]).json()["features"]:
            if feature["geometry"] is not None:
                bounds = shapely.from_geojson(json.dumps(feature["geometry"])).bounds
                assert west <= bounds[0] <= bounds[2] <= east, collection["id"]
                assert south <= bounds[1] <= bounds[3] <= north, collection["id"]


def test_req_core_sfc_md_op(world: World) -> None:
    for name in ALL:
        assert world.api("GET", f"{world.root()}/collections/{name}").status_code == 200


def test_req_core_sfc_md_success(world: World) -> None:
    for collection in world.api.get(f"{world.root()}/collections")["collections"]:
        assert world.api.get(f"{world.root()}/collections/{collection['id']}") == collection


def test_req_core_fc_op(world: World) -> None:
    for name in ALL:
        answer = world.items(name)
        assert answer.status_code == 200
        assert answer.json()["features"], name


def _parameter(world: World, name: str) -> dict[str, Any]:
    paths = world.api.get("/openapi.json")["paths"]
    told = paths["/api/v1/missions/{mission_id}/features/collections/{collection_id}/items"]["get"]
    (found,) = [p for p in told["parameters"] if p.get("name") == name]
    assert found["in"] == "query"
    assert found["required"] is False
    return dict(found["schema"])


def test_req_core_fc_bbox_definition(world: World) -> None:
    _parameter(world, "bbox")
    lon, lat = degrees(world, 4.0, 1.0)
    assert world.names(bbox=f"{lon - 1e-5},{lat - 1e-5},-99,{lon + 1e-5},{lat + 1e-5},99") == ["Near"]


def test_req_core_fc_bbox_response(world: World) -> None:
    lon, lat = degrees(world, 4.0, 1.0)
    assert world.names(bbox=f"{lon - 1e-5},{lat - 1e-5},{lon + 1e-5},{lat + 1e-5}") == ["Near"]
    assert world.names(bbox=f"{lon - 1},{lat + 1},{lon + 1},{lat + 2}") == []
    assert len(world.names(bbox=f"170,{lat - 1},-100,{lat + 1}")) == 3  # over the meridian of 180 degrees
    assert world.names(bbox=f"170,{lat - 1},-170,{lat + 1}") == []
    lon, lat = degrees(world, 7.9, 6.1)  # in the keep-out, which has no corner in the box
    assert world.names("keep-outs", bbox=f"{lon - 1e-7},{lat - 1e-7},{lon + 1e-7},{lat + 1e-7}") == ["Sand"]


def test_req_core_fc_limit_definition(world: World) -> None:
    schema = _parameter(world, "limit")
    assert (schema["type"], schema["minimum"], schema["maximum"], schema["default"]) == (
        "integer",
        1,
        10000,
        10,
    )


def test_req_core_fc_limit_response_1(world: World) -> None:
    assert len(world.items("targets", limit=2).json()["features"]) == 2
    assert world.items("targets", limit=1_000_000).status_code == 200


def test_req_core_fc_time_definition(world: World) -> None:
    _parameter(world, "datetime")
    for asked in ("2026-01-01T00:00:00Z", "2026-01-01T00:00:00+01:00/..", "/2999-01-01T00:00:00.5Z"):
        assert world.items("targets", datetime=asked).status_code == 200, asked


def test_req_core_fc_time_response(world: World) -> None:
    made = [f["properties"]["created_utc"] for f in world.items("targets").json()["features"]]
    now = datetime.now(UTC)
    before, after = (f"{now + timedelta(hours=h):%Y-%m-%dT%H:%M:%SZ}" for h in (-1, 1))
    assert len(world.names(datetime=f"{before}/{after}")) == len(made)
    assert world.names(datetime=f"../{before}") == []
    assert world.names(datetime=f"{after}/..") == []
    assert len(world.names(datetime=made[0])) == made.count(made[0])


def test_req_core_fc_response(world: World) -> None:
    page = world.items("targets").json()
    assert page["type"] == "FeatureCollection"
    assert len(page["features"]) == 3


def test_req_core_fc_links(world: World) -> None:
    seen, href = [], f"http://testserver/api/v1{world.root()}/collections/targets/items?limit=2"
    while href:
        page = follow(world, href).json()
        (itself,) = links(page, "self")
        assert itself["href"] == href
        seen += [feature["id"] for feature in page["features"]]
        href = next((link["href"] for link in links(page, "next")), "")
    assert len(seen) == len(set(seen)) == 3


def test_req_core_fc_rel_type(world: World) -> None:
    for link in world.items("targets", limit=1).json()["links"]:
        assert link["rel"]
        assert link["type"]


def test_req_core_fc_timeStamp(world: World) -> None:
    page = world.items("targets").json()
    assert "timeStamp" not in page, "where there is one it has to be that of the answer; there is none"


def test_req_core_fc_numberMatched(world: World) -> None:
    assert world.items("targets", limit=1).json()["numberMatched"] == 3
    assert world.items("targets", limit=1, filter="name='Near'").json()["numberMatched"] == 1


def test_req_core_fc_numberReturned(world: World) -> None:
    assert world.items("targets", limit=2).json()["numberReturned"] == 2


def test_req_core_f_op(world: World) -> None:
    for name in ALL:
        for feature in world.items(name).json()["features"]:
            path = f"{world.root()}/collections/{name}/items/{feature['id']}"
            found = world.api.get(path)
            assert {**found, "links": None} == {**feature, "links": None}


def test_one_feature_is_read_without_the_others_of_its_collection(world: World) -> None:
    read: list[str] = []

    def note(row: Any, _context: Any) -> None:
        read.append(row.id)

    event.listen(Row, "load", note, propagate=True)
    try:
        for name in ALL:
            for feature in world.items(name).json()["features"]:
                read.clear()
                path = f"{world.root()}/collections/{name}/items/{feature['id']}"
                assert world.api("GET", path).status_code == 200
                row = feature["id"].partition(".")[0]  # of a ribbon: its plan
                kin = {one for one in read if one.partition("-")[0] == row.partition("-")[0]}
                assert kin == {row}, name
    finally:
        event.remove(Row, "load", note)


def test_req_core_f_success(world: World) -> None:
    (first, *_) = world.items("targets").json()["features"]
    found = world.api.get(f"{world.root()}/collections/targets/items/{first['id']}")
    assert {**found, "links": None} == {**first, "links": None}
    assert world.api("GET", f"{world.root()}/collections/targets/items/tgt-none").status_code == 404


def test_req_core_f_links(world: World) -> None:
    found = world.api.get(f"{world.root()}/collections/targets/items/{world.targets['Near']}")
    (itself,), (collection,) = links(found, "self"), links(found, "collection")
    assert itself["type"] == "application/geo+json"
    assert follow(world, collection["href"]).json()["id"] == "targets"


# ---- Part 1, GeoJSON


def test_req_geojson_definition(world: World) -> None:
    for path in ("items", f"items/{world.targets['Near']}"):
        answer = world.api("GET", f"{world.root()}/collections/targets/{path}")
        assert answer.headers["content-type"] == "application/geo+json"


def test_req_geojson_content(world: World) -> None:
    for name in ALL:
        for feature in world.items(name).json()["features"]:
            assert feature["type"] == "Feature"
            assert isinstance(feature["properties"], dict)
            shape = shapely.from_geojson(json.dumps(feature["geometry"])) if feature["geometry"] else None
            assert shape is None or shape.is_valid


# ---- Part 2


def test_req_crs_crs_uri(world: World) -> None:
    for uri in world.api.get(f"{world.root()}/collections/targets")["crs"]:
        assert uri.startswith("http://www.opengis.net/def/crs/")


def test_req_crs_fc_md_crs_list(world: World) -> None:
    found = world.api.get(f"{world.root()}/collections/targets")["crs"]
    assert found[0] == CRS84
    assert {WGS84, UTM} < set(found)
    for uri in found:
        assert world.items("targets", crs=uri).status_code == 200


def test_req_crs_fc_md_crs_list_global(world: World) -> None:
    page = world.api.get(f"{world.root()}/collections")
    assert page["crs"] == page["collections"][0]["crs"]


def test_req_crs_fc_md_storageCrs(world: World) -> None:
    assert world.api.get(f"{world.root()}/collections/targets")["storageCrs"] == UTM


def test_req_crs_fc_md_storageCrs_valid_value(world: World) -> None:
    found = world.api.get(f"{world.root()}/collections/targets")
    assert found["storageCrs"] in found["crs"]


def test_req_crs_fc_crs_definition(world: World) -> None:
    _parameter(world, "crs")


def test_req_crs_fc_crs_valid_value(world: World) -> None:
    answer = world.items("targets", crs="http://www.opengis.net/def/crs/EPSG/0/32613")
    assert answer.status_code == 400
    assert UTM in answer.json()["detail"]


def test_req_crs_fc_crs_default_value(world: World) -> None:
    assert world.items("targets").json()["features"] == world.items("targets", crs=CRS84).json()["features"]


def test_req_crs_fc_crs_action(world: World) -> None:
    path = f"{world.root()}/collections/targets/items/{world.targets['Near']}"
    there = world.api.get(f"{path}?crs={UTM}")["geometry"]["coordinates"]
    assert there == pytest.approx([float(str(EARTH["x"])) + 4.0, float(str(EARTH["y"])) + 1.0], abs=1e-6)
    lon, lat = world.api.get(path)["geometry"]["coordinates"]
    turned = world.api.get(f"{path}?crs={WGS84}")["geometry"]["coordinates"]
    assert turned == [lat, lon]  # the order of the axes is that of the reference


def test_req_crs_fc_bbox_crs_definition(world: World) -> None:
    _parameter(world, "bbox-crs")


def test_req_crs_fc_bbox_crs_valid_values(world: World) -> None:
    unknown = "http://www.opengis.net/def/crs/EPSG/0/32613"
    assert world.items("targets", bbox="0,0,1,1", bbox_crs=unknown).status_code == 400


def test_req_crs_fc_bbox_crs_default_value(world: World) -> None:
    lon, lat = degrees(world, 4.0, 1.0)
    box = f"{lon - 1e-5},{lat - 1e-5},{lon + 1e-5},{lat + 1e-5}"
    assert world.names(bbox=box) == world.names(bbox=box, bbox_crs=CRS84) == ["Near"]


def test_req_crs_fc_bbox_crs_action(world: World) -> None:
    x, y = world.frame.out([(4.0, 1.0)], "EPSG:32612")[0]
    assert world.names(bbox=f"{x - 1},{y - 1},{x + 1},{y + 1}", bbox_crs=UTM) == ["Near"]
    lon, lat = degrees(world, 4.0, 1.0)
    box = f"{lat - 1e-5},{lon - 1e-5},{lat + 1e-5},{lon + 1e-5}"
    assert world.names(bbox=box, bbox_crs=WGS84) == ["Near"]


def test_req_crs_ogc_crs_header(world: World) -> None:
    for path in ("items", f"items/{world.targets['Near']}"):
        answer = world.api("GET", f"{world.root()}/collections/targets/{path}?crs={UTM}")
        assert answer.headers["content-crs"] == f"<{UTM}>"


def test_req_crs_ogc_crs_header_value(world: World) -> None:
    assert world.items("targets").headers["content-crs"] == f"<{CRS84}>"


def test_req_crs_geojson(world: World) -> None:
    page = world.items("keep-outs", crs=UTM).json()
    (ring,) = page["features"][0]["geometry"]["coordinates"]
    assert np.allclose(ring[:3], world.frame.out(RING, "EPSG:32612"), rtol=0, atol=1e-6)


# ---- Part 3


def test_req_queryables_queryables_link(world: World) -> None:
    rel = "http://www.opengis.net/def/rel/ogc/1.0/queryables"
    (link,) = links(world.api.get(f"{world.root()}/collections/targets"), rel)
    assert follow(world, link["href"]).status_code == 200


def test_req_queryables_get_queryables_op(world: World) -> None:
    for name in ALL:
        answer = world.api("GET", f"{world.root()}/collections/{name}/queryables")
        assert answer.headers["content-type"] == "application/schema+json"


def test_req_queryables_get_queryables_response(world: World) -> None:
    for name in ALL:
        url = f"{world.root()}/collections/{name}/queryables"
        schema = world.api.get(url)
        Draft202012Validator.check_schema(schema)
        assert schema["$id"].endswith(url)
        assert schema["properties"]["geometry"]["format"].startswith("geometry-")
        for feature in world.items(name).json()["features"]:
            known = {k: v for k, v in feature["properties"].items() if k in schema["properties"]}
            there = {k: v for k, v in known.items() if v is not None}
            assert list(Draft202012Validator(schema).iter_errors(there)) == []
            assert set(schema["properties"]) - {"geometry"} <= set(feature["properties"])


def test_req_filter_filter_param(world: World) -> None:
    assert world.names(filter="name = 'Near'") == ["Near"]


def test_req_filter_filter_lang_param(world: World) -> None:
    assert world.names(filter="name = 'Near'", filter_lang="cql2-text") == ["Near"]


def test_req_filter_filter_crs_param(world: World) -> None:
    x, y = world.frame.out([(4.0, 1.0)], "EPSG:32612")[0]
    box = f"BBOX({x - 1},{y - 1},{x + 1},{y + 1})"
    assert world.names(filter=f"S_INTERSECTS(geometry,{box})", filter_crs=UTM) == ["Near"]
    lon, lat = degrees(world, 4.0, 1.0)
    box = f"BBOX({lon - 1e-5},{lat - 1e-5},{lon + 1e-5},{lat + 1e-5})"
    assert world.names(filter=f"S_INTERSECTS(geometry,{box})") == ["Near"]
    turned = f"BBOX({lat - 1e-5},{lon - 1e-5},{lat + 1e-5},{lon + 1e-5})"
    assert world.names(filter=f"S_INTERSECTS(geometry,{turned})", filter_crs=WGS84) == ["Near"]


def test_req_filter_expression_construction(world: World) -> None:
    answer = world.items("targets", filter="colour = 'red'")
    assert answer.status_code == 400
    assert "there is no property 'colour'" in answer.json()["detail"]


def test_req_filter_mixing_expressions(world: World) -> None:
    lon, lat = degrees(world, 4.0, 1.0)
    box = f"{lon - 1e-5},{lat - 1e-5},{lon + 1e-5},{lat + 1e-5}"
    assert world.names(filter="name = 'Far'", bbox=box) == []
    assert world.names(filter="name <> 'Far'", bbox=box) == ["Near"]


def test_req_filter_response(world: World) -> None:
    assert sorted(world.names(filter="feature_type IS NULL OR feature_type = ''")) == ["Far", "Near"]


# ---- CQL2


def test_req_cql2_text_basic_cql2(world: World) -> None:
    assert world.names(filter="request_count > 0 AND NOT (name = 'Far')") == ["Near"]
    assert world.names(filter="request_value >= 20 AND must_do = FALSE") == ["Near"]
    assert len(world.names(filter="created_utc > TIMESTAMP('2020-01-01T00:00:00Z')")) == 3
    assert world.names(filter="created_utc < DATE('2020-01-01')") == []


def test_req_cql2_text_advanced_comparison_operators(world: World) -> None:
    assert world.names(filter="name LIKE 'N%'") == ["Near"]
    assert world.names(filter="request_value BETWEEN 1 AND 10") == ["Far"]
    assert sorted(world.names(filter="name IN ('Near','Far')")) == ["Far", "Near"]


def test_req_cql2_text_case_insensitive_comparison(world: World) -> None:
    assert world.names(filter="CASEI(name) = CASEI('GRÖSSE')") == ["Größe"]


def test_req_cql2_text_accent_insensitive_comparison(world: World) -> None:
    assert world.names(filter="ACCENTI(name) LIKE ACCENTI('gro%')") == []
    assert world.names(filter="ACCENTI(CASEI(name)) LIKE 'gro%'") == ["Größe"]


def test_req_cql2_text_basic_spatial_functions(world: World) -> None:
    lon, lat = degrees(world, 7.5, 6.5)
    assert world.names("keep-outs", filter=f"S_INTERSECTS(geometry, POINT({lon} {lat}))") == ["Sand"]


def test_req_cql2_text_basic_spatial_functions_plus(world: World) -> None:
    ring = ", ".join(f"{x} {y}" for x, y in (degrees(world, *c) for c in [(3, 0), (5, 0), (4, 3), (3, 0)]))
    assert world.names(filter=f"S_INTERSECTS(geometry, POLYGON(({ring})))") == ["Near"]


def test_req_cql2_text_spatial_functions(world: World) -> None:
    ring = ", ".join(f"{x} {y}" for x, y in (degrees(world, *c) for c in [(3, 0), (5, 0), (4, 3), (3, 0)]))
    assert world.names(filter=f"S_WITHIN(geometry, POLYGON(({ring})))") == ["Near"]
    assert len(world.names(filter=f"S_DISJOINT(geometry, POLYGON(({ring})))")) == 2


def test_req_cql2_text_temporal_functions(world: World) -> None:
    assert len(world.names(filter="T_AFTER(created_utc, DATE('2020-01-01'))")) == 3
    assert world.names(filter="T_DURING(created_utc, INTERVAL('..','2020-01-01'))") == []


def test_req_cql2_text_property_property(world: World) -> None:
    assert len(world.names(filter="name = name")) == 3
    assert world.names(filter="request_count > request_value") == []


def test_req_cql2_text_escaping(world: World) -> None:
    assert world.names(filter="notes = '50% o''clock'") == ["Größe"]
    assert world.names(filter=r"notes LIKE '50\% o%'") == ["Größe"]
    assert world.names(filter="\"name\" = 'Near'") == ["Near"]
