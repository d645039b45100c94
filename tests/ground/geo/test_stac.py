"""A mission's STAC catalogue, over REST and as files, read and checked by pystac; its COGs by GDAL."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import math
import zipfile
from collections.abc import Iterator
from datetime import datetime, timedelta
from pathlib import Path, PureWindowsPath
from typing import Any
from urllib.parse import unquote, urljoin, urlsplit

import numpy as np
import pytest
import rasterio
from PIL import Image
from sqlalchemy import event, select

from ground.gdr.archives import checked_names
from ground.resources.missions.value import Mission
from ground.resources.products.row import ProductRow
from ground.spreadsheet import shown
from mission import Sky
from tests.ground.conftest import Api, yard
from tests.ground.geo.test_places_api import change
from tests.ground.planning import PlannedDay, finished
from tests.neighbours.geodata.test_cog import assert_cog
from tests.shared import needed

pyproj = needed("pyproj")
pystac = needed("pystac")
pds4_tools = needed("pds4_tools")

JEZERO = {"crs": "IAU_2015:49900", "x": 77.45, "y": 18.44, "rotation_rad": 0.2}
UTAH = {"crs": "EPSG:32612", "x": 518_334.0, "y": 4_251_500.0, "height_m": 1400.0, "heights": "ellipsoid"}
START = "2031-03-04T05:06:07Z"
BODIES = {"Mars": ("IAU_2015:49900", JEZERO), "Earth": ("EPSG:4326", UTAH)}


def over_rest(api: Api) -> Any:
    """Return what gives pystac the documents of the service."""

    class Io(pystac.StacIO):  # type: ignore[misc, name-defined]
        def read_text(self, source: Any, *_: Any, **__: Any) -> str:
            answer = api("GET", urlsplit(str(source)).path)
            assert answer.status_code == 200, answer.text
            return answer.text

        def write_text(self, *_: Any, **__: Any) -> None:
            raise NotImplementedError

    return Io()


def documents(catalogue: Any) -> Iterator[Any]:
    for root, _, items in catalogue.walk():
        yield root
        yield from items


def assert_valid(found: Any) -> None:
    """Check a document against the schemas of STAC that pystac brings; those of extensions are on line."""
    document = found.to_dict(transform_hrefs=False)
    from pystac.validation import RegisteredValidator

    validator = RegisteredValidator.get_validator()
    validator.validate_core(document, found.STAC_OBJECT_TYPE, "1.1.0", found.id)


@pytest.fixture
def done(sqlite_planned_day: PlannedDay) -> tuple[Api, Mission, dict[str, Any]]:
    """Give a mission with one run and its products."""
    api, mission = sqlite_planned_day.api, sqlite_planned_day.mission
    order = {"plan_id": sqlite_planned_day.plan["id"], "seed": 4}
    run = finished(api, api.post(f"/missions/{mission.id}/runs", order, status=202))
    return api, mission, run


def unpacked(api: Api, mission: Mission, folder: Path) -> Path:
    with zipfile.ZipFile(io.BytesIO(api("GET", f"/missions/{mission.id}/stac-archive").content)) as archive:
        archive.extractall(folder)
    return folder


def assert_labels(api: Api, mission: Mission, known: dict[str, Any], folder: Path) -> None:
    """Check that pds4_tools reads each picture, the heights and the table of products as they are here."""
    answer = api("GET", f"/missions/{mission.id}/pds4-archive")
    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        archive.extractall(folder)
    skipped = json.loads((folder / "not-labelled.json").read_text())
    pictures = {k: p for k, p in known.items() if p["media"] in ("image/png", "image/jpeg")}
    assert pictures
    assert skipped.keys() == known.keys() - pictures.keys()
    for identifier, product in pictures.items():
        content = api("GET", f"/products/{identifier}/file").content
        with Image.open(io.BytesIO(content)) as opened:
            ours = np.asarray(opened.convert("L" if opened.mode == "L" else "RGB"))
        (found,) = pds4_tools.read(str(folder / f"{identifier}.xml"), quiet=True)
        assert np.array_equal(np.asarray(found.data), ours if ours.ndim == 2 else np.moveaxis(ours, 2, 0))
        label = (folder / f"{identifier}.xml").read_text()
        taken = datetime.fromisoformat(START) + timedelta(seconds=product["t_s"])
        assert f"<start_date_time>{taken:%Y-%m-%dT%H:%M:%S}" in label
        assert "<name>Mars</name>" in label
        assert f"target {product['target_id']}" in label or product["target_id"] is None
    (listed,) = pds4_tools.read(str(folder / "products.xml"), quiet=True)
    assert {str(v) for v in listed["product"]} == set(known)
    assert {str(v) for v in listed["sha256"]} == {p["sha256"] for p in known.values()}
    (heights,) = pds4_tools.read(str(next(folder.glob("trn-*.xml"))), quiet=True)
    layer = api.get(f"/missions/{mission.id}/terrain")["layers"][0]
    assert np.asarray(heights.data).shape == (layer["rows"], layer["columns"])


def test_pystac_walks_and_validates_the_catalogue_over_rest_and_as_files(
    done: tuple[Api, Mission, dict[str, Any]], tmp_path: Path
) -> None:
    api, mission, run = done
    change(api, mission.id, JEZERO)
    sol = api.get(f"/missions/{mission.id}/sols")["items"][0]
    api("PATCH", f"/sols/{sol['id']}", {"start_utc": START}, headers={"If-Match": "*"})
    known = {
        p["id"]: p for p in api.get(f"/missions/{mission.id}/products?run_id={run['subject_id']}")["items"]
    }
    assert known
    root = f"http://testserver/api/v1/missions/{mission.id}/stac"
    served = pystac.Catalog.from_file(root, stac_io=over_rest(api))
    folder = unpacked(api, mission, tmp_path)
    filed = pystac.Catalog.from_file(str(folder / "catalog.json"))
    for catalogue in (served, filed):
        found = list(documents(catalogue))
        for one in found:
            assert_valid(one)
        items = {one.id: one for one in found if isinstance(one, pystac.Item)}
        assert known.keys() < items.keys()
        assert [c.id for c in catalogue.get_children()] == ["terrain", "products"]
        assert all(isinstance(c, pystac.Collection) for c in catalogue.get_children())
        # a collection that names an extension has to use it: their schemas say so
        assert all(not c.stac_extensions for c in catalogue.get_children())
        for identifier, product in known.items():
            item = items[identifier]
            assert item.datetime == datetime.fromisoformat(START) + timedelta(
                seconds=round(product["t_s"], 3)
            )
            for name in ("run", "request", "target", "task", "plan"):
                assert item.properties[f"outcrop:{name}"] == product[f"{name}_id"]
            east, north, up = Sky(start_lmst_h=sol["start_lmst_h"]).clock().direction(product["t_s"])
            assert item.properties["view:sun_elevation"] == pytest.approx(math.degrees(math.asin(up)))
            assert item.ext.view.sun_azimuth == pytest.approx(math.degrees(math.atan2(east, north)) % 360)
            assert item.properties["ssys:targets"] == ["Mars"]
    for identifier, product in known.items():
        item = next(i for i in filed.get_items(recursive=True) if i.id == identifier)
        content = Path(item.assets["data"].get_absolute_href()).read_bytes()
        assert hashlib.sha256(content).hexdigest() == product["sha256"]
        assert item.assets["data"].ext.file.checksum == f"1220{product['sha256']}"
        sent = next(i for i in served.get_items(recursive=True) if i.id == identifier)
        assert api("GET", urlsplit(sent.assets["data"].href).path).content == content
    assert_labels(api, mission, known, tmp_path / "pds4")
    targets = {t["id"]: t["position"] for t in api.get(f"/missions/{mission.id}/targets")["items"]}
    shown = next(p for p in known.values() if "point_m" in p["label"] or p["target_id"])
    place = next(i for i in filed.get_items(recursive=True) if i.id == shown["id"]).geometry
    there = targets[shown["target_id"]] if "point_m" not in shown["label"] else None
    east, north = (there["east_m"], there["north_m"]) if there else shown["label"]["point_m"][:2]
    turn = 0.2
    geod = pyproj.CRS("IAU_2015:49900").get_geod()
    azimuth = math.degrees(
        math.atan2(
            east * math.cos(turn) - north * math.sin(turn), east * math.sin(turn) + north * math.cos(turn)
        )
    )
    lon, lat, _ = geod.fwd(77.45, 18.44, azimuth, math.hypot(east, north))
    assert place["coordinates"] == pytest.approx([lon, lat], abs=1e-8)


@pytest.mark.parametrize("body", ["Mars", "Earth"])
def test_the_terrain_is_a_cog_at_the_right_place_with_its_projection(
    sqlite_api: Api, terrain_folder: Path, tmp_path: Path, body: str
) -> None:
    from rover_iface.terrain import load_terrain

    api, mission = sqlite_api, yard(sqlite_api.repo, terrain_folder)
    degrees, place = BODIES[body]
    change(api, mission.id, place)
    filed = pystac.Catalog.from_file(str(unpacked(api, mission, tmp_path) / "catalog.json"))
    (item,) = filed.get_child("terrain").get_items()
    layer = load_terrain(terrain_folder).layers[0]
    for name in ("dem", "ortho"):
        asset = item.assets[name]
        path = Path(asset.get_absolute_href())
        assert_cog(path)
        served = next(
            pystac.Item.from_dict(api.get(urlsplit(l.href).path))
            for l in [
                pystac.Link.from_dict(x) for x in api.get(f"/missions/{mission.id}/stac/terrain")["links"]
            ]
            if l.rel == "item"
        )
        assert api("GET", urlsplit(served.assets[name].href).path).content == path.read_bytes()
        with rasterio.open(path) as file:
            assert list(asset.ext.proj.shape) == [file.height, file.width]
            assert asset.ext.proj.transform[:6] == pytest.approx(list(file.transform)[:6])
            assert pyproj.CRS.from_json_dict(item.ext.proj.projjson) == pyproj.CRS(item.ext.proj.wkt2)
            to = pyproj.Transformer.from_crs(file.crs.to_wkt(), degrees, always_xy=True)
            west, south, east, north = item.bbox
            middle = to.transform(*(file.transform @ (file.width / 2, file.height / 2)))
            assert middle == pytest.approx(((west + east) / 2, (south + north) / 2), abs=1e-6)
            if name == "dem":
                zero = place.get("height_m", 0.0)
                assert file.read(1)[::-1] == pytest.approx(layer.heights + zero, abs=2e-4)
                assert file.tags()["HEIGHTS"] == place.get("heights", "site")
    assert item.ext.proj.code == (place["crs"] if body == "Earth" else None)
    assert item.properties["ssys:targets"] == [body]


def test_a_mission_without_a_place_has_items_without_geometry(
    done: tuple[Api, Mission, dict[str, Any]], tmp_path: Path
) -> None:
    api, mission, _ = done
    filed = pystac.Catalog.from_file(str(unpacked(api, mission, tmp_path) / "catalog.json"))
    found = list(documents(filed))
    for one in found:
        assert_valid(one)
        assert not isinstance(one, pystac.Collection)
    items = [one for one in found if isinstance(one, pystac.Item)]
    assert len(items) > 1
    assert all(one.geometry is None and one.bbox is None for one in items)
    told = {one.properties["outcrop:datetime_is"] for one in items}
    assert told == {
        "when it came into the repository",
        "when it came into the repository: its sol has no start_utc",
    }
    (layer,) = filed.get_child("terrain").get_items()
    with rasterio.open(layer.assets["dem"].get_absolute_href()) as file:
        assert tuple(file.bounds) == pytest.approx(tuple(layer.properties["outcrop:site_bounds_m"]))
        assert np.isfinite(file.read(1)).all()


def test_what_is_not_in_the_catalogue_is_not_found(sqlite_api: Api, terrain_folder: Path) -> None:
    api, mission = sqlite_api, yard(sqlite_api.repo, terrain_folder)
    for path in ("terrain/trn-1-inner", "products/prd-1", "terrain/trn-1-inner/dem.tif"):
        assert api("GET", f"/missions/{mission.id}/stac/{path}").status_code == 404
    assert api("GET", f"/missions/{mission.id}/stac/plans").status_code == 422
    assert api("GET", "/missions/msn-none/stac").status_code == 404
    assert json.loads(api("GET", f"/missions/{mission.id}/stac/products").text)["type"] == "Catalog"


def test_names_of_products_are_of_files_in_archives_and_of_links_in_documents(
    done: tuple[Api, Mission, dict[str, Any]], tmp_path: Path
) -> None:
    """A program may call a file what it likes; every system unpacks it, and every reader finds it."""
    api, mission, run = done
    change(api, mission.id, JEZERO)
    names = ["a\\b #1?.png", "products/50%20 off.png", "x/..", "con.txt", "x/y: z\u00fc.dat", "x/trail. "]
    with api.repo.database.write() as session:
        rows = session.scalars(select(ProductRow).where(ProductRow.run_id == run["subject_id"])).all()
        for row, name in zip(rows, names, strict=False):
            row.file_name = name
        changed = {row.id: row.sha256 for row, _ in zip(rows, names, strict=False)}
    assert changed
    catalogue = pystac.Catalog.from_file(str(unpacked(api, mission, tmp_path) / "catalog.json"))
    found = {item.id: item for item in catalogue.get_items(recursive=True)}
    for identifier, sha256 in changed.items():
        asset = found[identifier].assets["data"]
        address = urljoin((tmp_path / "products" / identifier / "item.json").as_uri(), asset.href)
        content = Path(unquote(urlsplit(address).path)).read_bytes()
        assert hashlib.sha256(content).hexdigest() == sha256
    for path in (f"missions/{mission.id}/stac-archive", f"runs/{run['subject_id']}/products"):
        sent = api("GET", f"/{path}")
        file = tmp_path / "sent.zip"
        file.write_bytes(sent.content)
        with zipfile.ZipFile(file) as archive:
            for entry in checked_names(archive, 1 << 30):
                for part in PureWindowsPath(entry.filename).parts:
                    assert not set(part) & set('<>:"|?*\\')
                    assert not PureWindowsPath(part).is_reserved()
                    assert part == part.rstrip(". ")


def test_one_item_is_read_without_the_others(done: tuple[Api, Mission, dict[str, Any]]) -> None:
    api, mission, _ = done
    change(api, mission.id, JEZERO)
    items = api.get(f"/missions/{mission.id}/products")["items"]
    read: list[str] = []

    def note(row: Any, _context: Any) -> None:
        read.append(row.id)

    event.listen(ProductRow, "load", note)
    try:
        for product in items:
            read.clear()
            item = api.get(f"/missions/{mission.id}/stac/products/{product['id']}")
            assert item["collection"] == "products"
            assert read == [product["id"]]
    finally:
        event.remove(ProductRow, "load", note)
    assert len(items) > 1


def test_no_cell_of_the_list_of_products_is_carried_out_by_a_spreadsheet(
    done: tuple[Api, Mission, dict[str, Any]],
) -> None:
    api, mission, run = done
    with api.repo.database.write() as session:
        row = session.scalars(select(ProductRow).where(ProductRow.run_id == run["subject_id"])).first()
        assert row is not None
        row.kind, row.instrument, row.task_id = "=HYPERLINK(1)", "a\r\n=1+1", '@SUM("x")'
        identifier = row.id
    answer = api("GET", f"/missions/{mission.id}/pds4-archive")
    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        text = archive.read("products.csv").decode()
    (cells,) = [row for row in csv.reader(io.StringIO(text, newline="")) if row[0] == identifier]
    assert "'=HYPERLINK(1)" in cells
    assert not [
        cell for line in csv.reader(io.StringIO(text)) for cell in line if cell.startswith(("=", "@"))
    ]
    assert [shown(cell) for cell in cells if "SUM" in cell] == ["@SUM('x')"]
