"""Image labels: PDS3 (attached or detached), VICAR, Mars 2020 raw-feed JSON; with the image if it is there.

`read_product(path)` takes `.img`, `.vic`, `.lbl`, `.json`, each also gzipped, and gives an `ImageProduct`.
"""

from __future__ import annotations

import gzip
import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import LINEARITY_OF_TYPE, CameraModel, ModelKind
from rover_iface.errors import CameraError, CameraLabelError

Label = dict[str, Any]

_GROUP_NAMES = ("GEOMETRIC_CAMERA_MODEL", "GEOMETRIC_CAMERA_MODEL_PARMS")
_TYPES = {
    "MSB_INTEGER": ">i",
    "SUN_INTEGER": ">i",
    "MAC_INTEGER": ">i",
    "MSB_UNSIGNED_INTEGER": ">u",
    "SUN_UNSIGNED_INTEGER": ">u",
    "UNSIGNED_INTEGER": ">u",
    "INTEGER": ">i",
    "LSB_INTEGER": "<i",
    "PC_INTEGER": "<i",
    "LSB_UNSIGNED_INTEGER": "<u",
    "PC_UNSIGNED_INTEGER": "<u",
    "IEEE_REAL": ">f",
    "PC_REAL": "<f",
}
MOST_PX = 65_535
"""Widest image that a label may speak of."""
_VICAR_FORMATS = {"BYTE": ("u", 1), "HALF": ("i", 2), "FULL": ("i", 4), "REAL": ("f", 4), "DOUB": ("f", 8)}


@dataclass(frozen=True, slots=True)
class ImageProduct:
    """What an image file and its label say.

    Attributes
    ----------
    camera
        The camera model in `frame`, with the mission's axes (rover frames: x forward, y right, z down).
    image
        Samples as stored (height, width) or (height, width, bands), or None for a label alone.
    label
        The whole label as nested mappings, groups and objects by name.
    """

    name: str
    camera: CameraModel
    frame: str
    instrument: str
    label: Mapping[str, Any]
    image: npt.NDArray[np.generic] | None = None


def read_product(path: Path | str) -> ImageProduct:
    """Return the product in a file; the kind of label is found from the content.

    Raises
    ------
    CameraLabelError
        If the file is not a label that is known here, or holds no usable camera model.
    """
    path = Path(path)
    data = _content(path)
    if data.lstrip()[:1] == b"{":
        return _m2020(path, data)
    if data[:8] == b"LBLSIZE=":
        label = parse_vicar(data, path.name)
        return _product(path, label, _vicar_image(label, data, path.name))
    if b"PDS_VERSION_ID" in data[:400] or b"ODL_VERSION_ID" in data[:400]:
        label = parse_pds3(data, path.name)
        return _product(path, label, _pds3_image(label, data, path))
    raise CameraLabelError(f"{path.name} starts with {data[:16]!r}: neither a PDS3, a VICAR nor a JSON label")


def _content(path: Path) -> bytes:
    raw = path.read_bytes()
    if raw[:2] != b"\x1f\x8b":
        return raw
    try:
        return gzip.decompress(raw)
    except (OSError, EOFError) as err:
        raise CameraLabelError(f"{path.name} is a damaged gzip file: {err}") from err


# --- PDS3 -------------------------------------------------------------------------------------------------

_STATEMENT = re.compile(r"\s*(?:/\*.*?\*/\s*)*([\^\w:]+)\s*=\s*", re.DOTALL)
_END = re.compile(r"\s*(?:/\*.*?\*/\s*)*END\s*(?:\r?\n|$|\x00)", re.DOTALL)
_END_BLOCK = re.compile(r"\s*(?:/\*.*?\*/\s*)*END_(?:GROUP|OBJECT)\s*(?:=\s*\w+)?", re.DOTALL)
_TOKEN = re.compile(
    r'"((?:[^"])*)"|\'([^\']*)\'|([({])|([)}])|(,)|(<[^>]*>)|(/\*.*?\*/)|([^\s,(){}<>"\']+)', re.DOTALL
)


def parse_pds3(data: bytes, name: str = "label") -> dict[str, object]:
    """Return the PDS3 (ODL) label at the head of `data` as nested dictionaries; units are dropped."""
    text = data[: 1 << 20].decode("latin-1")
    top: Label = {}
    stack: list[Label] = [top]
    at = 0
    while True:
        if (m := _END_BLOCK.match(text, at)) is not None:
            if len(stack) == 1:
                raise CameraLabelError(f"{name}: a group ends that did not start, at byte {m.start()}")
            stack.pop()
            at = m.end()
            continue
        if _END.match(text, at):
            return top
        m = _STATEMENT.match(text, at)
        if m is None:
            line = text.count("\n", 0, at) + 1
            raise CameraLabelError(f"{name}: no statement and no END at line {line} of the label")
        value, at = _value(text, m.end(), name)
        if m.group(1) in {"GROUP", "OBJECT"}:
            inner: Label = {}
            stack[-1].setdefault(str(value), inner)
            stack.append(inner)
        else:
            stack[-1][m.group(1)] = value


def _value(text: str, at: int, name: str) -> tuple[Any, int]:
    """Return the value that starts at `at` and where it ends: scalar, or list for (...) and {...}."""
    lists: list[list[Any]] = []
    while True:
        while at < len(text) and text[at] in " \t\r\n":
            at += 1
        m = _TOKEN.match(text, at)
        if m is None:
            raise CameraLabelError(f"{name}: value at byte {at} of the label is not closed")
        at = m.end()
        if m.group(3):
            lists.append([])
            continue
        if m.group(5) or m.group(6) or m.group(7):
            continue
        if m.group(4):
            done: Any = lists.pop() if lists else []
        elif m.group(1) is not None or m.group(2) is not None:
            done = re.sub(r"\s*\r?\n\s*", " ", m.group(1) if m.group(1) is not None else m.group(2))
        else:
            done = _scalar(m.group(8))
        if not lists:
            unit = re.compile(r"[ \t]*<[^>]*>").match(text, at)
            return done, unit.end() if unit else at
        lists[-1].append(done)


def _scalar(token: str) -> Any:
    for kind in (int, float):
        try:
            return kind(token)
        except ValueError:
            continue
    return token


def _pds3_image(label: Label, data: bytes, path: Path) -> npt.NDArray[np.generic] | None:
    pointer, description = label.get("^IMAGE"), label.get("IMAGE")
    if pointer is None or not isinstance(description, dict):
        return None
    record = int(label.get("RECORD_BYTES", 1))
    if isinstance(pointer, list | str):
        parts = pointer if isinstance(pointer, list) else [pointer, 1]
        beside = next((p for p in _beside(path, str(parts[0]))), None)
        if beside is None:
            return None
        data = _content(beside)
        offset = (int(str(parts[1])) - 1) * record if len(parts) > 1 else 0
    else:
        offset = (int(pointer) - 1) * record
    kind = _TYPES.get(str(description.get("SAMPLE_TYPE")))
    if kind is None:
        raise CameraLabelError(
            f"{path.name}: SAMPLE_TYPE {description.get('SAMPLE_TYPE')!r} is not supported"
        )
    dtype = np.dtype(f"{kind}{int(description['SAMPLE_BITS']) // 8}")
    lines, samples = int(description["LINES"]), int(description["LINE_SAMPLES"])
    bands = int(description.get("BANDS", 1))
    pad = (
        int(description.get("LINE_PREFIX_BYTES", 0)),
        int(description.get("LINE_SUFFIX_BYTES", 0)),
    )
    return _raster(data, offset, dtype, lines, samples, bands, pad, path.name)


def _beside(path: Path, wanted: str) -> list[Path]:
    names = {wanted.lower(), wanted.lower() + ".gz"}
    return [p for p in path.parent.iterdir() if p.name.lower() in names]


def _raster(
    data: bytes,
    offset: int,
    dtype: np.dtype[Any],
    lines: int,
    samples: int,
    bands: int,
    pad: tuple[int, int],
    name: str,
) -> npt.NDArray[np.generic]:
    row = pad[0] + samples * dtype.itemsize + pad[1]
    need = offset + row * lines * bands
    if len(data) < need:
        raise CameraLabelError(f"{name}: label promises {need} bytes of image, the file holds {len(data)}")
    block = np.frombuffer(data, np.uint8, row * lines * bands, offset).reshape(bands, lines, row)
    values = np.ascontiguousarray(block[:, :, pad[0] : pad[0] + samples * dtype.itemsize]).view(dtype)
    native = values.astype(dtype.newbyteorder("="))
    return native[0] if bands == 1 else np.moveaxis(native, 0, -1)


# --- VICAR ------------------------------------------------------------------------------------------------

_VICAR_ITEM = re.compile(r"\s*(\w+)\s*=\s*('(?:[^']|'')*'|\([^)]*\)|[^\s]+)")


def parse_vicar(data: bytes, name: str = "label") -> dict[str, object]:
    """Return a VICAR label: system items at the top, each property as a dictionary under its name."""
    head = re.match(rb"LBLSIZE=\s*(\d+)", data)
    if head is None:
        raise CameraLabelError(f"{name}: VICAR label has no LBLSIZE")
    text = data[: int(head.group(1))].decode("latin-1").rstrip("\x00 ")
    top: Label = {}
    here = top
    for m in _VICAR_ITEM.finditer(text):
        key, token = m.group(1), m.group(2)
        value: Any
        if token.startswith("("):
            value = [_vicar_scalar(t) for t in re.findall(r"'(?:[^']|'')*'|[^,()\s]+", token)]
        else:
            value = _vicar_scalar(token)
        if key in {"PROPERTY", "TASK"}:
            here = top.setdefault(str(value), {}) if key == "PROPERTY" else {}
        else:
            here[key] = value
    return top


def _vicar_scalar(token: str) -> Any:
    return token[1:-1].replace("''", "'") if token.startswith("'") else _scalar(token)


def _vicar_image(label: Label, data: bytes, name: str) -> npt.NDArray[np.generic] | None:
    if str(label.get("TYPE", "IMAGE")) != "IMAGE" or "FORMAT" not in label:
        return None
    if label["FORMAT"] not in _VICAR_FORMATS or label.get("ORG", "BSQ") != "BSQ":
        raise CameraLabelError(
            f"{name}: VICAR {label['FORMAT']} in {label.get('ORG')} order is not supported"
        )
    kind, size = _VICAR_FORMATS[label["FORMAT"]]
    order = label.get("REALFMT" if kind == "f" else "INTFMT", "LOW")
    dtype = np.dtype(f"{'>' if order in {'HIGH', 'IEEE'} else '<'}{kind}{size}")
    offset = int(label["LBLSIZE"]) + int(label.get("NLB", 0)) * int(label["RECSIZE"])
    lines, samples, bands = (int(label[k]) for k in ("NL", "NS", "NB"))
    return _raster(data, offset, dtype, lines, samples, bands, (int(label.get("NBB", 0)), 0), name)


# --- camera model of a label ------------------------------------------------------------------------------


def _product(path: Path, label: Label, image: npt.NDArray[np.generic] | None) -> ImageProduct:
    group = next((label[g] for g in _GROUP_NAMES if isinstance(label.get(g), dict)), None)
    if group is None or "MODEL_TYPE" not in group:
        raise CameraLabelError(
            f"{path.name} holds no camera model: no group {_GROUP_NAMES[0]} with MODEL_TYPE in its label"
        )
    if image is not None:
        height, width = image.shape[:2]
    else:
        width, height = _declared_size(label, path.name)
    components = _components(group, path.name)
    return ImageProduct(
        name=str(label.get("PRODUCT_ID", path.name)),
        camera=_camera(str(group["MODEL_TYPE"]), components, width, height, path.name),
        frame=_frame(group),
        instrument=str(label.get("INSTRUMENT_ID", label.get("IDENTIFICATION", {}).get("INSTRUMENT_ID", ""))),
        label=label,
        image=image,
    )


def _declared_size(label: Label, name: str) -> tuple[int, int]:
    description = label.get("IMAGE", label)
    try:
        return int(description["LINE_SAMPLES"]), int(description["LINES"])
    except (KeyError, TypeError) as err:
        raise CameraLabelError(f"{name}: label does not tell the image size (LINES, LINE_SAMPLES)") from err


def _frame(group: Label) -> str:
    for key in ("REFERENCE_COORD_SYSTEM_NAME", "MSL:REFERENCE_COORD_SYSTEM_NAME"):
        if key in group:
            return str(group[key])
    return "ROVER_FRAME"


def _components(group: Label, name: str) -> dict[str, Any]:
    """Return component values by id letter; labels number them in the order of MODEL_COMPONENT_ID."""
    letters = group.get("MODEL_COMPONENT_ID")
    if not isinstance(letters, list):
        letters = list("CAHVORETP")
    if str(group.get("MODEL_TYPE")) == "CAHVORE" and letters[-1] == "E":
        letters = [*letters, "T", "P"]  # MSL numbers type and parameter without naming them
    found = {}
    for i, letter in enumerate(letters, start=1):
        value = group.get(f"MODEL_COMPONENT_{i}")
        if value is None:
            raise CameraLabelError(f"{name}: camera model lacks MODEL_COMPONENT_{i} ({letter})")
        found[str(letter)] = value
    return found


def _camera(kind: str, parts: Mapping[str, Any], width: int, height: int, name: str) -> CameraModel:
    if kind not in set(ModelKind):
        raise CameraLabelError(f"{name}: camera model {kind!r} is not one of {', '.join(ModelKind)}")
    missing = [letter for letter in kind if letter not in parts]
    if missing:
        raise CameraLabelError(f"{name}: {kind} model lacks vector {', '.join(missing)}")
    linearity = 1.0
    if kind == "CAHVORE":
        if "T" not in parts:
            raise CameraLabelError(f"{name}: CAHVORE model lacks its type (T)")
        code = int(_number(parts["T"], "type (T)", name))
        if code in LINEARITY_OF_TYPE:
            linearity = LINEARITY_OF_TYPE[code]
        elif code == 3 and "P" in parts:
            linearity = _number(parts["P"], "parameter (P)", name)
        else:
            raise CameraLabelError(f"{name}: CAHVORE type {code} is not 1, 2 or 3 with its parameter")
    try:
        return CameraModel(
            ModelKind(kind),
            width,
            height,
            **{c: np.array(parts[c], float) for c in kind},
            linearity=linearity,
        )
    except (TypeError, ValueError) as err:
        raise CameraLabelError(f"{name}: camera vectors are not numbers: {err}") from err
    except CameraError as err:
        raise CameraLabelError(f"{name}: {err}") from err


def _number(value: Any, what: str, name: str) -> float:
    try:
        found = float(value)
    except (TypeError, ValueError) as err:
        raise CameraLabelError(f"{name}: camera model's {what} is {value!r}, not a number") from err
    if not math.isfinite(found):
        raise CameraLabelError(f"{name}: camera model's {what} is {value!r}, not finite")
    return found


# --- Mars 2020 raw feed -----------------------------------------------------------------------------------


def _m2020(path: Path, data: bytes) -> ImageProduct:
    try:
        label = json.loads(data)
    except ValueError as err:
        raise CameraLabelError(f"{path.name} is not a JSON document: {err}") from err
    if not isinstance(label, dict):
        raise CameraLabelError(f"{path.name} holds {type(label).__name__}, not an object with the metadata")
    text, kind = label.get("camera_model_component_list"), label.get("camera_model_type")
    if not isinstance(text, str) or not isinstance(kind, str) or kind.upper() in {"", "NONE", "UNK"}:
        raise CameraLabelError(
            f"{path.name} holds no camera model: no camera_model_component_list with a type"
        )
    fields = [f.strip().strip("()") for f in text.split(";")]
    try:
        values: list[Any] = [[float(v) for v in f.split(",")] if "," in f else _scalar(f) for f in fields]
    except ValueError as err:
        raise CameraLabelError(f"{path.name}: camera_model_component_list: {err}") from err
    parts = dict(zip("CAHVORETP", values, strict=False))
    size = re.findall(r"\d+", str(label.get("dimension", "")))
    if len(size) != 2:
        raise CameraLabelError(f"{path.name}: dimension is {label.get('dimension')!r}, not (width,height)")
    width, height = int(size[0]), int(size[1])
    if not (0 < width <= MOST_PX and 0 < height <= MOST_PX):
        raise CameraLabelError(f"{path.name}: dimension is {width} x {height}; 1 to {MOST_PX} are possible")
    return ImageProduct(
        name=str(label.get("imageid", path.name)),
        camera=_camera(kind, parts, width, height, path.name),
        frame="ROVER_FRAME",
        instrument=str(label.get("instrument", "")),
        label=label,
        image=_beside_png(path, width, height),
    )


def _beside_png(path: Path, width: int, height: int) -> npt.NDArray[np.generic] | None:
    picture = path.with_name(re.sub(r"-metadata\.json$|\.json$", ".png", path.name))
    if not picture.is_file() or picture == path:
        return None
    from PIL import Image

    try:
        with Image.open(picture) as opened:
            image = np.asarray(opened)
    except (OSError, SyntaxError, ValueError) as err:
        raise CameraLabelError(f"{picture.name} cannot be read: {err}") from err
    if image.shape[:2] != (height, width):
        raise CameraLabelError(f"{picture.name} is {image.shape[1::-1]}, its label says {(width, height)}")
    return image
