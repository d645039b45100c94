"""PDS4 labels: an XML document beside a file that says, byte by byte, what is in it.

https://pds.nasa.gov/datastandards/documents, information model 1.21.0.0. A label is of one file: an
image, a map of heights or a table.
"""

from __future__ import annotations

import csv
import hashlib
import io
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from neighbours.geodata.errors import GeodataError

PDS = "http://pds.nasa.gov/pds4/pds/v1"
XSI = "http://www.w3.org/2001/XMLSchema-instance"
MODEL, FILES = "1.21.0.0", "https://pds.nasa.gov/pds4/pds/v1/PDS4_PDS_1L00"
MISSING_M = -99_999.0
"""Stands where a height is not known: lower than any ground, and no NaN, which PDS4 advises against."""
TYPES = {"|u1": "UnsignedByte", "<u2": "UnsignedLSB2", "<i2": "SignedLSB2", "<f4": "IEEE754LSBSingle"}
BODIES = {"EARTH": "Planet", "MARS": "Planet", "MOON": "Satellite"}
Kind = Literal["ASCII_String", "ASCII_Real", "ASCII_Integer"]


@dataclass(frozen=True, slots=True)
class About:
    """What a label says of a product beside its bytes; a time or body that is not known is None."""

    identifier: str
    bundle: str
    title: str
    mission: str
    host: str
    instrument: str
    body: str | None
    start_utc: datetime | None
    stop_utc: datetime | None
    created_utc: datetime
    comment: str = ""


@dataclass(frozen=True, slots=True)
class Labelled:
    """A file and its label, by name."""

    file_name: str
    content: bytes
    label: bytes

    @property
    def label_name(self) -> str:
        """Return the name of the label, beside the file."""
        return f"{self.file_name.rpartition('.')[0]}.xml"


def image(about: About, name: str, pixels: NDArray[Any]) -> Labelled:
    """Return pixels [rows, columns] or [rows, columns, bands], row 0 on top, as raw bytes with a label.

    Bands go one after the other (band sequential).

    Raises
    ------
    GeodataError
        If the type of the pixels has no word in PDS4 here.
    """
    data = pixels if pixels.ndim == 2 else np.moveaxis(pixels, 2, 0)
    axes = ("Line", "Sample") if data.ndim == 2 else ("Band", "Line", "Sample")
    return _array(about, name, data, f"Array_{data.ndim}D_Image", axes, None)


def height_map(about: About, name: str, heights: NDArray[np.floating[Any]]) -> Labelled:
    """Return heights [rows, columns], row 0 in the north, metres, as raw bytes with a label."""
    known = np.where(np.isfinite(heights), heights, MISSING_M).astype("<f4")
    return _array(about, name, known, "Array_2D_Map", ("Line", "Sample"), "m")


def table(
    about: About, name: str, columns: Sequence[tuple[str, Kind]], rows: Sequence[Sequence[str]]
) -> Labelled:
    """Return a table of text cells as CSV without a head, with a label.

    Raises
    ------
    GeodataError
        If there are no rows, a row has another number of cells, or a cell a line end or quote.
    """
    if not rows:
        raise GeodataError(f"the table {name} has no rows; PDS4 asks for one at least")
    for k, row in enumerate(rows, 1):
        if len(row) != len(columns) or any(set(cell) & set('\n\r"') for cell in row):
            raise GeodataError(
                f"row {k} of the table {name} has {len(row)} cells of {len(columns)}, or line ends or quotes"
            )
    out = io.StringIO(newline="")
    csv.writer(out, lineterminator="\r\n").writerows(rows)
    content = out.getvalue().encode()
    root, area = _label(about, name, content)
    found = _sub(area, "Table_Delimited")
    _bytes(found, "offset", 0)
    for tag, text in (
        ("parsing_standard_id", "PDS DSV 1"),
        ("records", str(len(rows))),
        ("record_delimiter", "Carriage-Return Line-Feed"),
        ("field_delimiter", "Comma"),
    ):
        _sub(found, tag, text)
    record = _sub(found, "Record_Delimited")
    _sub(record, "fields", str(len(columns)))
    _sub(record, "groups", "0")
    for number, (column, kind) in enumerate(columns, 1):
        field = _sub(record, "Field_Delimited")
        for tag, text in (("name", column), ("field_number", str(number)), ("data_type", kind)):
            _sub(field, tag, text)
    return Labelled(name, content, _text(root))


def _array(
    about: About, name: str, data: NDArray[Any], kind: str, axes: Sequence[str], unit: str | None
) -> Labelled:
    word = TYPES.get(data.dtype.newbyteorder("<").str)
    if word is None:
        raise GeodataError(
            f"{name}: numbers of the type {data.dtype} have no word here; known are {list(TYPES)}"
        )
    content = np.ascontiguousarray(data).astype(data.dtype.newbyteorder("<")).tobytes()
    root, area = _label(about, name, content)
    found = _sub(area, kind)
    _bytes(found, "offset", 0)
    _sub(found, "axes", str(len(axes)))
    _sub(found, "axis_index_order", "Last Index Fastest")
    element = _sub(found, "Element_Array")
    _sub(element, "data_type", word)
    if unit is not None:
        _sub(element, "unit", unit)
    for number, (axis, count) in enumerate(zip(axes, data.shape, strict=True), 1):
        part = _sub(found, "Axis_Array")
        for tag, text in (("axis_name", axis), ("elements", str(count)), ("sequence_number", str(number))):
            _sub(part, tag, text)
    if unit is not None:
        _sub(_sub(found, "Special_Constants"), "missing_constant", repr(MISSING_M))
    return Labelled(name, content, _text(root))


def _label(about: About, name: str, content: bytes) -> tuple[ET.Element, ET.Element]:
    """Return a label and its file area, which still lacks the object."""
    if not name.rpartition(".")[0] or "/" in name:
        raise GeodataError(f"{name!r} is not a name of a file with an ending")
    root = ET.Element(f"{{{PDS}}}Product_Observational", {f"{{{XSI}}}schemaLocation": f"{PDS} {FILES}.xsd"})
    head = _sub(root, "Identification_Area")
    for tag, text in (
        ("logical_identifier", f"urn:nasa:pds:{about.bundle}:data:{about.identifier}".lower()),
        ("version_id", "1.0"),
        ("title", about.title),
        ("information_model_version", MODEL),
        ("product_class", "Product_Observational"),
    ):
        _sub(head, tag, text)
    seen = _sub(root, "Observation_Area")
    if about.comment:
        _sub(seen, "comment", about.comment)
    times = _sub(seen, "Time_Coordinates")
    _time(times, "start_date_time", about.start_utc)
    _time(times, "stop_date_time", about.stop_utc)
    _mission(seen, about)
    if about.body is not None:
        target = _sub(seen, "Target_Identification")
        _sub(target, "name", about.body.title())
        _sub(target, "type", BODIES[about.body])
    area = _sub(root, "File_Area_Observational")
    file = _sub(area, "File")
    _sub(file, "file_name", name)
    _sub(file, "creation_date_time", _instant(about.created_utc))
    _bytes(file, "file_size", len(content))
    _sub(file, "md5_checksum", hashlib.md5(content, usedforsecurity=False).hexdigest())
    return root, area


def _mission(seen: ET.Element, about: About) -> None:
    mission = _sub(seen, "Investigation_Area")
    _sub(mission, "name", about.mission)
    _sub(mission, "type", "Mission")
    known = _sub(mission, "Internal_Reference")
    _sub(known, "lid_reference", f"urn:nasa:pds:context:investigation:mission.{about.bundle}".lower())
    _sub(known, "reference_type", "data_to_investigation")
    system = _sub(seen, "Observing_System")
    for part, kind in ((about.host, "Host"), (about.instrument, "Instrument")):
        if part:
            component = _sub(system, "Observing_System_Component")
            _sub(component, "name", part)
            _sub(component, "type", kind)


def _time(parent: ET.Element, tag: str, time: datetime | None) -> None:
    if time is None:
        ET.SubElement(parent, f"{{{PDS}}}{tag}", {f"{{{XSI}}}nil": "true", "nilReason": "unknown"})
    else:
        _sub(parent, tag, _instant(time))


def _instant(time: datetime) -> str:
    return time.astimezone(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _sub(parent: ET.Element, tag: str, text: str | None = None) -> ET.Element:
    found = ET.SubElement(parent, f"{{{PDS}}}{tag}")
    found.text = None if text is None else "".join(c for c in text if c.isprintable() or c in "\n\t")
    return found


def _bytes(parent: ET.Element, tag: str, count: int) -> None:
    _sub(parent, tag, str(count)).set("unit", "byte")


def _text(root: ET.Element) -> bytes:
    ET.register_namespace("", PDS)
    ET.register_namespace("xsi", XSI)
    ET.indent(root)
    head = f'<?xml version="1.0" encoding="UTF-8"?>\n<?xml-model href="{FILES}.sch"?>\n'
    text: str = ET.tostring(root, encoding="unicode")
    return f"{head}{text}\n".encode()
