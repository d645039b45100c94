"""The label a rover leaves beside a product comes in with its camera model, if it is its own."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import pytest

from ground.gdr.files import FileStore
from ground.resources.runs.work import store_product
from ground.uplink.product_labels import MAX_LABEL_BYTES

CAMERA = {"kind": "CAHV", "width": 4, "height": 3, "C": [0.0, 0.0, 1.0]}


def _row(folder: Path, beside: str | None) -> dict[str, Any]:
    data = b"a picture"
    digest = hashlib.sha256(data).hexdigest()
    (folder / "products").mkdir()
    (folder / "products" / "1.png").write_bytes(data)
    if beside is not None:
        (folder / "products" / "1.png.json").write_text(beside.replace("DIGEST", digest))
    label = {"target": "T1", "sha256": digest}
    return {
        "path": "products/1.png",
        "sha256": digest,
        "kind": "image",
        "task": "t",
        "t_s": 2.0,
        "label": label,
    }


def _label(tmp_path: Path, beside: str | None) -> dict[str, Any]:
    folder = tmp_path / "run"
    folder.mkdir()
    stored = store_product(folder, FileStore(tmp_path / "files"), _row(folder, beside))
    return dict(stored["label"])


def test_the_camera_model_comes_in_and_the_journal_has_the_last_word(tmp_path: Path) -> None:
    whole = {"sha256": "DIGEST", "camera_model": CAMERA, "point_m": [1.0, 2.0, 0.0], "target": "another"}
    label = _label(tmp_path, json.dumps(whole))
    assert label["camera_model"] == CAMERA
    assert label["point_m"] == [1.0, 2.0, 0.0]
    assert label["target"] == "T1"
    assert label["kind"] == "image"


@pytest.mark.parametrize(
    "beside",
    [
        None,
        "{",
        "[1, 2]",
        json.dumps({"sha256": "of another", "camera_model": CAMERA}),
        json.dumps({"sha256": "DIGEST", "camera_model": CAMERA, "filler": "x" * MAX_LABEL_BYTES}),
    ],
    ids=["none", "not JSON", "no object", "another product", "too long"],
)
def test_a_label_that_is_not_its_own_counts_for_nothing(tmp_path: Path, beside: str | None) -> None:
    assert "camera_model" not in _label(tmp_path, beside)
