"""PDS4 labels, read by pds4_tools: every number, text and checksum is ours."""

from __future__ import annotations

import hashlib
import xml.etree.ElementTree as ET
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from neighbours.geodata.errors import GeodataError
from neighbours.geodata.pds4 import MISSING_M, PDS, About, Labelled, height_map, image, table
from tests.shared import needed

pds4_tools = needed("pds4_tools")
NOW = datetime(2031, 3, 4, 5, 6, 7, 890_000, tzinfo=UTC)
ABOUT = About(
    "prd-1", "msn-1", "a picture <of> Rock & roll", "Yard", "k9", "navcam", "MARS", NOW, NOW, NOW, "run 1"
)


def read(folder: Path, made: Labelled) -> Any:
    (folder / made.file_name).write_bytes(made.content)
    (folder / made.label_name).write_bytes(made.label)
    return pds4_tools.read(str(folder / made.label_name), quiet=True, no_scale=True)


@pytest.mark.parametrize("dtype", ["u1", "<u2", "<i2", "<f4"])
@pytest.mark.parametrize("shape", [(7, 11), (7, 11, 3)])
def test_pixels_come_back_bit_for_bit(tmp_path: Path, dtype: str, shape: tuple[int, ...]) -> None:
    pixels = np.random.default_rng(3).uniform(0, 250, shape).astype(dtype)
    (found,) = read(tmp_path, image(ABOUT, "prd-1.img", pixels))
    data = np.asarray(found.data)
    ours = pixels if pixels.ndim == 2 else np.moveaxis(pixels, 2, 0)
    assert data.shape == ours.shape
    assert data.astype(dtype).tobytes() == np.ascontiguousarray(ours).tobytes()


def test_heights_come_back_and_the_unknown_is_told(tmp_path: Path) -> None:
    heights = np.random.default_rng(4).normal(-2500, 30, (9, 8)).astype(np.float32)
    heights[2, 3] = np.nan
    (found,) = read(tmp_path, height_map(ABOUT, "dem.img", heights))
    data = np.asarray(found.data)
    assert data[2, 3] == np.float32(MISSING_M)
    known = np.isfinite(heights)
    assert np.array_equal(data[known].astype(np.float32), heights[known])
    assert float(found.meta_data["Special_Constants"]["missing_constant"]) == MISSING_M


def test_a_table_comes_back_cell_by_cell(tmp_path: Path) -> None:
    rows = [["prd-1", "a, cell", "1.5", "7"], ["prd-2", "", "-2.25", "8"]]
    kinds = [("id", "ASCII_String"), ("note", "ASCII_String"), ("t_s", "ASCII_Real"), ("n", "ASCII_Integer")]
    (found,) = read(tmp_path, table(ABOUT, "list.csv", kinds, rows))  # type: ignore[arg-type]
    assert [str(v) for v in found["id"]] == ["prd-1", "prd-2"]
    assert str(found["note"][0]) == "a, cell"
    assert list(found["t_s"]) == [1.5, -2.25]
    assert list(found["n"]) == [7, 8]


def test_the_label_says_time_target_mission_instrument_and_checksum() -> None:
    made = image(ABOUT, "prd-1.img", np.zeros((2, 2), np.uint8))
    root = ET.fromstring(made.label)
    assert root.tag == f"{{{PDS}}}Product_Observational"
    assert {e.tag.partition("}")[0] for e in root.iter()} == {f"{{{PDS}"}
    said = {e.tag.partition("}")[2]: e.text for e in root.iter()}
    assert said["title"] == "a picture <of> Rock & roll"
    assert said["logical_identifier"] == "urn:nasa:pds:msn-1:data:prd-1"
    assert said["start_date_time"] == "2031-03-04T05:06:07.890Z"
    assert said["md5_checksum"] == hashlib.md5(made.content).hexdigest()
    assert said["file_size"] == "4"
    parts = {e.findtext(f"{{{PDS}}}type"): e.findtext(f"{{{PDS}}}name") for e in root.iter()}
    assert {
        "Mission": "Yard",
        "Host": "k9",
        "Instrument": "navcam",
        "Planet": "Mars",
    }.items() <= parts.items()


def test_what_pds4_cannot_say_is_refused() -> None:
    with pytest.raises(GeodataError, match="complex128"):
        image(ABOUT, "a.img", np.zeros((2, 2), complex))
    with pytest.raises(GeodataError, match="no rows"):
        table(ABOUT, "a.csv", [("id", "ASCII_String")], [])
    with pytest.raises(GeodataError, match="row 1"):
        table(ABOUT, "a.csv", [("id", "ASCII_String")], [["a\nb"]])
    with pytest.raises(GeodataError, match="quotes"):
        table(ABOUT, "a.csv", [("id", "ASCII_String")], [['a"b']])
    with pytest.raises(GeodataError, match="not a name of a file"):
        image(ABOUT, "../a.img", np.zeros((2, 2), np.uint8))
