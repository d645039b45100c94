"""Damaged and hostile files: each is refused in a sentence, within bounds of memory and processor time."""

from __future__ import annotations

import io
import json
import resource
import struct
import time
import warnings
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sqlalchemy import select

from ground.errors import GroundError
from ground.resources.plans.row import PlanRow
from ground.uplink.execute import Place, execute_package
from ground.uplink.package import json_text, manifest_text
from tests.ground.conftest import Api, yard
from tests.ground.killed import write_run
from tests.ground.signed import about, parts, small_site, zipped
from tests.ground.test_killed import uplinked_plan
from tests.ground.test_missions_api import upload

DEEP = b"[" * 200_000 + b"]" * 200_000
CPU_S = 5.0
"""Processor time of one refusal. The slowest, a hundred thousand entries of a zip, takes about a second."""
SPACE = 1536 * 2**20
"""Address space that one refusal may add; every bomb here would need several times that."""
RESIDENT = 400 * 2**20


@contextmanager
def bounded(name: str) -> Iterator[None]:
    """Fail if what is done takes more memory or processor time than a refusal may."""
    here = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    peak, begin = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
    resource.setrlimit(resource.RLIMIT_AS, (here + SPACE, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
    assert time.process_time() - begin <= CPU_S, name
    assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - peak) * 1024 <= RESIDENT, name


# ---- terrains


def raster(folder: Path, width: int, height: int, *, bands: int = 1, placed: bool = True) -> bytes:
    """Return a GeoTIFF of many pixels and few bytes: no block of it is written."""
    import rasterio
    from affine import Affine

    path = folder / "made.tif"
    options: dict[str, Any] = {"transform": Affine(0.1, 0.0, 0.0, 0.0, -0.1, 0.0)} if placed else {}
    shape = {"width": width, "height": height, "count": bands, "dtype": "float32"}
    tiles = {"tiled": True, "blockxsize": 32768, "blockysize": 32768} if width * height > 10**8 else {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        rasterio.open(
            path, "w", driver="GTiff", sparse_ok=True, bigtiff="yes", **shape, **tiles, **options
        ).close()
    return path.read_bytes()


def tiff_header(width: int, height: int) -> bytes:
    """Return a classic TIFF that claims a size and has one strip of nothing."""
    entries = [
        (256, 4, 1, width),
        (257, 4, 1, height),
        (258, 3, 1, 32),
        (259, 3, 1, 1),
        (262, 3, 1, 1),
        (273, 4, 1, 8),
        (277, 3, 1, 1),
        (278, 4, 1, height),
        (279, 4, 1, 0xFFFFFFF0),
        (339, 3, 1, 3),
    ]
    rows = b"".join(struct.pack("<HHII", *entry) for entry in entries)
    return b"II*\0" + struct.pack("<I", 8) + struct.pack("<H", len(entries)) + rows + bytes(4)


def png(width: int, height: int) -> bytes:
    """Return a PNG of one colour, a bit a pixel."""

    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    packed = zlib.compressobj(9)
    line = bytes(1 + (width + 7) // 8)
    body = b"".join(packed.compress(line) for _ in range(height)) + packed.flush()
    head = struct.pack(">IIBBBBB", width, height, 1, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", body) + chunk(b"IEND", b"")


def glb(document: dict[str, Any]) -> bytes:
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def _accessors(count: int) -> dict[str, Any]:
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"componentType": 5126, "type": "VEC3", "count": count}],
    }


def _borrowing(folder: Path) -> bytes:
    """Return a mesh whose corners stand in a sound file of somebody else's."""
    (folder / "theirs.bin").write_bytes(np.array([[0, 0, 0], [1, 0, 0], [0, 0, 1]], dtype="<f4").tobytes())
    uri = f"../../../../../..{folder}/theirs.bin"
    view = {"buffer": 0, "byteOffset": 0, "byteLength": 36}
    document = _accessors(3) | {"buffers": [{"uri": uri, "byteLength": 36}], "bufferViews": [view]}
    document["accessors"][0]["bufferView"] = 0
    return json.dumps(document).encode()


def _ply(vertices: str) -> bytes:
    return (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    ).encode() + bytes(48)


def _elsewhere(**members: str) -> bytes:
    """Return a zip of a terrain whose description names a file outside it."""
    layer = {"dem": "dem.tif", **members}
    return zipped({"terrain.json": json.dumps({"format": "terrain/1", "layers": [layer]}).encode()})


TERRAINS: dict[str, tuple[str, Callable[[Path], bytes]]] = {
    "a header of 10^9 columns": ("a.tif", lambda _: tiff_header(10**9, 1)),
    "a header of 10^9 rows and columns": ("a.tif", lambda _: tiff_header(10**9, 10**9)),
    "a raster of 3.6 10^9 posts": ("a.tif", lambda f: raster(f, 60_000, 60_000)),
    "a raster of 10^9 columns": ("a.tif", lambda f: raster(f, 10**9, 2)),
    "a raster that lies nowhere": ("a.tif", lambda f: raster(f, 16, 16, placed=False)),
    "a raster cut off": ("a.tif", lambda f: raster(f, 64, 64)[:300]),
    "a description that points elsewhere": (
        "a.tif",
        lambda _: (
            b'<VRTDataset rasterXSize="9" rasterYSize="9"><VRTRasterBand dataType="Float32" band="1">'
            b"<SimpleSource><SourceFilename>/etc/passwd</SourceFilename></SimpleSource></VRTRasterBand>"
            b"</VRTDataset>"
        ),
    ),
    "a DEM outside its folder": ("a.zip", lambda _: _elsewhere(dem="../../../etc/passwd")),
    "a DEM by its whole path": ("a.zip", lambda _: _elsewhere(dem="/etc/passwd")),
    "a mesh of 10^9 vertices without bytes": ("a.glb", lambda _: glb(_accessors(10**9))),
    "a mesh of deep JSON": ("a.gltf", lambda _: DEEP),
    "a mesh that points elsewhere": ("a.gltf", lambda f: _borrowing(f)),
    "a point cloud of 10^12": ("a.ply", lambda _: _ply("1000000000000")),
    "a mesh with corners that are not there": ("a.obj", lambda _: b"v 0 0 0\nf 1 2 999999999\n"),
    "a mesh of a size of 10^30": (
        "a.obj",
        lambda _: b"v 0 0 0\nv 1e30 0 0\nv 0 1e30 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n",
    ),
}


@pytest.mark.parametrize("name", TERRAINS)
def test_a_hostile_terrain_is_refused(name: str, sqlite_api: Api, tmp_path: Path) -> None:
    file_name, make = TERRAINS[name]
    source = {"source": "uploaded", "upload_id": upload(sqlite_api, file_name, make(tmp_path))}
    with bounded(name):
        answer = sqlite_api("POST", "/missions", {"name": "X", "terrain": source})
    refused(name, answer)


def test_an_ortho_image_of_ten_thousand_million_pixels_is_refused(
    sqlite_api: Api, terrain_folder: Path
) -> None:
    dem = upload(sqlite_api, "a.tif", next(terrain_folder.glob("dem*.tif")).read_bytes())
    image = upload(sqlite_api, "o.png", png(100_000, 100_000))
    source = {"source": "uploaded", "upload_id": dem, "ortho_upload_id": image}
    with bounded("ortho"):
        answer = sqlite_api("POST", "/missions", {"name": "X", "terrain": source})
    refused("ortho", answer)


def refused(name: str, answer: Any) -> None:
    """Hold an answer to be a refusal in words."""
    assert answer.status_code in {409, 413, 422}, (name, answer.text[:500])
    said = answer.json()
    assert said["type"].startswith("urn:outcrop:problem:"), name
    assert said["detail"], name
    assert "\n" not in said["detail"], name
    assert len(said["detail"]) <= 500, (name, said["detail"])


# ---- archives of missions


def _claims(size: int) -> bytes:
    """Return a zip whose entry claims another size than it has."""
    whole = bytearray(zipped({"manifest.json": b"{}" * 100}))
    place = whole.index(b"PK\x01\x02")
    whole[place + 24 : place + 28] = struct.pack("<I", size)
    return bytes(whole)


def _many(count: int) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for number in range(count):
            archive.writestr(zipfile.ZipInfo(f"{number}"), b"")
    return out.getvalue()


def _sealed() -> bytes:
    whole = bytearray(zipped({"manifest.json": b"{}"}))
    for mark, at in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        whole[whole.index(mark) + at] |= 1
    return bytes(whole)


ARCHIVES: dict[str, Callable[[], bytes]] = {
    "deep JSON": lambda: zipped({"manifest.json": DEEP, "rows.json": DEEP}),
    "a hundred thousand entries too many": lambda: _many(100_001),
    "a size that is a lie": lambda: _claims(2**32 - 2),
    "a name of 10,000 characters": lambda: zipped({"a" * 10_000: b"x"}),
    "a folder of 5,000 folders": lambda: zipped({"a/" * 5000 + "b": b"x"}),
    "a file in the place of a folder": lambda: zipped({"a": b"x", "a/b": b"x"}),
    "an entry with a password": _sealed,
    "no zip": lambda: b"PK\x05\x06" + bytes(18),
}


@pytest.mark.parametrize("name", ARCHIVES)
@pytest.mark.parametrize("place", ["/missions/import", "/runs/ingest", "/missions"])
def test_a_hostile_archive_is_refused_wherever_it_goes(name: str, place: str, sqlite_api: Api) -> None:
    upload_id = upload(sqlite_api, "x.zip", ARCHIVES[name]())
    order: dict[str, Any] = {"upload_id": upload_id}
    if place == "/missions":
        order = {"name": "X", "terrain": {"source": "uploaded", **order}}
    with bounded(name):
        answer = sqlite_api("POST", place, order, who="Administrator")
    refused(f"{name} at {place}", answer)


# ---- runs


def _document(**members: Any) -> Callable[[Path], None]:
    def harm(folder: Path) -> None:
        found = json.loads((folder / "run.json").read_text())
        (folder / "run.json").write_text(json.dumps({**found, **members}))

    return harm


def _raw(name: str, content: bytes) -> Callable[[Path], None]:
    return lambda folder: (folder / name).write_bytes(content) and None


def _product(**members: Any) -> Callable[[Path], None]:
    def harm(folder: Path) -> None:
        first, *rest = (folder / "products.jsonl").read_text().splitlines()
        lines = [json.dumps({**json.loads(first), **members}), *rest]
        (folder / "products.jsonl").write_text("".join(line + "\n" for line in lines))

    return harm


SAMPLE = {"east_m": 0.0, "north_m": 0.0, "heading_rad": 0.0, "task": "", "trackers": {}, "battery_j": 1.0}

RUNS: dict[str, Callable[[Path], None]] = {
    "a deep run.json": _raw("run.json", DEEP),
    "a deep line of the trace": _raw("trace.jsonl", DEEP),
    "a trace that is not a list": _raw("trace.jsonl", b"1\n"),
    "a record of one word": _raw("trace.jsonl", b'["x"]\n'),
    "a time that is none": _raw("trace.jsonl", b'[{}, "start", "look"]\n'),
    "telemetry that is not an object": _raw("telemetry.jsonl", b"[]\n"),
    "telemetry of words": _raw(
        "telemetry.jsonl", json.dumps({**SAMPLE, "t_s": "x", "energy_used_j": "much"}).encode()
    ),
    "a product that is a number": _raw("products.jsonl", b"1\n"),
    "a product outside": _product(path="../../etc/passwd"),
    "a product with a zero in its name": _product(path="products/\0"),
    "a product of another time": _product(t_s="soon"),
    "a product whose label is a list": _product(label=[1]),
    "a product with a kind of 10^6 letters and no file": _product(kind="x" * 10**6, path="x" * 10**6),
    "a seed that is a word": _document(seed="x"),
    "a seed of 10^30": _document(seed=10**30),
    "a utility that is a word": _document(utility="x"),
    "a utility of infinity": _document(utility=float("inf")),
    "an end that is a list": _document(end_s=[1]),
    "an outcome of 10^5 letters": _document(outcome="x" * 10**5),
    "an outcome that is an object": _document(outcome={}),
    "outcomes that are a list": _document(outcomes=[1]),
    "a plan that is an object": _document(plan={"a": 1}),
}


@pytest.fixture
def downlink(sqlite_api: Api, terrain_folder: Path) -> tuple[Api, PlanRow]:
    """Give a repository that waits for the runs of a plan."""
    repo = sqlite_api.repo
    uplinked_plan(repo, yard(repo, terrain_folder))
    (repo.data_dir / "downlink").mkdir()
    with repo.database.read() as session:
        return sqlite_api, session.scalars(select(PlanRow)).one()


def test_every_hostile_run_is_refused_and_leaves_nothing(downlink: tuple[Api, PlanRow]) -> None:
    api, plan = downlink
    for number, (name, harm) in enumerate(RUNS.items()):
        folder = write_run(api.repo, plan, number)
        harm(folder)
        content = zipped(
            {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}
        )
        sent = api("POST", "/uploads?file_name=run.zip", content=content, who="Operator").json()
        upload_id = sent["id"]
        with bounded(name):
            answer = api("POST", "/runs/ingest", {"upload_id": upload_id}, who="Operator")
        refused(name, answer)
    assert api.get(f"/missions/{plan.mission_id}/runs")["items"] == []


# ---- packages


def _package(manifest: bytes = b"{}", **files: bytes) -> bytes:
    return zipped(
        {"manifest.json": manifest, "plan.crl": b"x", "landmarks.json": b"{}", "signatures.json": b"{}"}
        | files
    )


def _with(**members: Any) -> bytes:
    _, crl, landmarks = parts(3)
    content = manifest_text({**about(3), **members}, crl, landmarks)
    named = {"manifest.json": content, "plan.crl": crl, "landmarks.json": landmarks, "signatures.json": "{}"}
    return zipped({name: text.encode() for name, text in named.items()})


def _bomb() -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("manifest.json", bytes(2 * 2**30 // 8))
    return out.getvalue()


PACKAGES: dict[str, Callable[[], bytes]] = {
    "256 MiB in 256 kB": _bomb,
    "a size that is a lie": lambda: _claims(2**31),
    "a hundred thousand files": lambda: _many(100_000),
    "a deep manifest": lambda: _package(DEEP),
    "a deep list of signatures": lambda: _package(**{"signatures.json": DEEP}),
    "a counter of 400 digits": lambda: _with(counter=10**400),
    "a million signatures": lambda: _package(
        json_text({"format": "package/2"}).encode(),
        **{"signatures.json": b'{"signatures": [' + b"{}," * 10**6 + b"{}]}"},
    ),
    "a number of a million digits": lambda: _package(b'{"counter": ' + b"9" * 10**6 + b"}"),
}


@pytest.mark.parametrize("name", PACKAGES)
def test_a_hostile_package_is_refused_on_board(name: str, tmp_path: Path) -> None:
    package, place = small_site(tmp_path)
    package.write_bytes(PACKAGES[name]())
    place = Place(place.rover, place.world, place.trust, place.seed)
    with bounded(name), pytest.raises(GroundError) as refusal:
        execute_package(package, place, tmp_path / "out")
    assert "\n" not in str(refusal.value)
    assert len(str(refusal.value)) <= 500
    assert not (tmp_path / "out").exists()
