"""Labels that a rover leaves beside its products, `FILE.json` beside `FILE`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

MAX_LABEL_BYTES = 64 * 1024


def whole_label(file: Path, sha256: str) -> Mapping[str, object]:
    """Return the label a rover left beside a product: with the camera model and the pose, which the journal's
    flat label has no room for. A file of another form, or of another product, counts for nothing.
    """
    beside = file.with_name(f"{file.name}.json")
    if beside.is_symlink() or not beside.is_file() or beside.stat().st_size > MAX_LABEL_BYTES:
        return {}
    try:
        label = json.loads(beside.read_bytes())
    except (ValueError, RecursionError):
        return {}
    return label if isinstance(label, dict) and label.get("sha256") == sha256 else {}
